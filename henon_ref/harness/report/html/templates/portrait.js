// A phase portrait, drawn from its packed points (henon_ref/harness/report/html/portrait.py).

/** Whole numbers of a portrait's points, as places within its limits (0 to 1). */
function pointsOf(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const numbers = new DataView(bytes.buffer);
  return Array.from({ length: bytes.length / 4 }, (_, k) =>
    [numbers.getInt16(4 * k, true) / 4096, numbers.getInt16(4 * k + 2, true) / 4096]);
}

const pieceClass = (label) =>
  label === "stick" ? "stick" : label === "surface" ? "surface" : label.endsWith("−1") ? "minus" : "plus";

/** The curves of a portrait, in a frame of their own. */
function portraitFigure(holder, portrait, height) {
  const [[left, right], [low, high]] = portrait.limits;
  const names = portrait.names.map((name) => (name === "t" ? "time t [s]" : name));
  const frame = begin(holder, {
    height, label: `Phase portrait: ${names[1]} over ${names[0]}`,
    x: { low: left, high: right, label: names[0] }, y: { low, high, label: names[1] },
  });
  const at = ([x, y]) => [frame.x(left + x * (right - left)), frame.y(low + y * (high - low))];
  const pieces = [...portrait.surfaces.map((text) => ["surface", text]), ...portrait.pieces];
  pieces.sort((a, b) => (a[0] === "stick") - (b[0] === "stick"));
  for (const [label, text] of pieces) {
    const points = pointsOf(text).map(at);
    const size = Math.max(...points.map(([x, y]) => Math.hypot(x - points[0][0], y - points[0][1])));
    if (label === "stick" && size < 2) frame.inside.append(shape("circle", { class: "rest", cx: points[0][0], cy: points[0][1], r: 4 }));
    else frame.inside.append(shape("path", { class: `piece ${pieceClass(label)}`, d: `M${points.map((p) => p.map((v) => v.toFixed(1))).join("L")}` }));
  }
  return frame;
}

/** What the lines of a portrait mean. */
function portraitKey(portrait) {
  const labels = [...new Set(portrait.pieces.map(([label]) => label))].sort();
  if (portrait.surfaces.length) labels.push("surface");
  return labels.map((label) => make("span", null,
    shape("svg", { class: "swatch", viewBox: "0 0 26 12", "aria-hidden": "true" },
      shape("path", { class: `piece ${pieceClass(label)}`, d: "M1,6H25" })), label === "surface" ? "surface h = 0" : label));
}
