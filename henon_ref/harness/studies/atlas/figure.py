"""Figure: tolerance against distance, a panel a solver, coloured by the run's outcome."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from henon_ref.figures import style
from henon_ref.figures.description import describe
from henon_ref.harness.rows import RunRow, number
from henon_ref.harness.studies.atlas.family import OUTCOMES, Family, Outcome, outcome_of
from henon_ref.text import one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = 3
"""Panels in a row."""
PANEL = 1.25
"""Height of a panel with its title and ticks [in]."""
COLOURS: dict[Outcome, str] = {
    "right": "#CFE3F3",
    "missed": style.ORANGE,
    "spurious": style.VERMILLION,
    "both": style.PURPLE,
    "status": style.GREEN,
    "failed": style.BLACK,
}
"""Right is pale and everything else darker than it, so that the panels can be read without colour, too."""
MOST_TICKS = 5
"""Labelled distances below a panel."""


def draw_atlas(family: Family, rows: Sequence[RunRow], solvers: Sequence[str]) -> Figure:
    """Panels of all solvers that were run, in their order; a run a reading, solver and tolerance."""
    tolerances = sorted({number(row.rtol) for row in rows}, reverse=True)
    cells = {(row.solver, row.reading, number(row.rtol)): outcome_of(row) for row in rows}
    lines = math.ceil(len(solvers) / COLUMNS)
    height = lines * PANEL + 1.15
    with style.figure(height) as figure:
        grid = figure.subplots(lines, COLUMNS, squeeze=False, sharex=True, sharey=True)
        figure.subplots_adjust(
            left=0.085, right=0.99, top=1 - 0.45 / height, bottom=0.78 / height, wspace=0.08, hspace=0.32
        )
        for k, axes in enumerate(grid.flat):
            if k < len(solvers):
                _draw_panel(axes, family, solvers[k], tolerances, cells)
            else:
                axes.set_axis_off()
        _label(figure, grid, family, tolerances, len(solvers))
        _legend(figure, {outcome for outcome in cells.values() if outcome is not None}, height)
        figure.suptitle(
            one_line(family.case.title), parse_math=False, x=0.085, ha="left", y=1 - 0.12 / height, fontsize=10
        )
        describe(figure, family.case.title, _description(family, cells, solvers))
        return figure


def _description(family: Family, cells: Mapping[tuple[str, str, float], Outcome | None], solvers: Sequence[str]) -> str:
    """What the panels show, and how many runs of each solver are right."""
    counts = []
    for solver in solvers:
        own = [outcome for key, outcome in cells.items() if key[0] == solver and outcome is not None]
        counts.append(f"{solver} {own.count('right')} of {len(own)}")
    return (
        f"A panel a solver. Across, {family.meaning}; upward, the relative tolerance; a cell's colour says how the run "
        f"ended. Right runs: {'; '.join(counts)}."
    )


def _draw_panel(
    axes: Axes,
    family: Family,
    solver: str,
    tolerances: Sequence[float],
    cells: dict[tuple[str, str, float], Outcome | None],
) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    order = family.order
    runs: dict[Outcome, list[tuple[int, int, int]]] = {}
    for j, tolerance in enumerate(tolerances):
        outcomes = [cells.get((solver, reading, tolerance)) for reading in order]
        for outcome, begin, end in _stretches(outcomes):
            runs.setdefault(outcome, []).append((begin, end, j))
    for outcome, boxes in runs.items():
        # Stretches of a row as one path: a figure of single cells is ten times as long.
        shape = [[(a, j), (b, j), (b, j + 1), (a, j + 1), (a, j)] for a, b, j in boxes]
        path = Path.make_compound_path(*(Path(corners, closed=True) for corners in shape))
        axes.add_patch(PathPatch(path, facecolor=COLOURS[outcome], linewidth=0))
    lines = [((i, 0), (i, len(tolerances))) for i in range(1, len(order))]
    lines += [((0, j), (len(order), j)) for j in range(1, len(tolerances))]
    grid = Path.make_compound_path(*map(Path, lines))
    axes.add_patch(PathPatch(grid, fill=False, edgecolor="white", linewidth=0.4))
    axes.set_xlim(0, len(order))
    axes.set_ylim(0, len(tolerances))
    axes.grid(visible=False)
    axes.set_title(one_line(solver), parse_math=False, fontsize=8, pad=2.5)
    axes.tick_params(length=2, pad=1.5, labelsize=7)
    for side in ("top", "right", "left", "bottom"):
        axes.spines[side].set_visible(False)
    if min(family.distances.values()) < 0:
        exact = next((i for i, reading in enumerate(order) if family.distances[reading] >= 0), 0)
        axes.plot([exact, exact], [0, len(tolerances)], color=style.GREY, lw=0.5)
    _draw_limit(axes, family, tolerances)


def _stretches(outcomes: Sequence[Outcome | None]) -> list[tuple[Outcome, int, int]]:
    """Neighbours of the same outcome: it, the first of them, and the one behind the last."""
    found: list[tuple[Outcome, int, int]] = []
    begin = 0
    for outcome, own in itertools.groupby(outcomes):
        end = begin + len(list(own))
        if outcome is not None:
            found.append((outcome, begin, end))
        begin = end
    return found


def _draw_limit(axes: Axes, family: Family, tolerances: Sequence[float]) -> None:
    """The staircase within which the tolerance is larger than the distance."""
    order = family.order
    low, high = 0, 0
    left: list[tuple[float, float]] = []
    right: list[tuple[float, float]] = []
    for j, tolerance in enumerate(tolerances):
        within = [i for i, reading in enumerate(order) if abs(family.distances[reading]) <= tolerance * (1 + 1e-9)]
        if within:
            low, high = min(within), max(within) + 1
        left += [(low, j), (low, j + 1)]
        right += [(high, j), (high, j + 1)]
    for side in (left, right):
        xs, ys = zip(*side, strict=True)
        if max(xs) > 0 and min(xs) < len(order):
            axes.plot(xs, ys, color=style.BLACK, lw=0.8, solid_joinstyle="miter")


def _label(figure: Figure, grid: object, family: Family, tolerances: Sequence[float], count: int) -> None:
    order = family.order
    ticks = _ticks([family.distances[reading] for reading in order])
    axes = grid[0, 0]  # type: ignore[index]
    axes.set_xticks([i + 0.5 for i in ticks], [_distance(family.distances[order[i]]) for i in ticks])
    shown = list(range(0, len(tolerances), 5)) if len(tolerances) > 6 else list(range(len(tolerances)))
    axes.set_yticks([j + 0.5 for j in shown], [style.power_of_ten(tolerances[j]) for j in shown])
    for k, panel in enumerate(grid.flat):  # type: ignore[attr-defined]
        if k + COLUMNS >= count:
            panel.tick_params(labelbottom=True)
            panel.get_xticklabels()[-1].set_horizontalalignment("right")  # the next panel's label starts there
    where = "   (left of the grey line the surface is not reached)" if min(family.distances.values()) < 0 else ""
    figure.supxlabel(family.meaning + where, fontsize=8.5, y=0.4 / figure.get_figheight())
    figure.supylabel("relative tolerance", fontsize=8.5, x=0.005)


def _ticks(distances: Sequence[float]) -> list[int]:
    """Positions that are labelled: both ends, the graze itself, and one between."""
    last = len(distances) - 1
    if min(distances) < 0:
        middle = next(i for i, distance in enumerate(distances) if distance >= 0)
        return sorted({0, middle // 2, middle, (middle + last + 1) // 2, last})
    return sorted({round(last * k / (MOST_TICKS - 2)) for k in range(MOST_TICKS - 1)})


def _distance(value: float) -> str:
    if value == 0:
        return "0"
    return ("−" if value < 0 else "") + style.power_of_ten(abs(value))


def _legend(figure: Figure, present: set[Outcome], height: float) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Patch | Line2D] = [
        Patch(facecolor=COLOURS[outcome], edgecolor=style.GREY, linewidth=0.4, label=words)
        for outcome, words in OUTCOMES.items()
        if outcome in present
    ]
    handles.append(Line2D([], [], color=style.BLACK, lw=0.8, label="tolerance = distance"))
    figure.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0.06, 0.0), ncols=4, handlelength=1.2, columnspacing=1.2
    )
