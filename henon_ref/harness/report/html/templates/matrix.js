// The matrix: a row a reading, a column a solver. Cells are made once; filters hide rows and columns, the digits wanted colour them.

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

/** A cell of the table: the link to its run, whose text and colour follow. */
function cellNode(cell) {
  if (!cell) return { cell: null, node: make("td", { class: "cell none" }) };
  const link = make("a", { id: cell.id, href: `#${cell.id}`, tabindex: "-1" });
  return { cell, link, node: make("td", { class: "cell" }, link) };
}

/** How a cell may stand to the digits wanted: the words of its title and of the key, which has the same colours. */
const STANDINGS = { reached: "gets the digits wanted", fewer: "right, with fewer digits", wrong: "not right",
  timeout: "out of time", undecided: "ill-conditioned or not unique: not decided in double precision", none: "not judged" };

/** The title of a cell, made when the pointer comes to it. */
function sayCell(event) {
  const link = event.target.closest("a");
  const cell = link && PLACES.get(link.id);
  if (cell) link.title = `${cell.solver.name} on ${cell.reading.label}: ${STANDINGS[standing(cell, Number(byId("digits").value))]}`;
}

/** What a cell says: digits, or the time for the digits wanted. */
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

/** How a cell stands to the digits wanted. */
function standing(cell, digits) {
  if (wallAt(cell, digits) !== null) return "reached";
  if (cell.right) return cell.digits === null ? "reached" : "fewer";
  if (cell.status === "timeout") return "timeout";
  if (["ill-conditioned", "not unique"].includes(cell.verdict)) return "undecided";
  return isJudged(cell) ? "wrong" : "none";
}

/** Texts and colours of all cells. */
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

/** Hide what the filters leave out. */
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

/** Whether a reading is one that some, all or none of the solvers shown get with the digits wanted. */
function isWanted(reading, solvers, digits, which) {
  if (which === "all") return true;
  const judged = solvers.map((solver) => reading.bySolver.get(solver.index)).filter((cell) => cell && isJudged(cell));
  const got = judged.filter((cell) => standing(cell, digits) === "reached").length;
  return which === "every" ? got === judged.length && got > 0 : which === "missed" ? got < judged.length : got === 0;
}

/** Show or hide a solver's column. */
function showSolver(index, shown) {
  if (shown) MATRIX.hidden.delete(index);
  else MATRIX.hidden.add(index);
  byId("matrix").querySelector("table").style.setProperty("--solvers", SOLVERS.length - MATRIX.hidden.size);
  byId("columns").textContent = [...MATRIX.hidden].map((k) => `#matrix tr > :nth-child(${k + 3}), #matrix col:nth-child(${k + 3}) { display: none; }`).join("\n");
}

/** Sort by a column; once more turns it round. */
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
