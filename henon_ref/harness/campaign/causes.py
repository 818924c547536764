"""Assign a verified cause to a run that is wrong through a fault of its solver.

Each cause in :mod:`henon_ref.baselines.causes` is a minimal run of the library alone. :data:`PATTERNS` lists the
symptoms that identify a cause uniquely. A run without a matching pattern stays unexplained.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from henon_ref.harness import registry
from henon_ref.harness.campaign import symptoms
from henon_ref.harness.campaign.symptoms import Rows, WrongRun
from henon_ref.harness.rows import RunRow

EXPLAINED = ("solver defect", "not judged")
"""Verdicts that a cause may explain; a run that was too slow ("not judged") can have a known cause, too."""
LATE = 1e8
"""Time from which ten roundings of the time exceed 1e-7 s [s]."""
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
    *(Pattern(f"{solvers[0].rpartition('-')[0] or solvers[0]}-pair", solvers, when=symptoms.within_one_step)
      for solvers in (SCIPY, CVODE, ("ida",), CVODE_C, OCTAVE, DIFFRAX, DIFFSOL)),
    Pattern("heyoka-double-root", HEYOKA, when=symptoms.double_root),
    Pattern("heyoka-hidden-drive", HEYOKA, when=lambda wrong: {g[0].kind for g in wrong.missed_pairs} == {"release"}),
    Pattern("heyoka-event-polynomial", HEYOKA, "stepped over", missed=1, when=lambda wrong: wrong.run.matched == 0),
    Pattern("scipy-bracket", SCIPY, "must have different signs"),
    Pattern("scipy-flat-root", (*SCIPY, "scipy-smoothed", "scipy-sign"), "Failed to converge after"),
    Pattern("scipy-blow-up", SCIPY, TOO_SMALL, ends="diverged", right=True),
    Pattern("scipy-late", SCIPY, TOO_SMALL, right=True, when=lambda wrong: abs(wrong.end) >= LATE),
    Pattern("scipy-pole", SCIPY, TOO_SMALL, right=True, when=symptoms.before_a_pole),
    Pattern("diffrax-pole", DIFFRAX, "does not advance", right=True, when=symptoms.before_a_pole),
    Pattern("scipy-radau-order", ("scipy-radau",), status="timeout", right=True, when=symptoms.slow),
    Pattern("scipy-bdf-order", ("scipy-bdf",), status="timeout", right=True, when=symptoms.slow),
    Pattern("scipy-lsoda-nan", ("scipy-lsoda", "scipy-smoothed"), NOT_FINITE, right=True),
    Pattern("heyoka-past-end", HEYOKA, ends="failed", missed=0, right=True, when=symptoms.past_the_end),
    Pattern("sign-chatter", ("scipy-sign",), "the budget of", status="failed"),
    Pattern("smoothed-convergence", ("scipy-smoothed",), "lsoda: Repeated convergence failures", right=True),
    Pattern("smoothed-late", ("scipy-smoothed",), status="wrong", when=symptoms.released_late),
    Pattern("smoothed-creep", ("scipy-smoothed",), status="wrong", when=symptoms.within_the_band),
    Pattern("sign-hops", ("scipy-sign",), status="wrong", when=symptoms.within_the_band),
    Pattern("rk4-landing", ("henon-rk4",), "events within one step", status="failed", ends="failed", missed=0,
            when=symptoms.within_steps),
    Pattern("diffsol-small-step", DIFFSOL, "Step size is too small at time = ", right=True, when=symptoms.small_step),
    Pattern("diffsol-late", DIFFSOL, "Stop time is at the current state time", right=True),
    Pattern("diffsol-stop-nan", DIFFSOL, "went on past", ends="failed", missed=0, right=True),
    Pattern("diffsol-nan", ("diffsol-tsit45",), NOT_FINITE, right=True),
    Pattern("nosnoc-infeasible", NOSNOC, "IPOPT finds no step", right=True),
    Pattern("nosnoc-cost", NOSNOC, status="timeout", right=True),
    Pattern("nosnoc-cost", NOSNOC, status="timeout", when=lambda wrong: wrong.run.found_transitions is None),
    Pattern("nosnoc-grid", NOSNOC, when=lambda wrong: bool(wrong.missed_pairs or wrong.first_missed)),
    Pattern("nosnoc-node", NOSNOC, status="wrong", when=symptoms.at_one_node),
    Pattern("cvode-c-late-end", CVODE_C, "; failed at t = ", ends="failed", missed=0, right=True),
    Pattern("cvode-c-late-end", CVODE_C, "CV_TOO_MUCH_WORK", ends="invalid", missed=0, right=True),
    Pattern("cvode-c-pair", CVODE_C, "went on past", status="wrong", missed=1, when=symptoms.lone_stick),
    Pattern("cvode-c-error", CVODE_C, status="wrong", missed=0, when=symptoms.there_and_back),
    Pattern("octave-blow-up", OCTAVE, "ode45 ended at", ends="diverged", right=True),
    Pattern("octave-blow-up", OCTAVE, "ode45 ended at", right=True,
            when=lambda wrong: wrong.misses_at(wrong.end)),
    Pattern("octave-nan", OCTAVE, "went on past", ends="failed", right=True),
    Pattern("octave-nan-state", OCTAVE, NOT_FINITE, right=True),
    Pattern("octave-first-step", OCTAVE, status="wrong", right=True, when=symptoms.in_the_first_step),
    Pattern("octave-line", OCTAVE, status="wrong",
            when=lambda wrong: any(symptoms.is_off(wrong, row) for row in wrong.matched)),
    Pattern("siconos-rounding", SICONOS, f"{LOST_SIGN}.*which the rounding of a step moves as far"),
    Pattern("siconos-steep", SICONOS, LOST_SIGN),
    Pattern("siconos-step", SICONOS, when=symptoms.time_stepping),
    Pattern("siconos-no-solution", SICONOS, ends="diverged", when=symptoms.over_a_blow_up),
    Pattern("siconos-damping", SICONOS, status="wrong", ends="ok", missed=0, when=symptoms.runs_away),
)  # fmt: skip
"""Patterns in order of precedence: the first that fits gives the cause."""


def cause_of(run: RunRow, transitions: Rows) -> str | None:
    """Return the name of the cause of a run that is wrong or too slow; None if no cause is certain."""
    if run.verdict not in EXPLAINED:
        return None
    wrong = WrongRun(run, transitions)
    return next((pattern.cause for pattern in PATTERNS if pattern.fits(wrong)), None)
