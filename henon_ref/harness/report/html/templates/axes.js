// A figure's frame: axes, grid and labels, at the width that there is, so that its letters keep their size.

/**
 * Begin a figure.
 * wanted: {height, left, x: {low, high, log, label, text}, y: {...}, label}; text(value) writes a tick (log: an exponent).
 * bare: no grid across what is drawn. Returns the SVG, its group for what is drawn, and at(x, y) in pixels.
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

/** A function from values to pixels. */
function scale(axis, from, to) {
  const place = axis.log ? Math.log10 : (value) => value;
  const low = place(axis.low);
  const span = place(axis.high) - low || 1;
  return (value) => from + ((place(value) - low) / span) * (to - from);
}

/** Values and texts of an axis's ticks, at most so many. */
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

/** The width of a holder, looked up once: to ask for it again would lay out the whole page. */
function widthOf(holder) {
  if (!WIDTHS.has(holder)) WIDTHS.set(holder, holder.clientWidth);
  return Math.max(WIDTHS.get(holder), 260);
}

/** Draw again whenever the width of a holder changes. */
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

/** A marker at a place; hollow ones are what is not right. */
function marker(kind, x, y, style, hollow, attributes) {
  const colour = style ? { style: `stroke:${style};fill:${hollow ? "var(--paper)" : style}` } : {};
  return shape("path", { d: MARKERS[kind] || MARKERS.o, transform: `translate(${x} ${y})`, "stroke-width": 1.4, ...colour,
    ...attributes });
}
