"""Errors of a run against the truth, its status, and the verdict on a run that is not right.

Times are compared as double-doubles: the truth is ``time + time_low``, and so is a run's time as far as the solver
provides it. A computed error may be below the truth's radius; it is kept, but ``digits`` never claims more than the
radius and the format of the times allow.

The verdict is a fault of the solver, or an ill-conditioned problem. A run at tolerance r is granted an error of
``e = r * size of the state`` in the state at any instant. The truth gives the effect of such an error on a transition:
it moves its time by ``conditioning * e``. If that is a large part of the distance to the next transition of the same
surface, the run cannot decide whether the two exist. On a parabola whose slope at its roots is h' and whose roots are a
gap apart, the surface function reaches a depth of ``h' * gap / 4``, and an error in the state moves it by
``conditioning * h' * e``: the pair of roots vanishes if ``conditioning * e >= gap / 4``. If a surface is nearly touched
without a transition, the distance itself is compared with e. If two transitions of different surfaces are closer than
the errors granted to both times, either may be the first.

At a singularity of the field, or if events accumulate, an error in the state moves the end by about its square root (by
Torricelli's law a level falls with its root). A run that ends likewise is granted that difference of the end time.

``not unique``: the run is right up to the instant from which on the exact run has several futures. ``not judged``: the
run is right up to the time limit (how far it comes depends on the machine); or it is right, but does not decide
anything about a surface that has transitions later; or it has none of the exact run's transitions, and the whole run is
within the rounding of its times; or nothing is known of the exact run after its start.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Literal

import numpy as np

from henon_ref.harness.score.matching import Matching, match, rounding
from henon_ref.harness.score.reference import Expected, ReferenceTransition
from henon_ref.trajectory import Event, Status, Trajectory, Transition

EARLY = ("diverged", "nonunique", "invalid")
"""Statuses with which a run may correctly end before the horizon."""
END_FRACTION = 1e-3
"""Largest distance of a correct early end from the truth's end, as a part of the run."""
FIXED_STEP_TOLERANCE = 1e-12
"""Tolerance that is assumed for a run without tolerances."""
PARABOLA_PART = 0.25
"""Part of the distance to its neighbour by which a transition has to move for the pair to vanish (a parabola)."""


@dataclass(frozen=True)
class Verdict:
    """A verdict with its reason."""

    word: Literal["right", "solver defect", "ill-conditioned", "not unique", "not judged"]
    basis: str = ""
    """Reason in one phrase; empty for ``right``."""


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
    elif (
        matching.cut_reference
        and not matching.pairs
        and expected.end_time - expected.start <= rounding(expected.end_time)
    ):
        words = "no transition is found, and the whole run is within the rounding of its times"
        judged = Verdict("not judged", words)
    else:
        judged = Verdict("right")
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


def granted_error(expected: Expected, tolerance: float | None) -> float:
    """Error in the state that a run at this tolerance is granted."""
    return (FIXED_STEP_TOLERANCE if tolerance is None else tolerance) * expected.scale


def verdict(expected: Expected, matching: Matching, run: Trajectory, *, tolerance: float | None) -> Verdict:
    """Verdict on a run that is not right, by its first missed or spurious transition.

    ``tolerance``: None for a fixed-step run.
    """
    if expected.nothing_known:
        return Verdict("not judged", "nothing is known of the exact run after its start")
    allowed, ended = granted_error(expected, tolerance), run.end_time
    missed = [expected.transitions[i].time for i in matching.missed[:1]]
    invented = [run.transitions[j].time for j in matching.spurious[:1]]
    where = min(missed + invented, default=None)
    if expected.status == "nonunique" and (where is None or where >= expected.end_time - allowed):
        return Verdict("not unique", f"from t = {expected.end_time:.9g} s on there are several futures")
    if run.status == "timeout" and (where is None or (where > ended and not invented)):
        return Verdict("not judged", f"right up to t = {ended:.9g} s, where the time limit stopped it")
    if where is None:
        # The error of a run grows up to its end: to 200 tolerances, as measured for BDF at 1e-12.
        allowed_time = math.sqrt(200.0 * allowed / expected.scale) * (expected.until - expected.start)
        if run.status == expected.status == "failed" and abs(ended - expected.end_time) <= allowed_time:
            basis = f"an error of its tolerances moves an end like that by {allowed_time:.1e} s: t = {ended:.9g} s"
            return Verdict("ill-conditioned", basis)
        return Verdict("solver defect", f"every transition is right, the end at t = {ended:.9g} s is not")
    if missed and missed[0] == where:
        fault = missed_verdict(expected, matching.missed[0], allowed)
    else:
        fault = spurious_verdict(expected, run.transitions[matching.spurious[0]], allowed)
    if fault.word == "solver defect" and missed and invented:
        return _order(expected, matching.missed[0], invented[0], allowed) or fault
    if fault.word == "solver defect" and where > ended:
        return Verdict("solver defect", f"right up to its end at t = {ended:.9g} s; then {fault.basis}")
    return fault


def missed_verdict(expected: Expected, index: int, allowed: float) -> Verdict:
    event = expected.transitions[index]
    what = f"{event.kind} at t = {event.time:.9g} s"
    if event.conditioning == float("inf"):
        return Verdict("ill-conditioned", f"{what} only touches: any error makes it two transitions or none")
    gap, moved = expected.gaps[index], event.conditioning * allowed
    basis = f"{what}: an error of {allowed:.1e} moves it by {moved:.1e} s, its neighbour is {gap:.1e} s away"
    if moved >= PARABOLA_PART * gap:
        return Verdict("ill-conditioned", basis)
    return _grazing(expected, event.time, gap, allowed) or Verdict("solver defect", basis)


def spurious_verdict(expected: Expected, event: Transition, allowed: float) -> Verdict:
    what = f"{event.kind} at t = {event.time:.9g} s"
    close, gap = expected.nearest(event.surface, event.time), expected.until - expected.start
    if close is not None:
        other, gap = expected.transitions[close], expected.gaps[close]
        reach = other.conditioning * allowed
        if reach >= PARABOLA_PART * gap:
            return Verdict(
                "ill-conditioned",
                f"{what}: an error of {allowed:.1e} moves the {other.kind} at t = {other.time:.9g} s by {reach:.1e} s",
            )
    if grazing := _grazing(expected, event.time, gap, allowed):
        return grazing
    nearest = expected.from_nearest_graze(event.time)
    no_graze = "the exact run comes close to no surface without reaching it"
    if nearest is not None:
        no_graze = f"the nearest near touch is {nearest:.1e} s away"
    return Verdict("solver defect", f"{what} is not there: an error of {allowed:.1e} is granted, and {no_graze}")


def _order(expected: Expected, index: int, invented: float, allowed: float) -> Verdict | None:
    """Verdict if within the granted error a missed transition and the one beside it, of another surface, may exchange.

    ``invented``: time of the run's first spurious transition [s].
    """
    event = expected.transitions[index]
    for other in (*expected.transitions[max(index - 1, 0) : index], *expected.transitions[index + 1 : index + 2]):
        gap, moved = abs(other.time - event.time), (event.conditioning + other.conditioning) * allowed
        if other.surface != event.surface and 0 < gap <= moved < math.inf and abs(invented - event.time) <= 2 * moved:
            both = f"{event.kind} at t = {event.time:.9g} s and {other.kind} at t = {other.time:.9g} s"
            basis = f"{both}: an error of {allowed:.1e} moves them by {moved:.1e} s, and either may be the first"
            return Verdict("ill-conditioned", basis)
    return None


def graze_distance(expected: Expected, index: int) -> float:
    """Distance of a transition from a graze [unit of the surface]: depth of the parabola to its neighbour's root."""
    event: ReferenceTransition = expected.transitions[index]
    return PARABOLA_PART * event.transversality * expected.gaps[index]


def _grazing(expected: Expected, where: float, gap: float, allowed: float) -> Verdict | None:
    """Verdict on a run that differs near a graze within the granted error; None if there is none."""
    graze = expected.closest_graze(where, gap)
    if graze is None or graze.distance > allowed:
        return None
    return Verdict(
        "ill-conditioned",
        f"at t = {graze.time:.9g} s the surface is {graze.distance:.1e} away, within an error of {allowed:.1e}",
    )
