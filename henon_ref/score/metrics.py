"""Errors of a run against the truth, and a verdict on it.

Times are compared as double-doubles: the truth is ``time + time_low``, a run's time is ``time + time_low`` as
far as the solver knows it. An error can come out below the truth's radius; it is kept as it is, and ``digits``
is what is claimed: never more than the radius and the format of the times allow.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import takewhile
from typing import Protocol

import numpy as np

from henon_ref.model.modes import Mode
from henon_ref.score.matching import Matching, match
from henon_ref.score.verdict import FIXED_STEP_TOLERANCE, RIGHT, Verdict, verdict
from henon_ref.trajectory import Status, Trajectory, Transition

HALF_ULP = 2.0**-53
EARLY = ("diverged", "nonunique", "invalid")
"""Statuses with which a run may rightly end before the horizon."""
CROWD_FRACTION = 1e-6
"""Where transitions accumulate, those within this fraction of the run from the last instant may be left out."""
END_FRACTION = 1e-3
"""A run that rightly ends early does so within this fraction of the run from the truth's end."""


class ReferenceEvent(Protocol):
    """A transition of the truth."""

    @property
    def kind(self) -> str: ...
    @property
    def surface(self) -> int: ...
    @property
    def from_mode(self) -> Mode: ...
    @property
    def to_mode(self) -> Mode: ...
    @property
    def time(self) -> float: ...
    @property
    def time_low(self) -> float: ...
    @property
    def radius(self) -> float: ...
    @property
    def conditioning(self) -> float: ...
    @property
    def transversality(self) -> float: ...
    @property
    def state(self) -> Sequence[object]: ...


class NearTouch(Protocol):
    """An instant at which a surface is nearly touched."""

    @property
    def time(self) -> float: ...
    @property
    def distance(self) -> float: ...


class Touches:
    """Near touches, found by time.

    Parameters
    ----------
    touches : sequence of NearTouch
        In any order.
    """

    def __init__(self, touches: Sequence[NearTouch]) -> None:
        self._touches = sorted(touches, key=lambda touch: touch.time)
        self._times = [touch.time for touch in self._touches]
        self._distances = np.array([touch.distance for touch in self._touches])

    def closest(self, time: float, within: float) -> NearTouch | None:
        """The one that comes closest to its surface of those no more than ``within`` from a time [s]."""
        begin, end = bisect_left(self._times, time - within), bisect_right(self._times, time + within)
        return self._touches[begin + int(np.argmin(self._distances[begin:end]))] if begin < end else None

    def from_nearest(self, time: float) -> float | None:
        """How far the nearest is from a time [s]; None where there is none."""
        at = bisect_left(self._times, time)
        return min((abs(other - time) for other in self._times[max(at - 1, 0) : at + 1]), default=None)


@dataclass(frozen=True)
class Expected:
    """What a run is scored against: the truth of one reading, in doubles and double-doubles."""

    status: Status
    """How the exact run ends."""
    transitions: Sequence[ReferenceEvent]
    """Every transition up to that end."""
    start: float
    """Initial time [s]."""
    until: float
    """Horizon [s]."""
    end_time: float
    """Where the exact run ends: the horizon, or before it [s]."""
    near_grazes: Sequence[NearTouch] = ()
    start_size: float = 0.0
    """Largest entry of the state at the start."""
    partial: bool = False
    """What happens after ``end_time`` is not known: runs are scored up to there, however they end."""

    @property
    def nothing_known(self) -> bool:
        """The truth could not leave the start: there is nothing that a run could be held against."""
        return self.partial and not self.transitions and self.end_time <= self.start

    @property
    def radius(self) -> float:
        """Largest radius of its transition times [s]."""
        return max((e.radius for e in self.transitions), default=0.0)

    @property
    def time_unit(self) -> float:
        """Power of ten that digits are counted from [s]: 1 unless transitions are 10 times rarer or denser."""
        gap = (self.end_time - self.start) / max(len(self.transitions), 1)
        return 10.0 ** math.trunc(math.log10(gap)) if 0 < gap < math.inf else 1.0

    @property
    def state_size(self) -> float:
        """Largest entry of a state at a transition; 0 where there is none."""
        return max((abs(float(str(value))) for event in self.transitions for value in event.state), default=0.0)

    @cached_property
    def gaps(self) -> list[float]:
        """Distance of each transition to the nearest other of its surface [s]; the run's length without."""
        found = [self.until - self.start] * len(self.transitions)
        last: dict[int, int] = {}
        for i, event in enumerate(self.transitions):
            before = last.get(event.surface)
            if before is not None:
                gap = abs(event.time - self.transitions[before].time)
                found[before], found[i] = min(found[before], gap), gap
            last[event.surface] = i
        return found

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
        """Index of the transition of this surface that is nearest to a time; None where it has none."""
        times, places = self._of_surface.get(surface, ([], []))
        at = bisect_left(times, time)
        return min(places[max(at - 1, 0) : at + 1], key=lambda i: abs(self.transitions[i].time - time), default=None)

    @cached_property
    def touches(self) -> Touches:
        """Its near touches, by time."""
        return Touches(self.near_grazes)

    @property
    def scale(self) -> float:
        """Size of the state that tolerances are relative to: at the start and at the transitions."""
        return max(self.start_size, self.state_size, HALF_ULP)


@dataclass(frozen=True)
class Score:
    """A run against the truth. None where there is nothing to measure."""

    matching: Matching
    status: Status
    reason: str
    verdict: Verdict
    """Whose fault a wrong run is."""
    time_errors: dict[int, float]
    """Reference index -> signed time error [s], touches included."""
    max_time_error: float | None
    rms_time_error: float | None
    max_state_error: float | None
    digits: float | None
    """Decimal digits of the worst transition time, counted from the case's unit of time."""


def time_error(event: Transition, reference: ReferenceEvent) -> float:
    """Signed time error [s] of two compensated times; the leading parts cancel exactly (Sterbenz)."""
    return (event.time - reference.time) + (event.time_low - reference.time_low)


def score(trajectory: Trajectory, expected: Expected, *, tolerance: float | None) -> Score:
    """Match a run with the truth and take its errors.

    Parameters
    ----------
    trajectory : Trajectory
    expected : Expected
    tolerance : float, optional
        Relative tolerance of the run, for the verdict on an ill-conditioned transition; None: double precision.
    """
    limit = _last_scored(expected)
    found = list(takewhile(lambda event: event.time <= limit, trajectory.transitions))
    slack = _end_slack(expected, tolerance)
    reached = trajectory.end_time >= expected.end_time - (slack if expected.partial else 0.0)
    matching = match(
        expected.transitions,
        found,
        start=expected.start,
        until=expected.end_time,
        radius=expected.radius,
        reached_horizon=trajectory.status in ("ok", expected.status) or reached,
        end_slack=slack,
        accumulating=expected.status == "failed",
    )
    errors = {i: time_error(found[j], expected.transitions[i]) for i, j in matching.pairs + matching.touch_pairs}
    counted = np.array([errors[i] for i, _ in matching.pairs])
    worst = float(np.max(np.abs(counted))) if counted.size else None
    status, reason, right = _status(trajectory, expected, matching, reached)
    return Score(
        matching=matching,
        status=status,
        reason=reason,
        verdict=RIGHT
        if right
        else verdict(
            expected,
            matching,
            found,
            tolerance=tolerance,
            ended=trajectory.end_time,
            timed_out=trajectory.status == "timeout",
        ),
        time_errors=errors,
        max_time_error=worst,
        rms_time_error=float(np.sqrt(np.mean(counted**2))) if counted.size else None,
        max_state_error=_state_error(trajectory, expected, matching),
        digits=None if worst is None else digits(worst, expected),
    )


def digits(error: float, expected: Expected) -> float:
    """Decimal digits that an error leaves, never more than the truth's radius and double precision allow."""
    floor = max(abs(error), expected.radius, HALF_ULP * expected.time_unit)
    return -math.log10(floor / expected.time_unit)


def _last_scored(expected: Expected) -> float:
    """The last instant [s] at which a transition of a run is scored."""
    if expected.partial:
        return expected.end_time
    if expected.status == "ok":
        return math.inf
    return expected.end_time + END_FRACTION * (expected.until - expected.start)


def _end_slack(expected: Expected, tolerance: float | None) -> float:
    """Time before the end [s] in which it is left to a run of this tolerance what it finds."""
    fraction = FIXED_STEP_TOLERANCE if tolerance is None else tolerance
    if expected.status == "failed":
        fraction = max(fraction, CROWD_FRACTION)
    return fraction * (expected.until - expected.start)


def _state_error(trajectory: Trajectory, expected: Expected, matching: Matching) -> float | None:
    """Largest absolute error of a state at a matched transition."""
    worst: float | None = None
    for i, j in matching.pairs:
        exact = [float(str(value)) for value in expected.transitions[i].state]
        error = max((abs(a - b) for a, b in zip(trajectory.transitions[j].state, exact, strict=False)), default=None)
        if error is not None and not math.isnan(error):
            worst = error if worst is None else max(worst, error)
    return worst


def _status(trajectory: Trajectory, expected: Expected, matching: Matching, reached: bool) -> tuple[Status, str, bool]:
    """A run's status after scoring, the reason in one sentence, and whether the run is right.

    ``reached``: it went as far as the truth is known, however it ended there.
    """
    status, reason = trajectory.status, trajectory.reason
    if expected.nothing_known:
        return status, reason, False
    if expected.partial and reached:
        return (status, reason, True) if matching.exact else ("wrong", _edits(matching, expected), False)
    if status not in ("ok", *EARLY, expected.status):  # it did not run to its own end
        return status, reason, False
    if status != expected.status:
        if status != "ok":
            return status, reason or f"the run ended at t = {trajectory.end_time:.6g}", False
        return "wrong", f"went on past t = {expected.end_time:.12g}, where the exact run is {expected.status}", False
    fault = ""
    if not matching.exact:
        fault = _edits(matching, expected)
    elif expected.status != "ok":
        late = abs(trajectory.end_time - expected.end_time)
        if late > END_FRACTION * (expected.until - expected.start):
            fault = f"{status} at t = {trajectory.end_time:.6g}, not at {expected.end_time:.12g}"
    if not fault:
        return status, reason, True
    if status == "failed":
        return status, f"{reason}; {fault}" if reason else fault, False
    return "wrong", fault, False


def _edits(matching: Matching, expected: Expected) -> str:
    """What is missed and spurious, and where it starts."""
    words = [f"{len(matching.missed)} missed", f"{len(matching.spurious)} spurious"]
    if matching.missed:
        event = expected.transitions[matching.missed[0]]
        words.append(f"first missed: {event.kind} at t = {event.time:.9g}")
    return ", ".join(words)
