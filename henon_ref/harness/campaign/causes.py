"""Which checked cause explains a run that is wrong by its solver's fault.

The causes are in :mod:`henon_ref.baselines.causes`, a minimal run of the library alone each. :data:`PATTERNS` is the
table of how a run looks where one of them is the reason, and no other is left; where nothing in it fits, the run stays
unexplained.
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
BANDS = {"scipy-smoothed": 2000.0, "scipy-sign": 400.0}
"""Half-widths of the bands in which transitions are read off, in absolute tolerances
(:mod:`henon_ref.baselines.scipy_naive`)."""
OFF = 3.0
"""Steps by which siconos may be off with a time (the cause siconos-step sees less)."""
FIRST_STEP = 1e-9
"""First step of octave-ode45 in each mode, as a part of the run's length."""
NO_SOLUTION = 10.0
"""Steps in front of a blow-up of order one in which an implicit step has no solution: four, and what order 1 is off."""
Rows = Sequence[TransitionRow]


class Seen:
    """One wrong run, with its transitions in order, but for touches."""

    def __init__(self, run: RunRow, transitions: Rows) -> None:
        self.run = run
        self.rows = [row for row in transitions if row.outcome != "touch"]
        self.right = list(takewhile(lambda row: row.outcome == "matched", self.rows))
        """Before the first that is wrong."""
        self.matched, self.missed, self.spurious = (
            [row for row in self.rows if row.outcome == what] for what in ("matched", "missed", "spurious")
        )
        self.end, self.step, self.steps = number(run.end_time_s), number(run.step_s), number(run.steps)
        self.solver = registry.base_name(run.solver).partition("+")[0]
        """Without its restart and variant."""

    def found(self, pattern: str) -> re.Match[str] | None:
        """Where a regular expression fits the solver's own words."""
        return re.search(pattern, self.run.status_reason or "")

    def misses_at(self, time: float) -> bool:
        """Whether the first transition that is missed is at a time [s], to what nothing there locates."""
        within = IN_FRONT * number(self.run.rtol)
        return any(abs(_exact(row) - time) <= within for row in self.missed[:1])

    @property
    def missed_pairs(self) -> list[Rows]:
        """Groups of transitions missed in a row, where each leads back to where it began.

        Each surface is crossed an even number of times in it. Empty where something else went wrong, too: then it is
        not known what the run did in between.
        """
        groups = [list(own) for what, own in groupby(self.rows, lambda row: row.outcome) if what == "missed"]
        whole = all(
            group[0].from_mode == group[-1].to_mode
            and all(count % 2 == 0 for count in Counter(row.surface for row in group).values())
            for group in groups
        )
        return [*groups] if whole and self.run.status == "wrong" and self.run.spurious == 0 else []

    @property
    def first_missed(self) -> Rows:
        """Transitions missed first, up to where the mode is again as before them: what comes behind follows from them.

        Empty where the mode does not become so before the next transition of the run, and where they begin within a
        mean step of a transition of the same surface, whose restart may have lost them.
        """
        group = list(takewhile(lambda row: row.outcome == "missed", self.rows[len(self.right) :]))
        until = next((k for k, row in enumerate(group, 1) if row.to_mode == group[0].from_mode), 0)
        if not until or self.run.status != "wrong" or not self.found(" missed, "):
            return []
        left = [_exact(row) for row in self.right if row.surface == group[0].surface]
        return group[:until] if not left or _exact(group[0]) - left[-1] > self.end / self.steps else []

    @property
    def stopped_between(self) -> Rows:
        """Two transitions of a surface that are missed first, within a mean step, where the run was ended between them:
        an event of another surface stopped the library, and the guard was negative.
        """
        if self.run.status != "failed" or not self.found("was stepped over") or self.run.spurious != 0:
            return []
        own = [row for row in self.missed if row.surface == self.missed[0].surface][:2]
        first, last = (_exact(own[0]), _exact(own[-1])) if own else (math.nan, math.nan)
        near = last - first < self.end / max(self.steps, 1.0)
        return own if len(own) == 2 and first <= self.end <= last and near else []


def _exact(row: TransitionRow) -> float:
    return number(row.reference_time_s)


def _within_one_step(seen: Seen) -> bool:
    """Signs are compared at the ends of a step: what is missed first lay in one, or around another surface's event."""
    return bool(seen.missed_pairs or seen.first_missed or seen.stopped_between)


def _double_root(seen: Seen) -> bool:
    """heyoka isolates all roots of a polynomial: what it misses is a double root to it, or not in the polynomial."""
    rows = seen.stopped_between or [row for group in seen.missed_pairs for row in group]
    return max((row.graze_distance for row in rows if row.graze_distance is not None), default=math.inf) <= LOST


def _in_front_of_a_pole(seen: Seen) -> bool:
    """In front of an event, or of the model's end: nothing has a value behind it."""
    return (seen.run.expected_status == "invalid" and seen.run.missed == 0) or seen.misses_at(seen.end)


def _slow(seen: Seen) -> bool:
    return number(seen.run.rtol) <= 1e-9 and seen.steps > 1000


def _past_the_end(seen: Seen) -> bool:
    """The exact run ends because a function has no value any more; the run goes on."""
    late = seen.found(r"failed at t = (\S+), not at (\S+)$")
    return seen.found("went on past") is not None or (late is not None and float(late[1]) > float(late[2]))


def _within_the_band(seen: Seen) -> bool:
    """The first transition of a surface that goes wrong, or one beside it, is told from its neighbour by less than the
    band is wide; or the run is off by more than its steps' errors before.

    Within the band the state is known no better. Releases are late anyway.
    """
    band = BANDS[seen.solver] * number(seen.run.atol)
    for surface in {row.surface for row in seen.rows}:
        own = [row for row in seen.rows if row.surface == surface]
        first = next((k for k, row in enumerate(own) if row.outcome in ("missed", "spurious")), len(own))
        beside = own[max(first - 1, 0) : first + 3] if first < len(own) else []
        if any(number(row.graze_distance) <= band * _reach(row) for row in beside):
            return True
    return any(_is_off(seen, row) for row in seen.right if row.kind != "release")


def _reach(row: TransitionRow) -> float:
    """By how much an error in the state moves what decides a transition; its own size at least where that is the
    surface function, which the guard of a release is not."""
    moved = (row.conditioning or 0.0) * (row.transversality or 0.0)
    return moved if row.kind == "release" else max(moved, 1.0)


def _is_off(seen: Seen, row: TransitionRow) -> bool:
    """Whether a time is off by more than the errors of all steps make of it.

    Step-size control grants each accepted step the absolute tolerance, so that together they move a transition by
    ``steps * atol * conditioning`` at most; the time itself is rounded in each. What is beyond that is not theirs.
    """
    step = number(seen.run.atol) * number(row.conditioning) + sys.float_info.epsilon * abs(_exact(row))
    return abs(number(row.time_error_s)) > seen.steps * step


def _released_late(seen: Seen) -> bool:
    """Each surface has all its transitions, and their order among surfaces alone is wrong, by late releases."""
    delays: dict[bool, list[float]] = {True: [], False: []}
    for surface in {row.surface for row in (*seen.missed, *seen.spurious)}:
        exact, found = ([row for row in rows if row.surface == surface] for rows in (seen.missed, seen.spurious))
        if [row.kind for row in exact] != [row.kind for row in found]:
            return False
        for there, here in zip(exact, found, strict=True):
            delays[there.kind == "release"].append(number(here.time_s) - _exact(there))
    latest = max(delays[True], default=0.0)
    return min(delays[True], default=0.0) > 0.0 and all(abs(delay) < latest for delay in delays[False])


def _within_steps(seen: Seen) -> bool:
    """What goes wrong first comes within a step of a transition that is right, and nothing is wrong before."""
    last, wrong = seen.right[-1:], seen.rows[len(seen.right) :][:1]
    return any(number(b.time_s) - number(a.time_s) <= seen.step for a, b in zip(last, wrong, strict=False))


def _small_step(seen: Seen) -> bool:
    """Words of diffsol's own, where the exact run ends or misses but the root in front of which they were said."""
    whole = seen.run.missed == 0 and seen.run.expected_status in ("diverged", "failed", "invalid")
    told = seen.found(r"at time = ([-+.e\d]+)")
    return whole or (told is not None and seen.misses_at(float(told[1])))


def _at_one_node(seen: Seen) -> bool:
    """What goes wrong first are two surfaces that change at one instant where the exact run has one of them."""
    extra = seen.spurious[:2]
    both = len({row.surface for row in extra}) == 2 and len({row.time_s for row in extra}) == 1
    return both and seen.misses_at(number(extra[0].time_s))


def _lone_stick(seen: Seen) -> bool:
    """No sign has changed up to the horizon: another root lay in the same step, which a run that slides has not."""
    return seen.run.found_transitions == 0 and any(row.kind == "stick" for row in seen.missed)


def _there_and_back(seen: Seen) -> bool:
    """What is spurious leads there and back, on the surface by CVODE's own solution."""
    pairs = list(zip(seen.spurious[::2], seen.spurious[1::2], strict=False))
    back = all(there.from_mode == back.to_mode and there.to_mode == back.from_mode for there, back in pairs)
    on_it = number(seen.run.max_surface_drift) < number(seen.run.atol)
    return 0 < len(seen.spurious) == 2 * len(pairs) and back and on_it


def _in_the_first_step(seen: Seen) -> bool:
    """The first transition that is missed comes within the first step after the one before it, or after zero.

    That step is a part of the run's length, which ends at its horizon: it went on to there.
    """
    times = [0.0, *map(_exact, seen.rows)]
    first = next((k for k, row in enumerate(seen.rows) if row.outcome == "missed"), None)
    return first is not None and 0.0 < times[first + 1] - times[first] <= FIRST_STEP * seen.end


def _time_stepping(seen: Seen) -> bool:
    """What begins and ends within a step is not there; what comes some steps behind the horizon may be."""
    run, times = seen.run, list(map(_exact, seen.missed))
    alone = run.status == "wrong" and run.expected_status == "ok"
    within = run.spurious == 0 and len(times) > 1 and max(times) - min(times) <= seen.step
    last = seen.end - OFF * seen.step
    behind = run.missed == 0 and bool(seen.spurious) and all(number(row.time_s) >= last for row in seen.spurious)
    early = run.status == "failed" and run.expected_status == "invalid" and run.missed == run.spurious == 0
    valueless = seen.found("^(ZeroDivisionError|ValueError: math domain error)") is not None
    slow = run.status == "timeout" and run.spurious == 0
    return bool(seen.missed_pairs) or slow or (alone and (within or behind)) or (early and valueless)


def _over_a_blow_up(seen: Seen) -> bool:
    """Nothing is wrong but what comes within some steps of the blow-up or behind."""
    past = seen.found(r"went on past t = ([-+.e\d]+),")
    if past is None or number(seen.run.missed) > 0:
        return False
    return all(number(row.time_s) >= float(past[1]) - NO_SOLUTION * seen.step for row in seen.spurious)


def _runs_away(seen: Seen) -> bool:
    """The first transition is in time, and the last is off by more than some steps."""
    errors = [abs(number(row.time_error_s)) for row in seen.matched]
    return len(errors) > 1 and errors[0] <= OFF * seen.step < errors[-1]


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
            and (run.spurious == 0 or not self.right)
            and seen.found(self.words) is not None
            and (self.when is None or self.when(seen))
        )


PATTERNS = (
    Pattern("heyoka-start", HEYOKA, AT_START, restart="none"),
    Pattern("scipy-fires-at-start", SCIPY, AT_START, restart="none"),
    Pattern("diffrax-start", DIFFRAX, AT_START, restart="none"),
    Pattern("heyoka-start", HEYOKA, "stepped over", restart="direction"),
    *(Pattern(f"{solvers[0].rpartition('-')[0] or solvers[0]}-pair", solvers, when=_within_one_step)
      for solvers in (SCIPY, CVODE, ("ida",), CVODE_C, OCTAVE, DIFFRAX, DIFFSOL)),
    Pattern("heyoka-double-root", HEYOKA, when=_double_root),
    Pattern("heyoka-hidden-drive", HEYOKA, when=lambda seen: {g[0].kind for g in seen.missed_pairs} == {"release"}),
    Pattern("heyoka-event-polynomial", HEYOKA, "stepped over", missed=1, when=lambda seen: seen.run.matched == 0),
    Pattern("scipy-bracket", SCIPY, "must have different signs"),
    Pattern("scipy-flat-root", (*SCIPY, "scipy-smoothed", "scipy-sign"), "Failed to converge after"),
    Pattern("scipy-blow-up", SCIPY, TOO_SMALL, ends="diverged", right=True),
    Pattern("scipy-late", SCIPY, TOO_SMALL, right=True, when=lambda seen: abs(seen.end) >= LATE),
    Pattern("scipy-pole", SCIPY, TOO_SMALL, right=True, when=_in_front_of_a_pole),
    Pattern("diffrax-pole", DIFFRAX, "does not advance", right=True, when=_in_front_of_a_pole),
    Pattern("scipy-radau-order", ("scipy-radau",), status="timeout", right=True, when=_slow),
    Pattern("scipy-bdf-order", ("scipy-bdf",), status="timeout", right=True, when=_slow),
    Pattern("scipy-lsoda-nan", ("scipy-lsoda", "scipy-smoothed"), NOT_FINITE, right=True),
    Pattern("heyoka-past-end", HEYOKA, ends="failed", missed=0, right=True, when=_past_the_end),
    Pattern("sign-chatter", ("scipy-sign",), "the budget of", status="failed"),
    Pattern("smoothed-convergence", ("scipy-smoothed",), "lsoda: Repeated convergence failures", right=True),
    Pattern("smoothed-late", ("scipy-smoothed",), status="wrong", when=_released_late),
    Pattern("smoothed-creep", ("scipy-smoothed",), status="wrong", when=_within_the_band),
    Pattern("sign-hops", ("scipy-sign",), status="wrong", when=_within_the_band),
    Pattern("rk4-landing", ("henon-rk4",), "events within one step", status="failed", ends="failed", missed=0,
            when=_within_steps),
    Pattern("diffsol-small-step", DIFFSOL, "Step size is too small at time = ", right=True, when=_small_step),
    Pattern("diffsol-late", DIFFSOL, "Stop time is at the current state time", right=True),
    Pattern("diffsol-stop-nan", DIFFSOL, "went on past", ends="failed", missed=0, right=True),
    Pattern("diffsol-nan", ("diffsol-tsit45",), NOT_FINITE, right=True),
    Pattern("nosnoc-infeasible", NOSNOC, "IPOPT finds no step", right=True),
    Pattern("nosnoc-cost", NOSNOC, status="timeout", right=True),
    Pattern("nosnoc-cost", NOSNOC, status="timeout", when=lambda seen: seen.run.found_transitions is None),
    Pattern("nosnoc-grid", NOSNOC, when=lambda seen: bool(seen.missed_pairs or seen.first_missed)),
    Pattern("nosnoc-node", NOSNOC, status="wrong", when=_at_one_node),
    Pattern("cvode-c-late-end", CVODE_C, "; failed at t = ", ends="failed", missed=0, right=True),
    Pattern("cvode-c-late-end", CVODE_C, "CV_TOO_MUCH_WORK", ends="invalid", missed=0, right=True),
    Pattern("cvode-c-pair", CVODE_C, "went on past", status="wrong", missed=1, when=_lone_stick),
    Pattern("cvode-c-error", CVODE_C, status="wrong", missed=0, when=_there_and_back),
    Pattern("octave-blow-up", OCTAVE, "ode45 ended at", ends="diverged", right=True),
    Pattern("octave-blow-up", OCTAVE, "ode45 ended at", right=True,
            when=lambda seen: seen.misses_at(seen.end)),
    Pattern("octave-nan", OCTAVE, "went on past", ends="failed", right=True),
    Pattern("octave-nan-state", OCTAVE, NOT_FINITE, right=True),
    Pattern("octave-first-step", OCTAVE, status="wrong", right=True, when=_in_the_first_step),
    Pattern("octave-line", OCTAVE, status="wrong", when=lambda seen: any(_is_off(seen, row) for row in seen.matched)),
    Pattern("siconos-rounding", SICONOS, f"{LOST_SIGN}.*which the rounding of a step moves as far"),
    Pattern("siconos-steep", SICONOS, LOST_SIGN),
    Pattern("siconos-step", SICONOS, when=_time_stepping),
    Pattern("siconos-no-solution", SICONOS, ends="diverged", when=_over_a_blow_up),
    Pattern("siconos-damping", SICONOS, status="wrong", ends="ok", missed=0, when=_runs_away),
)  # fmt: skip
"""The first that fits counts."""


def cause_of(run: RunRow, transitions: Rows) -> str | None:
    """Name of the cause of a run that is wrong or too slow; None where none is known for certain."""
    if run.verdict not in EXPLAINED:
        return None
    seen = Seen(run, transitions)
    return next((pattern.cause for pattern in PATTERNS if pattern.fits(seen)), None)
