"""Figure: digits that every solver reaches on every reading of a case."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from henon_ref.figures import style
from henon_ref.figures.description import describe
from henon_ref.harness.report.text.matrix import solvers_of
from henon_ref.harness.report.text.matrix_rows import UNJUDGED
from henon_ref.harness.report.text.ranking import LEVELS, best_of, by_solver
from henon_ref.harness.rows import NOT_RUN, RunRow, number
from henon_ref.text import one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

TITLE = "Digits of the worst transition time, each solver at its most accurate setting"
MOST_DIGITS = 16.0
DARK = 9.0
"""Digits from which on a cell is so dark that its text is white."""
WRONG, TIMEOUT, OPEN, UNKNOWN = style.ORANGE, "#C9B8E8", "#BDBDBD", "#E8E8E8"
NOTHING, CORNER, BLANK = "#E3ECF5", style.VERMILLION, "#FFFFFF"
LABELS = {
    NOTHING: "right, nothing to time",
    CORNER: "(corner) not right at another setting",
    WRONG: "right at no setting",
    TIMEOUT: "out of time",
    OPEN: "ill-conditioned or not unique",
    UNKNOWN: "not judged",
    BLANK: "cannot do it, or not run",
}
"""Colours, and what they mean; where no setting is right, what became of the last one decides."""
LEFT, ACROSS, WIDEST = 1.05, 6.08, 0.5
"""Room for the solvers' names and for all readings, and the most that one reading takes of it [in]."""
ROW, LETTER, HALF, LEGEND, IN_ROW = 0.19, 0.062, 0.09, 0.16, 4
"""Height of a row, length of a letter, side of a corner, height of a row of the legend [in]; labels in such a row."""
MOST_NAMES, MOST_TEXTS = 50, 44
"""Readings up to which each one is named, and each cell says its digits."""


def draw_readings(readings: Sequence[tuple[str, Sequence[RunRow]]]) -> Figure:
    """A cell a solver and reading; some solver ran.

    Parameters
    ----------
    readings : sequence of (name, rows)
        In the order of the columns.
    """
    cells = {(reading, solver): own for reading, rows in readings for solver, own in by_solver(rows).items()}
    cells = {key: own for key, own in cells.items() if own[-1].status not in NOT_RUN}
    solvers = [s for s in solvers_of(row for _, rows in readings for row in rows) if any(key[1] == s for key in cells)]
    names = [reading for reading, _ in readings]
    wide = min(ACROSS / len(names), WIDEST)
    texts = len(names) <= MOST_TEXTS
    blank = {BLANK} if len(cells) < len(solvers) * len(names) else set()
    patches = _patches(blank.union(*map(_named, cells.values())), shades=not texts)
    below = 0.18 + LEGEND * math.ceil(len(patches) / IN_ROW) + LETTER * max(map(len, names))
    height = 0.3 + ROW * len(solvers) + below
    with style.figure(height) as figure:
        box = (LEFT / style.WIDTH, below / height, wide * len(names) / style.WIDTH, ROW * len(solvers) / height)
        axes = figure.add_axes(box)
        for j, solver in enumerate(reversed(solvers)):
            for i, name in enumerate(names):
                if (name, solver) in cells:
                    _draw(axes, i, j, cells[name, solver], wide, texts=texts)
        _label(axes, names, solvers)
        figure.legend(
            handles=patches, loc="lower left", bbox_to_anchor=(0.0, 0.0), ncols=IN_ROW,
            fontsize=7.0, handlelength=1.1, columnspacing=1.0, borderpad=0.2,
        )  # fmt: skip
        describe(figure, TITLE, _description(cells, solvers, names))
        return figure


def _description(
    cells: Mapping[tuple[str, str], Sequence[RunRow]], solvers: Sequence[str], names: Sequence[str]
) -> str:
    """On how many readings each solver is right at some setting."""
    counts = []
    for solver in solvers:
        own = [rows for key, rows in cells.items() if key[1] == solver]
        some = sum(any(row.verdict == "right" for row in rows) for rows in own)
        counts.append(f"{solver} {some} of {len(own)}")
    return (
        f"A row a solver, a column for each of {len(names)} readings; cells say how many digits are right. "
        f"Readings in which some setting is right: {'; '.join(counts)}."
    )


def _draw(axes: Axes, i: int, j: int, rows: Sequence[RunRow], wide: float, *, texts: bool) -> None:
    """One cell."""
    from matplotlib.patches import Polygon, Rectangle

    reached, colour = number(best_of(rows).digits), _colour(rows)
    face = colour or _shade(reached)
    axes.add_patch(Rectangle((i, j), 1, 1, facecolor=face, edgecolor="white", linewidth=0.5))
    if colour is None and texts:
        ink = "white" if reached >= DARK else style.BLACK
        axes.text(i + 0.5, j + 0.46, f"{math.floor(reached)}", ha="center", va="center", fontsize=6.5, color=ink)
    if CORNER in _named(rows):
        corner = [(i + 1 - HALF / wide, j + 1), (i + 1, j + 1), (i + 1, j + 1 - HALF / ROW)]
        axes.add_patch(Polygon(corner, facecolor=CORNER, linewidth=0))


def _named(rows: Sequence[RunRow]) -> set[str]:
    """The colours of a cell that the legend names."""
    right = [row.verdict == "right" for row in rows]
    corner = {CORNER} if any(right) and not all(right) else set()
    return corner | {colour for colour in (_colour(rows),) if colour is not None}


def _colour(rows: Sequence[RunRow]) -> str | None:
    """Colour of a cell without digits; None: the shade of its digits."""
    if any(row.verdict == "right" for row in rows):
        return NOTHING if math.isnan(number(best_of(rows).digits)) else None
    row = rows[-1]
    if row.status == "timeout":
        return TIMEOUT
    if row.verdict in ("ill-conditioned", "not unique"):
        return OPEN
    return UNKNOWN if row.verdict in UNJUDGED else WRONG


def _shade(reached: float) -> str:
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return to_hex(colormaps["Blues"](0.08 + 0.9 * min(max(reached, 0.0), MOST_DIGITS) / MOST_DIGITS))


def _label(axes: Axes, names: Sequence[str], solvers: Sequence[str]) -> None:
    axes.set_xlim(0, len(names))
    axes.set_ylim(0, len(solvers))
    axes.grid(visible=False)
    every = math.ceil(len(names) / MOST_NAMES)
    axes.set_xticks([i + 0.5 for i in range(0, len(names), every)], names[::every], rotation=90, fontsize=7.5)
    axes.set_yticks(
        [j + 0.5 for j in range(len(solvers))], [one_line(solver) for solver in reversed(solvers)], parse_math=False
    )
    axes.tick_params(length=0, pad=2.5)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.set_title(TITLE)


def _patches(used: set[str], *, shades: bool) -> list[Patch]:
    """Legend of the colours; where cells do not say their digits, of the shades, too."""
    from matplotlib.patches import Patch

    found = [Patch(facecolor=_shade(level), linewidth=0, label=f"{level} digits") for level in LEVELS if shades]
    return found + [
        Patch(facecolor=colour, edgecolor=style.GREY, linewidth=0.4 if colour == BLANK else 0, label=label)
        for colour, label in LABELS.items()
        if colour in used
    ]
