"""Figures of the price list."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from henon_ref.figures import style
from henon_ref.figures.description import describe
from henon_ref.harness.figures.labels import label_column
from henon_ref.harness.report.text.ranking import by_solver, right
from henon_ref.harness.rows import RunRow, number
from henon_ref.harness.studies.price.growth import LONG, Horizon
from henon_ref.harness.studies.price.measure import fitted
from henon_ref.harness.studies.price.states import MANY, Size

COUNTS = {
    "wall_s": "wall time of one run, median",
    "rhs_evaluations": "right-hand sides (of henon and heyoka: whole Taylor expansions)",
    "steps": "steps",
}
"""What may stand on the axis of cost."""

BOUND = 1e-11
"""Error of a stick [s] that a run of a million seconds must not exceed."""


def draw_ladder(rows: Sequence[RunRow], count: str) -> Figure:
    """Worst error of a transition's time against a cost, one line a solver, for one reading.

    Times have bars, the 95 % intervals of the medians.
    """
    is_time = count == "wall_s"
    with style.figure(4.4) as figure:
        axes = figure.add_axes((0.1, 0.12, 0.645, 0.8))
        axes.set(xscale="log", yscale="log")
        ladders = by_solver(right(rows))
        lines = style.lines_of(ladders)
        tips = {}
        for solver, line in lines.items():
            points = [
                (cost, max(row.max_time_error_s, 1e-16))
                for row in ladders[solver]
                if (cost := getattr(row, count)) and row.max_time_error_s is not None
            ]
            if points:
                _plot(axes, line, points, "", ms=3.5)
                if is_time:
                    _draw_bars(axes, line, ladders[solver])
                tips[solver] = min(error for _, error in points)
        style.decades(axes.xaxis, style.time_text if is_time else style.power_of_ten)
        style.decades(axes.yaxis)
        ordered = sorted(tips, key=lambda solver: -tips[solver])
        label_column(axes, [(solver, lines[solver]) for solver in ordered], x=1.045, gap=0.05)
        if is_time:
            axes.plot([], [], color=style.GREY, lw=0.8, label="95 % interval of the median")
            axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
        axes.set(xlabel=COUNTS[count], ylabel="worst error of a transition time [s]")
        least = "; ".join(f"{solver} {tips[solver]:.1e} s" for solver in ordered)
        describe(
            figure,
            f"Accuracy against {'time' if is_time else count.replace('_', ' ')}",
            f"Across, {COUNTS[count]}; upward, the worst error of a transition time; both axes are logarithmic. "
            f"Least error of each solver: {least}.",
        )
    return figure


def _draw_bars(axes: Axes, line: style.Line, ladder: Sequence[RunRow]) -> None:
    known = [row for row in ladder if row.wall_s_low is not None and row.max_time_error_s is not None]
    if known:
        errors = [max(number(row.max_time_error_s), 1e-16) for row in known]
        low, high = [number(row.wall_s_low) for row in known], [number(row.wall_s_high) for row in known]
        axes.hlines(errors, low, high, color=line.colour, lw=0.8)


def draw_growth(found: Sequence[Horizon]) -> Figure:
    """Time of a transition and error of the last sticks over the horizon, for every solver."""
    solvers = dict.fromkeys(own.solver for own in found)
    powers = {solver: fitted(found, solver, "until", "wall_s", LONG) for solver in solvers}
    with style.figure(3.0) as figure:
        left, right_ = figure.subplots(1, 2, sharex=True)
        for solver, fit in powers.items():
            own = [run for run in found if run.solver == solver]
            settled = [(run.until, max(run.stick_error_s, 1e-16)) for run in own if not math.isnan(run.stick_error_s)]
            points, look = [(run.until, 1e6 * run.per_transition_s) for run in own], style.line_of(solver)
            _plot(left, look, points, f"{solver}: run ~ horizon^({fit})")
            _plot(right_, look, settled, solver)
        right_.axhline(BOUND, color=style.GREY, ls="--", lw=0.9)
        right_.annotate(
            f"bound: {BOUND:.0e} s", (max(run.until for run in found), BOUND), (0, -11),
            textcoords="offset points", fontsize=8.0, color=style.GREY, ha="right",
        )  # fmt: skip
        left.set(xlabel="horizon [s]", ylabel="wall time a transition [µs]")
        right_.set(xlabel="horizon [s]", ylabel="worst error of the last sticks [s]")
        _finish(
            figure,
            "Time of a transition, and error of the last sticks, over the horizon",
            "Two panels with logarithmic axes. Time of a run grows with a power of the horizon: "
            + "; ".join(f"{solver} {fit}" for solver, fit in powers.items())
            + f". In the second panel a dashed line is the bound of {BOUND:.0e} s on the error of the last sticks.",
            (left,),
        )
    return figure


def draw_sizes(found: Sequence[Size]) -> Figure:
    """Time of a simulated second and of getting ready over the number of states, for every solver."""
    columns = {
        "per_second": (1e3, "wall time of a simulated second [ms]"),
        "ready_s": (1.0, "wall time of making ready [s]"),
    }
    powers = {
        solver: [str(fitted(found, solver, "states", column, MANY)) for column in columns]
        for solver in dict.fromkeys(own.solver for own in found)
    }
    ticks = sorted({size.states for size in found})
    with style.figure(3.2) as figure:
        panels = figure.subplots(1, 2)
        for k, (column, (unit, words)) in enumerate(columns.items()):
            for solver, fits in powers.items():
                own = [size for size in found if size.solver == solver and size.agrees]
                points = [(size.states, unit * getattr(size, column)) for size in own]
                _plot(panels[k], style.line_of(solver), points, f"{solver}: ~ states^({fits[k]})")
            panels[k].set_xticks(ticks, [str(tick) for tick in ticks], minor=False)
            panels[k].set_xticks([], minor=True)
            panels[k].set(xlabel="states", ylabel=words)
        _finish(
            figure,
            "Time of a simulated second, and of making ready, over the number of states",
            "Two panels with logarithmic axes, a line a solver. Times grow with a power of the number of states: "
            + "; ".join(f"{solver} {', '.join(fits)}" for solver, fits in powers.items())
            + ".",
            panels,
        )
    return figure


def _finish(figure: Figure, title: str, words: str, with_legend: Iterable[Axes]) -> None:
    for axes in with_legend:
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
    figure.set_layout_engine("constrained")
    describe(figure, title, words)


def _plot(axes: Axes, look: style.Line, points: Sequence[tuple[float, float]], label: str, **more: float) -> None:
    axes.loglog(
        [x for x, _ in points], [y for _, y in points], ls=look.dashes, marker=look.marker, color=look.colour,
        lw=look.width, label=label, **more,
    )  # fmt: skip
