"""Figures of the price list."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from henon_ref.columns import Row
from henon_ref.price.growth import Horizon
from henon_ref.price.states import Size, exponent
from henon_ref.registry import COMPILED
from henon_ref.report import style
from henon_ref.report.ranking import by_solver, number, right

COUNTS = {
    "wall_s": "wall time of one run, median [s]",
    "rhs_evaluations": "right-hand sides",
    "steps": "steps",
}
"""What may stand on the axis of cost."""

BOUND = 1e-11
"""Error of a stick [s] that a run of a million seconds must not exceed."""


def draw_ladder(rows: Sequence[Row], count: str) -> Figure:
    """Worst error of a transition's time against a cost, one line a solver, for one reading."""
    with style.figure(4.4) as figure:
        axes = figure.add_axes((0.1, 0.12, 0.68, 0.8))
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
                if not solver.endswith(COMPILED):
                    tips.append((solver, x, y, style.line_of(solver).colour))
        style.decades(axes.xaxis)
        style.decades(axes.yaxis)
        style.label_points(axes, tips, x=1.03, gap=0.05)
        axes.plot([], [], ":", color=style.GREY, marker="o", mfc="white", ms=3.5, label="compiled callbacks (+numba)")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
        axes.set(xlabel=COUNTS[count], ylabel="worst error of a transition time [s]")
    return figure


def _draw_line(axes: Axes, solver: str, points: Sequence[tuple[float, float]]) -> None:
    look = style.line_of(solver.removesuffix(COMPILED))
    fair = solver.endswith(COMPILED)
    x, y = np.array(points).T
    axes.plot(
        x, y, ":" if fair else look.dashes, marker=look.marker, color=look.colour, lw=look.width, ms=3.5,
        mfc="white" if fair else look.colour,
    )  # fmt: skip


def draw_growth(found: Sequence[Horizon]) -> Figure:
    """Time of a transition and error of the last sticks over the horizon."""
    with style.figure(2.6) as figure:
        left, right_ = figure.subplots(1, 2)
        until = [own.until for own in found]
        times = [1e6 * own.per_transition_s for own in found]
        left.semilogx(until, times, "o-", color=style.VERMILLION)
        left.set(xlabel="horizon [s]", ylabel="wall time a transition [µs]", ylim=(0, 1.1 * max(times)))
        settled = [own for own in found if not math.isnan(own.stick_error_s)]
        errors = [max(own.stick_error_s, 1e-16) for own in settled]
        right_.loglog([own.until for own in settled], errors, "o-", color=style.BLUE)
        right_.axhline(BOUND, color=style.GREY, ls="--", lw=0.9)
        right_.annotate(f"asked for: {BOUND:.0e} s", (settled[0].until, BOUND), (0, -10), textcoords="offset points")
        right_.set(xlabel="horizon [s]", ylabel="worst error of the last sticks [s]", ylim=(1e-14, 1e-10))
        right_.set_xlim(left.get_xlim())
        figure.set_layout_engine("constrained")
    return figure


def draw_sizes(found: Sequence[Size]) -> Figure:
    """Time of a step over the number of states, for every solver."""
    with style.figure(3.0) as figure:
        axes = figure.subplots()
        for solver in dict.fromkeys(own.solver for own in found):
            own = [size for size in found if size.solver == solver]
            look = style.line_of(solver)
            power = exponent(found, solver)
            label = solver if math.isnan(power) else f"{solver}: step ~ states^{power:.2f}"
            axes.loglog(
                [size.states for size in own], [1e6 * size.per_step_s for size in own], look.dashes,
                marker=look.marker, color=look.colour, lw=look.width, label=label,
            )  # fmt: skip
        ticks = sorted({size.states for size in found})
        axes.set_xticks(ticks, [str(tick) for tick in ticks], minor=False)
        axes.set_xticks([], minor=True)
        axes.set(xlabel="states", ylabel="wall time a step [µs]")
        axes.legend(loc="upper left")
        figure.set_layout_engine("constrained")
    return figure
