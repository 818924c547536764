"""Section 4.2: Fig. 8 in its three readings, and the origin of its numbers."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.paper.listing import LISTING, PRINTED_STEP
from henon_ref.figures import style
from henon_ref.figures.motion import Motion, plane_of, portrait
from henon_ref.harness.studies.paper.systems import (
    FIG8_VALUES,
    INNER,
    MU0,
    PERIOD,
    VP,
    A,
    Findings,
    W,
    fig8_equations,
    fig8_listing_limit,
    reference,
    sampled,
)
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Transition

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PUBLISHED_DURATIONS = (1.1746, 0.4161)
BELT, T = float(FIG8_VALUES[VP]), float(PERIOD)
LATE = 34 * T + 2.8
"""Start of the two periods that are drawn [s], between two sticks of the limit's orbit."""


@dataclass(frozen=True)
class Stick:
    """One stick of a run: start and duration [s], length [m]."""

    start: float
    duration: float
    length: float


def sticks(transitions: Iterable[Transition]) -> list[Stick]:
    """Complete sticks that end later than 60 s, longest first."""
    found = [
        Stick(a.time, b.time - a.time, b.state[0] - a.state[0])
        for a, b in pairwise(transitions)
        if a.kind == "stick" and b.time > 60.0
    ]
    return sorted(found, key=lambda s: -s.duration)


def listing_run(problem: Problem) -> tuple[Transition, ...]:
    """Transitions of the appendix as printed."""
    return tuple(LISTING.prepare(problem, step=PRINTED_STEP)().transitions)


def on_orbit(problem: Problem) -> tuple[Transition, ...]:
    """Transitions of a run in the last six of 80 periods of the forcing (40 orbits), when the run is periodic."""
    end = 80 * PERIOD
    return tuple(
        t for t in reference(replace(problem, until=end)).transitions if float(end) - 6 * T < t.time < float(end)
    )


@cache
def limit_sticks() -> tuple[Stick, Stick]:
    """Longest and shortest stick of the listing's limit for small steps."""
    found = sticks(on_orbit(fig8_listing_limit()))
    return found[0], found[-1]


def base(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement of the spring's far end."""
    return np.asarray(float(FIG8_VALUES[A]) * np.sin(float(FIG8_VALUES[W]) * t))


def section() -> Findings:
    """Check the numbers of Sec. 4.2, and Fig. 8."""
    listing, equations = listing_run(fig8_listing_limit()), on_orbit(fig8_equations())
    every, limit = sticks(listing), limit_sticks()
    printed = every[0], every[-1]
    durations, lengths = (
        all(abs(getattr(stick, name) - own) <= 0.5e-4 for stick, own in zip(printed, published, strict=True))
        for name, published in (("duration", PUBLISHED_DURATIONS), ("length", (0.4697, 0.1663)))
    )
    turns = sorted(t.state[0] for t in [t for t in listing if t.kind == "crossing"][-2:])
    long_starts = sorted(s.start for s in every if s.duration > 1)
    period = long_starts[1] - long_starts[0]
    other = sticks(listing_run(replace(fig8_listing_limit(), initial=(INNER, FIG8_VALUES[VP]))))
    drawn = sampled(fig8_listing_limit(), LATE, LATE + 2 * T)[1]
    z = np.where(np.ravel(drawn.modes) == 0, drawn.states[:, 0] - base(drawn.times), np.inf)
    lowest = float(z.min())
    overload = abs(lowest**3 - lowest) / float(FIG8_VALUES[MU0])
    return Findings(
        {
            "durations": durations and lengths and {t.kind for t in equations} == {"crossing"},
            "lengths": durations and lengths,
            "period": abs(period - 2 * T) < 1e-6,
            "start": all(
                abs(a.duration - b.duration) < 1e-9 for a, b in zip((other[0], other[-1]), printed, strict=True)
            ),
            "deflections": round(turns[0], 4) != round(turns[1], 4) and max(turns) < -0.7,
        },
        {
            "printed": printed,
            "limit": limit,
            "phases": sorted({round(t.time % T, 10) for t in equations}),
            "own": [BELT * duration for duration in PUBLISHED_DURATIONS],
            "period": period,
            "forcing": T,
            "two_periods": 2 * T,
            "turns": turns,
            "lowest": lowest,
            "overload": overload,
        },
        {"fig8": draw_fig8(drawn, int(np.argmin(z)), overload)},
    )


def draw_fig8(limit: Motion, lowest: int, overload: float) -> Figure:
    """Draw the phase portraits of the three readings, and the stretch of the spring in the limit."""
    window = LATE, LATE + 2 * T
    with style.figure(6.2) as figure:
        grid = figure.add_gridspec(2, 3, height_ratios=(1, 1))
        for k, (title, motion) in enumerate(
            {
                "a   listing as printed": sampled(fig8_listing_limit(), *window, LISTING.prepare, step=PRINTED_STEP)[1],
                "b   listing, $h \\to 0$": limit,
                "c   Eqs. (17), (18)": sampled(fig8_equations(), *window)[1],
            }.items()
        ):
            ax = figure.add_subplot(grid[0, k])
            portrait(ax, fig8_equations().system, motion, (0, 1), label="_")
            ax.set(xlabel="$x_1$ [m]", ylabel="" if k else "$x_2$ [m/s]", xlim=(-0.95, 0.75), ylim=(-2.3, 1.75))
            ax.set_title(title)
        _draw_stretch(figure.add_subplot(grid[1, :]), limit, lowest, overload)
        figure.set_layout_engine("constrained")
    return figure


def _draw_stretch(ax: Axes, drawn: Motion, lowest: int, overload: float) -> None:
    inner = float(INNER)
    times, z = drawn.times - drawn.times[0], drawn.states[:, 0] - base(drawn.times)
    ax.plot(times, z, color=style.BLUE)
    held = [piece for label, piece in plane_of(fig8_equations().system, 0, 1).pieces(drawn.modes) if label == "stick"]
    for k, stick in enumerate(held):
        span = times[stick]
        ax.axvspan(span[0], span[-1], color=style.STICK_SHADE, zorder=0, label="stick" if k == 0 else None)
    ax.axhline(inner, color=style.BLACK, ls=":", label=r"tangent points $\pm z^*$")
    ax.axhline(-inner, color=style.BLACK, ls=":")
    ax.annotate(
        f"spring force {overload:.2f} times\nwhat friction can hold", (times[lowest], z[lowest]), xytext=(0, -4),
        textcoords="offset points", va="top", ha="center", fontsize=8,
    )  # fmt: skip
    ax.set(xlabel=f"$t$ - {drawn.times[0]:.3f} [s]", ylabel="$z$ [m]", xlim=(0, 2 * T), ylim=(-0.75, 0.75))
    ax.set_title("d   stretch of the spring in b")
    ax.legend(loc="lower right", bbox_to_anchor=(1, 0.985), ncols=2)
