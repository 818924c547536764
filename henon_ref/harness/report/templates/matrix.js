// Data of the page: solvers, readings with the cells of the matrix and their runs, and the address of each run.

const SOLVERS = DATA.solvers.map((solver, k) => ({ ...solver, index: k, colour: `light-dark(${solver.light}, ${solver.dark})` }));

/** Convert a list to an object. */
const named = (fields, values) => Object.fromEntries(fields.map((field, k) => [field, values[k]]));

const READINGS = DATA.cases.flatMap((own) => own.readings.map((reading) => ({
  ...reading,
  of: own,
  kindName: DATA.kinds[reading.kind],
  label: own.readings.length > 1 || reading.name !== "default" ? `${own.name} / ${reading.name}` : own.name,
})));
READINGS.forEach((reading, k) => {
  reading.index = k;
  reading.cells = reading.cells.map(([solver, ...values]) => cellOf(reading, solver, values));
  reading.bySolver = new Map(reading.cells.map((cell) => [cell.solver.index, cell]));
});

/** Make the cell of one solver on one reading. */
function cellOf(reading, solver, values) {
  const own = named(DATA.cell, values);
  const runs = reading.runs[solver]?.map((run) => named(DATA.fields, run)) || null;
  return { ...own, reading, solver: SOLVERS[solver], runs, best: own.right ? own.digits ?? 0 : -1 };
}

/** Shortest time of a run with at least a number of digits (0: of any right run); null if there is none. */
const wallAt = (cell, digits) => cell[digits ? `wall_${digits}_s` : "wall_s"];

/** Cell shown first for a reading: the most digits, then the shortest time. */
const bestCell = (reading) => [...reading.cells].sort((a, b) => b.best - a.best || (a.wall_s ?? Infinity) - (b.wall_s ?? Infinity))[0];

/** Whether any run of a solver was judged. */
const isJudged = (cell) => cell.judged > 0;

// Each run has an identifier that is valid in an address.
const PLACES = new Map();
for (const reading of READINGS) {
  for (const cell of reading.cells) {
    const plain = ["run", reading.of.name, reading.name, cell.solver.name].join("-").replace(/[^A-Za-z0-9_-]/g, "_");
    let id = plain;
    for (let k = 2; PLACES.has(id); k++) id = `${plain}-${k}`;
    PLACES.set(id, cell);
    cell.id = id;
  }
}
// Recommended solver for a number of digits and a kind of case: a table, and a figure of all solvers.

/** Data for a number of digits. */
const levelOf = (digits) => DATA.choice.find((level) => level.digits === digits);

function drawChoice(digits, kind) {
  const level = levelOf(digits);
  level.rows.forEach((cells, k) => {
    const row = byId("choice-table").querySelectorAll("tbody tr")[k];
    row.classList.toggle("now", kind === k);
    cells.forEach((text, j) => { row.children[j].textContent = text; });
  });
  byId("choice-table").querySelector("caption").textContent = level.caption;
  const group = level.groups[kind === null ? 0 : kind + 1];
  byId("answer").textContent = group.answer;
  const lines = group.bars.map(([solver, got, judged, slower]) => ({ solver: SOLVERS[solver], got, judged, slower }));
  lines.sort((a, b) => a.solver.few - b.solver.few);
  drawBars(byId("reaches"), lines, group.all, `Number of ${group.readings} in which each solver obtains ${level.wanted}, and its time`);
  byId("reaches-note").textContent = `Dark: readings in which the solver obtains ${level.wanted}. Pale: readings in which it is judged. ` +
    `Full width: ${group.readings}. Dots: median of its time over that of the fastest solver, in the readings of the dark bar.`;
}

/** Description of a solver's project, with its address. */
const projectWords = ({ package: name, link, about }) => [link ? make("a", { href: link }, name) : name, about ? `, ${about}` : ""];

/** List the projects of the solvers. */
function listProjects() {
  const first = new Map(SOLVERS.map((solver) => [solver.package, solver]).reverse());
  const named = [...new Set(SOLVERS.map((solver) => solver.package))].map((name) => first.get(name));
  byId("projects").replaceChildren(...named.map((solver) => make("li", null, ...projectWords(solver))));
}

const ROW = 20;
const shortName = (name) => (name.length > 18 ? `${name.slice(0, 17)}…` : name);

function drawBars(holder, lines, all, label) {
  const width = widthOf(holder);
  const names = Math.min(132, 0.34 * width);
  const middle = names + (width - names) * 0.52;
  const bars = { from: names + 6, to: middle - 76 };
  const wide = (readings) => (bars.to - bars.from) * readings / (all || 1);
  const slowest = Math.max(10, ...lines.map((line) => line.slower || 1));
  const axis = { low: 1, high: 10 ** Math.ceil(Math.log10(slowest) - 1e-9), log: true };
  const times = scale(axis, middle + 10, width - 18);
  const top = 34;
  const apart = lines.findIndex((line) => line.solver.few); // they follow a line of text
  const height = top + ROW * (lines.length + (apart >= 0)) + 8;
  const svg = shape("svg", { class: "bars", viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label },
    shape("text", { class: "tick", x: bars.from, y: 12 }, "obtained in, of judged"),
    shape("text", { class: "tick", x: middle + 6, y: 12 }, "time over the fastest"));
  const labels = Math.max(2, Math.floor((width - middle) / 44));
  for (const tick of ticks({ ...axis, text: (k) => (k < 4 ? `×${10 ** k}` : `×${powerOfTen(k)}`) }, labels)) {
    svg.append(shape("line", { class: "grid", x1: times(tick.value), x2: times(tick.value), y1: top - 4, y2: height - 6 }),
      shape("text", { class: "tick", x: times(tick.value), y: 27, "text-anchor": "middle" }, tick.text));
  }
  if (apart >= 0) {
    svg.append(shape("text", { class: "tick", x: 0, y: top + ROW * apart + 14 }, "run on less than half of the readings:"));
  }
  lines.forEach((line, k) => {
    const y = top + ROW * (k + (apart >= 0 && k >= apart));
    const { got, judged } = line;
    const words = `${line.solver.name}: in ${got} of the ${judged} readings in which it is judged (${Math.floor(100 * got / judged)} %), of ${all}` +
      (line.slower ? `\n×${significant(line.slower, 2)} as long as the fastest (median)` : "");
    const row = shape("g", null,
      shape("rect", { x: 0, y, width, height: ROW, fill: "transparent" }),
      shape("text", { x: names, y: y + 14, "text-anchor": "end" }, shortName(line.solver.name)),
      shape("rect", { class: "bar-all", x: bars.from, y: y + 4, width: wide(all), height: ROW - 8 }),
      shape("rect", { class: "bar-judged", x: bars.from, y: y + 4, width: wide(judged), height: ROW - 8 }),
      shape("rect", { class: "bar-in", x: bars.from, y: y + 4, width: wide(got), height: ROW - 8 }),
      shape("text", { class: "tick", x: bars.to + 5, y: y + 14 }, `${got} of ${judged}`));
    if (line.slower) row.append(shape("circle", { class: "dot", cx: times(line.slower), cy: y + ROW / 2, r: 3.6 }));
    tooltip.on(row, words);
    svg.append(row);
  });
  holder.replaceChildren(svg);
}
// Matrix with a row per reading and a column per solver. Cells are made once. Filters hide rows and columns; the number of digits
// selects the colours.

const MATRIX = { rows: [], hidden: new Set(), sort: { by: "case", up: true } };
const SHORT = { unsupported: "–", unavailable: "·", "ill-conditioned": "ill-cond." };

function makeMatrix() {
  const heads = [head("case", "case / reading"), head("kind", "kind"),
    ...SOLVERS.map((solver) => head(solver.index, solver.name, solver.few ? "solver few" : "solver"))];
  const body = make("tbody");
  for (const reading of READINGS) {
    const cells = SOLVERS.map((solver) => cellNode(reading.bySolver.get(solver.index)));
    const words = [reading.of.name, reading.name, reading.of.title, reading.title || ""].join(" ").toLowerCase();
    const node = make("tr", null, make("th", { scope: "row", title: reading.of.title }, reading.label),
      make("td", { class: "kind" }, reading.kindName), cells.map((cell) => cell.node));
    MATRIX.rows.push({ reading, node, words, cells });
    body.append(node);
  }
  MATRIX.body = body;
  const widths = make("colgroup", null, make("col", { class: "name" }), make("col", { class: "kind" }), SOLVERS.map(() => make("col")));
  const whole = make("table", { style: `--solvers:${SOLVERS.length}` }, widths, make("thead", null, make("tr", null, heads)), body);
  whole.addEventListener("pointerover", sayCell);
  byId("matrix").replaceChildren(whole);
  const first = body.querySelector("a");
  if (first) first.setAttribute("tabindex", "0");
  arrowKeys(byId("matrix"), "a");
  byId("standings").replaceChildren(...Object.entries(STANDINGS).filter(([name]) => name !== "none")
    .map(([name, words]) => make("span", null, make("i", { class: `chip ${name}` }), words)));
}

function head(by, text, kind) {
  const button = make("button", { type: "button", onclick: () => sortMatrix(by) }, text);
  return make("th", { scope: "col", class: kind, "data-by": by, "aria-sort": by === "case" ? "ascending" : null }, button);
}

/** Make a cell of the table with the link to its run; text and colour are set later. */
function cellNode(cell) {
  if (!cell) return { cell: null, node: make("td", { class: "cell none" }) };
  const link = make("a", { id: cell.id, href: `#${cell.id}`, tabindex: "-1" });
  return { cell, link, node: make("td", { class: "cell" }, link) };
}

/** Possible results of a cell for the selected digits -> text in its title and in the key of the colours. */
const STANDINGS = { reached: "reaches the required digits", fewer: "right, with fewer digits", wrong: "not right",
  timeout: "out of time", undecided: "ill-conditioned or not unique: not decided in double precision", none: "not judged" };

/** Set the title of a cell when the pointer enters it. */
function sayCell(event) {
  const link = event.target.closest("a");
  const cell = link && PLACES.get(link.id);
  if (cell) link.title = `${cell.solver.name} on ${cell.reading.label}: ${STANDINGS[standing(cell, Number(byId("digits").value))]}`;
}

/** Text of a cell: digits, or the time for the selected digits. */
function cellText(cell, digits, shown) {
  if (!cell.right) {
    const word = { timeout: cell.status, undecided: cell.verdict, wrong: cell.status }[standing(cell, digits)];
    return word ? SHORT[word] || word : SHORT[cell.status] || "not judged";
  }
  if (shown === "time") {
    return duration(wallAt(cell, digits)) || "–";
  }
  const reached = cell.digits === null ? "ok" : digitsText(cell.digits);
  return cell.right === cell.settings ? reached : `${reached} *`;
}

/** Result of a cell for the selected digits, a key of STANDINGS. */
function standing(cell, digits) {
  if (wallAt(cell, digits) !== null) return "reached";
  if (cell.right) return cell.digits === null ? "reached" : "fewer";
  if (cell.status === "timeout") return "timeout";
  if (["ill-conditioned", "not unique"].includes(cell.verdict)) return "undecided";
  return isJudged(cell) ? "wrong" : "none";
}

/** Set the texts and colours of all cells. */
function colourMatrix(digits, shown) {
  for (const row of MATRIX.rows) {
    for (const { cell, node, link } of row.cells) {
      if (!cell) continue;
      const own = standing(cell, digits);
      const text = cellText(cell, digits, shown);
      if (link.textContent !== text) link.textContent = text;
      const name = `cell ${own}${MATRIX.shown === cell ? " shown" : ""}`;
      if (node.className !== name) node.className = name;
    }
  }
}

/** Hide the rows that the filters exclude. */
function filterMatrix({ digits, kind, tag, text, which }) {
  const solvers = SOLVERS.filter((solver) => !MATRIX.hidden.has(solver.index));
  let visible = 0;
  for (const row of MATRIX.rows) {
    const { reading } = row;
    const known = (kind === null || reading.kind === kind) && (!tag || (reading.of.tags || []).includes(tag)) &&
      text.toLowerCase().split(/\s+/).every((word) => row.words.includes(word));
    row.node.hidden = !(known && isWanted(reading, solvers, digits, which));
    visible += row.node.hidden ? 0 : 1;
  }
  byId("nothing").hidden = visible > 0;
  byId("matrix").hidden = visible === 0;
  byId("shown-rows").textContent = `${visible} of ${count(READINGS.length, "reading")}`;
}

/** Check whether some, all or none of the shown solvers reach the selected digits on a reading. */
function isWanted(reading, solvers, digits, which) {
  if (which === "all") return true;
  const judged = solvers.map((solver) => reading.bySolver.get(solver.index)).filter((cell) => cell && isJudged(cell));
  const got = judged.filter((cell) => standing(cell, digits) === "reached").length;
  return which === "every" ? got === judged.length && got > 0 : which === "missed" ? got < judged.length : got === 0;
}

/** Show or hide the column of a solver. */
function showSolver(index, shown) {
  if (shown) MATRIX.hidden.delete(index);
  else MATRIX.hidden.add(index);
  byId("matrix").querySelector("table").style.setProperty("--solvers", SOLVERS.length - MATRIX.hidden.size);
  byId("columns").textContent = [...MATRIX.hidden].map((k) => `#matrix tr > :nth-child(${k + 3}), #matrix col:nth-child(${k + 3}) { display: none; }`).join("\n");
}

/** Sort by a column; a second call reverses the order. */
function sortMatrix(by) {
  const { sort, rows, body } = MATRIX;
  MATRIX.sort = { by, up: sort.by === by ? !sort.up : typeof by !== "number" };
  const sign = MATRIX.sort.up ? 1 : -1;
  const shown = byId("shown").value;
  const digits = Number(byId("digits").value);
  const key = (row) => {
    if (by === "case") return row.reading.index;
    if (by === "kind") return row.reading.kind;
    const cell = row.reading.bySolver.get(by);
    if (!cell) return -2;
    return shown === "time" ? -(wallAt(cell, digits) ?? Infinity) : cell.best;
  };
  rows.sort((a, b) => sign * (key(a) - key(b) || 0) || a.reading.index - b.reading.index);
  body.append(...rows.map((row) => row.node));
  for (const th of document.querySelectorAll("#matrix th[data-by]")) {
    if (th.dataset.by === String(by)) th.setAttribute("aria-sort", MATRIX.sort.up ? "ascending" : "descending");
    else th.removeAttribute("aria-sort");
  }
}
