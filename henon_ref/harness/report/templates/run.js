// One run: phase portrait, work-precision diagram, and all settings of one solver with errors, reasons and causes.

const RUN = { cell: null, hidden: new Set() };

function showRun(cell, { scroll = true } = {}) {
  const { reading, solver } = cell;
  const before = RUN.cell;
  RUN.cell = cell;
  for (const own of [before, cell]) {
    const node = own && byId(own.id)?.parentElement;
    if (node) node.classList.toggle("shown", own === cell);
  }
  MATRIX.shown = cell;
  byId("run-reading").value = String(reading.index);
  options(byId("run-solver"), reading.cells.map((one) => [one.solver.index, one.solver.name]));
  byId("run-solver").value = String(solver.index);
  byId("run-title").textContent = `${solver.name} on ${reading.label}`;
  byId("run-words").replaceChildren(...runWords(reading, solver));
  drawPortrait(reading);
  drawRuns(cell);
  drawFiles(reading);
  drawWork();
  if (scroll) {
    byId("run").scrollIntoView({ block: "start" });
    byId("run-title").focus({ preventScroll: true });
  }
}

/** Describe the case and the project of the solver. */
function runWords(reading, solver) {
  const own = reading.of;
  const title = reading.title && reading.title !== own.title ? `${own.title}. ${reading.title}` : own.title;
  const truth = reading.transitions === undefined ? null :
    `Truth: ${count(reading.transitions, "transition")}${reading.proven ? ", proven" : ", not proven"}` +
    (reading.ends && reading.ends !== "ok" ? `; the exact run ends ${reading.ends}` : "") + ".";
  return [make("div", null, make("p", null, make("strong", null, title)), reading.story ? make("p", null, reading.story) : null),
    make("div", null, make("p", { class: "small" }, `${solver.name}: `, ...projectWords(solver)),
      make("p", { class: "quiet small" }, [`Kind: ${reading.kindName}.`, truth, own.source ? `Source: ${own.source}.`.replace("..", ".") : null,
      own.tags ? `Tags: ${own.tags.join(", ")}.` : null, reading.commit ? `Run by commit ${reading.commit.replaceAll(", ", " and ")}.` : null]
        .filter(Boolean).join(" ")))];
}

/** Draw the phase portrait of a reading from its packed points. */
function drawPortrait(reading) {
  const holder = byId("portrait");
  const { portrait } = reading;
  byId("portrait-key").replaceChildren();
  if (!portrait) {
    const other = READINGS.find((own) => own.of === reading.of && own.portrait);
    holder.replaceChildren(make("p", { class: "quiet" }, "No portrait of this reading is kept",
      other ? ["; there is one of ", make("a", { href: `#${bestCell(other).id}` }, other.name)] : null, "."));
    byId("portrait-note").textContent = "";
    return;
  }
  portraitFigure(holder, portrait, 340);
  const seconds = portrait.window.map((time) => significant(time, 6)).join(" s to ");
  byId("portrait-note").textContent = `The motion from ${seconds} s`;
  byId("portrait-key").replaceChildren(...portraitKey(portrait));
}

/** Runs of a reading with a time and an error, by solver. */
function laddersOf(reading) {
  return reading.cells.filter((cell) => cell.runs).map((cell) => ({
    cell, solver: cell.solver, runs: cell.runs.filter((run) => run.wall_s > 0 && run.max_time_error_s !== null),
  })).filter((ladder) => ladder.runs.length);
}

/** Draw the work-precision diagram of the reading: error over time, one line per solver. */
function drawWork() {
  const { reading, solver } = RUN.cell;
  const holder = byId("work");
  const ladders = laddersOf(reading);
  drawSwitches(ladders);
  const drawn = ladders.filter((ladder) => !RUN.hidden.has(ladder.solver.index));
  RUN.frame = null;
  if (!drawn.length) {
    const why = !reading.cells.some((cell) => cell.runs) ? "The runs of this case are not kept." :
      ladders.length ? "No solver is selected." : "No run of this reading has both a time and an error.";
    holder.replaceChildren(make("p", { class: "quiet" }, why));
    return;
  }
  const floor = reading.floor || 1e-17;
  const error = (run) => Math.max(run.max_time_error_s, floor);
  const runs = drawn.flatMap((ladder) => ladder.runs);
  const frame = begin(holder, {
    height: 340, role: "group", label: "Work-precision: worst error of a transition time over the wall time of a run",
    x: { ...around(runs.map((run) => run.wall_s), 1), log: true, label: "wall time of one run", text: decadeOfTime },
    y: { ...around(runs.map(error), 1), log: true, label: "worst error of a transition time [s]" },
  });
  RUN.frame = frame;
  RUN.level = shape("g");
  frame.inside.append(RUN.level);
  drawLevel();
  for (const ladder of [...drawn].sort((a, b) => (a.solver === solver) - (b.solver === solver))) {
    const group = shape("g", { class: ladder.solver === solver || ladder.cell.best >= 0 ? null : "faint" });
    const { colour } = ladder.solver;
    const good = ladder.runs.filter((run) => run.verdict === "right");
    const line = good.map((run) => `${frame.x(run.wall_s).toFixed(1)},${frame.y(error(run)).toFixed(1)}`).join("L");
    if (good.length > 1) {
      group.append(shape("path", { d: `M${line}`, fill: "none", "stroke-dasharray": ladder.solver.dashes || null,
        style: `stroke:${colour};stroke-width:${ladder.solver === solver ? 3 : ladder.solver.width}` }));
    }
    for (const run of ladder.runs) {
      const right = run.verdict === "right";
      const words = `${ladder.solver.name} at ${run.setting}\nerror ${errorText(run.max_time_error_s, floor)} s` +
        `${run.digits === null ? "" : ` (${digitsText(run.digits)} digits)`}\ntime ${duration(run.wall_s)}${right ? "" : `\nnot right: ${run.status}`}`;
      const point = marker(ladder.solver.marker, frame.x(run.wall_s), frame.y(error(run)), colour, !right,
        { role: "img", "aria-label": words.replaceAll("\n", ", "), tabindex: "-1" });
      tooltip.on(point, words);
      group.append(point);
    }
    frame.inside.append(group);
  }
  frame.inside.querySelector("[tabindex]")?.setAttribute("tabindex", "0");
}

/** Limits of whole decades around some values. */
function around(values, least) {
  let low = Math.floor(Math.log10(Math.min(...values)) - 0.25);
  let high = Math.ceil(Math.log10(Math.max(...values)) + 0.25);
  if (high - low < least + 1) [low, high] = [low - 1, high + 1];
  return { low: 10 ** low, high: 10 ** high };
}

/** Draw the largest error that the selected digits allow, as a line. */
function drawLevel() {
  const { frame, level, cell } = RUN;
  if (!frame) return;
  level.replaceChildren();
  const digits = Number(byId("digits").value);
  const y = frame.y((cell.reading.unit || 1) * 10 ** -digits);
  const [left, right] = [frame.edge.left, frame.edge.left + frame.inner.width];
  if (digits === 0 || y < frame.edge.top || y > frame.edge.top + frame.inner.height) return;
  level.append(shape("line", { class: "level", x1: left, x2: right, y1: y, y2: y }),
    shape("text", { class: "tick", x: right - 4, y: y - 4, "text-anchor": "end" }, count(digits, "digit")));
}

/** Make one checkbox per solver, with a sample of its line. */
function drawSwitches(ladders) {
  const focused = document.activeElement?.dataset?.switch;
  byId("switches").replaceChildren(...ladders.map(({ solver }) => {
    const box = make("input", { type: "checkbox", "data-switch": solver.index, onchange: (event) => {
      if (event.target.checked) RUN.hidden.delete(solver.index);
      else RUN.hidden.add(solver.index);
      drawWork();
    } });
    box.checked = !RUN.hidden.has(solver.index);
    const line = shape("path", { d: "M1,6H25", "stroke-dasharray": solver.dashes || null, style: `stroke:${solver.colour};stroke-width:${solver.width}` });
    return make("label", null, box, shape("svg", { class: "swatch", viewBox: "0 0 26 12", "aria-hidden": "true" }, line,
      marker(solver.marker, 13, 6, solver.colour, false)), solver.name);
  }));
  if (focused !== undefined) document.querySelector(`[data-switch="${focused}"]`)?.focus();
}

/** Make the tables of all settings of the solver, with errors, and with reasons for runs that are not right. */
function drawRuns(cell) {
  const holder = byId("run-tables");
  const { reading } = cell;
  if (!cell.runs) {
    const levels = DATA.choice.map((level) => level.digits).filter((digits) => digits && wallAt(cell, digits) !== null);
    const times = levels.map((digits) => `${digits} digits in ${duration(wallAt(cell, digits))}`).join(", ");
    holder.replaceChildren(make("p", null, `The runs of this case are not stored in this folder. Summary in the matrix: status ${cell.status}` +
      `${cell.verdict ? ` (${cell.verdict})` : ""}, right at ${cell.right ?? 0} of ${cell.settings} settings` +
      `${cell.digits === null ? "" : `, ${digitsText(cell.digits)} digits`}${times ? `; ${times}` : ""}. ` +
      "A comparison of the case file repeats the runs."));
    return;
  }
  const headings = ["setting", "result", ["digits", "number"], ["transition time, worst error [s]", "number"],
    ["stick duration [s]", "number"], ["state", "number"], ["time (IQR)", "number"], ["steps", "number"], ["right-hand sides", "number"]];
  const rows = cell.runs.map((run) => [run.setting || "–", resultOf(run), digitsText(run.digits), errorText(run.max_time_error_s, reading.floor),
    errorText(run.max_stick_error_s, reading.floor), errorText(run.max_state_error),
    duration(run.wall_s) + (run.wall_s_iqr === null ? "" : ` (${duration(run.wall_s_iqr)})`),
    run.steps === null ? "" : String(run.steps), run.rhs_evaluations === null ? "" : String(run.rhs_evaluations)]);
  const reasons = cell.runs.filter((run) => run.status_reason || run.cause || run.verdict_basis);
  holder.replaceChildren(scrolling(table(headings, rows, `Errors of ${cell.solver.name} at each of its settings`), "Errors at each setting"));
  if (!reasons.length) return;
  const why = reasons.map((run) => [run.setting || "–", resultOf(run), run.status_reason || "",
    run.verdict_basis ? `${run.verdict}: ${run.verdict_basis}` : run.verdict === "right" ? "" : run.verdict || "",
    run.cause ? DATA.causes[run.cause] || run.cause : ""]);
  holder.append(make("h3", null, "Reasons and causes"),
    scrolling(table(["setting", "result", "reason", "verdict", "cause in the library"], why), "Reasons and causes"));
}

/** Describe the result of a run in a few words. */
function resultOf(run) {
  const parts = [run.status === "ok" || run.verdict === "right" ? run.verdict || run.status : run.status];
  if (run.missed || run.spurious) parts.push(`${run.missed || 0} missed, ${run.spurious || 0} spurious`);
  if (run.missed_touches) parts.push(`${count(run.missed_touches, "graze")} missed`);
  return parts.join(": ");
}

const scrolling = (content, label) => make("div", { class: "scroll reflow", tabindex: "0", role: "region", "aria-label": label }, content);

/** Make links to the files of the case, if they exist next to this page. */
function drawFiles(reading) {
  const { name, files = [] } = reading.of;
  // The name of a figure is READING_KIND.svg (henon_ref/harness/report/svg.py); a kind has no underscore.
  const own = files.filter((file) => !file.endsWith(".svg") || file.slice(0, file.lastIndexOf("_")) === reading.name);
  byId("run-files").hidden = !own.length;
  byId("run-file-list").replaceChildren(...own.map((file) =>
    make("li", null, make("a", { href: `${encodeURIComponent(name)}/${encodeURIComponent(file)}` }, file))));
}
// Page of a folder of reports: controls and their actions.

const control = (id) => byId(id).value;
const settings = () => ({
  digits: Number(control("digits")), kind: control("kind") === "" ? null : Number(control("kind")), tag: control("tag"),
  text: control("search"), which: control("which"), shown: control("shown"),
});

function followDigits() {
  const { digits, kind, shown, which } = settings();
  drawChoice(digits, kind);
  colourMatrix(digits, shown);
  if (which !== "all") filterMatrix(settings());
  drawLevel();
}

function followFilters() {
  const own = settings();
  drawChoice(own.digits, own.kind);
  filterMatrix(own);
}

/** Make the controls whose choices depend on the data. */
function makeControls() {
  options(byId("digits"), DATA.choice.map(({ digits }) => [digits, digits ? count(digits, "digit") : "right, any digits"]));
  byId("digits").value = byId("digits").dataset.first;
  options(byId("kind"), [["", "all kinds"], ...DATA.kinds.map((name, k) => [k, name])]);
  const tags = [...new Set(DATA.cases.flatMap((own) => own.tags || []))].sort();
  options(byId("tag"), [["", tags.length ? "all tags" : "no tags known"], ...tags]);
  byId("tag").disabled = !tags.length;
  options(byId("run-reading"), READINGS.map((reading) => [reading.index, reading.label]));
  byId("solvers").replaceChildren(...SOLVERS.map((solver) => {
    const box = make("input", { type: "checkbox", "data-solver": solver.index, onchange: (event) => {
      showSolver(solver.index, event.target.checked);
      filterMatrix(settings());
      saySolvers();
    } });
    box.checked = true;
    return make("label", null, box, solver.name);
  }));
  byId("solvers").append(make("button", { type: "button", onclick: () => allSolvers(true) }, "all"),
    make("button", { type: "button", onclick: () => allSolvers(false) }, "none"));
  saySolvers();
}

function allSolvers(shown) {
  for (const box of document.querySelectorAll("[data-solver]")) {
    box.checked = shown;
    showSolver(Number(box.dataset.solver), shown);
  }
  filterMatrix(settings());
  saySolvers();
}

function saySolvers() {
  byId("solvers-text").textContent = `Solvers shown (${SOLVERS.length - MATRIX.hidden.size} of ${SOLVERS.length})`;
}

/** Show the run that the address names. */
function followAddress() {
  const cell = PLACES.get(decodeURIComponent(location.hash.slice(1)));
  if (cell) showRun(cell);
}

function chooseRun() {
  const reading = READINGS[Number(control("run-reading"))];
  const cell = reading.bySolver.get(Number(control("run-solver"))) || bestCell(reading);
  history.replaceState(null, "", `#${cell.id}`); // otherwise a link to the run still named by the address would do nothing
  showRun(cell, { scroll: false });
}

function start() {
  themeButton(byId("theme"));
  makeControls();
  if (!READINGS.length) return;
  makeMatrix();
  listProjects();
  for (const id of ["digits", "shown"]) byId(id).addEventListener("change", followDigits);
  for (const id of ["kind", "tag", "which"]) byId(id).addEventListener("change", followFilters);
  byId("search").addEventListener("input", () => filterMatrix(settings()));
  byId("run-reading").addEventListener("change", chooseRun);
  byId("run-solver").addEventListener("change", chooseRun);
  byId("run-solvers-all").addEventListener("click", () => { RUN.hidden.clear(); drawWork(); });
  byId("run-solvers-none").addEventListener("click", () => { SOLVERS.forEach((own) => RUN.hidden.add(own.index)); drawWork(); });
  arrowKeys(byId("work"), "[tabindex]");
  followDigits();
  filterMatrix(settings());
  const shown = READINGS.find((reading) => reading.portrait && laddersOf(reading).length > 1) || READINGS[0];
  showRun(bestCell(shown), { scroll: false });
  window.addEventListener("hashchange", followAddress);
  // After loading, the browser scrolls to the cell that the address names; the run must be shown after that.
  if (document.readyState === "complete") setTimeout(followAddress);
  else window.addEventListener("load", () => setTimeout(followAddress));
  onWidth(byId("reaches"), () => drawChoice(settings().digits, settings().kind));
  onWidth(byId("work"), () => { drawPortrait(RUN.cell.reading); drawWork(); });
}

start();
