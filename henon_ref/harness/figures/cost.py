"""Figure: work-precision diagram, largest error against wall time, with one curve of settings per solver."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.figures import style
from henon_ref.figures.style import describe
from henon_ref.harness.figures.labels import label_column
from henon_ref.harness.rows import RunRow, number
from henon_ref.harness.score.reference import HALF_ULP, Expected
from henon_ref.text import one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLE = "Accuracy against time"


def draw_cost(rows: Sequence[RunRow], expected: Expected, *, of: str = "") -> Figure | None:
    """Draw the work-precision diagram: largest error of a transition time over median wall time of a run.

    ``of`` is the name of the reading for the title, if the case has several readings. Filled markers are right runs,
    hollow markers all other runs. None if fewer than two runs have an error and a time.
    """
    floor = max(expected.radius, HALF_ULP * expected.time_unit)  # smallest error that can be claimed
    timed = [row for row in rows if row.wall_s and row.max_time_error_s is not None]
    if len(timed) < 2:
        return None
    ladders = {
        solver: [row for row in timed if row.solver == solver] for solver in dict.fromkeys(r.solver for r in timed)
    }
    points = {solver: _points(ladder, floor) for solver, ladder in ladders.items()}
    tips = {solver: own[:, own[1].argmin()] for solver, own in points.items()}  # the most accurate run of each
    lines = style.lines_of(ladders)
    with style.figure(4.6) as figure:
        axes = figure.add_axes((0.1, 0.11, 0.645, 0.78))
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_autoscale_on(False)  # limits are set below, since equal errors have no scale
        for solver, ladder in ladders.items():
            _draw_ladder(axes, lines[solver], ladder, *points[solver])
        _set_limits(axes, *np.hstack(list(points.values())))
        style.decades(axes.xaxis, style.time_text)
        style.decades(axes.yaxis)
        ordered = sorted(tips, key=lambda solver: -tips[solver][1])
        label_column(axes, [(solver, lines[solver]) for solver in ordered], x=1.045, gap=0.052)
        axes.set_xlabel("wall time of one run, median")
        axes.set_ylabel("worst error of a transition time [s]")
        axes.set_title(f"{TITLE}: {one_line(of)}" if of else TITLE, parse_math=False, pad=20)
        _draw_legend(axes, timed)
        describe(figure, TITLE, _description(tips))
        return figure


def _points(rows: Sequence[RunRow], floor: float) -> NDArray[np.float64]:
    """Return wall times [s] and errors [s]; no error is below ``floor``."""
    return np.array([(number(row.wall_s), max(number(row.max_time_error_s), floor)) for row in rows]).T


def _draw_ladder(
    axes: Axes, line: style.Line, ladder: Sequence[RunRow], x: NDArray[np.float64], y: NDArray[np.float64]
) -> None:
    right = np.array([row.verdict == "right" for row in ladder])
    axes.plot(x[right], y[right], ls=line.dashes, color=line.colour, lw=line.width, zorder=2)
    low, high = [number(row.wall_s_low) for row in ladder], [number(row.wall_s_high) for row in ladder]
    axes.hlines(y, low, high, line.colour, lw=0.8)
    for chosen, face in ((right, line.colour), (~right, "white")):
        axes.plot(x[chosen], y[chosen], line.marker, mfc=face, mec=line.colour, mew=1.0, zorder=3)


def _draw_legend(axes: Axes, rows: Sequence[RunRow]) -> None:
    """Draw the legend of the markers and bars that occur."""
    from matplotlib.lines import Line2D

    marker: dict[str, Any] = {"color": style.GREY, "marker": "o", "ls": "none"}
    handles = []
    if any(row.verdict != "right" for row in rows):
        handles.append(Line2D([], [], **marker, label="right"))
        words = "not right (transitions missed or spurious, or cut short)"
        handles.append(Line2D([], [], **marker, mfc="white", label=words))
    if any(number(row.wall_s_high) > number(row.wall_s_low) for row in rows):
        handles.append(Line2D([], [], color=style.GREY, lw=0.8, label="95 % interval of the median"))
    if handles:
        place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (-0.02, 0.995), "borderaxespad": 0.1}
        axes.legend(handles=handles, ncols=3, handletextpad=0.5, columnspacing=1.2, **place)


def _set_limits(axes: Axes, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Set limits with margins, and with at least two decades of time so that two decades are labelled."""
    left, right = x.min() / 2.0, x.max() * 2.0
    if math.floor(math.log10(right)) - math.ceil(math.log10(left)) < 1:
        left, right = 10.0 ** math.floor(math.log10(left)), 10.0 ** math.ceil(math.log10(right))
    axes.set_xlim(left, right)
    axes.set_ylim(10 ** np.floor(np.log10(y.min()) - 0.2), 10 ** np.ceil(np.log10(y.max()) + 0.2))


def _description(tips: Mapping[str, NDArray[np.float64]]) -> str:
    ordered = sorted(tips.items(), key=lambda tip: float(tip[1][0]))
    parts = [f"{solver} {error:.1e} s in {style.time_text(wall)}" for solver, (wall, error) in ordered]
    return (
        "Work-precision diagram with logarithmic axes: median wall time of one run (horizontal), and worst "
        f"error of a transition time in seconds. The most accurate run of each solver: {'; '.join(parts)}."
    )
