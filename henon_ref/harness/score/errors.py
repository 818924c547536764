"""Errors of a run against the truth, and a verdict on it.

Times are compared as double-doubles: the truth is ``time + time_low``, a run's time is ``time + time_low`` as
far as the solver knows it. An error can come out below the truth's radius; it is kept as it is, and ``digits``
is what is claimed: never more than the radius and the format of the times allow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from henon_ref.harness.score.matching import Matching, match
from henon_ref.harness.score.reference import HALF_ULP, Expected
from henon_ref.harness.score.verdict import FIXED_STEP_TOLERANCE, RIGHT, Verdict, undecided_verdict, verdict
from henon_ref.trajectory import Event, Status, Trajectory

EARLY = ("diverged", "nonunique", "invalid")
"""Statuses with which a run may rightly end before the horizon."""
CROWD_FRACTION = 1e-6
"""Where transitions accumulate, those within this fraction of the run from the last instant may be left out."""
END_FRACTION = 1e-3
"""A run that rightly ends early does so within this fraction of the run from the truth's end."""


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


def time_error(event: Event, reference: Event) -> float:
    """Signed time error [s] of two compensated times; the leading parts cancel exactly (Sterbenz)."""
    return (event.time - reference.time) + (event.time_low - reference.time_low)


def score(trajectory: Trajectory, expected: Expected, *, tolerance: float | None) -> Score:
    """Match a run of some relative tolerance (None: it has none) with the truth, and take its errors."""
    limit = _last_scored(expected)
    found = list(takewhile(lambda event: event.time <= limit, trajectory.transitions))
    slack = _end_slack(expected, tolerance)
    reached = trajectory.end_time >= expected.end_time - (slack if expected.partial else 0.0)
    since = {surface: time for surface, time in trajectory.undecided_after if surface >= 0}
    (exact, left_out), (own, _) = (_decided(events, since) for events in (expected.transitions, found))
    matching = match(
        exact,
        own,
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
    if right:
        judged = RIGHT if left_out is None else undecided_verdict(expected.transitions[left_out])
    else:
        judged = verdict(
            expected, matching, found, tolerance=tolerance, status=trajectory.status, ended=trajectory.end_time
        )
    return Score(
        matching=matching,
        status=status,
        reason=reason,
        verdict=judged,
        time_errors=errors,
        max_time_error=worst,
        rms_time_error=float(np.sqrt(np.mean(counted**2))) if counted.size else None,
        max_state_error=_state_error(trajectory, expected, matching),
        digits=None if worst is None else digits(worst, expected),
    )


def _decided(events: Sequence[Event], since: Mapping[int, float]) -> tuple[dict[int, Event], int | None]:
    """Transitions that are matched, by their places: those of a surface up to where the run decides nothing of it.

    ``since``: surface -> from when on it does not [s]; its entries in the modes of other transitions are 0 from there
    on. Beside them the first transition that changes a mode and is left out.
    """
    kept = {i: event for i, event in enumerate(events) if not event.time > since.get(event.surface, math.inf)}
    out = (i for i, event in enumerate(events) if i not in kept and event.kind != "graze")
    return {i: _hidden(event, since) for i, event in kept.items()}, next(out, None)


def _hidden(event: Event, since: Mapping[int, float]) -> Event:
    hidden = {surface for surface, time in since.items() if event.time > time}
    if not hidden:
        return event
    before, after = (
        tuple(0 if i in hidden else sign for i, sign in enumerate(mode)) for mode in (event.from_mode, event.to_mode)
    )
    made: Event = replace(event, from_mode=before, to_mode=after)  # type: ignore[type-var]
    return made


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
        exact = [float(value) for value in expected.transitions[i].state]
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


def published_partners(durations: Sequence[float | None], published: Sequence[float]) -> tuple[float | None, ...]:
    """The published duration that belongs to each stick: the list, one period, repeated and started where it fits best.

    ``durations`` [s] are in order, None for a stick that the run does not have (it keeps its place).
    """
    if not published:
        return (None,) * len(durations)
    known = np.array([k for k, d in enumerate(durations) if d is not None], dtype=np.intp)
    lasting = np.array([d for d in durations if d is not None])
    printed, count = np.array(published), len(published)

    def misfit(shift: int) -> float:
        return float(np.sum(np.abs(lasting - printed[(known + shift) % count])))

    best = min(range(count), key=misfit)
    return tuple(None if d is None else published[(k + best) % count] for k, d in enumerate(durations))
