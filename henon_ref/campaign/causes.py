"""Which checked cause explains a run that is wrong by its solver's fault.

The causes are in :mod:`baselines.causes`, a minimal run of the library alone each. Here is only when one of them is
the reason of a row: where the row itself leaves no other. Where it does, the row stays unexplained.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence

from henon_ref.campaign.seen_run import Seen, number
from henon_ref.columns import Row

EXPLAINED = ("solver defect", "not judged")
"""Verdicts on runs that a cause may explain: one that was too slow may be so for a known reason."""
PAIR_BY_PACKAGE = {"cvode-adams": "cvode-pair", "cvode-bdf": "cvode-pair", "ida": "ida-pair"}
SCIPY = ("scipy-rk45", "scipy-dop853", "scipy-radau", "scipy-bdf", "scipy-lsoda")
PAIR_BY_PACKAGE |= {"cvode-c-adams": "cvode-c-pair", "cvode-c-bdf": "cvode-c-pair", "octave-ode45": "octave-pair"}
PAIR_BY_PACKAGE |= dict.fromkeys(SCIPY, "scipy-pair")
DIFFRAX = ("diffrax-dopri8", "diffrax-kvaerno5")
DIFFSOL = ("diffsol-tsit45", "diffsol-bdf")
PAIR_BY_PACKAGE |= dict.fromkeys(DIFFRAX, "diffrax-pair") | dict.fromkeys(DIFFSOL, "diffsol-pair")
EPSILON = sys.float_info.epsilon
NO_BRACKET = "The root is not contained in [lower, upper]"
NO_CONVERGENCE = "Failed to converge after"
TOO_SMALL = "Required step size is less than spacing between numbers"
NOT_FINITE = "the state is not finite"
LATE = 1e8
"""Times [s] from which ten roundings are 1e-7 and more."""
LOST = 1e-15
"""A surface function that goes no deeper than this part of the state's size between two roots is in its rounding."""
IN_FRONT = 1000.0
"""Tolerances that a run's error stays below where nothing locates its end: BDF's is 200 of them at 1e-12."""
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
SMOOTHED_BAND = 2000.0
"""Half-width of the band of ``scipy-smoothed`` in absolute tolerances (:mod:`baselines.scipy_naive`)."""


def cause_of(run: Row, transitions: Sequence[Row]) -> str | None:
    """Name of the cause of a run that is wrong or too slow; None where none is known for certain."""
    if run["verdict"] not in EXPLAINED:
        return None
    seen = Seen(run, transitions)
    return next((name for rule in RULES if (name := rule(seen)) is not None), None)


def _restart(seen: Seen) -> str | None:
    """A restart that keeps no root out: the library stops where it starts, or loses the next root."""
    if seen.restart == "none" and ("accumulate" in seen.reason or NO_BRACKET in seen.reason):
        fires = {"heyoka": "heyoka-start"} | dict.fromkeys(SCIPY, "scipy-fires-at-start")
        return (fires | dict.fromkeys(DIFFRAX, "diffrax-start")).get(seen.solver)
    if seen.restart == "direction" and seen.solver == "heyoka" and "stepped over" in seen.reason:
        return "heyoka-start"
    return None


def _pair(seen: Seen) -> str | None:
    """Signs are compared at the ends of a step: a pair that is missed, and nothing else before it, lay in one step.

    So did the two roots of an impact that is missed: the driver ends a run at whose stops a guard is negative.
    """
    return PAIR_BY_PACKAGE.get(seen.solver) if seen.missed_pairs or seen.first_missed else None


def _heyoka_pair(seen: Seen) -> str | None:
    """heyoka isolates all roots of a polynomial: what it misses is a double root to it, or not in the polynomial."""
    if seen.solver != "heyoka" or not seen.missed_pairs:
        return None
    if seen.depth <= LOST:
        return "heyoka-double-root"
    slept = all(row["kind"] == "release" for group in seen.missed_pairs for row in group[:1])
    return "heyoka-hidden-drive" if slept else None


def _heyoka_polynomial(seen: Seen) -> str | None:
    """The first root of a run is stepped over: there was no restart to lose it."""
    first = seen.number("matched") == 0 and seen.number("missed") == 1
    return "heyoka-event-polynomial" if seen.solver == "heyoka" and "stepped over" in seen.reason and first else None


def _bracket(seen: Seen) -> str | None:
    return "scipy-bracket" if seen.solver in SCIPY and "must have different signs" in seen.reason else None


def _flat_root(seen: Seen) -> str | None:
    """brentq's iterations are used up: at a root at which the surface function has no slope."""
    scipy = seen.solver in (*SCIPY, "scipy-smoothed", "scipy-sign")
    return "scipy-flat-root" if scipy and NO_CONVERGENCE in seen.reason else None


def _small_step(seen: Seen) -> str | None:
    """SciPy's words for a step below ten roundings of the time: at a late time, at a blow-up, in front of an end."""
    if seen.solver not in SCIPY or TOO_SMALL not in seen.reason or not seen.right_so_far:
        return None
    if seen.run["expected_status"] == "diverged":
        return "scipy-blow-up"
    if abs(seen.number("end_time_s")) >= LATE:
        return "scipy-late"
    return None


def _pole(seen: Seen) -> str | None:
    """Steps that no longer move the time in front of an event, or of the model's end: nothing has a value behind it."""
    stuck = "does not advance" in seen.reason if seen.solver in DIFFRAX else TOO_SMALL in seen.reason
    if seen.solver not in (*SCIPY, *DIFFRAX) or not stuck or not seen.right_so_far:
        return None
    ends = seen.run["expected_status"] == "invalid" and seen.number("missed") == 0
    there = ends or _in_front(seen, seen.number("end_time_s"))
    return ("diffrax-pole" if seen.solver in DIFFRAX else "scipy-pole") if there else None


def _diffsol(seen: Seen) -> str | None:
    """Words of diffsol's own, where the exact run ends or misses but the root in front of which they were said."""
    if seen.solver not in DIFFSOL or not seen.right_so_far:
        return None
    small = re.search(r"Step size is too small at time = ([-+.e\d]+)", seen.reason)
    if small:
        whole = seen.number("missed") == 0 and seen.run["expected_status"] in ("diverged", "failed", "invalid")
        return "diffsol-small-step" if whole or _in_front(seen, float(small[1])) else None
    if "Stop time is at the current state time" in seen.reason:
        return "diffsol-late"
    if seen.run["expected_status"] == "failed" and "went on past" in seen.reason and seen.number("missed") == 0:
        return "diffsol-stop-nan"
    return "diffsol-nan" if seen.solver == "diffsol-tsit45" and seen.reason.startswith(NOT_FINITE) else None


def _in_front(seen: Seen, time: float) -> bool:
    """Whether the first transition that is missed is where the run ended: a pole behind its surface."""
    roots = [row["reference_time_s"] for row in seen.transitions if row["outcome"] == "missed"][:1]
    return any(isinstance(root, float) and abs(root - time) <= IN_FRONT * seen.number("rtol") for root in roots)


def _nosnoc(seen: Seen) -> str | None:
    """nosnoc without a solution of a step, out of time, or with a pair that one step has no room for."""
    if seen.solver != "nosnoc":
        return None
    if "IPOPT finds no step" in seen.reason and seen.right_so_far:
        return "nosnoc-infeasible"
    if seen.run["status"] == "timeout" and (seen.right_so_far or seen.run["found_transitions"] is None):
        return "nosnoc-cost"
    if seen.missed_pairs:
        return "nosnoc-grid"
    return "nosnoc-node" if _at_one_node(seen) else None


def _at_one_node(seen: Seen) -> bool:
    """Whether what goes wrong first are two surfaces that change at one instant where the exact run has one of them."""
    wrong = [row for row in seen.transitions if row["outcome"] in ("missed", "spurious")]
    extra = [row for row in wrong if row["outcome"] == "spurious"][:2]
    if seen.run["status"] != "wrong" or len(extra) < 2 or extra[0]["surface"] == extra[1]["surface"]:
        return False
    node, within = number(extra[0], "time_s"), IN_FRONT * seen.number("rtol")
    missed = [number(row, "reference_time_s") for row in wrong if row["outcome"] == "missed"][:1]
    return number(extra[1], "time_s") == node and any(abs(time - node) <= within for time in missed)


def _slow(seen: Seen) -> str | None:
    """Right as far as it came at a tight tolerance, and out of time."""
    tight = seen.number("rtol") <= 1e-9
    if seen.run["status"] != "timeout" or not tight or not (seen.right_so_far and seen.number("steps") > 1000):
        return None
    return {"scipy-radau": "scipy-radau-order", "scipy-bdf": "scipy-bdf-order"}.get(seen.solver)


def _no_number(seen: Seen) -> str | None:
    """LSODA alone, which ``scipy-smoothed`` uses, too, accepts a step to a state that is no number."""
    lsoda = seen.solver in ("scipy-lsoda", "scipy-smoothed")
    return "scipy-lsoda-nan" if lsoda and seen.reason.startswith(NOT_FINITE) and seen.right_so_far else None


def _past_the_end(seen: Seen) -> str | None:
    """The exact run ends because a function has no value any more; heyoka goes on, all before that being right."""
    ended = seen.run["expected_status"] == "failed" and "went on past" in seen.reason
    right = seen.right_so_far and seen.number("missed") == 0
    return "heyoka-past-end" if seen.solver == "heyoka" and ended and right else None


def _late_end(seen: Seen) -> str | None:
    """The exact run ends because a function has no value any more: CVODE's steps become shorter until it gives up."""
    failed = seen.run["expected_status"] == "failed" and "; failed at t = " in seen.reason
    invalid = seen.run["expected_status"] == "invalid" and "CV_TOO_MUCH_WORK" in seen.reason
    right = seen.right_so_far and seen.number("missed") == 0
    return "cvode-c-late-end" if seen.solver.startswith("cvode-c-") and (failed or invalid) and right else None


def _lone_root(seen: Seen) -> str | None:
    """The first root is missed and no sign has changed up to the horizon: another root lay in the same step.

    The exact run slides from the first one on and has no second one; the smooth run without a mode change has.
    """
    only = seen.number("missed") == 1 and seen.number("found_transitions") == 0
    slid = only and any(row["outcome"] == "missed" and row["kind"] == "stick" for row in seen.transitions)
    past = seen.run["status"] == "wrong" and "went on past" in seen.reason
    return "cvode-c-pair" if seen.solver.startswith("cvode-c-") and slid and past else None


def _error_of_a_run(seen: Seen) -> str | None:
    """Nothing is missed, and what is spurious leads there and back, on the surface by CVODE's own solution."""
    extra = [row for row in seen.transitions if row["outcome"] == "spurious"]
    back = len(extra) > 0 and all(
        there["from_mode"] == back["to_mode"] and there["to_mode"] == back["from_mode"]
        for there, back in zip(extra[::2], extra[1::2], strict=False)
    )
    whole = seen.run["status"] == "wrong" and seen.number("missed") == 0 and len(extra) % 2 == 0
    crossed = seen.number("max_surface_drift") < seen.number("atol")
    return "cvode-c-error" if seen.solver.startswith("cvode-c-") and whole and back and crossed else None


def _octave(seen: Seen) -> str | None:
    """A blow-up that ode45 has no word for, a guard without a value, and events on a straight line."""
    if seen.solver != "octave-ode45":
        return None
    if "ode45 ended at" in seen.reason and seen.right_so_far:
        pole = _in_front(seen, seen.number("end_time_s"))
        if seen.run["expected_status"] == "diverged" or pole:
            return "octave-blow-up"
    if seen.run["expected_status"] == "failed" and "went on past" in seen.reason and seen.right_so_far:
        return "octave-nan"
    if seen.reason.startswith(NOT_FINITE) and seen.right_so_far:
        return "octave-nan-state"
    if _in_first_step(seen):
        return "octave-first-step"
    return "octave-line" if seen.run["status"] == "wrong" and _off_by_location(seen) else None


def _in_first_step(seen: Seen) -> bool:
    """Whether the first transition that is missed comes within the first step after the one before it, or after zero.

    That step is a part of the run's length, which ends at its horizon: it went on to there.
    """
    if seen.run["status"] != "wrong" or not seen.right_so_far:
        return False
    before = 0.0
    for row in seen.transitions:
        time = number(row, "reference_time_s")
        if row["outcome"] == "missed":
            return 0.0 < time - before <= FIRST_STEP * seen.number("end_time_s")
        before = time
    return False


def _off_by_location(seen: Seen) -> bool:
    """Whether a time is off by more than the errors of all steps make of it.

    Step-size control grants each accepted step the absolute tolerance, so that together they move a transition by
    ``steps * atol * conditioning`` at most; the time itself is rounded in each. What is beyond that is the location's.
    """
    steps, atol = seen.number("steps"), seen.number("atol")
    return any(
        isinstance(error := row.get("time_error_s"), float)
        and isinstance(conditioning := row.get("conditioning"), float)
        and abs(error) > steps * (atol * conditioning + EPSILON * abs(number(row, "reference_time_s")))
        for row in seen.transitions
        if row["outcome"] == "matched"
    )


def _time_stepping(seen: Seen) -> str | None:
    """What begins and ends within a step is not there, what comes within some steps behind the horizon may be; steps
    of one length take long, and go on over a blow-up.
    """
    if seen.solver != "siconos":
        return None
    if LOST_SIGN in seen.reason:
        return "siconos-rounding" if ROUNDED in seen.reason else "siconos-steep"
    slow = seen.run["status"] == "timeout" and seen.right_so_far
    if seen.missed_pairs or slow or _within_a_step(seen) or _at_the_end(seen) or _a_step_early(seen):
        return "siconos-step"
    if _over_the_end(seen):
        return "siconos-no-solution"
    return "siconos-damping" if _runs_away(seen) else None


def _runs_away(seen: Seen) -> bool:
    """Whether no transition is missed, the first is in time, and the last of them is off by more than some steps."""
    errors = [abs(number(row, "time_error_s")) for row in seen.transitions if row["outcome"] == "matched"]
    bound = OFF * seen.number("step_s")
    right = seen.run["status"] == "wrong" and seen.run["expected_status"] == "ok" and seen.number("missed") == 0
    return right and len(errors) > 1 and errors[0] <= bound < errors[-1]


def _a_step_early(seen: Seen) -> bool:
    """Whether a function has no value in the very step in which the model ends, all before that being right."""
    ended = seen.run["status"] == "failed" and seen.run["expected_status"] == "invalid"
    return ended and NO_VALUE.match(seen.reason) is not None and seen.number("missed") == seen.number("spurious") == 0


def _within_a_step(seen: Seen) -> bool:
    """Whether nothing is wrong but that transitions within one step are missed."""
    times = [number(row, "reference_time_s") for row in seen.transitions if row["outcome"] == "missed"]
    alone = seen.run["status"] == "wrong" and seen.run["expected_status"] == "ok" and seen.right_so_far
    return alone and len(times) > 1 and max(times) - min(times) <= seen.number("step_s")


def _at_the_end(seen: Seen) -> bool:
    """Whether nothing is wrong but transitions within the error of a time in front of the horizon."""
    extra = [row for row in seen.transitions if row["outcome"] == "spurious"]
    first = seen.number("end_time_s") - OFF * seen.number("step_s")
    right = seen.run["status"] == "wrong" and seen.run["expected_status"] == "ok" and seen.number("missed") == 0
    return right and len(extra) > 0 and all(number(row, "time_s") >= first for row in extra)


def _over_the_end(seen: Seen) -> bool:
    """Whether the run goes on past a blow-up, and nothing is wrong but what comes within some steps of it or behind."""
    past = re.search(r"went on past t = ([-+.e\d]+),", seen.reason)
    if seen.run["expected_status"] != "diverged" or past is None or seen.number("missed") > 0:
        return False
    first = float(past[1]) - NO_SOLUTION * seen.number("step_s")
    times = [row["time_s"] for row in seen.transitions if row["outcome"] == "spurious"]
    return all(isinstance(time, float) and time >= first for time in times)


def _naive(seen: Seen) -> str | None:
    if seen.solver == "scipy-sign" and "the budget of" in seen.reason and seen.run["status"] == "failed":
        return "sign-chatter"
    within = seen.solver == "scipy-smoothed" and seen.depth <= SMOOTHED_BAND * seen.number("atol")
    return "smoothed-creep" if within and seen.missed_pairs else None


RULES: tuple[Callable[[Seen], str | None], ...] = (
    _restart,
    _pair,
    _heyoka_pair,
    _heyoka_polynomial,
    _bracket,
    _flat_root,
    _small_step,
    _pole,
    _diffsol,
    _nosnoc,
    _slow,
    _no_number,
    _past_the_end,
    _late_end,
    _lone_root,
    _error_of_a_run,
    _octave,
    _time_stepping,
    _naive,
)
NAMES = (
    "scipy-pair", "cvode-pair", "ida-pair", "scipy-fires-at-start", "scipy-bracket", "scipy-flat-root", "scipy-late",
    "scipy-pole", "diffrax-pole",
    "scipy-blow-up", "scipy-radau-order", "scipy-bdf-order", "scipy-lsoda-nan", "heyoka-start", "heyoka-double-root",
    "heyoka-hidden-drive", "heyoka-event-polynomial", "heyoka-past-end", "sign-chatter", "smoothed-creep",
    "cvode-c-pair", "cvode-c-late-end", "cvode-c-error", "octave-pair", "octave-blow-up", "octave-nan", "octave-line",
    "octave-nan-state", "octave-first-step",
    "diffrax-pair", "diffrax-start", "diffsol-pair", "diffsol-small-step", "diffsol-nan", "diffsol-late",
    "diffsol-stop-nan",
    "nosnoc-infeasible", "nosnoc-cost", "nosnoc-grid", "nosnoc-node",
    "siconos-step", "siconos-no-solution", "siconos-steep", "siconos-rounding", "siconos-damping",
)  # fmt: skip
"""Every name that a rule may give."""
