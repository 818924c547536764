"""Runs of every solver at every tolerance, 1e-3 to 1e-15: the rows that prices are read from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from henon_ref.casefile.case import Case
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Observer, Options
from henon_ref.harness.report.text.paired_times import FIRST
from henon_ref.harness.rows import RunRow
from henon_ref.harness.studies.runs import rows_of

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


def run_ladder(cases: Sequence[Case], options: Options, observer: Observer) -> list[RunRow]:
    """Rows of the ladder on the cases' readings.

    Parameters
    ----------
    cases : sequence of Case
    options : Options
        Solvers, processes and journals; tolerances and deadline are the ladder's own.
    observer : Observer
    """
    changed = replace(options, solvers=options.solvers or solvers(), tolerances=LADDER, timeout=TIMEOUT)
    by_case = rows_of([_without_listings(case) for case in cases], changed, observer)
    return [row for own in by_case.values() for row in own]


def _without_listings(case: Case) -> Case:
    """The readings that are not tied to a solver of their own (Listing 1 as printed)."""
    return replace(case, readings=tuple(reading for reading in case.readings if reading.solvers is None))
