// The page's data, unpacked: solvers, cases, readings, and the cells of the matrix with their runs.

const DATA = JSON.parse(byId("data").textContent);
const SOLVERS = DATA.solvers.map((solver, k) => ({ ...solver, index: k, colour: `var(--s${k})` }));
const TEXT_FIELDS = new Set(["setting", "status", "verdict", "status_reason", "cause", "verdict_basis"]);
const NOT_RUN = ["unsupported", "unavailable"];
const MOST_DIGITS = 15;

/** A list as an object; text fields hold numbers of words. */
function named(fields, values) {
  return Object.fromEntries(fields.map((field, k) => {
    const value = values[k] ?? null;
    return [field, value !== null && TEXT_FIELDS.has(field) ? DATA.words[value] : value];
  }));
}

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
  reading.timed = reading.cells.some((cell) => cell.digits !== null);
});

/** One solver on one reading. */
function cellOf(reading, solver, values) {
  const own = named(DATA.cell, values);
  const packed = reading.runs[solver];
  const runs = packed ? packed.map((run) => named(DATA.fields, run)) : null;
  const cell = { ...own, reading, solver: SOLVERS[solver], runs };
  cell.walls = Array.from({ length: MOST_DIGITS + 1 }, (_, digits) => wallAt(cell, digits));
  cell.best = cell.right ? cell.digits ?? 0 : -1;
  return cell;
}

/**
 * Shortest time of a run that gets so many digits; 0 digits: of any right run. null: there is none; NaN: there is one,
 * and its time is not known. Of a case whose runs are not kept the time is that for the next higher digits in the matrix.
 */
function wallAt(cell, digits) {
  if (!cell.right) return null;
  if (digits === 0) return cell.wall_s;
  if (cell.runs) {
    const walls = cell.runs.filter((run) => run.verdict === "right" && run.digits !== null && run.digits >= digits)
      .map((run) => run.wall_s).filter((wall) => wall !== null);
    return walls.length ? Math.min(...walls) : null;
  }
  if (cell.digits === null || cell.digits < digits) return null;
  const level = DATA.levels.find((own) => own >= digits && cell[`wall_${own}_s`] !== null);
  return level === undefined ? NaN : cell[`wall_${level}_s`];
}

/** The cell that a reading's details begin with: the most digits, then the shortest time. */
const bestCell = (reading) => [...reading.cells].sort((a, b) => b.best - a.best || (a.wall_s ?? Infinity) - (b.wall_s ?? Infinity))[0];

/** Whether any run of a solver was judged. */
const isJudged = (cell) => cell.judged > 0;

// Every run's place on the page has a name that may stand in an address.
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
