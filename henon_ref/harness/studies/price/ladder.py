"""Runs of every solver at every tolerance, 1e-3 to 1e-15: the rows that prices are read from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from henon_ref.casefile.case import Case
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Observer, Options
from henon_ref.harness.report.text.paired_times import FIRST
from henon_ref.harness.rows import Row, RunRow
from henon_ref.harness.studies.runs import records_of

LADDER = tuple(10.0**-k for k in range(3, 16))
"""Relative tolerances. A library that refuses one says so, and the row with it."""
TIMEOUT = 4.0
"""Seconds that one run may take: a slower one is never the cheapest where any other gets there."""
WHEN_NAMED = ("cvode-c-adams", "cvode-c-bdf", "octave-ode45")
"""Solvers that run when named elsewhere, which belong here all the same."""


def solvers(chosen: Sequence[str] = ()) -> tuple[str, ...]:
    """Names of the solvers; those of a fixed step run at the steps that the case names.

    Parameters
    ----------
    chosen : sequence of str
        Those asked for, to which the reference is added that prices are multiples of. None: those that run by default
        and :data:`WHEN_NAMED`; with ``all`` the peers that are installed as well.

    Raises
    ------
    CaseError
        For an unknown name.
    """
    named = [registry.check(name) for name in chosen if name != registry.ALL]
    if registry.ALL in chosen:
        every = registry.expanded((registry.ALL,))
    else:
        every = () if named else (*registry.default_names(), *WHEN_NAMED)
    return tuple(dict.fromkeys((FIRST, *every, *named)))


@dataclass(frozen=True)
class SampleRow(Row):
    """The raw samples of one setting."""

    case: str
    reading: str
    against: str | None
    """The pair that it was timed in; None for the ladder's own times."""
    digits: int | None
    solver: str
    rtol: float | None
    step_s: float | None
    samples_us: str
    """In their order, with blanks between them."""


@dataclass(frozen=True)
class Ladder:
    """What was run."""

    rows: list[RunRow]
    samples: list[SampleRow]
    """The raw samples behind the rows' times."""


def run_ladder(cases: Sequence[Case], options: Options, observer: Observer) -> Ladder:
    """Run the ladder on the cases' readings.

    Parameters
    ----------
    cases : sequence of Case
    options : Options
        Solvers, processes and journals; tolerances and deadline are the ladder's own.
    observer : Observer
    """
    changed = replace(options, solvers=options.solvers or solvers(), tolerances=LADDER, timeout=TIMEOUT)
    by_case = records_of([_without_listings(case) for case in cases], changed, observer)
    records = [record for own in by_case.values() for record in own]
    samples = [
        SampleRow(*run.problem, None, None, run.solver, run.rtol, run.step_s, microseconds(record.samples))
        for record in records
        if record.samples and (run := record.run)
    ]
    return Ladder([record.run for record in records], samples)


def microseconds(samples: Sequence[float]) -> str:
    """Samples [s] as a row has them."""
    return " ".join(f"{1e6 * sample:.5g}" for sample in samples)


def _without_listings(case: Case) -> Case:
    """The readings that are not tied to a solver of their own (Listing 1 as printed)."""
    return replace(case, readings=tuple(reading for reading in case.readings if reading.solvers is None))
