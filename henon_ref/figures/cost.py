"""Figure: worst error against wall time, one ladder of settings a solver."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from henon_ref.columns import Row
from henon_ref.figures import style
from henon_ref.score.reference import HALF_ULP, Expected

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_cost(rows: Sequence[Row], expected: Expected) -> Figure | None:
    """Work-precision diagram: median wall time of a run over the worst error of a transition."""
    floor = max(expected.radius, HALF_ULP * expected.time_unit)
    ladders: dict[str, list[Row]] = {}
    for row in rows:
        if _number(row["wall_s"]) and row["max_time_error_s"] is not None:
            ladders.setdefault(str(row["solver"]), []).append(row)
    if sum(len(ladder) for ladder in ladders.values()) < 2:  # a single point compares with nothing
        return None
    with style.figure(4.6) as figure:
        axes = figure.add_axes((0.1, 0.11, 0.67, 0.8))
        axes.set_xscale("log")
        axes.set_yscale("log")
        for solver, ladder in ladders.items():
            _draw_ladder(axes, solver, ladder, floor)
        _set_limits(axes, ladders, floor)
        style.decades(axes.xaxis)
        style.decades(axes.yaxis)
        tips = [_tip(solver, ladder, floor) for solver, ladder in ladders.items()]
        style.label_points(axes, tips, x=1.045, gap=0.052)
        axes.set_xlabel("wall time of one run, median [s]   (bars: 95 % interval of the median)")
        axes.set_ylabel("worst error of a transition time [s]")
        axes.set_title("Accuracy against cost   (hollow: transitions missed or spurious)")
        return figure


def _draw_ladder(axes: Axes, solver: str, ladder: Sequence[Row], floor: float) -> None:
    line = style.line_of(solver)
    x = np.array([_value(row["wall_s"]) for row in ladder])
    y = np.array([max(_value(row["max_time_error_s"]), floor) for row in ladder])
    right = np.array([row["verdict"] == "right" for row in ladder])
    axes.plot(x[right], y[right], line.dashes, color=line.colour, lw=line.width, zorder=2)
    axes.hlines(
        y, [_value(r["wall_s_low"]) for r in ladder], [_value(r["wall_s_high"]) for r in ladder], line.colour, lw=0.8
    )
    for chosen, face in ((right, line.colour), (~right, "white")):
        axes.plot(x[chosen], y[chosen], line.marker, mfc=face, mec=line.colour, mew=1.0, zorder=3)


def _set_limits(axes: Axes, ladders: dict[str, list[Row]], floor: float) -> None:
    x = np.array([_value(row["wall_s"]) for ladder in ladders.values() for row in ladder])
    y = np.array([max(_value(row["max_time_error_s"]), floor) for ladder in ladders.values() for row in ladder])
    axes.set_xlim(x.min() / 2.0, x.max() * 2.0)
    axes.set_ylim(10 ** np.floor(np.log10(y.min()) - 0.2), 10 ** np.ceil(np.log10(y.max()) + 0.2))


def _tip(solver: str, ladder: Sequence[Row], floor: float) -> tuple[str, float, float, style.Line]:
    """Label, most accurate point and line style of a ladder."""
    points = [(_value(row["wall_s"]), max(_value(row["max_time_error_s"]), floor)) for row in ladder]
    wall, error = min(points, key=lambda point: point[1])
    return solver, wall, error, style.line_of(solver)


def _number(value: object) -> bool:
    return isinstance(value, float | int) and value > 0


def _value(value: object) -> float:
    return float(value) if isinstance(value, float | int) else float("nan")
