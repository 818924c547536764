// The page's data: solvers, readings with the cells of the matrix and their runs, and a place of each run.

const SOLVERS = DATA.solvers.map((solver, k) => ({ ...solver, index: k, colour: `var(--s${k})` }));

/** A list as an object. */
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

/** One solver on one reading. */
function cellOf(reading, solver, values) {
  const own = named(DATA.cell, values);
  const runs = reading.runs[solver]?.map((run) => named(DATA.fields, run)) || null;
  return { ...own, reading, solver: SOLVERS[solver], runs, best: own.right ? own.digits ?? 0 : -1 };
}

/** Shortest time of a run that gets so many digits (0: of any right one); null: there is none. */
const wallAt = (cell, digits) => cell[digits ? `wall_${digits}_s` : "wall_s"];

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
