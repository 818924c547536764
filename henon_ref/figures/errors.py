"""Figure: the error of every transition, per solver, at its tightest setting."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from henon_ref.columns import Row
from henon_ref.figures import style
from henon_ref.score.reference import Expected

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST = 1e-18
"""Errors below this [s] are drawn at the lower edge, and none at all (a run that agrees to the last bit), too."""
MOST_MARKED = 60
"""Transitions up to which each one gets a marker."""
FEW_MARKED = 16
"""Markers, roughly, of a longer line."""


class ScoredRun(Protocol):
    """A run's rows."""

    @property
    def run(self) -> Row:
        """Its row of ``runs.csv``."""
        ...

    @property
    def transitions(self) -> Sequence[Row]:
        """Its rows of ``transitions.csv``."""
        ...


def tightest(records: Sequence[ScoredRun]) -> list[ScoredRun]:
    """The last setting of every solver that matched at least one transition.

    A run that the time limit stopped is left out: how far it came is the machine's doing.
    """
    best: dict[object, ScoredRun] = {}
    for record in records:
        if record.run["matched"] and record.run["status"] != "timeout":
            best[record.run["solver"]] = record
    return list(best.values())


def draw_errors(records: Sequence[ScoredRun], expected: Expected) -> Figure | None:
    """Absolute time error of every matched transition over its time."""
    chosen = tightest(records)
    if not chosen or len(expected.transitions) == 0:
        return None
    with style.figure(4.2) as figure:
        axes = figure.add_axes((0.095, 0.11, 0.575, 0.79))
        axes.set_yscale("log")
        lowest, highest = _limits(chosen, expected)
        axes.set_ylim(lowest, highest)
        axes.set_xlim(expected.start, expected.end_time)
        ends = [_draw(axes, record, lowest) for record in chosen]
        hidden = any(min(_errors(record)[1], default=1.0) < lowest for record in chosen)
        _draw_floor(axes, expected, lowest, hidden=hidden)
        style.decades(axes.yaxis)
        style.label_points(axes, ends, x=1.045, gap=0.055)
        axes.set_xlabel("time of the transition [s]")
        axes.set_ylabel("absolute error of its time [s]")
        axes.set_title("Error of every transition, each solver at its tightest setting")
        return figure


def _errors(record: ScoredRun) -> tuple[list[float], list[float]]:
    times, errors = [], []
    for row in record.transitions:
        time, error = row["reference_time_s"], row["time_error_s"]
        if isinstance(time, float) and isinstance(error, float) and row["kind"] != "graze":
            times.append(time)
            errors.append(abs(error))
    return times, errors


def _limits(records: Sequence[ScoredRun], expected: Expected) -> tuple[float, float]:
    """Whole decades around what there is, the lower end not below what can be seen or claimed."""
    found = np.array([error for record in records for error in _errors(record)[1]])
    seen = found[found > max(LEAST, expected.radius)]
    if not seen.size:
        return LEAST, 1e-12
    least = seen.min()
    if seen.size < found.size:  # what is drawn at the lower edge must not look like an error of some size
        least = max(min(least, float(np.spacing(abs(expected.end_time))) / 8), LEAST)
    return float(10 ** np.floor(np.log10(least))), float(10 ** np.ceil(np.log10(seen.max()) + 0.1))


def _draw(axes: Axes, record: ScoredRun, lowest: float) -> tuple[str, float, float, style.Line]:
    """One solver's line; returns its label, where it ends, and how it is drawn."""
    solver = str(record.run["solver"])
    line = style.line_of(solver)
    times, errors = _errors(record)
    shown = np.maximum(errors, lowest)
    every = 1 if len(times) <= MOST_MARKED else len(times) // FEW_MARKED
    strong = line.width > style.THIN
    axes.plot(
        times,
        shown,
        line.dashes,
        color=line.colour,
        lw=line.width if strong else 0.8,
        alpha=1.0 if strong else 0.75,
        marker=line.marker,
        markevery=every,
        ms=3.2,
        zorder=3 if strong else 2,
    )
    label = f"{solver} {_setting(record)}"
    if record.run["verdict"] != "right":
        label += f" ({record.run['status']})"
    return label, times[-1], float(shown[-1]), line


def _setting(record: ScoredRun) -> str:
    rtol, step = record.run["rtol"], record.run["step_s"]
    return f"{rtol:.0e}".replace("e-0", "e-") if rtol is not None else f"h={step:g} s"


def _draw_floor(axes: Axes, expected: Expected, lowest: float, *, hidden: bool) -> None:
    """What a time in double precision can hold, the truth's radius where it is in sight, and what lies below all."""
    times = np.linspace(expected.start, expected.end_time, 400)
    half_ulp = np.spacing(np.abs(times)) / 2
    axes.fill_between(times, lowest, np.maximum(half_ulp, lowest), color="#EDEDED", lw=0, zorder=0, step="mid")
    notes = []
    if half_ulp[-1] > lowest:
        notes.append("grey: below half a unit\nin the last place of t")
    if expected.radius > lowest:
        axes.axhline(expected.radius, color=style.GREY, lw=0.8, ls="--")
        notes.append("dashed: the truth's radius")
    axes.figure.text(0.70, 0.02, "\n".join(notes), va="bottom", fontsize=7.0, color=style.GREY)
    if hidden:
        axes.figure.text(0.02, 0.02, "at the lower edge: no error", va="bottom", fontsize=7.0, color=style.GREY)
