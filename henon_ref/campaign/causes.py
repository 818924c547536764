"""Which checked cause explains a run that is wrong by its solver's fault.

The causes are in :mod:`baselines.causes`, a minimal run of the library alone each. Here is only when one of them is
the reason of a row: where the row itself leaves no other. Where it does, the row stays unexplained.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from itertools import groupby

from henon_ref.campaign.causes_of_peers import DIFFSOL, NOT_FINITE, PEER_NAMES, PEER_RULES
from henon_ref.campaign.seen_run import Seen, number
from henon_ref.columns import Row

EXPLAINED = ("solver defect", "not judged")
"""Verdicts on runs that a cause may explain: one that was too slow may be so for a known reason."""
PAIR_BY_PACKAGE = {"cvode-adams": "cvode-pair", "cvode-bdf": "cvode-pair", "ida": "ida-pair"}
SCIPY = ("scipy-rk45", "scipy-dop853", "scipy-radau", "scipy-bdf", "scipy-lsoda")
PAIR_BY_PACKAGE |= {"cvode-c-adams": "cvode-c-pair", "cvode-c-bdf": "cvode-c-pair", "octave-ode45": "octave-pair"}
PAIR_BY_PACKAGE |= dict.fromkeys(SCIPY, "scipy-pair")
DIFFRAX = ("diffrax-dopri8", "diffrax-kvaerno5")
PAIR_BY_PACKAGE |= dict.fromkeys(DIFFRAX, "diffrax-pair") | dict.fromkeys(DIFFSOL, "diffsol-pair")
NO_BRACKET = "The root is not contained in [lower, upper]"
NO_CONVERGENCE = "Failed to converge after"
TOO_SMALL = "Required step size is less than spacing between numbers"
ENDED = re.compile(r"failed at t = (\S+), not at (\S+)$")
"""What is said of a run that ends as it should, but elsewhere."""
LATE = 1e8
"""Times [s] from which ten roundings are 1e-7 and more."""
LOST = 1e-15
"""A surface function that goes no deeper than this part of the state's size between two roots is in its rounding."""
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


def _pair_around_an_event(seen: Seen) -> str | None:
    """The first of two roots is stepped over where another surface's event stops the library between them."""
    between = seen.stopped_between
    if not between:
        return None
    if seen.solver == "heyoka":
        depth = max((float(row["graze_distance"]) for row in between), default=math.inf)  # type: ignore[arg-type]
        return "heyoka-double-root" if depth <= LOST else None
    return PAIR_BY_PACKAGE.get(seen.solver)


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
    there = ends or seen.misses_at(seen.number("end_time_s"))
    return ("diffrax-pole" if seen.solver in DIFFRAX else "scipy-pole") if there else None


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
    late = ENDED.search(seen.reason)
    past = "went on past" in seen.reason or (late is not None and float(late[1]) > float(late[2]))
    ended = seen.run["expected_status"] == "failed" and past
    right = seen.right_so_far and seen.number("missed") == 0
    return "heyoka-past-end" if seen.solver == "heyoka" and ended and right else None


def _naive(seen: Seen) -> str | None:
    if seen.solver == "scipy-sign" and "the budget of" in seen.reason and seen.run["status"] == "failed":
        return "sign-chatter"
    if seen.solver != "scipy-smoothed":
        return None
    within = seen.depth <= SMOOTHED_BAND * seen.number("atol") and seen.missed_pairs
    if within or _smoothed_into_one(seen):
        return "smoothed-creep"
    return "smoothed-late" if _released_late(seen) else None


def _released_late(seen: Seen) -> bool:
    """Whether each surface has all its transitions, and their order among surfaces alone is wrong, by late releases."""
    wrong = [row for row in seen.transitions if row["outcome"] in ("missed", "spurious")]
    delays: dict[bool, list[float]] = {True: [], False: []}
    for surface in {row["surface"] for row in wrong}:
        own = [row for row in wrong if row["surface"] == surface]
        exact, found = ([row for row in own if row["outcome"] == what] for what in ("missed", "spurious"))
        if [row["kind"] for row in exact] != [row["kind"] for row in found]:
            return False
        for there, here in zip(exact, found, strict=True):
            delays[there["kind"] == "release"].append(number(here, "time_s") - number(there, "reference_time_s"))
    late, others = delays[True], delays[False]
    latest = max(late, default=0.0)
    return seen.run["status"] == "wrong" and min(late, default=0.0) > 0.0 and all(abs(d) < latest for d in others)


def _smoothed_into_one(seen: Seen) -> bool:
    """Whether all that is wrong are two transitions of a surface in a row that are found as one, which smoothing hides.

    It leads where they lead, and the surface function stays within the band between them.
    """
    rows = [row for row in seen.transitions if row["outcome"] != "touch"]
    groups = [list(own) for right, own in groupby(rows, lambda row: row["outcome"] == "matched") if not right]
    return seen.run["status"] == "wrong" and bool(groups) and all(_one_for_two(seen, own) for own in groups)


def _one_for_two(seen: Seen, rows: Sequence[Row]) -> bool:
    missed = [row for row in rows if row["outcome"] == "missed"]
    found = [row for row in rows if row["outcome"] == "spurious"]
    if (len(missed), len(found)) != (2, 1) or len({row["surface"] for row in rows}) != 1:
        return False
    (first, last), (one,) = missed, found
    if (one["from_mode"], one["to_mode"]) != (first["from_mode"], last["to_mode"]):
        return False
    return min(number(first, "graze_distance"), number(last, "graze_distance")) <= SMOOTHED_BAND * seen.number("atol")


RULES: tuple[Callable[[Seen], str | None], ...] = (
    _restart,
    _pair,
    _pair_around_an_event,
    _heyoka_pair,
    _heyoka_polynomial,
    _bracket,
    _flat_root,
    _small_step,
    _pole,
    _slow,
    _no_number,
    _past_the_end,
    _naive,
    *PEER_RULES,
)
NAMES = (
    "scipy-pair", "cvode-pair", "ida-pair", "scipy-fires-at-start", "scipy-bracket", "scipy-flat-root", "scipy-late",
    "scipy-pole", "diffrax-pole",
    "scipy-blow-up", "scipy-radau-order", "scipy-bdf-order", "scipy-lsoda-nan", "heyoka-start", "heyoka-double-root",
    "heyoka-hidden-drive", "heyoka-event-polynomial", "heyoka-past-end", "sign-chatter", "smoothed-creep",
    "smoothed-late",
    "cvode-c-pair", "octave-pair", "diffrax-pair", "diffrax-start", "diffsol-pair", *PEER_NAMES,
)  # fmt: skip
"""Every name that a rule may give."""
