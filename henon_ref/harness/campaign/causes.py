"""Which checked cause explains a run that is wrong by its solver's fault.

The causes are in :mod:`henon_ref.baselines.causes`, a minimal run of the library alone each. Here is a table of how a
run looks where one of them is the reason, and no other is left; where nothing in it fits, the run stays unexplained.
"""

from __future__ import annotations

import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby, takewhile

from henon_ref.harness import registry
from henon_ref.harness.rows import RunRow, TransitionRow, number

EXPLAINED = ("solver defect", "not judged")
"""Verdicts on runs that a cause may explain: one that was too slow may be so for a known reason."""
IN_FRONT = 1000.0
"""Tolerances that a run's error stays below where nothing locates its end: BDF's is 200 of them at 1e-12."""
LATE = 1e8
"""Times [s] from which ten roundings are 1e-7 and more."""
LOST = 1e-15
"""A surface function that goes no deeper than this part of the state's size between two roots is in its rounding."""
SMOOTHED_BAND = 2000.0
"""Half-width of the band of ``scipy-smoothed`` in absolute tolerances (:mod:`henon_ref.baselines.scipy_naive`)."""
OFF = 3.0
"""Steps by which siconos may be off with a time (the cause siconos-step sees less)."""
FIRST_STEP = 1e-9
"""First step of octave-ode45 in each mode, as a part of the run's length."""
NO_SOLUTION = 10.0
"""Steps in front of a blow-up of order one in which an implicit step has no solution: four, and what order 1 is off."""


@dataclass(frozen=True)
class Seen:
    """One wrong run."""

    run: RunRow
    transitions: Sequence[TransitionRow]

    @property
    def solver(self) -> str:
        """The solver's name without its restart and variant."""
        return registry.base_name(self.run.solver).partition("+")[0]

    def found(self, pattern: str) -> re.Match[str] | None:
        """Where a regular expression fits the solver's own words."""
        return re.search(pattern, self.run.status_reason or "")

    @property
    def right_so_far(self) -> bool:
        """What was found before the run ended is right."""
        return self.run.spurious == 0

    def of(self, outcome: str) -> list[TransitionRow]:
        """Transitions of one outcome."""
        return [row for row in self.transitions if row.outcome == outcome]

    @property
    def missed_pairs(self) -> list[list[TransitionRow]]:
        """Groups of transitions that are missed in a row, where each group leads back to where it began.

        Each surface is crossed an even number of times in it, and there and back again. Empty where something else went
        wrong, too: then it is not known what the run did in between.
        """
        if self.run.status != "wrong" or self.run.spurious != 0:
            return []
        groups: list[list[TransitionRow]] = [[]]
        for row in self.transitions:
            if row.outcome == "missed":
                groups[-1].append(row)
            elif groups[-1] and row.outcome != "touch":
                groups.append([])
        groups = [group for group in groups if group]
        whole = all(
            group[0].from_mode == group[-1].to_mode
            and all(count % 2 == 0 for count in Counter(row.surface for row in group).values())
            for group in groups
        )
        return groups if whole else []

    @property
    def first_missed(self) -> list[TransitionRow]:
        """Transitions missed first, up to where the mode is again as before them: what comes behind follows from them.

        Empty where what comes before them is not right, where the mode does not become so before the next transition
        of the run, and where they begin within a mean step of a transition of the same surface, whose restart may have
        lost them.
        """
        if self.run.status != "wrong" or not self.found(" missed, "):
            return []
        rows = [row for row in self.transitions if row.outcome != "touch"]
        first = next((k for k, row in enumerate(rows) if row.outcome != "matched"), len(rows))
        group = list(takewhile(lambda row: row.outcome == "missed", rows[first:]))
        until = next((k for k, row in enumerate(group, 1) if row.to_mode == group[0].from_mode), 0)
        step = number(self.run.end_time_s) / number(self.run.steps)
        left = [number(row.reference_time_s) for row in rows[:first] if group and row.surface == group[0].surface]
        if not until or (left and not number(group[0].reference_time_s) - left[-1] > step):
            return []
        return group[:until]

    @property
    def stopped_between(self) -> list[TransitionRow]:
        """Two transitions of a surface that are missed first, where the run was ended between them.

        Within a mean step of each other: an event of another surface stopped the library, and the guard was negative.
        """
        if self.run.status != "failed" or not self.found("was stepped over") or not self.right_so_far:
            return []
        missed = self.of("missed")
        own = [row for row in missed if row.surface == missed[0].surface][:2]
        times = [number(row.reference_time_s) for row in own]
        end = number(self.run.end_time_s)
        step = end / max(number(self.run.steps), 1.0)
        return own if len(own) == 2 and times[0] <= end <= times[1] and times[1] - times[0] < step else []

    def misses_at(self, time: float) -> bool:
        """Whether the first transition that is missed is where the run ended [s]: a pole behind its surface."""
        within = IN_FRONT * number(self.run.rtol)
        return any(abs(number(row.reference_time_s) - time) <= within for row in self.of("missed")[:1])


def _deepest(rows: Sequence[TransitionRow]) -> float:
    """Greatest depth of the surface function between roots [unit of the surface]."""
    return max((row.graze_distance for row in rows if row.graze_distance is not None), default=math.inf)


def _in_pairs(seen: Seen) -> list[TransitionRow]:
    return [row for group in seen.missed_pairs for row in group]


def _within_one_step(seen: Seen) -> bool:
    """Signs are compared at the ends of a step: what is missed first lay in one, or around another surface's event.

    So did the two roots of an impact that is missed: the driver ends a run at whose stops a guard is negative.
    """
    return bool(seen.missed_pairs or seen.first_missed or seen.stopped_between)


def _double_root(seen: Seen) -> bool:
    """heyoka isolates all roots of a polynomial: what it misses is a double root to it, or not in the polynomial."""
    return _deepest(seen.stopped_between or _in_pairs(seen)) <= LOST


def _asleep(seen: Seen) -> bool:
    return bool(seen.missed_pairs) and all(group[0].kind == "release" for group in seen.missed_pairs)


def _in_front_of_a_pole(seen: Seen) -> bool:
    """In front of an event, or of the model's end: nothing has a value behind it."""
    ends = seen.run.expected_status == "invalid" and seen.run.missed == 0
    return ends or seen.misses_at(number(seen.run.end_time_s))


def _slow(seen: Seen) -> bool:
    """At a tight tolerance."""
    return number(seen.run.rtol) <= 1e-9 and number(seen.run.steps) > 1000


def _past_the_end(seen: Seen) -> bool:
    """The exact run ends because a function has no value any more; the run goes on."""
    late = seen.found(r"failed at t = (\S+), not at (\S+)$")
    return seen.found("went on past") is not None or (late is not None and float(late[1]) > float(late[2]))


def _within_the_band(seen: Seen) -> bool:
    rows = _in_pairs(seen)
    return bool(rows) and _deepest(rows) <= SMOOTHED_BAND * number(seen.run.atol)


def _released_late(seen: Seen) -> bool:
    """Each surface has all its transitions, and their order among surfaces alone is wrong, by late releases."""
    wrong = [row for row in seen.transitions if row.outcome in ("missed", "spurious")]
    delays: dict[bool, list[float]] = {True: [], False: []}
    for surface in {row.surface for row in wrong}:
        own = [row for row in wrong if row.surface == surface]
        exact, found = ([row for row in own if row.outcome == what] for what in ("missed", "spurious"))
        if [row.kind for row in exact] != [row.kind for row in found]:
            return False
        for there, here in zip(exact, found, strict=True):
            delays[there.kind == "release"].append(number(here.time_s) - number(there.reference_time_s))
    late, others = delays[True], delays[False]
    latest = max(late, default=0.0)
    return min(late, default=0.0) > 0.0 and all(abs(delay) < latest for delay in others)


def _smoothed_into_one(seen: Seen) -> bool:
    """All that is wrong are two transitions of a surface in a row that are found as one, which smoothing hides.

    It leads where they lead, and the surface function stays within the band between them.
    """
    rows = [row for row in seen.transitions if row.outcome != "touch"]
    groups = [list(own) for right, own in groupby(rows, lambda row: row.outcome == "matched") if not right]
    return bool(groups) and all(_one_for_two(seen, own) for own in groups)


def _one_for_two(seen: Seen, rows: Sequence[TransitionRow]) -> bool:
    missed = [row for row in rows if row.outcome == "missed"]
    found = [row for row in rows if row.outcome == "spurious"]
    if (len(missed), len(found)) != (2, 1) or len({row.surface for row in rows}) != 1:
        return False
    (first, last), (one,) = missed, found
    if (one.from_mode, one.to_mode) != (first.from_mode, last.to_mode):
        return False
    depth = min(number(first.graze_distance), number(last.graze_distance))
    return depth <= SMOOTHED_BAND * number(seen.run.atol)


def _small_step(seen: Seen) -> bool:
    """Words of diffsol's own, where the exact run ends or misses but the root in front of which they were said."""
    whole = seen.run.missed == 0 and seen.run.expected_status in ("diverged", "failed", "invalid")
    told = seen.found(r"at time = ([-+.e\d]+)")
    return whole or (told is not None and seen.misses_at(float(told[1])))


def _at_one_node(seen: Seen) -> bool:
    """What goes wrong first are two surfaces that change at one instant where the exact run has one of them."""
    extra = seen.of("spurious")[:2]
    if len(extra) < 2 or extra[0].surface == extra[1].surface or extra[0].time_s != extra[1].time_s:
        return False
    return any(
        abs(number(row.reference_time_s) - number(extra[0].time_s)) <= IN_FRONT * number(seen.run.rtol)
        for row in seen.of("missed")[:1]
    )


def _lone_stick(seen: Seen) -> bool:
    """No sign has changed up to the horizon: another root lay in the same step, which a run that slides has not."""
    return seen.run.found_transitions == 0 and any(row.kind == "stick" for row in seen.of("missed"))


def _there_and_back(seen: Seen) -> bool:
    """What is spurious leads there and back, on the surface by CVODE's own solution."""
    extra = seen.of("spurious")
    back = len(extra) % 2 == 0 and all(
        there.from_mode == back.to_mode and there.to_mode == back.from_mode
        for there, back in zip(extra[::2], extra[1::2], strict=True)
    )
    return len(extra) > 0 and back and number(seen.run.max_surface_drift) < number(seen.run.atol)


def _in_the_first_step(seen: Seen) -> bool:
    """The first transition that is missed comes within the first step after the one before it, or after zero.

    That step is a part of the run's length, which ends at its horizon: it went on to there.
    """
    before = 0.0
    for row in seen.transitions:
        time = number(row.reference_time_s)
        if row.outcome == "missed":
            return 0.0 < time - before <= FIRST_STEP * number(seen.run.end_time_s)
        before = time
    return False


def _off_by_location(seen: Seen) -> bool:
    """A time is off by more than the errors of all steps make of it.

    Step-size control grants each accepted step the absolute tolerance, so that together they move a transition by
    ``steps * atol * conditioning`` at most; the time itself is rounded in each. What is beyond that is the location's.
    """
    steps, atol = number(seen.run.steps), number(seen.run.atol)
    return any(
        abs(number(row.time_error_s))
        > steps * (atol * number(row.conditioning) + sys.float_info.epsilon * abs(number(row.reference_time_s)))
        for row in seen.of("matched")
    )


def _time_stepping(seen: Seen) -> bool:
    """What begins and ends within a step is not there; what comes some steps behind the horizon may be."""
    run, missed, extra = seen.run, seen.of("missed"), seen.of("spurious")
    alone = run.status == "wrong" and run.expected_status == "ok"
    times = [number(row.reference_time_s) for row in missed]
    within = seen.right_so_far and len(times) > 1 and max(times) - min(times) <= number(run.step_s)
    last = number(run.end_time_s) - OFF * number(run.step_s)
    behind = run.missed == 0 and bool(extra) and all(number(row.time_s) >= last for row in extra)
    early = run.status == "failed" and run.expected_status == "invalid" and run.missed == run.spurious == 0
    valueless = seen.found("^(ZeroDivisionError|ValueError: math domain error)") is not None
    slow = run.status == "timeout" and seen.right_so_far
    return bool(seen.missed_pairs) or slow or (alone and (within or behind)) or (early and valueless)


def _over_a_blow_up(seen: Seen) -> bool:
    """Nothing is wrong but what comes within some steps of the blow-up or behind."""
    past = seen.found(r"went on past t = ([-+.e\d]+),")
    if past is None or number(seen.run.missed) > 0:
        return False
    first = float(past[1]) - NO_SOLUTION * number(seen.run.step_s)
    return all(number(row.time_s) >= first for row in seen.of("spurious"))


def _runs_away(seen: Seen) -> bool:
    """The first transition is in time, and the last is off by more than some steps."""
    errors = [abs(number(row.time_error_s)) for row in seen.of("matched")]
    return len(errors) > 1 and errors[0] <= OFF * number(seen.run.step_s) < errors[-1]


SCIPY = ("scipy-rk45", "scipy-dop853", "scipy-radau", "scipy-bdf", "scipy-lsoda")
DIFFRAX, DIFFSOL = ("diffrax-dopri8", "diffrax-kvaerno5"), ("diffsol-tsit45", "diffsol-bdf")
CVODE, CVODE_C = ("cvode-adams", "cvode-bdf"), ("cvode-c-adams", "cvode-c-bdf")
HEYOKA, OCTAVE, NOSNOC, SICONOS = ("heyoka",), ("octave-ode45",), ("nosnoc",), ("siconos",)
AT_START = r"accumulate|The root is not contained in \[lower, upper\]"
TOO_SMALL = "Required step size is less than spacing between numbers"
NOT_FINITE = "^the state is not finite"
LOST_SIGN = "the relay's sign is not that of the surface function"


@dataclass(frozen=True)
class Pattern:
    """How a run looks that a cause explains: all that is given here holds of it."""

    cause: str
    solvers: tuple[str, ...]
    words: str = ""
    """A regular expression that fits the run's reason."""
    restart: str = ""
    """How the library was restarted."""
    status: str = ""
    ends: str = ""
    """How the exact run ends."""
    missed: int | None = None
    right: bool = False
    """Whether what was found before the run ended has to be right."""
    when: Callable[[Seen], bool] | None = None
    """What else holds."""

    def fits(self, seen: Seen) -> bool:
        """Whether a run looks like this."""
        run = seen.run
        return (
            seen.solver in self.solvers
            and self.restart in ("", registry.restart_of(run.solver))
            and self.status in ("", run.status)
            and self.ends in ("", run.expected_status)
            and self.missed in (None, run.missed)
            and (seen.right_so_far or not self.right)
            and seen.found(self.words) is not None
            and (self.when is None or self.when(seen))
        )


PATTERNS = (
    Pattern("heyoka-start", HEYOKA, AT_START, restart="none"),
    Pattern("scipy-fires-at-start", SCIPY, AT_START, restart="none"),
    Pattern("diffrax-start", DIFFRAX, AT_START, restart="none"),
    Pattern("heyoka-start", HEYOKA, "stepped over", restart="direction"),
    Pattern("scipy-pair", SCIPY, when=_within_one_step),
    Pattern("cvode-pair", CVODE, when=_within_one_step),
    Pattern("ida-pair", ("ida",), when=_within_one_step),
    Pattern("cvode-c-pair", CVODE_C, when=_within_one_step),
    Pattern("octave-pair", OCTAVE, when=_within_one_step),
    Pattern("diffrax-pair", DIFFRAX, when=_within_one_step),
    Pattern("diffsol-pair", DIFFSOL, when=_within_one_step),
    Pattern("heyoka-double-root", HEYOKA, when=_double_root),
    Pattern("heyoka-hidden-drive", HEYOKA, when=_asleep),
    Pattern("heyoka-event-polynomial", HEYOKA, "stepped over", missed=1, when=lambda seen: seen.run.matched == 0),
    Pattern("scipy-bracket", SCIPY, "must have different signs"),
    Pattern("scipy-flat-root", (*SCIPY, "scipy-smoothed", "scipy-sign"), "Failed to converge after"),
    Pattern("scipy-blow-up", SCIPY, TOO_SMALL, ends="diverged", right=True),
    Pattern("scipy-late", SCIPY, TOO_SMALL, right=True, when=lambda seen: abs(number(seen.run.end_time_s)) >= LATE),
    Pattern("scipy-pole", SCIPY, TOO_SMALL, right=True, when=_in_front_of_a_pole),
    Pattern("diffrax-pole", DIFFRAX, "does not advance", right=True, when=_in_front_of_a_pole),
    Pattern("scipy-radau-order", ("scipy-radau",), status="timeout", right=True, when=_slow),
    Pattern("scipy-bdf-order", ("scipy-bdf",), status="timeout", right=True, when=_slow),
    Pattern("scipy-lsoda-nan", ("scipy-lsoda", "scipy-smoothed"), NOT_FINITE, right=True),
    Pattern("heyoka-past-end", HEYOKA, ends="failed", missed=0, right=True, when=_past_the_end),
    Pattern("sign-chatter", ("scipy-sign",), "the budget of", status="failed"),
    Pattern("smoothed-creep", ("scipy-smoothed",), when=_within_the_band),
    Pattern("smoothed-creep", ("scipy-smoothed",), status="wrong", when=_smoothed_into_one),
    Pattern("smoothed-late", ("scipy-smoothed",), status="wrong", when=_released_late),
    Pattern("diffsol-small-step", DIFFSOL, "Step size is too small at time = ", right=True, when=_small_step),
    Pattern("diffsol-late", DIFFSOL, "Stop time is at the current state time", right=True),
    Pattern("diffsol-stop-nan", DIFFSOL, "went on past", ends="failed", missed=0, right=True),
    Pattern("diffsol-nan", ("diffsol-tsit45",), NOT_FINITE, right=True),
    Pattern("nosnoc-infeasible", NOSNOC, "IPOPT finds no step", right=True),
    Pattern("nosnoc-cost", NOSNOC, status="timeout", right=True),
    Pattern("nosnoc-cost", NOSNOC, status="timeout", when=lambda seen: seen.run.found_transitions is None),
    Pattern("nosnoc-grid", NOSNOC, when=lambda seen: bool(seen.missed_pairs)),
    Pattern("nosnoc-node", NOSNOC, status="wrong", when=_at_one_node),
    Pattern("cvode-c-late-end", CVODE_C, "; failed at t = ", ends="failed", missed=0, right=True),
    Pattern("cvode-c-late-end", CVODE_C, "CV_TOO_MUCH_WORK", ends="invalid", missed=0, right=True),
    Pattern("cvode-c-pair", CVODE_C, "went on past", status="wrong", missed=1, when=_lone_stick),
    Pattern("cvode-c-error", CVODE_C, status="wrong", missed=0, when=_there_and_back),
    Pattern("octave-blow-up", OCTAVE, "ode45 ended at", ends="diverged", right=True),
    Pattern("octave-blow-up", OCTAVE, "ode45 ended at", right=True,
            when=lambda seen: seen.misses_at(number(seen.run.end_time_s))),
    Pattern("octave-nan", OCTAVE, "went on past", ends="failed", right=True),
    Pattern("octave-nan-state", OCTAVE, NOT_FINITE, right=True),
    Pattern("octave-first-step", OCTAVE, status="wrong", right=True, when=_in_the_first_step),
    Pattern("octave-line", OCTAVE, status="wrong", when=_off_by_location),
    Pattern("siconos-rounding", SICONOS, f"{LOST_SIGN}.*which the rounding of a step moves as far"),
    Pattern("siconos-steep", SICONOS, LOST_SIGN),
    Pattern("siconos-step", SICONOS, when=_time_stepping),
    Pattern("siconos-no-solution", SICONOS, ends="diverged", when=_over_a_blow_up),
    Pattern("siconos-damping", SICONOS, status="wrong", ends="ok", missed=0, when=_runs_away),
)  # fmt: skip
"""The first that fits counts."""


def cause_of(run: RunRow, transitions: Sequence[TransitionRow]) -> str | None:
    """Name of the cause of a run that is wrong or too slow; None where none is known for certain."""
    if run.verdict not in EXPLAINED:
        return None
    seen = Seen(run, transitions)
    return next((pattern.cause for pattern in PATTERNS if pattern.fits(seen)), None)
