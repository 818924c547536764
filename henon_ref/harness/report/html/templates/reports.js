// The page of a folder of reports: its controls, and what follows from them.

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

/** The controls whose choices depend on the data. */
function makeControls() {
  options(byId("digits"), DATA.choice.map(({ digits }) => [digits, digits ? count(digits, "digit") : "right at all"]));
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

/** The run that the address names. */
function followAddress() {
  const cell = PLACES.get(decodeURIComponent(location.hash.slice(1)));
  if (cell) showRun(cell);
}

function chooseRun() {
  const reading = READINGS[Number(control("run-reading"))];
  const cell = reading.bySolver.get(Number(control("run-solver"))) || bestCell(reading);
  history.replaceState(null, "", `#${cell.id}`); // else the address names another run, and a link to that one does nothing
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
  // The browser itself goes to the cell that the address names, once all is loaded: the run comes after that.
  if (document.readyState === "complete") setTimeout(followAddress);
  else window.addEventListener("load", () => setTimeout(followAddress));
  onWidth(byId("reaches"), () => drawChoice(settings().digits, settings().kind));
  onWidth(byId("work"), () => { drawPortrait(RUN.cell.reading); drawWork(); });
}

start();
