// Functions shared by both pages: elements and tables, numbers, axes, and phase portraits.

// Elements. Text is never parsed as HTML.

const SVG = "http://www.w3.org/2000/svg";

/** Make an HTML element with attributes, listeners ("onclick") and children; missing attributes and children are omitted. */
function make(name, attributes, ...children) {
  return filled(document.createElement(name), attributes, children);
}

/** Make an SVG element. */
function shape(name, attributes, ...children) {
  return filled(document.createElementNS(SVG, name), attributes, children);
}

function filled(node, attributes, children) {
  for (const [key, value] of Object.entries(attributes || {})) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else node.setAttribute(key, value === true ? "" : value);
  }
  node.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== ""));
  return node;
}

const byId = (id) => document.getElementById(id);

/** Make a table from headings and rows; a heading is text, or [text, "number"] for a column of numbers. */
function table(headings, rows, caption) {
  const columns = headings.map((own) => (Array.isArray(own) ? own : [own, null]));
  const head = columns.map(([text, side]) => make("th", { scope: "col", class: side }, text));
  const body = rows.map((cells) =>
    make("tr", { class: cells.now ? "now" : null }, cells.map((cell, k) =>
      k === 0 ? make("th", { scope: "row" }, cell) : make("td", { class: columns[k][1], "data-label": columns[k][0] }, cell))));
  return make("table", null, caption ? make("caption", null, caption) : null,
    make("thead", null, make("tr", null, head)), make("tbody", null, body));
}

/** Set the options of a select element: [value, text], or a text that is also the value. */
function options(select, entries) {
  select.replaceChildren(...entries.map((own) => {
    const [value, text] = Array.isArray(own) ? own : [own, own];
    return make("option", { value }, text);
  }));
}

/** Use one tab stop for many links or points; arrow keys move between them, by rows and columns in a table. */
function arrowKeys(container, selector) {
  container.addEventListener("keydown", (event) => {
    const from = event.target.closest(selector);
    const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] };
    const step = steps[event.key];
    if (!from || !step) return;
    const row = from.closest("tr");
    let next = null;
    if (row) {
      const visible = (own) => [...own.querySelectorAll(selector)].filter((one) => one.getClientRects().length > 0);
      const column = visible(row).indexOf(from);
      const rows = [...row.parentElement.children].filter((own) => !own.hidden);
      const other = rows[rows.indexOf(row) + step[0]];
      next = other ? visible(other)[column + step[1]] : null;
    } else {
      const all = [...container.querySelectorAll(selector)];
      next = all[all.indexOf(from) + step[0] + step[1]];
    }
    if (!next) return;
    event.preventDefault();
    from.setAttribute("tabindex", "-1");
    next.setAttribute("tabindex", "0");
    next.focus();
  });
}

/** Tooltip next to the node under the pointer or with the keyboard focus. */
const tooltip = {
  box: null,
  show(text, place) {
    if (!this.box) document.body.append((this.box = make("div", { class: "tooltip", role: "tooltip" })));
    this.box.textContent = text;
    this.box.hidden = false;
    const own = this.box.getBoundingClientRect();
    const left = Math.min(place.right + 8, window.innerWidth - own.width - 8);
    const above = place.top - own.height - 6;
    this.box.style.left = `${Math.max(left, 4)}px`;
    this.box.style.top = `${above > 4 ? above : place.bottom + 6}px`;
  },
  hide() {
    if (this.box) this.box.hidden = true;
  },
  /** Show a text while the pointer is on a node, or the node has the focus. */
  on(node, text) {
    const show = () => this.show(text, node.getBoundingClientRect());
    for (const event of ["pointerenter", "focus"]) node.addEventListener(event, show);
    for (const event of ["pointerleave", "blur"]) node.addEventListener(event, () => this.hide());
  },
};
document.addEventListener("keydown", (event) => event.key === "Escape" && tooltip.hide());

/** Set up the button that switches between a dark and a light page; the browser stores the choice if possible. */
function themeButton(button) {
  const root = document.documentElement;
  const dark = () => root.dataset.theme === "dark" ||
    (!root.dataset.theme && matchMedia("(prefers-color-scheme: dark)").matches);
  const say = () => { button.textContent = dark() ? "Light page" : "Dark page"; };
  try {
    const kept = localStorage.getItem("henon_ref theme");
    if (kept) root.dataset.theme = kept;
  } catch { /* a page from disk may have no storage */ }
  say();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", say);
  button.addEventListener("click", () => {
    root.dataset.theme = dark() ? "light" : "dark";
    say();
    try {
      localStorage.setItem("henon_ref theme", root.dataset.theme);
    } catch { /* the choice is lost when the page is closed */ }
    document.dispatchEvent(new Event("themechange"));
  });
}
// Formats of numbers, as in the markdown reports (henon_ref/harness/table.py).

/** Format a number with significant digits, and with an exponent if it is very large or small. */
function significant(value, places = 3) {
  if (value === 0 || !Number.isFinite(value)) return String(value);
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  if (exponent < -3 || exponent >= 6) return exponential(value, places);
  return String(Number(value.toPrecision(places)));
}

const exponential = (value, places = 2) => value.toExponential(places - 1).replace("e+", "e");

/** Format a wall time [s] with a unit. */
function duration(seconds) {
  if (seconds === null || seconds === undefined) return "";
  if (seconds < 1e-4) return `${significant(seconds * 1e6)} µs`;
  return seconds < 1 ? `${significant(seconds * 1e3)} ms` : `${significant(seconds)} s`;
}

/** Format a number of digits, rounded down. */
const digitsText = (value) => (value === null || value === undefined ? "" : String(Math.floor(value * 10 + 1e-9) / 10));

/** Format an error; an error below the smallest claimable error (floor) is shown as "< floor". */
function errorText(value, floor = 0) {
  if (value === null || value === undefined) return "";
  if (Math.abs(value) < floor) return `< ${exponential(floor, 1)}`;
  return value === 0 ? "0" : exponential(value);
}

const count = (number, noun) => `${number || "no"} ${noun}${number === 1 ? "" : "s"}`;

const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/** Format a power of ten. */
function powerOfTen(exponent) {
  if (exponent === 0) return "1";
  const digits = [...String(Math.abs(exponent))].map((digit) => SUPERSCRIPTS[digit]).join("");
  return `10${exponent < 0 ? "⁻" : ""}${digits}`;
}

/** Format a decade of time with a unit. */
function decadeOfTime(exponent) {
  if (exponent >= 0) return `${10 ** exponent} s`;
  if (exponent >= -3) return `${Math.round(10 ** (exponent + 3))} ms`;
  if (exponent >= -6) return `${Math.round(10 ** (exponent + 6))} µs`;
  return `${Math.round(10 ** (exponent + 9))} ns`;
}
// Frame of a figure: axes, grid and labels, at the available width, so that letters keep their size.

/**
 * Begin a figure.
 * wanted: {height, left, x: {low, high, log, label, text}, y: {...}, label, bare}; text(value) formats a tick (log: an exponent),
 * bare omits the grid. Returns the SVG, groups inside and above the clipped area, the scales x and y, and the margins.
 */
function begin(holder, wanted) {
  const width = widthOf(holder);
  const edge = { left: wanted.left || 58, right: 14, top: 10, bottom: 44 };
  const inner = { width: width - edge.left - edge.right, height: wanted.height - edge.top - edge.bottom };
  const x = scale(wanted.x, edge.left, edge.left + inner.width);
  const y = scale(wanted.y, edge.top + inner.height, edge.top);
  const bottom = edge.top + inner.height;
  const frame = shape("g", { "aria-hidden": "true" });
  for (const tick of ticks(wanted.x, Math.max(2, Math.floor(inner.width / 75)))) {
    const at = x(tick.value);
    frame.append(shape("line", { class: "grid", x1: at, x2: at, y1: wanted.bare ? bottom : edge.top, y2: bottom + 4 }),
      shape("text", { class: "tick", x: at, y: bottom + 16, "text-anchor": "middle" }, tick.text));
  }
  for (const tick of ticks(wanted.y, Math.max(2, Math.floor(inner.height / 34)))) {
    const at = y(tick.value);
    frame.append(shape("line", { class: "grid", x1: edge.left - 4, x2: wanted.bare ? edge.left : edge.left + inner.width, y1: at, y2: at }),
      shape("text", { class: "tick", x: edge.left - 7, y: at + 4, "text-anchor": "end" }, tick.text));
  }
  frame.append(
    shape("path", { class: "axis", d: `M${edge.left},${edge.top}V${bottom}H${edge.left + inner.width}` }),
    shape("text", { x: edge.left + inner.width / 2, y: wanted.height - 8, "text-anchor": "middle" }, wanted.x.label),
    shape("text", { transform: `translate(13 ${edge.top + inner.height / 2}) rotate(-90)`, "text-anchor": "middle" },
      wanted.y.label));
  const clip = `clip-${holder.id}`;
  const inside = shape("g", { "clip-path": `url(#${clip})` });
  const above = shape("g");
  const svg = shape("svg", { viewBox: `0 0 ${width} ${wanted.height}`, role: wanted.role || "img", "aria-label": wanted.label },
    shape("clipPath", { id: clip }, shape("rect", { x: edge.left, y: edge.top, width: inner.width, height: inner.height })),
    frame, inside, above);
  holder.replaceChildren(svg);
  return { svg, inside, above, x, y, edge, inner, width };
}

/** Return the function from values to pixels. */
function scale(axis, from, to) {
  const place = axis.log ? Math.log10 : (value) => value;
  const low = place(axis.low);
  const span = place(axis.high) - low || 1;
  return (value) => from + ((place(value) - low) / span) * (to - from);
}

/** Values and texts of the ticks of an axis, about `most` or fewer. */
function ticks(axis, most) {
  if (axis.log) {
    const first = Math.ceil(Math.log10(axis.low) - 1e-9);
    const last = Math.floor(Math.log10(axis.high) + 1e-9);
    const step = Math.max(1, Math.ceil((last - first + 1) / most));
    const found = [];
    for (let k = first; k <= last; k += step) found.push({ value: 10 ** k, text: (axis.text || powerOfTen)(k) });
    return found;
  }
  const rough = (axis.high - axis.low) / most || 1;
  const decade = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((own) => own * decade >= rough) * decade;
  const places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const found = [];
  for (let k = Math.ceil(axis.low / step - 1e-9); k * step <= axis.high + 1e-9 * step; k++) {
    const value = k * step;
    const text = Math.abs(value) >= 1e5 || (step < 1e-4) ? significant(value, 6) : value.toFixed(Math.min(places, 8));
    found.push({ value, text: axis.text ? axis.text(value) : text.replace("-", "−") });
  }
  return found;
}

const WIDTHS = new Map();

/** Width of a holder, cached because each query would lay out the whole page again. */
function widthOf(holder) {
  if (!WIDTHS.has(holder)) WIDTHS.set(holder, holder.clientWidth);
  return Math.max(WIDTHS.get(holder), 260);
}

/** Redraw if the width of a holder changes. */
function onWidth(holder, drawAgain) {
  new ResizeObserver((entries) => {
    const width = Math.round(entries.at(-1).contentRect.width);
    if (width && width !== WIDTHS.get(holder)) {
      WIDTHS.set(holder, width);
      drawAgain();
    }
  }).observe(holder);
}

const MARKERS = {
  o: "M0,-4A4,4 0 1 1 0,4A4,4 0 1 1 0,-4Z", s: "M-3.6,-3.6H3.6V3.6H-3.6Z", D: "M0,-4.8L4.8,0L0,4.8L-4.8,0Z",
  "^": "M0,-4.6L4.4,3.6H-4.4Z", v: "M0,4.6L4.4,-3.6H-4.4Z", "<": "M-4.6,0L3.6,-4.4V4.4Z", ">": "M4.6,0L-3.6,-4.4V4.4Z",
  P: "M-1.6,-4.4H1.6V-1.6H4.4V1.6H1.6V4.4H-1.6V1.6H-4.4V-1.6H-1.6Z",
  X: "M-4.2,-2L-2,-4.2L0,-2L2,-4.2L4.2,-2L2,0L4.2,2L2,4.2L0,2L-2,4.2L-4.2,2L-2,0Z",
};

/** Make a marker; hollow markers are runs that are not right. */
function marker(kind, x, y, style, hollow, attributes) {
  const colour = style ? { style: `stroke:${style};fill:${hollow ? "var(--paper)" : style}` } : {};
  return shape("path", { d: MARKERS[kind] || MARKERS.o, transform: `translate(${x} ${y})`, "stroke-width": 1.4, ...colour,
    ...attributes });
}
// Phase portrait, drawn from packed points (henon_ref/harness/report/rendering.py).

/** Unpack the points of a portrait, as fractions of its limits (0 to 1); of earlier reports, base64 text. */
function pointsOf(text) {
  if (!text.includes(" ")) {
    const numbers = new DataView(bytesOf(text).buffer);
    return Array.from({ length: numbers.byteLength / 4 }, (_, k) =>
      [numbers.getInt16(4 * k, true) / 4096, numbers.getInt16(4 * k + 2, true) / 4096]);
  }
  const steps = text.split(" ").map(Number), place = [0, 0];
  return Array.from({ length: steps.length / 2 }, (_, k) => {
    place[0] += steps[2 * k];
    place[1] += steps[2 * k + 1];
    return place.map((value) => value / 2048);
  });
}

const pieceClass = (label) =>
  label === "stick" ? "stick" : label === "surface" ? "surface" : label.endsWith("−1") ? "minus" : "plus";

/** Draw the curves of a portrait in a new frame. */
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

/** Make the key of the lines of a portrait. */
function portraitKey(portrait) {
  const labels = [...new Set(portrait.pieces.map(([label]) => label))].sort();
  if (portrait.surfaces.length) labels.push("surface");
  return labels.map((label) => make("span", null,
    shape("svg", { class: "swatch", viewBox: "0 0 26 12", "aria-hidden": "true" },
      shape("path", { class: `piece ${pieceClass(label)}`, d: "M1,6H25" })), label === "surface" ? "surface h = 0" : label));
}
