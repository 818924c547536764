"""Figures of a comparison: the work-precision diagram, and the errors of the transitions over time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.figures import style
from henon_ref.figures.style import describe
from henon_ref.harness.rows import RunRow, TransitionRow, number
from henon_ref.harness.score.ranking import by_solver
from henon_ref.harness.score.reference import Expected
from henon_ref.text import one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COST = "Accuracy against time"
ERRORS = "Largest error so far, each solver at its tightest setting"


def draw_cost(rows: Sequence[RunRow], expected: Expected, *, of: str = "") -> Figure | None:
    """Draw the work-precision diagram: largest error of a transition time over median wall time of a run.

    ``of`` is the name of the reading for the title, if the case has several readings. Filled markers are right runs,
    hollow markers all other runs. None if fewer than two runs have an error and a time.
    """
    timed = [row for row in rows if row.wall_s and row.max_time_error_s is not None]
    if len(timed) < 2:
        return None
    ladders = by_solver(timed)
    points = {solver: _points(ladder, expected.floor) for solver, ladder in ladders.items()}
    tips = {solver: own[:, own[1].argmin()] for solver, own in points.items()}  # the most accurate run of each
    lines = style.lines_of(ladders)
    with style.figure(4.6) as figure:
        axes = figure.add_axes((0.1, 0.11, 0.645, 0.78))
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_autoscale_on(False)  # limits are set below, since equal errors have no scale
        for solver, ladder in ladders.items():
            _draw_ladder(axes, lines[solver], ladder, *points[solver])
        _set_cost_limits(axes, *np.hstack(list(points.values())))
        style.decades(axes.xaxis, style.time_text)
        style.decades(axes.yaxis)
        ordered = sorted(tips, key=lambda solver: -tips[solver][1])
        label_column(axes, [(solver, lines[solver]) for solver in ordered], gap=0.052)
        axes.set_xlabel("wall time of one run, median")
        axes.set_ylabel("worst error of a transition time [s]")
        axes.set_title(f"{COST}: {one_line(of)}" if of else COST, parse_math=False, pad=20)
        _draw_legend(axes, timed)
        describe(figure, COST, _cost_description(tips))
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


def _set_cost_limits(axes: Axes, x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    """Set limits with margins, and with at least two decades of time so that two decades are labelled."""
    left, right = x.min() / 2.0, x.max() * 2.0
    if math.floor(math.log10(right)) - math.ceil(math.log10(left)) < 1:
        left, right = 10.0 ** math.floor(math.log10(left)), 10.0 ** math.ceil(math.log10(right))
    axes.set_xlim(left, right)
    axes.set_ylim(10 ** np.floor(np.log10(y.min()) - 0.2), 10 ** np.ceil(np.log10(y.max()) + 0.2))


def _cost_description(tips: Mapping[str, NDArray[np.float64]]) -> str:
    ordered = sorted(tips.items(), key=lambda tip: float(tip[1][0]))
    parts = [f"{solver} {error:.1e} s in {style.time_text(wall)}" for solver, (wall, error) in ordered]
    return (
        "Work-precision diagram with logarithmic axes: median wall time of one run (horizontal), and worst "
        f"error of a transition time in seconds. The most accurate run of each solver: {'; '.join(parts)}."
    )


LOWEST_ERROR = 1e-18
"""Errors below this value, and zero errors, are drawn at the lower edge [s]."""


@dataclass(frozen=True)
class Curve:
    """Running maximum of the absolute time error [s] of a run, at the times of its matched transitions [s]."""

    run: RunRow
    times: NDArray[np.float64]
    errors: NDArray[np.float64]

    @property
    def last(self) -> float:
        """Largest error of the run [s]; 0 if only touches are matched."""
        return float(self.errors[-1]) if self.errors.size else 0.0

    @property
    def label(self) -> str:
        """Solver and setting, and the status or verdict of a run that is not right."""
        wrong = self.run.verdict if self.run.status == "ok" else self.run.status
        words = f"{self.run.solver} {self.run.setting}"
        return words if self.run.verdict == "right" else f"{words} ({wrong})"


def running_maximum(run: RunRow, transitions: Sequence[TransitionRow]) -> Curve:
    """Compute the curve of a run without touches."""
    pairs = [
        (row.reference_time_s, abs(row.time_error_s))
        for row in transitions
        if row.reference_time_s is not None and row.time_error_s is not None and row.kind != "graze"
    ]
    times, errors = np.array(pairs, dtype=float).reshape(-1, 2).T
    return Curve(run, times, np.maximum.accumulate(errors))


def draw_errors(runs: Sequence[tuple[RunRow, Sequence[TransitionRow]]], expected: Expected) -> Figure | None:
    """Draw the running maximum of the absolute time error of matched transitions, over their times.

    Each solver is drawn at its last setting with a matched transition. Runs that timed out are left out, since their
    length depends on the machine. None if there is nothing to draw.
    """
    tightest = {run.solver: (run, own) for run, own in runs if run.matched and run.status != "timeout"}
    if not tightest or not expected.transitions:
        return None
    curves = [running_maximum(*scored) for scored in tightest.values()]
    lines = style.lines_of(tightest)
    lowest, highest = _error_limits(curves, expected)
    with style.figure(4.5) as figure:
        axes = figure.add_axes((0.095, 0.165, 0.575, 0.745))
        axes.set_yscale("log")
        axes.set_ylim(lowest, highest)
        axes.set_xlim(expected.start, expected.end_time)
        last = max((event.time for event in expected.transitions if event.kind != "graze"), default=expected.start)
        for k, curve in enumerate(curves):
            _draw_curve(axes, lines[curve.run.solver], curve, lowest, shift=k / len(curves), last=last)
        _draw_floor(axes, expected, lowest)
        notes = _notes(curves, expected, lowest, last)
        figure.text(0.02, 0.015, notes, va="bottom", fontsize=7.0, color=style.GREY)
        style.decades(axes.yaxis)
        labels = [(curve.label, lines[curve.run.solver]) for curve in curves]
        label_column(axes, labels, gap=0.055, ends=[max(curve.last, lowest) for curve in curves])
        axes.set_xlabel("time of the transition [s]")
        axes.set_ylabel("largest error of a transition time up to t [s]")
        axes.set_title(ERRORS)
        describe(figure, ERRORS, _error_description(curves, expected))
        return figure


def _error_limits(curves: Sequence[Curve], expected: Expected) -> tuple[float, float]:
    """Return limits of whole decades around the final errors, not below the radius of the truth or ``LOWEST_ERROR``."""
    ends = np.array([curve.last for curve in curves if curve.errors.size])
    seen = ends[ends > max(LOWEST_ERROR, expected.radius)]
    if not seen.size:
        return LOWEST_ERROR, 1e-12
    least = seen.min() / 100  # two decades below the smallest final error
    if seen.size < ends.size:  # a curve with zero error at the lower edge must not look like one with an error
        least = min(least, float(np.spacing(abs(expected.end_time))) / 8)
    return max(float(10 ** np.floor(np.log10(least))), LOWEST_ERROR), float(10 ** np.ceil(np.log10(seen.max()) + 0.1))


def _draw_curve(axes: Axes, line: style.Line, curve: Curve, lowest: float, *, shift: float, last: float) -> None:
    """Draw the curve of one solver, constant between two transitions.

    It extends to the right edge if the last exact transition is matched; otherwise it ends in a cross. ``shift``, a
    fraction of the distance of two markers, separates the markers of different solvers.
    """
    times, shown = curve.times, np.maximum(curve.errors, lowest)
    if not times.size:
        return
    strong = line.width > style.THIN
    left, right = axes.get_xlim()
    start, end = times[0], right if times[-1] >= last else times[-1]
    width = line.width if strong else 0.9
    drawn: dict[str, Any] = {"ls": line.dashes, "color": line.colour, "lw": width, "zorder": 3 if strong else 2}
    axes.plot([*times, end], [*shown, shown[-1]], drawstyle="steps-post", **drawn)
    places = left + (right - left) * (np.arange(6) + shift) / 6  # about six markers per curve
    places = places[(start <= places) & (places <= end)]
    places = places if places.size else times[-1:]
    levels = shown[np.searchsorted(times, places, side="right") - 1]
    axes.plot(places, levels, line.marker, color=line.colour, ms=3.4, zorder=4 if strong else 3)
    if times[-1] < last:
        axes.plot(times[-1:], shown[-1:], "+", color=line.colour, ms=9.0, mew=1.6, zorder=5)


def _error_description(curves: Sequence[Curve], expected: Expected) -> str:
    ordered = sorted(curves, key=lambda curve: curve.last)
    words = [f"{curve.label} {curve.last:.1e} s" if curve.last else f"{curve.label} none" for curve in ordered]
    return (
        f"Horizontal axis: time from {expected.start:g} to {expected.end_time:g} s; logarithmic vertical axis: largest "
        f"absolute error of all transition times up to this time. At the end: {'; '.join(words)}."
    )


def _draw_floor(axes: Axes, expected: Expected, lowest: float) -> None:
    """Draw the resolution of a time in double precision, and the radius of the truth if it is visible."""
    ends = expected.start, expected.end_time
    powers = 2.0 ** np.arange(-8, np.ceil(np.log2(max(map(abs, ends)))) + 1)
    edges = np.unique(np.clip(np.concatenate([-powers, powers, ends]), *ends))
    half_ulp = np.spacing(np.abs(edges[:-1] + edges[1:]) / 2) / 2
    heights = np.maximum(np.append(half_ulp, half_ulp[-1:]), lowest)
    axes.fill_between(edges, lowest, heights, color="#EDEDED", lw=0, zorder=0, step="post")
    if expected.radius > lowest:
        axes.axhline(expected.radius, color=style.GREY, lw=0.8, ls="--")


def _notes(curves: Sequence[Curve], expected: Expected, lowest: float, last: float) -> str:
    """Explain the marks other than the curves, two to a line."""
    some = [curve for curve in curves if curve.times.size]
    known = {
        "grey: below half a unit in the last place of t": np.spacing(abs(expected.end_time)) / 2 > lowest,
        "grey dashes: the truth's radius": expected.radius > lowest,
        "at the lower edge: less, or no error": any(curve.errors[0] < lowest for curve in some),
        "+: no later transition is matched": any(curve.times[-1] < last for curve in some),
    }
    notes = [words for words, drawn in known.items() if drawn]
    return "\n".join(";   ".join(notes[k : k + 2]) for k in range(0, len(notes), 2))


COLUMN = 1.045
"""Place of the left edge of a column of labels, as a fraction of the width of the axes."""
SAMPLE = 22.0
"""Length of the sample of a line [pt]."""


def label_column(
    axes: Axes, labels: Sequence[tuple[str, style.Line]], *, gap: float, ends: Sequence[float] = ()
) -> None:
    """Draw a column of labels to the right of the axes, from top to bottom.

    The distance of two labels is ``gap``, as a fraction of the height of the axes, or less if there are many labels.
    ``ends`` are the final values of the curves in data coordinates; limits and scales must be set before. With
    ``ends``, labels are ordered by these values and placed as near to them as possible, and a thin line in the margin
    connects each label with the end of its curve. These lines cross neither the curves nor each other.
    """
    from matplotlib.lines import Line2D

    point, gap = _point(axes), min(gap, 1.0 / max(len(labels), 1))
    along = [COLUMN + part * SAMPLE * point for part in (0.0, 0.5, 1.0)]
    place: dict[str, Any] = {"transform": axes.transAxes, "clip_on": False}
    order = sorted(range(len(labels)), key=lambda k: -ends[k]) if ends else range(len(labels))
    level, height = 1.0, 1.0 + gap / 2
    for row, k in enumerate(order):
        label, line = labels[k]
        if ends:
            place_of_end = (axes.transScale + axes.transLimits).transform((axes.get_xlim()[0], ends[k]))
            level = min(max(float(place_of_end[1]), 0.0), 1.0)
        height = max(min(level, height - gap), (len(labels) - row - 0.5) * gap)  # leaves room for the labels below
        if ends:
            way = [1.005, COLUMN - 2 * point], [level, height]
            axes.add_artist(Line2D(*way, lw=0.5, alpha=0.7, color=line.colour, zorder=1, **place))
        drawn: dict[str, Any] = {"ls": line.dashes, "lw": line.width, "marker": line.marker, "ms": 4.0}
        axes.add_artist(Line2D(along, [height] * 3, markevery=[1], color=line.colour, **drawn, **place))
        text, size = _fitted(axes, one_line(label))
        at = COLUMN + (SAMPLE + 4) * point
        axes.text(at, height, text, parse_math=False, va="center", fontsize=size, transform=axes.transAxes)


def _fitted(axes: Axes, label: str) -> tuple[str, float]:
    """Fit a label into the figure by a smaller font, and by truncation if necessary; return text and size [pt]."""
    largest, smallest = 8.0, 6.0
    letter = 0.62  # assumed width, slightly above the average [em]
    place = axes.get_position()
    room = ((1.0 - place.x0) / place.width - COLUMN) / _point(axes) - SAMPLE - 6
    most = int(room / (letter * smallest))
    text = label if len(label) <= most else f"{label[: most - 1]}…"
    return text, min(largest, room / (letter * len(text)))


def _point(axes: Axes) -> float:
    """Return one point (1/72 inch) as a fraction of the width of the axes."""
    return axes.figure.dpi / 72.0 / axes.bbox.width
