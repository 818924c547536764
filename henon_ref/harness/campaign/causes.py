"""Assign a verified cause to a run that is wrong through a fault of its solver.

Each cause in :mod:`henon_ref.baselines.causes` is a minimal run of the library alone. :data:`PATTERNS` lists the
symptoms that identify a cause uniquely. A run without a matching pattern stays unexplained.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass

from henon_ref.harness import registry
from henon_ref.harness.campaign.wrong_run import Rows, WrongRun, exact_time
from henon_ref.harness.rows import RunRow, TransitionRow, number

OFF = 3.0
"""Largest error of a time found by siconos [steps]; the cause siconos-step shows a smaller one."""


def within_one_step(wrong: WrongRun) -> bool:
    """The first missed roots lie within one step, or around another surface's event: compared signs are equal."""
    return bool(wrong.missed_pairs or wrong.first_missed or wrong.stopped_between)


def double_root(wrong: WrongRun) -> bool:
    """heyoka isolates all roots of a polynomial, so the missed roots coincide in its rounding."""
    rows = wrong.stopped_between or [row for group in wrong.missed_pairs for row in group]
    depths = [row.graze_distance for row in rows if row.graze_distance is not None]
    return max(depths, default=math.inf) <= 1e-15


def wrong_from_the_start(wrong: WrongRun) -> bool:
    """The run misses all transitions, more than a pair of one surface, or the time of the first is far off.

    The rows show that a step was too long, not whose series had the gap: if the time of a transition is far off, it is
    nearly always that of a state, since errors of the size of the tolerance move no time by its square root; if all
    transitions are missed, the motion may be right and the event function's polynomial wrong.
    """
    lost = wrong.run.matched == 0 and len(wrong.missed) > 2 and len({row.surface for row in wrong.missed}) == 1
    far = math.sqrt(number(wrong.run.rtol))
    off = any(abs(number(row.time_error_s)) > far * number(row.conditioning) for row in wrong.right[:1])
    return (lost and bool(wrong.missed_pairs)) or off


def before_a_pole(wrong: WrongRun) -> bool:
    """The run stops before an event or the end of the model, after which a function has no value."""
    return (wrong.run.expected_status == "invalid" and wrong.run.missed == 0) or wrong.misses_at(wrong.end)


def slow(wrong: WrongRun) -> bool:
    return number(wrong.run.rtol) <= 1e-9 and wrong.steps > 1000


def past_the_end(wrong: WrongRun) -> bool:
    """The exact run ends because a function has no value any more, but the run continues."""
    late = wrong.found(r"failed at t = (\S+), not at (\S+)$")
    return wrong.found("went on past") is not None or (late is not None and float(late[1]) > float(late[2]))


def within_the_band(wrong: WrongRun) -> bool:
    """The transitions around the first wrong one of a surface differ by less than the width of the band.

    The state within the band is uncertain by its width. True as well if an earlier transition other than a release is
    off by more than the errors of all steps explain; releases are late for another reason.
    """
    # The half-width of the band from which the solver reads its transitions (baselines/scipy_naive).
    band = {"scipy-smoothed": 2000.0, "scipy-sign": 400.0}[wrong.solver] * number(wrong.run.atol)
    for surface in {row.surface for row in wrong.rows}:
        own = [row for row in wrong.rows if row.surface == surface]
        first = next((k for k, row in enumerate(own) if row.outcome in ("missed", "spurious")), len(own))
        nearby = own[max(first - 1, 0) : first + 3] if first < len(own) else []
        if any(number(row.graze_distance) <= band * _reach(row) for row in nearby):
            return True
    return any(is_off(wrong, row) for row in wrong.right if row.kind != "release")


def _reach(row: TransitionRow) -> float:
    """Change of the deciding function per unit error of the state; at least 1 if this is a surface function."""
    moved = (row.conditioning or 0.0) * (row.transversality or 0.0)
    return moved if row.kind == "release" else max(moved, 1.0)


def is_off(wrong: WrongRun, row: TransitionRow) -> bool:
    """Check whether the error of a time exceeds the sum of the errors of all steps.

    Step-size control allows an error of ``atol`` in each accepted step, so that all steps together move a transition by
    at most ``steps * atol * conditioning``. In addition, each step rounds the time.
    """
    step = number(wrong.run.atol) * number(row.conditioning) + sys.float_info.epsilon * abs(exact_time(row))
    return abs(number(row.time_error_s)) > wrong.steps * step


def released_late(wrong: WrongRun) -> bool:
    """Each surface has all its transitions, and late releases alone change their order among the surfaces."""
    delays: dict[bool, list[float]] = {True: [], False: []}
    for surface in {row.surface for row in (*wrong.missed, *wrong.spurious)}:
        exact, found = ([row for row in rows if row.surface == surface] for rows in (wrong.missed, wrong.spurious))
        if [row.kind for row in exact] != [row.kind for row in found]:
            return False
        for there, here in zip(exact, found, strict=True):
            delays[there.kind == "release"].append(number(here.time_s) - exact_time(there))
    latest = max(delays[True], default=0.0)
    return min(delays[True], default=0.0) > 0.0 and all(abs(delay) < latest for delay in delays[False])


def within_steps(wrong: WrongRun) -> bool:
    """The first wrong transition follows the last right one within one step."""
    last, first = wrong.right[-1:], wrong.rows[len(wrong.right) :][:1]
    return any(number(b.time_s) - number(a.time_s) <= wrong.step for a, b in zip(last, first, strict=False))


def small_step(wrong: WrongRun) -> bool:
    """The exact run has an end of its own, or diffsol's message names the time of the first missed transition."""
    whole = wrong.run.missed == 0 and wrong.run.expected_status in ("diverged", "failed", "invalid")
    at_time = wrong.found(r"at time = ([-+.e\d]+)")
    return whole or (at_time is not None and wrong.misses_at(float(at_time[1])))


def at_one_node(wrong: WrongRun) -> bool:
    """The first two spurious transitions are of two surfaces at one instant, where the exact run has one of them."""
    extra = wrong.spurious[:2]
    both = len({row.surface for row in extra}) == 2 and len({row.time_s for row in extra}) == 1
    return both and wrong.misses_at(number(extra[0].time_s))


def lone_stick(wrong: WrongRun) -> bool:
    """The run has no transition because two roots lie within one step, but the exact run sticks at the first root."""
    return wrong.run.found_transitions == 0 and any(row.kind == "stick" for row in wrong.missed)


def there_and_back(wrong: WrongRun) -> bool:
    """The spurious transitions form pairs that leave a mode and return, on the surface as CVODE computes it."""
    pairs = list(zip(wrong.spurious[::2], wrong.spurious[1::2], strict=False))
    back = all(there.from_mode == back.to_mode and there.to_mode == back.from_mode for there, back in pairs)
    on_it = number(wrong.run.max_surface_drift) < number(wrong.run.atol)
    return 0 < len(wrong.spurious) == 2 * len(pairs) and back and on_it


def in_the_first_step(wrong: WrongRun) -> bool:
    """The first missed transition lies within the first step after its predecessor, or after time zero.

    The first step of octave-ode45 in each mode is 1e-9 of the length of the run, which extends to the horizon.
    """
    times = [0.0, *map(exact_time, wrong.rows)]
    first = next((k for k, row in enumerate(wrong.rows) if row.outcome == "missed"), None)
    return first is not None and 0.0 < times[first + 1] - times[first] <= 1e-9 * wrong.end


def time_stepping(wrong: WrongRun) -> bool:
    """Transitions within one step are missed, and transitions some steps after the horizon are found before it."""
    run, times = wrong.run, list(map(exact_time, wrong.missed))
    alone = run.status == "wrong" and run.expected_status == "ok"
    within = run.spurious == 0 and len(times) > 1 and max(times) - min(times) <= wrong.step
    last = wrong.end - OFF * wrong.step
    behind = run.missed == 0 and bool(wrong.spurious) and all(number(row.time_s) >= last for row in wrong.spurious)
    early = run.status == "failed" and run.expected_status == "invalid" and run.missed == run.spurious == 0
    valueless = early and wrong.found("^(ZeroDivisionError|ValueError: math domain error)") is not None
    slow = run.status == "timeout" and run.spurious == 0
    return bool(wrong.missed_pairs) or slow or (alone and (within or behind)) or valueless


def over_a_blow_up(wrong: WrongRun) -> bool:
    """Only transitions shortly before the blow-up, or after it, are wrong.

    An implicit step may have no solution within four steps before a blow-up of order one, or ten with the error of a
    method of order 1.
    """
    past = wrong.found(r"went on past t = ([-+.e\d]+),")
    if past is None or number(wrong.run.missed) > 0:
        return False
    return all(number(row.time_s) >= float(past[1]) - 10.0 * wrong.step for row in wrong.spurious)


def runs_away(wrong: WrongRun) -> bool:
    """The time of the first transition is right within some steps, and the last is off by more."""
    errors = [abs(number(row.time_error_s)) for row in wrong.matched]
    return len(errors) > 1 and errors[0] <= OFF * wrong.step < errors[-1]


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
    """Symptoms of a run that a cause explains; a run must meet all conditions that are given."""

    cause: str
    solvers: tuple[str, ...]
    words: str = ""
    """Regular expression found in the reason of the run."""
    restart: str = ""
    """Restart of the library."""
    status: str = ""
    ends: str = ""
    """Status of the exact run."""
    missed: int | None = None
    right: bool = False
    """Whether the run must have no spurious transition."""
    when: Callable[[WrongRun], bool] | None = None
    """Further condition on the run."""

    def fits(self, wrong: WrongRun) -> bool:
        run = wrong.run
        return (
            wrong.solver in self.solvers
            and self.restart in ("", registry.restart_of(run.solver))
            and self.status in ("", run.status)
            and self.ends in ("", run.expected_status)
            and self.missed in (None, run.missed)
            and (run.spurious == 0 or not self.right)
            and wrong.found(self.words) is not None
            and (self.when is None or self.when(wrong))
        )


PATTERNS = (
    Pattern("heyoka-start", HEYOKA, AT_START, restart="none"),
    Pattern("scipy-fires-at-start", SCIPY, AT_START, restart="none"),
    Pattern("diffrax-start", DIFFRAX, AT_START, restart="none"),
    Pattern("heyoka-start", HEYOKA, "stepped over", restart="direction"),
    *(Pattern(f"{solvers[0].rpartition('-')[0] or solvers[0]}-pair", solvers, when=within_one_step)
      for solvers in (SCIPY, CVODE, ("ida",), CVODE_C, OCTAVE, DIFFRAX, DIFFSOL)),
    Pattern("heyoka-double-root", HEYOKA, when=double_root),
    Pattern("heyoka-hidden-drive", HEYOKA, when=lambda wrong: {g[0].kind for g in wrong.missed_pairs} == {"release"}),
    Pattern("heyoka-gap", HEYOKA, status="wrong", ends="ok", right=True, when=wrong_from_the_start),
    Pattern("heyoka-event-polynomial", HEYOKA, "stepped over", missed=1, when=lambda wrong: wrong.run.matched == 0),
    Pattern("scipy-bracket", SCIPY, "must have different signs"),
    Pattern("scipy-flat-root", (*SCIPY, "scipy-smoothed", "scipy-sign"), "Failed to converge after"),
    Pattern("scipy-blow-up", SCIPY, TOO_SMALL, ends="diverged", right=True),
    # From 1e8 s on, ten roundings of the time exceed 1e-7 s.
    Pattern("scipy-late", SCIPY, TOO_SMALL, right=True, when=lambda wrong: abs(wrong.end) >= 1e8),
    Pattern("scipy-pole", SCIPY, TOO_SMALL, right=True, when=before_a_pole),
    Pattern("diffrax-pole", DIFFRAX, "does not advance", right=True, when=before_a_pole),
    Pattern("scipy-radau-order", ("scipy-radau",), status="timeout", right=True, when=slow),
    Pattern("scipy-bdf-order", ("scipy-bdf",), status="timeout", right=True, when=slow),
    Pattern("scipy-lsoda-nan", ("scipy-lsoda", "scipy-smoothed"), NOT_FINITE, right=True),
    Pattern("heyoka-past-end", HEYOKA, ends="failed", missed=0, right=True, when=past_the_end),
    Pattern("sign-chatter", ("scipy-sign",), "the budget of", status="failed"),
    Pattern("smoothed-convergence", ("scipy-smoothed",), "lsoda: Repeated convergence failures", right=True),
    Pattern("smoothed-late", ("scipy-smoothed",), status="wrong", when=released_late),
    Pattern("smoothed-creep", ("scipy-smoothed",), status="wrong", when=within_the_band),
    Pattern("sign-hops", ("scipy-sign",), status="wrong", when=within_the_band),
    Pattern("rk4-landing", ("henon-rk4",), "events within one step", status="failed", ends="failed", missed=0,
            when=within_steps),
    Pattern("diffsol-small-step", DIFFSOL, "Step size is too small at time = ", right=True, when=small_step),
    Pattern("diffsol-late", DIFFSOL, "Stop time is at the current state time", right=True),
    Pattern("diffsol-stop-nan", DIFFSOL, "went on past", ends="failed", missed=0, right=True),
    Pattern("diffsol-nan", ("diffsol-tsit45",), NOT_FINITE, right=True),
    Pattern("nosnoc-infeasible", NOSNOC, "IPOPT finds no step", right=True),
    Pattern("nosnoc-cost", NOSNOC, status="timeout", right=True),
    Pattern("nosnoc-cost", NOSNOC, status="timeout", when=lambda wrong: wrong.run.found_transitions is None),
    Pattern("nosnoc-grid", NOSNOC, when=lambda wrong: bool(wrong.missed_pairs or wrong.first_missed)),
    Pattern("nosnoc-node", NOSNOC, status="wrong", when=at_one_node),
    Pattern("cvode-c-late-end", CVODE_C, "; failed at t = ", ends="failed", missed=0, right=True),
    Pattern("cvode-c-late-end", CVODE_C, "CV_TOO_MUCH_WORK", ends="invalid", missed=0, right=True),
    Pattern("cvode-c-pair", CVODE_C, "went on past", status="wrong", missed=1, when=lone_stick),
    Pattern("cvode-c-error", CVODE_C, status="wrong", missed=0, when=there_and_back),
    Pattern("octave-blow-up", OCTAVE, "ode45 ended at", ends="diverged", right=True),
    Pattern("octave-blow-up", OCTAVE, "ode45 ended at", right=True, when=lambda wrong: wrong.misses_at(wrong.end)),
    Pattern("octave-nan", OCTAVE, "went on past", ends="failed", right=True),
    Pattern("octave-nan-state", OCTAVE, NOT_FINITE, right=True),
    Pattern("octave-first-step", OCTAVE, status="wrong", right=True, when=in_the_first_step),
    Pattern("octave-line", OCTAVE, status="wrong",
            when=lambda wrong: any(is_off(wrong, row) for row in wrong.matched)),
    Pattern("siconos-rounding", SICONOS, f"{LOST_SIGN}.*which the rounding of a step moves as far"),
    Pattern("siconos-steep", SICONOS, LOST_SIGN),
    Pattern("siconos-step", SICONOS, when=time_stepping),
    Pattern("siconos-no-solution", SICONOS, ends="diverged", when=over_a_blow_up),
    Pattern("siconos-damping", SICONOS, status="wrong", ends="ok", missed=0, when=runs_away),
)  # fmt: skip
"""Patterns in order of precedence: the first that fits gives the cause."""


def cause_of(run: RunRow, transitions: Rows) -> str | None:
    """Return the name of the cause of a run that is wrong or too slow; None if no cause is certain."""
    if run.verdict not in ("solver defect", "not judged"):  # a run that was too slow is not judged
        return None
    wrong = WrongRun(run, transitions)
    return next((pattern.cause for pattern in PATTERNS if pattern.fits(wrong)), None)
