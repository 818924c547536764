// Which solver to take, for so many digits and a kind of case: a table, and a figure of every solver.

/** What the data says for so many digits. */
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
  drawBars(byId("reaches"), lines, group.all, `In how many of ${group.readings} each solver gets ${level.wanted}, and its time`);
  byId("reaches-note").textContent = `Dark: readings in which the solver gets ${level.wanted}; pale: those in which it is judged; ` +
    `the whole width: all ${group.readings}. Dots: its time over that of the fastest solver, the median over the readings that it gets.`;
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
    const { got, judged } = line;
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
