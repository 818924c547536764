"""Verdict on a run that is not right: fault of the solver, or an ill-conditioned problem.

A run at tolerance r is granted an error of ``e = r * size of the state`` in the state at any instant. The truth gives
the effect of such an error on a transition: it moves its time by ``conditioning * e``. If that is a large part of the
distance to the next transition of the same surface, the run cannot decide whether the two exist. On a parabola whose
slope at its roots is h' and whose roots are a gap apart, the surface function reaches a depth of ``h' * gap / 4``, and
an error in the state moves it by ``conditioning * h' * e``: the pair of roots vanishes if ``conditioning * e >=
gap / 4``. If a surface is nearly touched without a transition, the distance itself is compared with e.

At a singularity of the field, or if events accumulate, an error in the state moves the end by about its square root (by
Torricelli's law a level falls with its root). A run that ends likewise is granted that difference of the end time.

``not unique``: the run is right up to the instant from which on the exact run has several futures. ``not judged``: the
run is right up to the time limit (how far it comes depends on the machine); or it is right, but does not decide
anything about a surface that has transitions later; or nothing is known of the exact run after its start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from henon_ref.harness.score.matching import Matching
from henon_ref.harness.score.reference import Expected, ReferenceTransition
from henon_ref.trajectory import Trajectory, Transition

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


RIGHT = Verdict("right")


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
        if fault.word == "solver defect" and where > ended and not invented:
            return Verdict("solver defect", f"right up to its end at t = {ended:.9g} s; then {fault.basis}")
        return fault
    return spurious_verdict(expected, run.transitions[matching.spurious[0]], allowed)


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
