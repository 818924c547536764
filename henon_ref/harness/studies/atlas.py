"""Atlas of grazes and pairs of roots: each family of cases by all solvers with a tolerance, and a figure per family.

The runs are not timed.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import sympy as sp

from henon_ref.casefile.case import Case, Reading
from henon_ref.figures import style
from henon_ref.figures.style import describe
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import fixed_step
from henon_ref.harness.report.folder import RUNS
from henon_ref.harness.result_files import rows_text
from henon_ref.harness.rows import NOT_RUN, RunRow, number
from henon_ref.harness.studies.page import rows_of, write
from henon_ref.harness.studies.restarts import ending
from henon_ref.harness.studies.study import StudyRequest, StudyResult
from henon_ref.harness.table import Table, exponential
from henon_ref.text import code, markdown, one_line, paragraphs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TOLERANCES = tuple(10.0**-k for k in range(3, 14))
"""Relative tolerances of the atlas."""
KINDS = {
    "two-roots": "distance of the two roots [s]",
    "grazing": "distance from the graze, in units of the surface",
}
"""Tags of the families in the atlas, with the meaning of their parameter; the first matching tag counts."""
Outcome = Literal["right", "missed", "spurious", "both", "status", "failed"]
OUTCOMES: dict[Outcome, tuple[str, str]] = {
    "right": ("right", "#CFE3F3"),
    "missed": ("missed", style.ORANGE),
    "spurious": ("spurious", style.VERMILLION),
    "both": ("missed and spurious", style.PURPLE),
    "status": ("other end than the exact run", style.GREEN),
    "failed": ("failed or out of time", style.BLACK),
}
"""Label and colour of each outcome of a run; right is pale, so that the panels can be read without colour."""
COLUMNS = 3
"""Panels per row."""


@dataclass(frozen=True)
class Family:
    """A case whose readings differ in one parameter, the distance."""

    case: Case
    """The case with only the family's readings."""
    meaning: str
    """Meaning and unit of the distance."""
    distances: dict[str, float]
    """Distance of each reading, in increasing order; negative if the surface is not reached."""


def family_of(case: Case) -> Family | None:
    """Return the family of a case; None if it is no family, or its readings differ in more than one parameter.

    Readings whose equations differ from those of the first reading are left out.
    """
    first = case.readings[0]
    meaning = next((words for tag, words in KINDS.items() if tag in first.tags), None)
    if "family" not in first.tags or meaning is None:
        return None
    alike = [reading for reading in case.readings if _equations(reading) == _equations(first)]
    values = {reading.name: reading.problem.system.parameters for reading in alike}
    differing = [symbol for symbol in values[first.name] if len({own.get(symbol) for own in values.values()}) > 1]
    if len(differing) != 1:
        return None
    distances = {name: float(own[differing[0]]) for name, own in values.items()}
    ordered = dict(sorted(distances.items(), key=lambda item: item[1]))
    return Family(replace(case, readings=tuple(alike)), meaning, ordered)


def _equations(reading: Reading) -> tuple[tuple[sp.Expr, ...], ...]:
    return reading.problem.system.surfaces, reading.problem.system.field


def outcome_of(row: RunRow) -> Outcome | None:
    """Outcome of a run; None if it was not made."""
    if row.status in NOT_RUN:
        return None
    end = ending(row)
    if end == "right" or end == "failed":
        return end
    if row.missed and row.spurious:
        return "both"
    return "missed" if row.missed else "spurious" if row.spurious else "status"


def run_atlas(request: StudyRequest) -> StudyResult:
    """Run the families at the atlas's tolerances and write its page; no page without a family or a solver for it."""
    found = [family for case in request.cases if (family := family_of(case)) is not None]
    names = registry.expanded(request.options.solvers or registry.default_names())
    # A solver with a fixed step has no tolerance.
    solvers = tuple(s for s in names if not (fixed_step(s) if isinstance(s, str) else s.fixed_step))
    if not found or not solvers:
        return StudyResult(None)
    changed = replace(request.options, solvers=solvers, tolerances=TOLERANCES, timed=False, folder=request.folder)
    rows = rows_of([family.case for family in found], changed, request.observer)
    sections, figures = [], {}
    for family in found:
        case = family.case
        own = [row for row in rows if row.case == case.name]
        figures[f"{case.name}.svg"] = draw_atlas(family, own)
        sections.append(
            {
                "title": markdown(case.title),
                "case": case.name,
                "story": paragraphs(case.readings[0].story or ""),
                "counts": count_table(own).markdown,
            }
        )
    context = {
        "sections": sections,
        "runs": len(rows),
        "tightest": exponential(min(TOLERANCES), 1),
        "loosest": exponential(max(TOLERANCES), 1),
        "origin": request.origin,
    }
    return StudyResult(write(request.folder, "atlas", context, {RUNS: rows_text(RunRow, rows)}, figures))


def solvers_of(rows: Sequence[RunRow]) -> list[str]:
    """Solvers that ran, in the registry's order."""
    return registry.in_order(row.solver for row in rows if outcome_of(row) is not None)


def count_table(rows: Sequence[RunRow]) -> Table:
    """Table of the number of runs of each solver by outcome and by the cause of errors."""
    blame = ("ill-conditioned", "solver defect")
    lines = []
    for solver in solvers_of(rows):
        own = [row for row in rows if row.solver == solver and outcome_of(row) is not None]
        tally: Counter[str | None] = Counter(outcome_of(row) for row in own)
        tally.update(row.verdict for row in own if row.verdict in blame)
        lines.append((code(solver), f"{len(own)}", *(f"{tally[word] or ''}" for word in (*OUTCOMES, *blame))))
    headings = ("solver", "runs", *(label for label, _ in OUTCOMES.values()), *blame)
    return Table(headings, "lr", lines)


def draw_atlas(family: Family, rows: Sequence[RunRow]) -> Figure:
    """Draw tolerance against distance in one panel per solver; each cell is a run."""
    solvers = solvers_of(rows)
    tolerances = sorted({number(row.rtol) for row in rows}, reverse=True)
    cells = {(row.solver, row.reading, number(row.rtol)): outcome_of(row) for row in rows}
    lines = math.ceil(len(solvers) / COLUMNS)
    height = lines * 1.25 + 1.15  # panels with title and ticks, legend [in]
    with style.figure(height) as figure:
        grid = figure.subplots(lines, COLUMNS, squeeze=False, sharex=True, sharey=True)
        figure.subplots_adjust(
            left=0.085, right=0.99, top=1 - 0.45 / height, bottom=0.78 / height, wspace=0.08, hspace=0.32
        )
        for axes, solver in itertools.zip_longest(grid.flat, solvers):
            if solver is None:
                axes.set_axis_off()
            else:
                outcomes = [[cells.get((solver, reading, t)) for reading in family.distances] for t in tolerances]
                _draw_panel(axes, solver, outcomes)
                _draw_limits(axes, [abs(distance) for distance in family.distances.values()], tolerances)
                if min(family.distances.values()) < 0:
                    exact = next((i for i, distance in enumerate(family.distances.values()) if distance >= 0), 0)
                    axes.plot([exact, exact], [0, len(tolerances)], color=style.GREY, lw=0.5)
        _label(figure, family, tolerances, len(solvers))
        _legend(figure, set(cells.values()))
        figure.suptitle(
            one_line(family.case.title), parse_math=False, x=0.085, ha="left", y=1 - 0.12 / height, fontsize=10
        )
        describe(figure, family.case.title, _description(family, cells, solvers))
        return figure


def _description(family: Family, cells: Mapping[tuple[str, str, float], Outcome | None], solvers: Sequence[str]) -> str:
    """Describe the panels in words, with the number of right runs of each solver."""
    counts = []
    for solver in solvers:
        own = [outcome for key, outcome in cells.items() if key[0] == solver and outcome is not None]
        counts.append(f"{solver} {own.count('right')} of {len(own)}")
    return (
        f"One panel per solver. Horizontal axis: {family.meaning}; vertical axis: relative tolerance; colours: "
        f"outcomes of the runs. Right runs: {'; '.join(counts)}."
    )


def _draw_panel(axes: Axes, solver: str, outcomes: Sequence[Sequence[Outcome | None]]) -> None:
    """Draw one solver's outcomes, one row per tolerance."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    # Adjacent cells of an outcome are one box, and all its boxes one path; single cells would make a file ten times as
    # long.
    rows_of_box: dict[tuple[Outcome, int, int], list[int]] = {}
    for j, line in enumerate(outcomes):
        begin = 0
        for outcome, own in itertools.groupby(line):
            end = begin + len(list(own))
            if outcome is not None:
                rows_of_box.setdefault((outcome, begin, end), []).append(j)
            begin = end
    boxes: dict[Outcome, list[Path]] = {}
    for (outcome, begin, end), rows in rows_of_box.items():
        for _, together in itertools.groupby(enumerate(rows), lambda numbered: numbered[1] - numbered[0]):
            low, *_, high = [row for _, row in together] * 2
            corners = [(begin, low), (end, low), (end, high + 1), (begin, high + 1), (begin, low)]
            boxes.setdefault(outcome, []).append(Path(corners, closed=True))
    for outcome, paths in boxes.items():
        axes.add_patch(PathPatch(Path.make_compound_path(*paths), facecolor=OUTCOMES[outcome][1], linewidth=0))
    width, height = len(outcomes[0]), len(outcomes)
    # All lines of one direction are one, which turns outside of the panel.
    across = [(i, k) for i in range(1, width) for k in (-1, height + 1)[:: 1 if i % 2 else -1]]
    upward = [(k, j) for j in range(1, height) for k in (-1, width + 1)[:: 1 if j % 2 else -1]]
    grid = Path.make_compound_path(Path(across), Path(upward))
    axes.add_patch(PathPatch(grid, fill=False, edgecolor="white", linewidth=0.4))
    axes.set_xlim(0, width)
    axes.set_ylim(0, height)
    axes.grid(visible=False)
    axes.set_title(one_line(solver), parse_math=False, fontsize=8, pad=2.5)
    axes.tick_params(length=2, pad=1.5, labelsize=7)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _draw_limits(axes: Axes, distances: Sequence[float], tolerances: Sequence[float]) -> None:
    """Draw the staircase between the cells whose tolerance is larger than the distance and the other cells."""
    ends = [(0, 0)]
    for tolerance in tolerances:
        within = [i for i, distance in enumerate(distances) if distance <= tolerance * (1 + 1e-9)]
        ends.append((within[0], within[-1] + 1) if within else ends[-1])
    heights = [j + k for j in range(len(tolerances)) for k in (0, 1)]
    for side in zip(*ends[1:], strict=True):
        if max(side) > 0 and min(side) < len(distances):
            places = [place for place in side for _ in (0, 1)]
            axes.plot(places, heights, color=style.BLACK, lw=0.8, solid_joinstyle="miter")


def _label(figure: Figure, family: Family, tolerances: Sequence[float], count: int) -> None:
    """Label the axes, and the ticks of the lowest panel of each column."""
    distances, shared = list(family.distances.values()), figure.axes[0]
    ticks = _ticks(distances)
    shared.set_xticks([i + 0.5 for i in ticks], [_distance(distances[i]) for i in ticks])
    shown = range(0, len(tolerances), 5 if len(tolerances) > 6 else 1)
    shared.set_yticks([j + 0.5 for j in shown], [style.power_of_ten(tolerances[j]) for j in shown])
    for panel in figure.axes[max(count - COLUMNS, 0) :]:
        panel.tick_params(labelbottom=True)
        panel.get_xticklabels()[-1].set_horizontalalignment("right")  # the next panel's label starts there
    where = "   (left of the grey line the surface is not reached)" if min(distances) < 0 else ""
    figure.supxlabel(family.meaning + where, fontsize=8.5, y=0.4 / figure.get_figheight())
    figure.supylabel("relative tolerance", fontsize=8.5, x=0.005)


def _ticks(distances: Sequence[float]) -> list[int]:
    """Positions of the labels: both ends, and with the graze itself three positions between them, else two."""
    last = len(distances) - 1
    if min(distances) < 0:
        middle = next(i for i, distance in enumerate(distances) if distance >= 0)
        return sorted({0, middle // 2, middle, (middle + last + 1) // 2, last})
    return sorted({round(last * k / 3) for k in range(4)})


def _distance(value: float) -> str:
    if value == 0:
        return "0"
    return ("−" if value < 0 else "") + style.power_of_ten(abs(value))


def _legend(figure: Figure, present: set[Outcome | None]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Patch | Line2D] = [
        Patch(facecolor=colour, edgecolor=style.GREY, linewidth=0.4, label=label)
        for outcome, (label, colour) in OUTCOMES.items()
        if outcome in present
    ]
    handles.append(Line2D([], [], color=style.BLACK, lw=0.8, label="tolerance = distance"))
    figure.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0.06, 0.0), ncols=4, handlelength=1.2, columnspacing=1.2
    )
