"""Figure of the index: in how many readings of each kind every solver reaches so many digits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING

from henon_ref.figures import style
from henon_ref.harness.report.text.choice import ANY, AS_MANY, by_kind, reading_counts, readings_for
from henon_ref.harness.report.text.matrix import solvers_of
from henon_ref.harness.report.text.matrix_rows import MatrixRow
from henon_ref.harness.report.text.ranking import LEVELS
from henon_ref.text import one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS: tuple[tuple[str, int | None], ...] = (("ok", ANY), *((f"{level}", level) for level in LEVELS))
"""Label of a column of a panel, and its digits."""
CORNER = style.VERMILLION
LEFT, RIGHT, ABOVE, BELOW, BETWEEN, ROW = 1.05, 0.03, 0.78, 0.54, 0.1, 0.19
"""Room for names of solvers, right of the panels, above and below them, between two of them; height of a row [in]."""
TITLE = "Percent of the readings of each kind in which a solver is right to so many digits"
LABEL = (
    "digits of the worst transition time, in the readings that have one (timed); ok: right, in all\n"
    "shares of the readings that the solver is judged in; a corner: in fewer than nine tenths of them"
)
LETTERS = 13
"""Letters of a line of a panel's title."""
DARK = 0.7
"""Share from which on a cell is so dark that its text is white."""


def draw_kinds(rows: Sequence[MatrixRow]) -> Figure:
    """A panel a kind of case, a row a solver, a column a number of digits: the share of readings, in percent.

    Parameters
    ----------
    rows : sequence of MatrixRow
        Of a matrix; some solver was judged.
    """
    kinds = by_kind(rows)
    solvers = solvers_of(row for row in rows if row.judged)
    height = ABOVE + ROW * len(solvers) + BELOW
    wide = (style.WIDTH - LEFT - RIGHT - BETWEEN * (len(kinds) - 1)) / len(kinds)
    with style.figure(height) as figure:
        for k, (kind, own) in enumerate(kinds.items()):
            left = LEFT + k * (wide + BETWEEN)
            axes = figure.add_axes(
                (left / style.WIDTH, BELOW / height, wide / style.WIDTH, ROW * len(solvers) / height)
            )
            _draw_panel(axes, kind, own, solvers)
            axes.set_yticks([])
            if k == 0:
                names = [one_line(solver) for solver in reversed(solvers)]
                axes.set_yticks([j + 0.5 for j in range(len(solvers))], names, parse_math=False)
        figure.suptitle(TITLE, x=0.01, y=1 - 0.1 / height, ha="left", va="top", fontsize=9.5)
        figure.text(
            LEFT / style.WIDTH, 0.04 / height, LABEL,
            fontsize=8.0, va="bottom", linespacing=1.15,
        )  # fmt: skip
        return figure


def _draw_panel(axes: Axes, kind: str, rows: Sequence[MatrixRow], solvers: Sequence[str]) -> None:
    from matplotlib.patches import Polygon, Rectangle

    drawn = [(label, level) for label, level in COLUMNS if readings_for(rows, level)]
    for j, solver in enumerate(reversed(solvers)):
        own = {row.problem: row for row in rows if row.solver == solver and row.judged}
        for i, (_, level) in enumerate(drawn):
            readings = readings_for(rows, level)
            share = _share(own, level, readings)
            if share is not None:
                colour, ink = _shade(share), "white" if share >= DARK else style.BLACK
                percent = f"{math.floor(100 * share + 1e-9)}"
                axes.add_patch(Rectangle((i, j), 1, 1, facecolor=colour, edgecolor="white", linewidth=0.5))
                axes.text(i + 0.5, j + 0.46, percent, ha="center", va="center", fontsize=5.5, color=ink)
                if len(readings & set(own)) < AS_MANY * len(readings):
                    axes.add_patch(Polygon([(i + 0.7, j + 1), (i + 1, j + 1), (i + 1, j + 0.7)], facecolor=CORNER))
    axes.set_xlim(0, len(COLUMNS))
    axes.set_ylim(0, len(solvers))
    axes.grid(visible=False)
    axes.set_xticks([i + 0.5 for i in range(len(drawn))], [label for label, _ in drawn], fontsize=7.0)
    axes.tick_params(length=0, pad=2.0)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.set_title(f"{fill(kind, LETTERS)}\n({reading_counts(rows)})", fontsize=7.5, linespacing=1.05)


def _share(own: Mapping[tuple[str, str], MatrixRow], level: int | None, readings: set[tuple[str, str]]) -> float | None:
    """Part of the readings that the solver was judged in; None where it was in none of them."""
    judged = readings & set(own)
    right = sum(bool(own[key].right if level is None else own[key].wall(level)) for key in judged)
    return right / len(judged) if judged else None


def _shade(share: float) -> str:
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return to_hex(colormaps["Blues"](0.04 + 0.86 * share))
