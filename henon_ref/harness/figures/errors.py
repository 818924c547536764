"""Figure: running maximum of the error of the transition times, each solver at its tightest setting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.figures import style
from henon_ref.figures.style import describe
from henon_ref.harness.figures.labels import label_column
from henon_ref.harness.rows import RunRow, TransitionRow
from henon_ref.harness.score.reference import Expected

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TITLE = "Largest error so far, each solver at its tightest setting"
LEAST = 1e-18
"""Errors below this value, and zero errors, are drawn at the lower edge [s]."""
LEAST_POWER = -8
"""Half a unit in the last place of times below two to this power is smaller than ``LEAST``."""
ROOM = 2
"""Decades shown below the smallest final error of a curve."""
MARKERS = 6
"""Approximate number of markers per curve."""
Scored = tuple[RunRow, Sequence[TransitionRow]]
"""A run and its transitions."""


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


def draw_errors(runs: Sequence[Scored], expected: Expected) -> Figure | None:
    """Draw the running maximum of the absolute time error of matched transitions, over their times.

    Each solver is drawn at its last setting with a matched transition. Runs that timed out are left out, since their
    length depends on the machine. None if there is nothing to draw.
    """
    tightest = {run.solver: (run, own) for run, own in runs if run.matched and run.status != "timeout"}
    if not tightest or not expected.transitions:
        return None
    curves = [running_maximum(*scored) for scored in tightest.values()]
    lines = style.lines_of(tightest)
    lowest, highest = _limits(curves, expected)
    with style.figure(4.5) as figure:
        axes = figure.add_axes((0.095, 0.165, 0.575, 0.745))
        axes.set_yscale("log")
        axes.set_ylim(lowest, highest)
        axes.set_xlim(expected.start, expected.end_time)
        last = max((event.time for event in expected.transitions if event.kind != "graze"), default=expected.start)
        for k, curve in enumerate(curves):
            _draw(axes, lines[curve.run.solver], curve, lowest, shift=k / len(curves), last=last)
        _draw_floor(axes, expected, lowest)
        notes = _notes(curves, expected, lowest, last)
        figure.text(0.02, 0.015, notes, va="bottom", fontsize=7.0, color=style.GREY)
        style.decades(axes.yaxis)
        labels = [(curve.label, lines[curve.run.solver]) for curve in curves]
        label_column(axes, labels, x=1.045, gap=0.055, ends=[max(curve.last, lowest) for curve in curves])
        axes.set_xlabel("time of the transition [s]")
        axes.set_ylabel("largest error of a transition time up to t [s]")
        axes.set_title(TITLE)
        describe(figure, TITLE, _description(curves, expected))
        return figure


def _limits(curves: Sequence[Curve], expected: Expected) -> tuple[float, float]:
    """Return limits of whole decades around the final errors, not below the radius of the truth or ``LEAST``."""
    ends = np.array([curve.last for curve in curves if curve.errors.size])
    seen = ends[ends > max(LEAST, expected.radius)]
    if not seen.size:
        return LEAST, 1e-12
    least = seen.min() / 10**ROOM
    if seen.size < ends.size:  # a curve with zero error at the lower edge must not look like one with an error
        least = min(least, float(np.spacing(abs(expected.end_time))) / 8)
    return max(float(10 ** np.floor(np.log10(least))), LEAST), float(10 ** np.ceil(np.log10(seen.max()) + 0.1))


def _draw(axes: Axes, line: style.Line, curve: Curve, lowest: float, *, shift: float, last: float) -> None:
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
    places = left + (right - left) * (np.arange(MARKERS) + shift) / MARKERS
    places = places[(start <= places) & (places <= end)]
    places = places if places.size else times[-1:]
    levels = shown[np.searchsorted(times, places, side="right") - 1]
    axes.plot(places, levels, line.marker, color=line.colour, ms=3.4, zorder=4 if strong else 3)
    if times[-1] < last:
        axes.plot(times[-1:], shown[-1:], "+", color=line.colour, ms=9.0, mew=1.6, zorder=5)


def _description(curves: Sequence[Curve], expected: Expected) -> str:
    ordered = sorted(curves, key=lambda curve: curve.last)
    words = [f"{curve.label} {curve.last:.1e} s" if curve.last else f"{curve.label} none" for curve in ordered]
    return (
        f"Horizontal axis: time from {expected.start:g} to {expected.end_time:g} s; logarithmic vertical axis: largest "
        f"absolute error of all transition times up to this time. At the end: {'; '.join(words)}."
    )


def _draw_floor(axes: Axes, expected: Expected, lowest: float) -> None:
    """Draw the resolution of a time in double precision, and the radius of the truth if it is visible."""
    ends = expected.start, expected.end_time
    powers = 2.0 ** np.arange(LEAST_POWER, np.ceil(np.log2(max(map(abs, ends)))) + 1)
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
