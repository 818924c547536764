"""Figures of the price list."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from henon_ref.price.growth import Horizon
from henon_ref.price.ladder import FAIR
from henon_ref.report import style
from henon_ref.report.ranking import by_solver, number, right
from henon_ref.score.columns import Row

COUNTS = {
    "wall_s": "wall time of one run, median [s]",
    "rhs_evaluations": "right-hand sides",
    "steps": "steps",
}
"""What may stand on the axis of cost."""


def draw_ladder(rows: Sequence[Row], count: str) -> Figure:
    """Worst error of a transition's time against a cost, one line a solver, for one reading."""
    with style.figure(4.4) as figure:
        axes = figure.add_axes((0.1, 0.12, 0.68, 0.82))
        axes.set_xscale("log")
        axes.set_yscale("log")
        tips = []
        for solver, ladder in by_solver(right(rows)).items():
            points = [
                (number(row, count), max(number(row, "max_time_error_s"), 1e-16))
                for row in ladder
                if row[count] and row["max_time_error_s"] is not None
            ]
            if points:
                _draw_line(axes, solver, points)
                x, y = min(points, key=lambda point: point[1])
                tips.append((solver, x, y, style.line_of(solver.removesuffix(FAIR)).colour))
        style.decades(axes.xaxis)
        style.decades(axes.yaxis)
        style.label_points(axes, tips, x=1.03, gap=0.04)
        axes.set(xlabel=COUNTS[count], ylabel="worst error of a transition time [s]")
    return figure


def _draw_line(axes: Axes, solver: str, points: Sequence[tuple[float, float]]) -> None:
    look = style.line_of(solver.removesuffix(FAIR))
    fair = solver.endswith(FAIR)
    x, y = np.array(points).T
    axes.plot(
        x, y, ":" if fair else look.dashes, marker=look.marker, color=look.colour, lw=look.width, ms=3.5,
        mfc="white" if fair else look.colour,
    )  # fmt: skip


def draw_growth(found: Sequence[Horizon]) -> Figure:
    """Time of a transition and error of the last sticks over the horizon."""
    until = [own.until for own in found]
    with style.figure(2.6) as figure:
        left, right_ = figure.subplots(1, 2)
        left.semilogx(until, [1e6 * own.per_transition_s for own in found], "o-", color=style.VERMILLION)
        left.set(xlabel="horizon [s]", ylabel="wall time a transition [µs]", ylim=(0, None))
        right_.loglog(until, [max(own.stick_error_s, 1e-16) for own in found], "o-", color=style.BLUE)
        right_.set(xlabel="horizon [s]", ylabel="worst error of the last sticks [s]")
        figure.set_layout_engine("constrained")
    return figure
