// Page of a sweep: a diagram of its points or section points, and the run of each point.

/** Decode base64 text to an array of numbers. */
const numbersOf = (text, kind) => new kind(bytesOf(text).buffer);

/** Columns of the points: numbers, or indices of words. */
const COLUMNS = new Map(DATA.columns.map((column) => {
  const kinds = { double: Float64Array, single: Float32Array, word: Uint8Array };
  return [column.name, { ...column, values: numbersOf(column.data, kinds[column.kind]) }];
}));
const POINTS = numbersOf(DATA.points, Int32Array);
const SWEPT = DATA.swept;
const textOf = (column, k) => (column.kind === "word" ? column.words[column.values[k]] : numberText(column, column.values[k]));
const numberText = (column, value) => (Number.isNaN(value) ? "" : column.kind === "double" ? String(value) : significant(value, 7));

/** Tables with several rows per point. */
const FRAMES = DATA.frames.map((frame) => ({
  ...frame,
  point: numbersOf(frame.point, Uint32Array),
  columns: new Map(frame.columns.map(({ name, data }) => [name, numbersOf(data, Float32Array)])),
}));

const CATEGORIES = ["#0072b2", "#e69f00", "#009e73", "#d55e00", "#56b4e9", "#aa4499", "#b8a800", "#767676", "#8c4a2f", "#5a5fd0", "#66cdaa", "#cc79a7"];
const VIRIDIS = ["#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c", "#28ae80", "#5ec962", "#addc30", "#fde725"];
const VIEW = { chosen: 0, drawn: null };

const control = (id) => byId(id).value;
const frameNow = () => FRAMES.find((frame) => frame.name === control("what")) || null;

/** Set the choices for both axes and the colour after a table is selected. */
function followTable() {
  const frame = frameNow();
  const points = [...COLUMNS.values()];
  const numbers = points.filter((column) => column.kind !== "word").map((column) => column.name);
  const own = frame ? [...frame.columns.keys()] : [];
  options(byId("across"), [...numbers, ...own]);
  options(byId("upward"), frame ? own : numbers);
  const colours = points.filter((column) => !SWEPT.includes(column.name)).map((column) => column.name);
  options(byId("colour"), [["", "one colour"], ...colours]);
  byId("across").value = SWEPT[0];
  const observed = numbers.filter((name) => !SWEPT.includes(name));
  byId("upward").value = frame ? own.find((name) => name !== "time_s") || own[0] : SWEPT[1] || observed[0] || SWEPT[0];
  byId("colour").value = !frame && SWEPT[1] ? DATA.coloured || "" : "";
  drawAll();
}

/** Values to draw, and the point of each entry. */
function entries() {
  const frame = frameNow();
  const count = frame ? frame.point.length : POINTS.length;
  const pointOf = frame ? frame.point : Uint32Array.from(POINTS, (_, k) => k);
  const values = (name) => {
    if (frame && frame.columns.has(name)) return frame.columns.get(name);
    const column = COLUMNS.get(name).values;
    return frame ? Float64Array.from(frame.point, (k) => column[k]) : column;
  };
  return { frame, count, pointOf, x: values(control("across")), y: values(control("upward")) };
}

function limitsOf(values) {
  let low = Infinity;
  let high = -Infinity;
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return low > high ? [0, 1] : low === high ? [low - 0.5, high + 0.5] : [low, high];
}

const spread = ([low, high], room) => [low - room * (high - low), high + room * (high - low)];

/** Distinct values in increasing order. */
const distinct = (values) => [...new Set(values)].sort((a, b) => a - b);

function drawAll() {
  const own = entries();
  const across = distinct(own.x);
  const upward = distinct(own.y);
  const grid = !own.frame && across.length > 1 && upward.length > 1 && across.length * upward.length === own.count;
  const half = (values) => (grid ? 0.5 / (values.length - 1) : 0.02);
  const [left, right] = spread(limitsOf(own.x), half(across));
  const [low, high] = spread(limitsOf(own.y), grid ? half(upward) : 0.04);
  const name = frameNow() ? `${control("upward")} at ${own.frame.name}` : control("upward");
  const words = `${own.count} ${own.frame ? "rows of " + own.frame.name : "points"}: ${name} over ${control("across")}`;
  const frame = begin(byId("drawing"), {
    height: 440, left: 66, bare: grid, label: words, x: { low: left, high: right, label: control("across") }, y: { low, high, label: name },
  });
  VIEW.drawn = { ...own, frame, grid, across, upward };
  drawMarks(frame, own, grid, across.length, upward.length);
  drawChosen();
}

/** Return the colour of each entry, and show the key; shares are fractions of the drawn points. */
function colours(own) {
  const column = COLUMNS.get(control("colour"));
  const ink = getComputedStyle(document.body).color;
  if (!column) {
    byId("colour-key").replaceChildren();
    return () => ink;
  }
  if (column.kind === "word") {
    const of = POINTS.length < DATA.count ? `${POINTS.length} of ${DATA.count}` : DATA.count;
    byId("colour-key").replaceChildren(make("span", null, `Of ${of} points:`), ...column.words.map((word, k) => {
      const share = column.values.reduce((sum, value) => sum + (value === k), 0) / POINTS.length;
      const chip = make("i", { class: "chip", style: `background:${CATEGORIES[k % CATEGORIES.length]}` });
      return make("span", null, chip, `${word || "no value"}: ${(100 * share).toFixed(1)} %`);
    }));
    return (k) => CATEGORIES[column.values[own.pointOf[k]] % CATEGORIES.length];
  }
  const [low, high] = limitsOf(column.values);
  const blank = column.values.filter(Number.isNaN).length;
  byId("colour-key").replaceChildren(make("span", null, significant(low, 4)),
    make("i", { class: "ramp", style: `background:linear-gradient(90deg,${VIRIDIS.join(",")})`, role: "img", "aria-label": "colour scale" }),
    make("span", null, significant(high, 4)), blank ? make("span", null, `not drawn: ${count(blank, "point")} without a value`) : "");
  const steps = Array.from({ length: 256 }, (_, k) => ramp(k / 255));
  return (k) => {
    const value = column.values[own.pointOf[k]];
    return Number.isNaN(value) ? "transparent" : steps[Math.round((255 * (value - low)) / (high - low))];
  };
}

function ramp(share) {
  const at = share * (VIRIDIS.length - 1);
  const k = Math.min(Math.floor(at), VIRIDIS.length - 2);
  const part = (text, from) => parseInt(text.slice(from, from + 2), 16);
  const mixed = [1, 3, 5].map((from) => Math.round(part(VIRIDIS[k], from) + (at - k) * (part(VIRIDIS[k + 1], from) - part(VIRIDIS[k], from))));
  return `rgb(${mixed})`;
}

/** Draw the marks on a canvas below the frame: cells of a grid, or dots. */
function drawMarks(frame, own, grid, columns, rows) {
  const ratio = window.devicePixelRatio || 1;
  const { edge, inner } = frame;
  const canvas = make("canvas", { "aria-hidden": "true", width: Math.round(inner.width * ratio), height: Math.round(inner.height * ratio),
    style: `left:${edge.left}px;top:${edge.top}px;width:${inner.width}px;height:${inner.height}px` });
  const brush = canvas.getContext("2d");
  brush.scale(ratio, ratio);
  const colour = colours(own);
  const size = grid ? [inner.width / columns, inner.height / rows] : Array(2).fill(own.count > 5000 ? 1.4 : own.count > 500 ? 2.4 : 5);
  for (let k = 0; k < own.count; k++) {
    brush.fillStyle = colour(k);
    const [x, y] = [frame.x(own.x[k]) - edge.left - size[0] / 2, frame.y(own.y[k]) - edge.top - size[1] / 2];
    brush.fillRect(x, y, size[0] + (grid ? 0.6 : 0), size[1] + (grid ? 0.6 : 0));
  }
  byId("drawing").prepend(canvas);
  frame.svg.style.cursor = "crosshair";
  frame.svg.addEventListener("pointermove", (event) => hover(event));
  frame.svg.addEventListener("pointerleave", () => tooltip.hide());
  frame.svg.addEventListener("click", (event) => {
    const k = nearest(event);
    if (k !== null) choose(VIEW.drawn.pointOf[k]);
  });
}

/** Entry nearest to the pointer. */
function nearest(event) {
  const { frame, count, x, y } = VIEW.drawn;
  const box = frame.svg.getBoundingClientRect();
  const at = [event.clientX - box.left, event.clientY - box.top];
  let best = null;
  let least = Infinity;
  for (let k = 0; k < count; k++) {
    const distance = (frame.x(x[k]) - at[0]) ** 2 + (frame.y(y[k]) - at[1]) ** 2;
    if (distance < least) [least, best] = [distance, k];
  }
  return best;
}

function hover(event) {
  const k = nearest(event);
  if (k === null) return;
  const { pointOf, x, y } = VIEW.drawn;
  const colour = COLUMNS.get(control("colour"));
  const words = [`point ${POINTS[pointOf[k]]}`, `${control("across")} = ${significant(x[k], 6)}`, `${control("upward")} = ${significant(y[k], 6)}`];
  if (colour) words.push(`${colour.name}: ${textOf(colour, pointOf[k])}`);
  tooltip.show(words.join("\n"), { left: event.clientX, right: event.clientX, top: event.clientY, bottom: event.clientY });
}

/** Select a point by its index among the points on the page. */
function choose(k) {
  VIEW.chosen = k;
  byId("point").value = String(k);
  byId("point-text").textContent = `point ${POINTS[k]}`;
  byId("point").setAttribute("aria-valuetext", `point ${POINTS[k]}`);
  const rows = [...COLUMNS.values()].map((column) => [column.name, textOf(column, k)]);
  byId("values").replaceChildren(table(["quantity", ["value", "number"]], rows, `Point ${POINTS[k]} of ${DATA.count}`));
  drawChosen();
  drawRun(k);
  drawCase(k);
}

/** Draw rings around the entries of the selected point. */
function drawChosen() {
  const { frame, count, pointOf, x, y } = VIEW.drawn;
  frame.above.replaceChildren();
  let shown = 0;
  for (let k = 0; k < count && shown < 300; k++) {
    if (pointOf[k] !== VIEW.chosen || Number.isNaN(x[k]) || Number.isNaN(y[k])) continue;
    shown += 1;
    const place = { cx: frame.x(x[k]), cy: frame.y(y[k]), r: 5 };
    frame.above.append(shape("circle", { class: "ring below", ...place }), shape("circle", { class: "ring", ...place }));
  }
}

/** Draw the portrait of the nearest point that has one; distances are relative to the range of each swept value. */
function drawRun(k) {
  const holder = byId("portrait");
  byId("portrait-key").replaceChildren();
  if (!DATA.runs.length) {
    holder.replaceChildren(make("p", { class: "quiet" }, DATA.no_runs));
    byId("portrait-note").textContent = "";
    return;
  }
  const swept = SWEPT.map((name) => COLUMNS.get(name).values);
  const sizes = swept.map((values) => limitsOf(values)).map(([low, high]) => high - low);
  const distance = (run) => run.values.reduce((sum, value, j) => sum + ((value - swept[j][k]) / sizes[j]) ** 2, 0);
  const run = DATA.runs.reduce((best, own) => (distance(own) < distance(best) ? own : best));
  portraitFigure(holder, run.portrait, 330);
  byId("portrait-key").replaceChildren(...portraitKey(run.portrait));
  const own = SWEPT.map((name, j) => `${name} = ${significant(run.values[j], 5)}`).join(", ");
  const which = distance(run) === 0 ? "This point's run" :
    make("strong", null, `Run of point ${run.point} (${own}), the nearest of the ${DATA.runs.length} points with a portrait`);
  byId("portrait-note").replaceChildren(which, `; ${run.portrait.window.map((time) => significant(time, 6)).join(" s to ")} s, ends ${run.status}`);
}

/** Show the point as a case file, and the command that simulates it. */
function drawCase(k) {
  if (!DATA.case) {
    byId("case-note").textContent = DATA.no_case;
    return;
  }
  const name = `${DATA.name}_point_${POINTS[k]}`.slice(0, 64);
  let text = DATA.case.replaceAll(DATA.place_of_name, name);
  SWEPT.forEach((own, j) => { text = text.replaceAll(DATA.places[j], String(COLUMNS.get(own).values[k])); });
  byId("case-text").textContent = text;
  byId("case-command").textContent = `henon-ref simulate ${name}.yaml --rtol ${DATA.rtol}`;
  const link = byId("case-link");
  if (link.href.startsWith("blob:")) URL.revokeObjectURL(link.href);
  link.href = URL.createObjectURL(new Blob([text], { type: "text/yaml" }));
  link.download = `${name}.yaml`;
  link.textContent = `Save as ${name}.yaml`;
}

function start() {
  themeButton(byId("theme"));
  options(byId("what"), [...FRAMES.map((frame) => [frame.name, `${frame.name} (${frame.point.length < frame.rows ? `${frame.point.length} of ${frame.rows}` : frame.rows} rows)`]), ["", `points (${POINTS.length})`]]);
  byId("what").value = FRAMES.length && SWEPT.length === 1 ? FRAMES[0].name : "";
  byId("what").addEventListener("change", followTable);
  for (const id of ["across", "upward", "colour"]) byId(id).addEventListener("change", drawAll);
  byId("point").max = String(POINTS.length - 1);
  byId("point").addEventListener("input", () => choose(Number(control("point"))));
  document.addEventListener("themechange", drawAll);
  followTable();
  choose(POINTS.length >> 1);
  onWidth(byId("drawing"), drawAll);
  onWidth(byId("portrait"), () => drawRun(VIEW.chosen));
}

start();
