"""Which checked cause explains a wrong run of a peer: CVODE called from C, diffsol, nosnoc, Octave, Siconos.

As in :mod:`henon_ref.campaign.causes`, which asks these rules after its own.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable

from henon_ref.campaign.seen_run import IN_FRONT, Seen
from henon_ref.rows import number

DIFFSOL = ("diffsol-tsit45", "diffsol-bdf")
NOT_FINITE = "the state is not finite"
EPSILON = sys.float_info.epsilon
LOST_SIGN = "the relay's sign is not that of the surface function"
ROUNDED = "which the rounding of a step moves as far"
NO_VALUE = re.compile(r"ZeroDivisionError|ValueError: math domain error")
"""What Python says of a function that has no value."""
OFF = 3.0
"""Steps by which siconos may be off with a time (the cause siconos-step sees less)."""
FIRST_STEP = 1e-9
"""First step of octave-ode45 in each mode, as a part of the run's length."""
NO_SOLUTION = 10.0
"""Steps in front of a blow-up of order one in which an implicit step has no solution: four, and what order 1 is off."""


def _diffsol(seen: Seen) -> str | None:
    """Words of diffsol's own, where the exact run ends or misses but the root in front of which they were said."""
    if seen.solver not in DIFFSOL or not seen.right_so_far:
        return None
    small = re.search(r"Step size is too small at time = ([-+.e\d]+)", seen.reason)
    if small:
        whole = number(seen.run.missed) == 0 and seen.run.expected_status in ("diverged", "failed", "invalid")
        return "diffsol-small-step" if whole or seen.misses_at(float(small[1])) else None
    if "Stop time is at the current state time" in seen.reason:
        return "diffsol-late"
    if seen.run.expected_status == "failed" and "went on past" in seen.reason and number(seen.run.missed) == 0:
        return "diffsol-stop-nan"
    return "diffsol-nan" if seen.solver == "diffsol-tsit45" and seen.reason.startswith(NOT_FINITE) else None


def _nosnoc(seen: Seen) -> str | None:
    """nosnoc without a solution of a step, out of time, or with a pair that one step has no room for."""
    if seen.solver != "nosnoc":
        return None
    if "IPOPT finds no step" in seen.reason and seen.right_so_far:
        return "nosnoc-infeasible"
    if seen.run.status == "timeout" and (seen.right_so_far or seen.run.found_transitions is None):
        return "nosnoc-cost"
    if seen.missed_pairs:
        return "nosnoc-grid"
    return "nosnoc-node" if _at_one_node(seen) else None


def _at_one_node(seen: Seen) -> bool:
    """Whether what goes wrong first are two surfaces that change at one instant where the exact run has one of them."""
    wrong = [row for row in seen.transitions if row.outcome in ("missed", "spurious")]
    extra = [row for row in wrong if row.outcome == "spurious"][:2]
    if seen.run.status != "wrong" or len(extra) < 2 or extra[0].surface == extra[1].surface:
        return False
    node, within = number(extra[0].time_s), IN_FRONT * number(seen.run.rtol)
    missed = [number(row.reference_time_s) for row in wrong if row.outcome == "missed"][:1]
    return number(extra[1].time_s) == node and any(abs(time - node) <= within for time in missed)


def _late_end(seen: Seen) -> str | None:
    """The exact run ends because a function has no value any more: CVODE's steps become shorter until it gives up."""
    failed = seen.run.expected_status == "failed" and "; failed at t = " in seen.reason
    invalid = seen.run.expected_status == "invalid" and "CV_TOO_MUCH_WORK" in seen.reason
    right = seen.right_so_far and number(seen.run.missed) == 0
    return "cvode-c-late-end" if seen.solver.startswith("cvode-c-") and (failed or invalid) and right else None


def _lone_root(seen: Seen) -> str | None:
    """The first root is missed and no sign has changed up to the horizon: another root lay in the same step.

    The exact run slides from the first one on and has no second one; the smooth run without a mode change has.
    """
    only = number(seen.run.missed) == 1 and number(seen.run.found_transitions) == 0
    slid = only and any(row.outcome == "missed" and row.kind == "stick" for row in seen.transitions)
    past = seen.run.status == "wrong" and "went on past" in seen.reason
    return "cvode-c-pair" if seen.solver.startswith("cvode-c-") and slid and past else None


def _error_of_a_run(seen: Seen) -> str | None:
    """Nothing is missed, and what is spurious leads there and back, on the surface by CVODE's own solution."""
    extra = [row for row in seen.transitions if row.outcome == "spurious"]
    back = len(extra) > 0 and all(
        there.from_mode == back.to_mode and there.to_mode == back.from_mode
        for there, back in zip(extra[::2], extra[1::2], strict=False)
    )
    whole = seen.run.status == "wrong" and number(seen.run.missed) == 0 and len(extra) % 2 == 0
    crossed = number(seen.run.max_surface_drift) < number(seen.run.atol)
    return "cvode-c-error" if seen.solver.startswith("cvode-c-") and whole and back and crossed else None


def _octave(seen: Seen) -> str | None:
    """A blow-up that ode45 has no word for, a guard without a value, and events on a straight line."""
    if seen.solver != "octave-ode45":
        return None
    if "ode45 ended at" in seen.reason and seen.right_so_far:
        pole = seen.misses_at(number(seen.run.end_time_s))
        if seen.run.expected_status == "diverged" or pole:
            return "octave-blow-up"
    if seen.run.expected_status == "failed" and "went on past" in seen.reason and seen.right_so_far:
        return "octave-nan"
    if seen.reason.startswith(NOT_FINITE) and seen.right_so_far:
        return "octave-nan-state"
    if _in_first_step(seen):
        return "octave-first-step"
    return "octave-line" if seen.run.status == "wrong" and _off_by_location(seen) else None


def _in_first_step(seen: Seen) -> bool:
    """Whether the first transition that is missed comes within the first step after the one before it, or after zero.

    That step is a part of the run's length, which ends at its horizon: it went on to there.
    """
    if seen.run.status != "wrong" or not seen.right_so_far:
        return False
    before = 0.0
    for row in seen.transitions:
        time = number(row.reference_time_s)
        if row.outcome == "missed":
            return 0.0 < time - before <= FIRST_STEP * number(seen.run.end_time_s)
        before = time
    return False


def _off_by_location(seen: Seen) -> bool:
    """Whether a time is off by more than the errors of all steps make of it.

    Step-size control grants each accepted step the absolute tolerance, so that together they move a transition by
    ``steps * atol * conditioning`` at most; the time itself is rounded in each. What is beyond that is the location's.
    """
    steps, atol = number(seen.run.steps), number(seen.run.atol)
    return any(
        row.time_error_s is not None
        and row.conditioning is not None
        and abs(row.time_error_s) > steps * (atol * row.conditioning + EPSILON * abs(number(row.reference_time_s)))
        for row in seen.transitions
        if row.outcome == "matched"
    )


def _time_stepping(seen: Seen) -> str | None:
    """What begins and ends within a step is not there, what comes within some steps behind the horizon may be; steps
    of one length take long, and go on over a blow-up.
    """
    if seen.solver != "siconos":
        return None
    if LOST_SIGN in seen.reason:
        return "siconos-rounding" if ROUNDED in seen.reason else "siconos-steep"
    slow = seen.run.status == "timeout" and seen.right_so_far
    if seen.missed_pairs or slow or _within_a_step(seen) or _at_the_end(seen) or _a_step_early(seen):
        return "siconos-step"
    if _over_the_end(seen):
        return "siconos-no-solution"
    return "siconos-damping" if _runs_away(seen) else None


def _within_a_step(seen: Seen) -> bool:
    """Whether nothing is wrong but that transitions within one step are missed."""
    times = [number(row.reference_time_s) for row in seen.transitions if row.outcome == "missed"]
    alone = seen.run.status == "wrong" and seen.run.expected_status == "ok" and seen.right_so_far
    return alone and len(times) > 1 and max(times) - min(times) <= number(seen.run.step_s)


def _runs_away(seen: Seen) -> bool:
    """Whether no transition is missed, the first is in time, and the last of them is off by more than some steps."""
    errors = [abs(number(row.time_error_s)) for row in seen.transitions if row.outcome == "matched"]
    bound = OFF * number(seen.run.step_s)
    right = seen.run.status == "wrong" and seen.run.expected_status == "ok" and number(seen.run.missed) == 0
    return right and len(errors) > 1 and errors[0] <= bound < errors[-1]


def _a_step_early(seen: Seen) -> bool:
    """Whether a function has no value in the very step in which the model ends, all before that being right."""
    ended = seen.run.status == "failed" and seen.run.expected_status == "invalid"
    return (
        ended and NO_VALUE.match(seen.reason) is not None and number(seen.run.missed) == number(seen.run.spurious) == 0
    )


def _at_the_end(seen: Seen) -> bool:
    """Whether nothing is wrong but transitions within the error of a time in front of the horizon."""
    extra = [row for row in seen.transitions if row.outcome == "spurious"]
    first = number(seen.run.end_time_s) - OFF * number(seen.run.step_s)
    right = seen.run.status == "wrong" and seen.run.expected_status == "ok" and number(seen.run.missed) == 0
    return right and len(extra) > 0 and all(number(row.time_s) >= first for row in extra)


def _over_the_end(seen: Seen) -> bool:
    """Whether the run goes on past a blow-up, and nothing is wrong but what comes within some steps of it or behind."""
    past = re.search(r"went on past t = ([-+.e\d]+),", seen.reason)
    if seen.run.expected_status != "diverged" or past is None or number(seen.run.missed) > 0:
        return False
    first = float(past[1]) - NO_SOLUTION * number(seen.run.step_s)
    times = [row.time_s for row in seen.transitions if row.outcome == "spurious"]
    return all(time is not None and time >= first for time in times)


PEER_RULES: tuple[Callable[[Seen], str | None], ...] = (
    _diffsol,
    _nosnoc,
    _late_end,
    _lone_root,
    _error_of_a_run,
    _octave,
    _time_stepping,
)
PEER_NAMES = (
    "cvode-c-late-end", "cvode-c-error", "octave-blow-up", "octave-nan", "octave-line", "octave-nan-state",
    "octave-first-step", "diffsol-small-step", "diffsol-nan", "diffsol-late", "diffsol-stop-nan", "nosnoc-infeasible",
    "nosnoc-cost", "nosnoc-grid", "nosnoc-node", "siconos-step", "siconos-no-solution", "siconos-steep",
    "siconos-rounding", "siconos-damping",
)  # fmt: skip
"""Every name that a rule of these may give."""
