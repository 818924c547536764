"""Reference of scoring: the truth of one reading, in doubles and double-doubles, and the kind of the reading."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, localcontext
from functools import cached_property
from math import inf

import numpy as np
from numpy.typing import NDArray

from henon_ref.modes.mode import Mode
from henon_ref.trajectory import Kind, Status

HALF_ULP = 2.0**-53
KINDS = (
    "crossings",
    "stick-slip",
    "several surfaces",
    "jumps",
    "graze or close roots",
    "no transition",
    "ends early",
    "no truth",
)
"""Kinds of readings (:func:`kind_of`), in the order of tables."""
CLOSE = 1 / 400
"""Two transitions of one surface are close if the time between them is less than this part of the mean time between
transitions. Motions of the suite that are not built to have close roots stay above 1/320 of it."""


@dataclass(frozen=True)
class ReferenceTransition:
    """One transition, far more accurate than a double."""

    kind: Kind
    surface: int
    """Index of the surface that changes (or is touched)."""
    from_mode: Mode
    to_mode: Mode
    time_digits: str
    """Time [s] in decimal digits."""
    radius: float
    """Bound of the error of ``time_digits`` [s]: proven, or from the agreement of two precisions."""
    state: tuple[str, ...]
    """State in decimal digits."""
    state_radius: float
    """Largest radius of the state's components."""
    transversality: float = 0.0
    """Rate at which the guard falls through zero [unit of the guard / s]; 0 for a touch."""
    conditioning: float = inf
    """Largest growth of an earlier error into this time [s / unit of state]; see ``harness/truth/conditioning.py``."""
    proven: bool = False
    """Whether ball arithmetic has enclosed the transition; without ``closed_form`` the radius is the enclosure's."""
    closed_form: bool = False
    """Whether the time is the case's closed form, which is within the radius of the computed or proven time."""

    @cached_property
    def time(self) -> float:
        """Time [s], rounded to double."""
        return split_double(self.time_digits)[0]

    @cached_property
    def time_low(self) -> float:
        """Rounding error of ``time`` [s]: the time is ``time + time_low``."""
        return split_double(self.time_digits)[1]


@dataclass(frozen=True)
class NearGraze:
    """An instant at which the state nearly touches a surface."""

    time: float
    """[s]."""
    surface: int
    distance: float
    """abs(h) at this instant [unit of the surface]."""
    lasts: bool = False
    """Whether the distance does not grow until the mode changes, so that the approach continues until then."""


@dataclass(frozen=True)
class Expected:
    """Reference of scoring: the truth of one reading, in doubles and double-doubles."""

    status: Status
    """Status of the exact run."""
    transitions: Sequence[ReferenceTransition]
    """Every transition up to ``end_time``."""
    start: float
    """Initial time [s]."""
    until: float
    """Horizon [s]."""
    end_time: float
    """End of the exact run [s]: the horizon, or an earlier time."""
    near_grazes: Sequence[NearGraze] = ()
    start_size: float = 0.0
    """Largest absolute value in the initial state."""
    partial: bool = False
    """Whether the exact run after ``end_time`` is unknown: runs are then scored up to that time only."""

    @property
    def nothing_known(self) -> bool:
        """Whether the truth ends at the start, so that no run can be scored."""
        return self.partial and not self.transitions and self.end_time <= self.start

    @property
    def radius(self) -> float:
        """Largest radius of the transition times [s]."""
        return max((e.radius for e in self.transitions), default=0.0)

    @property
    def floor(self) -> float:
        """Smallest error of a time that can be claimed [s]: the radius, or half a unit in the last place."""
        return max(self.radius, HALF_ULP * self.time_unit)

    @property
    def time_unit(self) -> float:
        """Power of ten that digits are counted from [s]: 1 unless transitions are 10 times rarer or denser."""
        gap = (self.end_time - self.start) / max(len(self.transitions), 1)
        return 10.0 ** math.trunc(math.log10(gap)) if 0 < gap < math.inf else 1.0

    @property
    def state_size(self) -> float:
        """Largest absolute value of a state at a transition; 0 if there is none."""
        return max((abs(float(str(value))) for event in self.transitions for value in event.state), default=0.0)

    @cached_property
    def gaps(self) -> list[float]:
        """Distance of each transition to the nearest other one of its surface [s]; the run's length if there is none.

        A reset that is applied several times at one instant counts once.
        """
        span = self.until - self.start
        nearest: dict[tuple[object, ...], float] = {}
        last: dict[int, tuple[object, ...]] = {}
        own: list[tuple[object, ...]] = []
        for event in self.transitions:
            instant = (event.surface, event.time, event.kind, event.from_mode, event.to_mode)
            before = last.get(event.surface, instant)
            if before != instant:
                gap = abs(event.time - float(before[1]))  # type: ignore[arg-type]  # its time
                nearest[before], nearest[instant] = min(nearest.get(before, span), gap), gap
            last[event.surface] = instant
            own.append(instant)
        return [nearest.get(instant, span) for instant in own]

    @cached_property
    def _of_surface(self) -> dict[int, tuple[list[float], list[int]]]:
        """Surface -> times and indices of its transitions."""
        found: dict[int, tuple[list[float], list[int]]] = {}
        for i, event in enumerate(self.transitions):
            times, places = found.setdefault(event.surface, ([], []))
            times.append(event.time)
            places.append(i)
        return found

    def nearest(self, surface: int, time: float) -> int | None:
        """Index of the transition of a surface that is nearest to a time; None if there is none."""
        times, places = self._of_surface.get(surface, ([], []))
        at = bisect_left(times, time)
        return min(places[max(at - 1, 0) : at + 1], key=lambda i: abs(self.transitions[i].time - time), default=None)

    @cached_property
    def _grazes(self) -> tuple[list[NearGraze], NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
        """Near grazes in order of time, their times and distances, and whether they last."""
        grazes = sorted(self.near_grazes, key=lambda graze: graze.time)
        times, distances = (np.array([getattr(own, name) for own in grazes]) for name in ("time", "distance"))
        return grazes, times, distances, np.array([graze.lasts for graze in grazes], dtype=bool)

    def closest_graze(self, time: float, within: float) -> NearGraze | None:
        """Return the near graze with the smallest distance at most ``within`` [s] from a time.

        Near grazes that last count only if they are not later than the time. Between two of them the distance is
        interpolated exponentially.
        """
        grazes, times, distances, lasting = self._grazes
        begin, end = bisect_left(times, time - within), bisect_right(times, time + within)
        later = lasting[begin:end] & (times[begin:end] > time)
        earlier = np.where(later, np.inf, distances[begin:end])
        found = [] if later.all() else [grazes[begin + int(np.argmin(earlier))]]
        return min([*found, *self._approached(time)], key=lambda graze: graze.distance, default=None)

    def _approached(self, time: float) -> Iterator[NearGraze]:
        """Yield near grazes interpolated to a time within a lasting approach, which ends where the mode changes."""
        changes, last = [event.time for event in self.transitions], dict[int, NearGraze]()
        grazes, _, _, lasting = self._grazes
        for graze in (grazes[k] for k in np.flatnonzero(lasting)):
            before, last[graze.surface] = last.get(graze.surface), graze
            if before is None or not before.time <= time < graze.time:
                continue
            if bisect_right(changes, before.time) == bisect_right(changes, graze.time):
                part = (time - before.time) / (graze.time - before.time)
                distance = before.distance * (graze.distance / before.distance) ** part if before.distance else 0.0
                yield replace(before, time=time, distance=distance)

    def from_nearest_graze(self, time: float) -> float | None:
        """Return the distance from a time to the nearest near graze [s]; None if there is none."""
        _, times, _, _ = self._grazes
        at = bisect_left(times, time)
        return min((abs(float(other) - time) for other in times[max(at - 1, 0) : at + 1]), default=None)

    @property
    def scale(self) -> float:
        """Size of the state that tolerances are relative to: its largest value at the start and at transitions."""
        return max(self.start_size, self.state_size, HALF_ULP)


def kind_of(expected: Expected | None, surfaces: int) -> str:
    """Return the kind of a reading, the ability of a solver that it tests: the first one that applies to its truth.

    * ``no truth``: nothing is known of the exact run after its start;
    * ``ends early``: it cannot reach its horizon (its future is not unique, the model no longer holds, it diverges);
    * ``graze or close roots``: it touches a surface, comes close to one without reaching it (a near graze of the
      truth), or two transitions of one surface are close;
    * ``no transition``;
    * ``jumps``: the state jumps;
    * ``several surfaces``: the system has more than one;
    * ``stick-slip``: it enters or leaves sliding;
    * ``crossings``: it only crosses the surface.
    """
    if expected is None or expected.nothing_known:
        return "no truth"
    if expected.status != "ok" or expected.partial:
        return "ends early"
    kinds = {event.kind for event in expected.transitions}
    mean = (expected.end_time - expected.start) / max(len(expected.transitions), 1)
    if "graze" in kinds or expected.near_grazes or min(expected.gaps, default=mean) < CLOSE * mean:
        return "graze or close roots"
    if not kinds:
        return "no transition"
    if "reset" in kinds:
        return "jumps"
    if surfaces > 1:
        return "several surfaces"
    return "stick-slip" if kinds & {"stick", "release"} else "crossings"


def split_double(digits: str) -> tuple[float, float]:
    """Split a decimal number into the nearest double and the rounding error.

    >>> split_double("0.1")
    (0.1, -5.551115123125783e-18)
    """
    with localcontext() as context:
        context.prec = 1000
        exact = Decimal(digits)
        high = float(exact)
        return high, float(exact - Decimal(high))
