"""Errors of a run against the truth, and the status and verdict that follow.

Times are compared as double-doubles: the truth is ``time + time_low``, and so is a run's time as far as the solver
provides it. A computed error may be below the truth's radius; it is kept, but ``digits`` never claims more than the
radius and the format of the times allow.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np

from henon_ref.harness.score.matching import Matching, match
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.score.verdict import FIXED_STEP_TOLERANCE, RIGHT, Verdict, verdict
from henon_ref.trajectory import Event, Status, Trajectory

EARLY = ("diverged", "nonunique", "invalid")
"""Statuses with which a run may correctly end before the horizon."""
END_FRACTION = 1e-3
"""Largest distance of a correct early end from the truth's end, as a part of the run."""


@dataclass(frozen=True)
class Score:
    """Score of a run against the truth; None for quantities that have nothing to be measured on."""

    matching: Matching
    status: Status
    reason: str
    verdict: Verdict
    """Classification of a wrong run: fault of the solver, or of the problem."""
    time_errors: dict[int, float]
    """Reference index -> signed time error [s], grazes included."""
    max_time_error: float | None
    rms_time_error: float | None
    max_state_error: float | None
    digits: float | None
    """Decimal digits of the worst transition time, counted from the case's unit of time."""


def time_error(event: Event, reference: Event) -> float:
    """Signed time error [s] of two compensated times; the leading parts cancel exactly (Sterbenz)."""
    return (event.time - reference.time) + (event.time_low - reference.time_low)


def score(trajectory: Trajectory, expected: Expected, *, tolerance: float | None) -> Score:
    """Match a run with the truth and compute its errors; ``tolerance``: relative, None for a fixed-step run."""
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
    errors = {
        i: time_error(trajectory.transitions[j], expected.transitions[i])
        for i, j in matching.pairs + matching.touch_pairs
    }
    counted = np.array([errors[i] for i, _ in matching.pairs])
    worst = float(np.max(np.abs(counted))) if counted.size else None
    status, reason, right = _status(trajectory, expected, matching, reached)
    if not right:
        judged = verdict(expected, matching, trajectory, tolerance=tolerance)
    elif left_out is not None:
        event = expected.transitions[left_out]
        words = f"nothing is decided of the surface of the {event.kind} at t = {event.time:.9g} s"
        judged = Verdict("not judged", words)
    else:
        judged = RIGHT
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
    """Transitions to be matched, by index, and the first omitted transition that changes a mode.

    ``since``: surface -> time [s] after which the run may lack transitions of it. Later transitions of the surface are
    omitted, and its entries in the modes of later transitions of other surfaces are set to 0.
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
    """Correct decimal digits for an error, at most those that the truth's radius and double precision allow."""
    return -math.log10(max(abs(error), expected.floor) / expected.time_unit)


def _last_scored(expected: Expected) -> float:
    """The last instant [s] at which a transition of a run is scored."""
    if expected.partial:
        return expected.end_time
    if expected.status == "ok":
        return math.inf
    return expected.end_time + END_FRACTION * (expected.until - expected.start)


def _end_slack(expected: Expected, tolerance: float | None) -> float:
    """Time before the end [s] in which transitions of a run at this tolerance are not counted against it."""
    fraction = FIXED_STEP_TOLERANCE if tolerance is None else tolerance
    if expected.status == "failed":  # transitions that accumulate at the end may be left out
        fraction = max(fraction, 1e-6)
    return fraction * (expected.until - expected.start)


def _state_error(trajectory: Trajectory, expected: Expected, matching: Matching) -> float | None:
    worst: float | None = None
    for i, j in matching.pairs:
        exact = [float(value) for value in expected.transitions[i].state]
        error = max((abs(a - b) for a, b in zip(trajectory.transitions[j].state, exact, strict=False)), default=None)
        if error is not None and not math.isnan(error):
            worst = error if worst is None else max(worst, error)
    return worst


def _status(trajectory: Trajectory, expected: Expected, matching: Matching, reached: bool) -> tuple[Status, str, bool]:
    """Status of a run after scoring, the reason in one sentence, and whether the run is right.

    ``reached``: the run reached the end of the known truth, regardless of its status.
    """
    status, reason = trajectory.status, trajectory.reason
    if expected.nothing_known:
        return status, reason, False
    if expected.partial and reached:
        return (status, reason, True) if matching.exact else ("wrong", _edits(matching, expected), False)
    if status not in ("ok", *EARLY, expected.status):  # the run was stopped before its own end
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
    """Count of missed and spurious transitions, and the first missed one, for messages."""
    words = [f"{len(matching.missed)} missed", f"{len(matching.spurious)} spurious"]
    if matching.missed:
        event = expected.transitions[matching.missed[0]]
        words.append(f"first missed: {event.kind} at t = {event.time:.9g}")
    return ", ".join(words)


def published_partners(durations: Sequence[float | None], published: Sequence[float]) -> tuple[float | None, ...]:
    """Assign published durations to sticks: the list, one period, is repeated with the shift that fits best.

    ``durations`` [s] are in order; None for a stick that the run does not have (it still counts as a position).
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
