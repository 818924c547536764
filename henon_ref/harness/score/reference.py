"""Reference of scoring: the truth of one reading, in doubles and double-doubles."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, localcontext
from functools import cached_property
from math import inf

import numpy as np

from henon_ref.modes.mode import Mode
from henon_ref.trajectory import Kind, Status

HALF_ULP = 2.0**-53


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


class NearGrazes:
    """Near grazes, searchable by time.

    ``changes`` are the times [s] at which the mode changes, in order: an approach ends at a change.
    """

    def __init__(self, grazes: Sequence[NearGraze], changes: Sequence[float] = ()) -> None:
        self._changes = changes
        self._grazes = sorted(grazes, key=lambda graze: graze.time)
        self._times = np.array([graze.time for graze in self._grazes])
        self._distances = np.array([graze.distance for graze in self._grazes])
        self._lasting = np.array([graze.lasts for graze in self._grazes], dtype=bool)

    def closest(self, time: float, within: float) -> NearGraze | None:
        """Return the near graze with the smallest distance at most ``within`` [s] from a time.

        Near grazes that last count only if they are not later than the time. Between two of them the distance is
        interpolated exponentially.
        """
        begin, end = bisect_left(self._times, time - within), bisect_right(self._times, time + within)
        later = self._lasting[begin:end] & (self._times[begin:end] > time)
        distances = np.where(later, np.inf, self._distances[begin:end])
        found = [] if later.all() else [self._grazes[begin + int(np.argmin(distances))]]
        return min([*found, *self._approached(time)], key=lambda graze: graze.distance, default=None)

    def _approached(self, time: float) -> Iterator[NearGraze]:
        """Near grazes interpolated to a time within a lasting approach."""
        last: dict[int, NearGraze] = {}
        for graze in self._grazes if self._lasting.any() else ():
            before = last.get(graze.surface)
            if (
                graze.lasts
                and before is not None
                and before.time <= time < graze.time
                and self._one_mode(before, graze)
            ):
                part = (time - before.time) / (graze.time - before.time)
                distance = before.distance * (graze.distance / before.distance) ** part if before.distance else 0.0
                yield replace(before, time=time, distance=distance)
            if graze.lasts:
                last[graze.surface] = graze

    def _one_mode(self, before: NearGraze, after: NearGraze) -> bool:
        return bisect_right(self._changes, before.time) == bisect_right(self._changes, after.time)

    def from_nearest(self, time: float) -> float | None:
        """Distance from a time to the nearest near graze [s]; None if there is none."""
        at = bisect_left(self._times, time)
        return min((abs(float(other) - time) for other in self._times[max(at - 1, 0) : at + 1]), default=None)


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
    def grazes_by_time(self) -> NearGrazes:
        return NearGrazes(self.near_grazes, [t.time for t in self.transitions])

    @property
    def scale(self) -> float:
        """Size of the state that tolerances are relative to: its largest value at the start and at transitions."""
        return max(self.start_size, self.state_size, HALF_ULP)


def split_double(digits: str) -> tuple[float, float]:
    """Split a decimal number into the nearest double and the rounding error.

    Examples
    --------
    >>> split_double("0.1")
    (0.1, -5.551115123125783e-18)
    """
    with localcontext() as context:
        context.prec = 1000
        exact = Decimal(digits)
        high = float(exact)
        return high, float(exact - Decimal(high))
