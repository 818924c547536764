"""Section 4.2: Fig. 8 in its three readings, and where its numbers come from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.paper.listing import LISTING
from henon_ref.baselines.paper.listing_variants import DEFECTS, run_variant
from henon_ref.figures import style
from henon_ref.harness.report.svg import svg
from henon_ref.harness.studies.paper.audit import PRINTED_STEP, numbers
from henon_ref.harness.studies.paper.claims import Claim, Section, checked, picture
from henon_ref.harness.studies.paper.curves import Curve, curve, thinned
from henon_ref.harness.studies.paper.systems import (
    FIG8_VALUES,
    INNER,
    PERIOD,
    VP,
    A,
    W,
    fig8_equations,
    fig8_listing_limit,
)
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Transition

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PUBLISHED_DURATIONS = (1.1746, 0.4161)
PUBLISHED_LENGTHS = (0.4697, 0.1663)
HALF_DIGIT = 0.5e-4
"""Half a unit of the last digit printed."""
BELT, T = float(FIG8_VALUES[VP]), float(PERIOD)
LATE = 34 * T + 2.8
"""The two periods that are drawn start here [s], between two sticks of the limit's orbit."""
REPEATS = 40
"""Two-period turns after which a run counts as on its orbit."""


@dataclass(frozen=True)
class Stick:
    """One stick of a run."""

    start: float
    duration: float
    length: float


def sticks(transitions: tuple[Transition, ...], after: float) -> list[Stick]:
    """Sticks that end later than ``after``, longest first, without those cut off."""
    found = [
        Stick(a.time, b.time - a.time, b.state[0] - a.state[0])
        for a, b in pairwise(transitions)
        if a.kind == "stick" and b.time > after
    ]
    return sorted(found, key=lambda s: -s.duration)


@dataclass(frozen=True)
class Readings:
    """Late transitions of the three readings."""

    listing: tuple[Transition, ...]
    limit: tuple[Transition, ...]
    """On its periodic orbit."""
    equations: tuple[Transition, ...]
    """On its periodic orbit."""


@cache
def readings() -> Readings:
    """Run all three from the listing's start: the listing to 70 s, the others until they repeat themselves."""
    end = 2 * REPEATS * PERIOD
    listing = LISTING.prepare(fig8_listing_limit(), step=PRINTED_STEP)().transitions
    limit = curve(replace(fig8_listing_limit(), until=end), after=float(end) - 6 * T, until=float(end), points=2)
    equations = curve(replace(fig8_equations(), until=end), after=float(end) - 6 * T, until=float(end), points=2)
    return Readings(tuple(listing), limit.transitions, equations.transitions)


def section(folder: Path) -> Section:
    """The numbers of Sec. 4.2; draws Fig. 8."""
    made = readings()
    (folder / "fig8.svg").write_bytes(svg(draw_fig8()))
    lowest, overload = worst_stretch()
    long, short = _two(made.limit)
    text = _TEXT.format(long=long.duration, short=short.duration, lowest=lowest, overload=overload, period=2 * T)
    caption = (
        "Fig. 8 again, two periods of the forcing on the attractor. a: the appendix as printed. b: its limit for "
        "small steps. c: Eqs. (17) and (18). d: the spring's stretch in b; sticks are shaded, and between the dotted "
        "lines friction can hold the spring."
    )
    return Section("Section 4.2: Fig. 8", text + picture(folder, "fig8.svg", caption), _claims(made))


def _two(transitions: tuple[Transition, ...], after: float = 60.0) -> tuple[Stick, Stick]:
    """The longest and the shortest stick."""
    found = sticks(transitions, after)
    return found[0], found[-1]


@cache
def worst_stretch() -> tuple[float, float]:
    """Lowest z in a stick of the limit's orbit, and the spring's force there over what friction can hold."""
    drawn = late_curve(fig8_listing_limit())
    z = drawn.states[:, 0] - base(drawn.times)
    lowest = float(z[drawn.modes == 0].min())
    return lowest, abs(lowest**3 - lowest) / numbers()[3]


def base(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacement of the spring's far end."""
    return np.asarray(float(FIG8_VALUES[A]) * np.sin(float(FIG8_VALUES[W]) * t))


def late_curve(problem: Problem) -> Curve:
    """Two periods of the forcing, late in the run."""
    return curve(problem, after=LATE, until=LATE + 2 * T)


def _claims(made: Readings) -> tuple[Claim, ...]:
    return (*_durations(made), *_other_numbers(made))


def _durations(made: Readings) -> list[Claim]:
    printed, limit = _two(made.listing), _two(made.limit)
    agree = all(
        abs(stick.duration - duration) <= HALF_DIGIT and abs(stick.length - length) <= HALF_DIGIT
        for stick, duration, length in zip(printed, PUBLISHED_DURATIONS, PUBLISHED_LENGTHS, strict=True)
    )
    crosses = {t.kind for t in made.equations} == {"crossing"}
    phases = sorted({round(t.time % T, 10) for t in made.equations})
    own = [BELT * duration for duration in PUBLISHED_DURATIONS]
    return [
        checked(
            "Fig. 8, Sec. 4.2",
            "sticks of 1.1746 s and 0.4161 s",
            agree and crosses,
            f"The appendix as printed gives {printed[0].duration:.5f} and {printed[1].duration:.5f} at h = 1e-4. What "
            f"it converges to for h -> 0, slip x' = 3 f and one-sided release, has {limit[0].duration:.10f} and "
            f"{limit[1].duration:.10f}. Eqs. (17) and (18) have no stick on their attractor at all: it crosses at "
            f"t mod T = {phases[0]:.10f} and {phases[1]:.10f}.",
            corrected=True,
        ),
        checked(
            "Fig. 8, Sec. 4.2",
            "sticks of length 0.4697 and 0.1663",
            agree,
            f"As printed {printed[0].length:.5f} and {printed[1].length:.5f}; in the limit {limit[0].length:.10f} and "
            f"{limit[1].length:.10f}. At the belt's speed the printed durations make {own[0]:.4f} and {own[1]:.4f}: "
            "the listing puts the position back to the tangent point at a release, but not the time.",
            corrected=True,
        ),
    ]


def _other_numbers(made: Readings) -> list[Claim]:
    turns = [t for t in made.listing if t.kind == "crossing"][-2:]
    long_starts = sorted(s.start for s in sticks(made.listing, 60) if s.duration > 1)
    period = long_starts[1] - long_starts[0]
    upper = replace(fig8_listing_limit(), initial=(INNER, FIG8_VALUES[VP]))
    other = _two(tuple(LISTING.prepare(upper, step=PRINTED_STEP)().transitions))
    same_sticks = all(abs(a.duration - b.duration) < 1e-9 for a, b in zip(other, _two(made.listing), strict=True))
    return [
        checked(
            "Fig. 8",
            "a two-periodic trajectory",
            abs(period - 2 * T) < 1e-6,
            f"The listing's orbit repeats after {period:.6f} s, twice the forcing's T = {T:.6f} s. That of Eq. (18) "
            "repeats after T.",
        ),
        checked(
            "Fig. 8, caption",
            "start (x(3), vp)",
            same_sticks,
            "The listing starts from `T[3]`, which is x(4) = -x(3) of Eq. (16), Python counting from 0. Both starts "
            "end on the same orbit, with the same sticks.",
            corrected=True,
        ),
        checked(
            "Sec. 4.2",
            "two deflection points in the left part, where Sigma is crossed",
            len({round(t.state[0], 4) for t in turns}) == 2 and all(t.state[0] < -0.7 for t in turns),
            "The listing's orbit crosses upward at x1 = "
            + " and ".join(f"{t.state[0]:.4f}" for t in sorted(turns, key=lambda t: t.state[0]))
            + ".",
        ),
    ]


def draw_fig8() -> Figure:
    """Phase portraits of the three readings, and the stretch of the spring in the limit."""
    limit, equations = late_curve(fig8_listing_limit()), late_curve(fig8_equations())
    path = run_variant(DEFECTS, step=PRINTED_STEP, numbers=numbers(), until=LATE + 2 * T, path_from=LATE).path
    on = np.abs(path[:, 2] - BELT) < 1e-12
    kept = thinned(np.where(on, 0.0, path[:, 2] - BELT), 80)
    path, on = path[kept], on[kept]
    with style.figure(6.2) as figure:
        grid = figure.add_gridspec(2, 3, height_ratios=(1, 1))
        portraits = [figure.add_subplot(grid[0, k]) for k in range(3)]
        portraits[0].plot(path[:, 1], path[:, 2], color=style.BLUE, lw=1)
        portraits[0].plot(np.where(on, path[:, 1], np.nan), path[:, 2], color=style.BLACK, lw=2.6)
        for ax, drawn in zip(portraits[1:], (limit, equations), strict=True):
            ax.plot(drawn.states[:, 0], drawn.states[:, 1], color=style.BLUE, lw=1)
            for stick in drawn.sticks():
                ax.plot(drawn.states[stick, 0], drawn.states[stick, 1], color=style.BLACK, lw=2.6)
        titles = ("a   listing as printed", "b   listing, $h \\to 0$", "c   Eqs. (17), (18)")
        for ax, title in zip(portraits, titles, strict=True):
            ax.axhline(BELT, color=style.GREY, lw=0.8, zorder=1)
            ax.set(xlabel="$x_1$ [m]", xlim=(-0.95, 0.75), ylim=(-2.3, 1.75))
            ax.set_title(title)
        portraits[0].set_ylabel("$x_2$ [m/s]")
        portraits[2].plot([], [], color=style.BLACK, lw=2.6, label="stick")
        portraits[2].plot([], [], color=style.GREY, lw=0.8, label="belt's speed")
        portraits[2].legend(loc="lower center")
        _draw_stretch(figure.add_subplot(grid[1, :]), limit)
        figure.set_layout_engine("constrained")
    return figure


def _draw_stretch(ax: Axes, drawn: Curve) -> None:
    inner = float(INNER)
    start = drawn.times[0]
    ax.plot(drawn.times - start, drawn.states[:, 0] - base(drawn.times), color=style.BLUE)
    for k, stick in enumerate(drawn.sticks()):
        span = drawn.times[stick] - start
        ax.axvspan(span[0], span[-1], color=style.STICK_SHADE, zorder=0, label="stick" if k == 0 else None)
    ax.axhline(inner, color=style.BLACK, ls=":", label=r"tangent points $\pm z^*$")
    ax.axhline(-inner, color=style.BLACK, ls=":")
    lowest, overload = worst_stretch()
    at = int(np.argmin(np.where(drawn.modes == 0, drawn.states[:, 0] - base(drawn.times), np.inf)))
    ax.annotate(
        f"spring force {overload:.2f} times\nwhat friction can hold",
        (drawn.times[at] - start, lowest),
        xytext=(0, -4),
        textcoords="offset points",
        va="top",
        ha="center",
        fontsize=8,
    )
    ax.set(xlabel=f"$t$ - {start:.3f} [s]", ylabel="$z$ [m]", xlim=(0, 2 * T), ylim=(-0.75, 0.75))
    ax.set_title("d   stretch of the spring in b")
    ax.legend(loc="lower right", bbox_to_anchor=(1, 0.985), ncols=2)


_TEXT = """\
One figure, three readings, from the listing's start:

- **`listing`**, the appendix as printed (h = 1e-4). It gives the paper's digits.
- **`listing_limit`**, what the appendix is a step method for: slip `x' = 3 f`, and a stick that ends only where z
  rises through the upper tangent point. Its orbit has period {period:.6f} s = 2 T and sticks of {long:.10f}
  and {short:.10f} s.
- **`equations`**, Eqs. (17) and (18) with Filippov's sliding: an orbit of period T that crosses twice and never
  sticks.

In the long stick z falls to {lowest:.3f}, far below the lower tangent point: the spring then pulls {overload:.2f} times
as hard as friction can hold. The paper's longer duration is that of a stick which its friction law cannot hold.

"""
