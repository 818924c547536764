// Which solver to take, for so many digits and a kind of case: a table, and a figure of every solver.

/**
 * The solvers that get so many digits in about as many readings as any other, the fastest first: what
 * henon_ref/harness/report/text/choice.py does for the markdown index.
 */
function reaches(cells, digits) {
  const bySolver = new Map();
  const fastest = new Map();
  for (const cell of cells) {
    const wall = cell.walls[digits];
    if (wall === null) continue;
    if (!bySolver.has(cell.solver)) bySolver.set(cell.solver, new Map());
    bySolver.get(cell.solver).set(cell.reading.index, wall);
    if (!Number.isNaN(wall)) fastest.set(cell.reading.index, Math.min(wall, fastest.get(cell.reading.index) ?? Infinity));
  }
  const most = Math.max(0, ...[...bySolver.values()].map((walls) => walls.size));
  return [...bySolver].map(([solver, walls]) => ({ solver, walls, slower: timesAsLong(walls, fastest) }))
    .filter((own) => own.walls.size >= 0.9 * most)
    .sort((a, b) => (a.slower ?? 1) - (b.slower ?? 1) || b.walls.size - a.walls.size);
}

/** How many times as long one solver takes as another: the median over the readings that both get. */
function timesAsLong(walls, others) {
  const ratios = [...walls].filter(([key, wall]) => others.get(key) && !Number.isNaN(wall))
    .map(([key, wall]) => wall / others.get(key));
  return ratios.length ? median(ratios) : null;
}

/** The solver to take, and the one to take of all other packages. */
function choiceOf(readings, digits) {
  const cells = readings.flatMap((reading) => reading.cells);
  const [first] = reaches(cells, digits);
  if (!first) return { first: null, other: null };
  const [other] = reaches(cells.filter((cell) => cell.solver.package !== first.solver.package), digits);
  return { first, other: other || null, times: other ? timesAsLong(other.walls, first.walls) : null };
}

/** The readings that can have so many digits: with 0 all, else those with a transition to time. */
const countable = (readings, digits) => readings.filter((reading) => digits === 0 || reading.timed);

const readingsWord = (digits) => (digits ? "readings with a transition to time" : "readings");

function typicalTime(walls) {
  const known = [...walls.values()].filter((wall) => !Number.isNaN(wall));
  return known.length ? duration(median(known)) : "";
}

const wanted = (digits) => (digits ? count(digits, "digit") : "the right sequence and end");

function drawChoice(digits, kind) {
  const rows = DATA.kinds.map((name, k) => {
    const readings = READINGS.filter((reading) => reading.kind === k);
    const { first, other, times } = choiceOf(readings, digits);
    const [timed, all] = [countable(readings, digits).length, readings.length];
    const cells = [name, timed === all ? `${all}` : `${timed} of ${all}`,
      first ? make("code", null, first.solver.name) : "none", first ? `${first.walls.size}` : "", first ? typicalTime(first.walls) : "",
      other ? make("code", null, other.solver.name) : "", other ? `${other.walls.size}` : "", times ? `×${significant(times, 2)}` : ""];
    cells.now = kind === k;
    return cells;
  });
  byId("choice-table").replaceChildren(table(
    ["kind of case", ["readings", "number"], "take", ["gets", "number"], ["time", "number"], "other package", ["gets", "number"],
      ["times as long", "number"]], rows,
    `The fastest of the solvers that get ${wanted(digits)} in the most readings, or in up to a tenth fewer; ${digits ? "readings: of all, those with a transition to time; " : ""}times are medians`));
  drawAnswer(digits, kind);
  drawReaches(digits, kind);
}

/** The sentence above the table. */
function drawAnswer(digits, kind) {
  const readings = countable(READINGS.filter((reading) => kind === null || reading.kind === kind), digits);
  const { first, other, times } = choiceOf(readings, digits);
  const about = `${wanted(digits)}, ${kind === null ? "all kinds of case" : DATA.kinds[kind]}`;
  const parts = [`For ${about}: `];
  if (!first) parts.push("no solver gets there.");
  else {
    parts.push("take ", make("strong", null, first.solver.name), ` (in ${first.walls.size} of ${readings.length} ${readingsWord(digits)})`);
    if (other) {
      const longer = times ? `, ${significant(times, 2)} times as long` : "";
      parts.push("; of other packages ", make("strong", null, other.solver.name), ` (in ${other.walls.size}${longer})`);
    }
    parts.push(".");
  }
  byId("answer").replaceChildren(...parts);
}

/** A row a solver: in how many of the readings it gets so many digits, those with the most first, and how long it takes. */
function drawReaches(digits, kind) {
  const readings = countable(READINGS.filter((reading) => kind === null || reading.kind === kind), digits);
  const fastest = new Map();
  const own = SOLVERS.map((solver) => ({ solver, judged: 0, walls: new Map() }));
  for (const reading of readings) {
    for (const cell of reading.cells.filter(isJudged)) {
      const line = own[cell.solver.index];
      line.judged += 1;
      const wall = cell.walls[digits];
      if (wall === null) continue;
      line.walls.set(reading.index, wall);
      if (!Number.isNaN(wall)) fastest.set(reading.index, Math.min(wall, fastest.get(reading.index) ?? Infinity));
    }
  }
  const lines = own.filter((line) => line.judged).map((line) => ({ ...line, slower: timesAsLong(line.walls, fastest) }))
    .sort((a, b) => a.solver.few - b.solver.few || b.walls.size - a.walls.size || (a.slower ?? Infinity) - (b.slower ?? Infinity) || a.judged - b.judged);
  const all = `${readings.length} ${readingsWord(digits)}`;
  drawBars(byId("reaches"), lines, readings.length, `In how many of ${all} each solver gets ${wanted(digits)}, and its time`);
  byId("reaches-note").textContent = `Dark: readings in which the solver gets ${wanted(digits)}; pale: those in which it is judged; ` +
    `the whole width: all ${all}. Dots: its time over that of the fastest solver, the median over the readings that it gets.`;
}

/** A line on a solver's project, with its address. */
const projectWords = ({ package: name, link, about }) => [link ? make("a", { href: link }, name) : name, about ? `, ${about}` : ""];

/** The projects that the solvers come from. */
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
  const apart = lines.findIndex((line) => line.solver.few); // these stand below a line of words
  const height = top + ROW * (lines.length + (apart >= 0)) + 8;
  const svg = shape("svg", { class: "bars", viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label },
    shape("text", { class: "tick", x: bars.from, y: 12 }, "gets, of judged"),
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
    const [got, judged] = [line.walls.size, line.judged];
    const words = `${line.solver.name}: gets ${got} of the ${judged} readings that it is judged in (${Math.floor(100 * got / judged)} %), of ${all}` +
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
