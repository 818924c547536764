"""Comparisons: every solver on every reading of a case, scored against the truth, as data frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

from henon_ref.campaign.campaign import Campaign
from henon_ref.campaign.options import Draw, Observer, Options
from henon_ref.campaign.results import ReadingResult
from henon_ref.campaign.rows import Record
from henon_ref.casefile.case import Case
from henon_ref.columns import JUDGED_COLUMNS, RUN_COLUMNS, STICK_COLUMNS, TRANSITION_COLUMNS, Row
from henon_ref.errors import CaseError
from henon_ref.jit.cache_folder import cache_root
from henon_ref.score.gate import gate_failures
from henon_ref.solver import Solver

if TYPE_CHECKING:
    import pandas as pd

T = TypeVar("T")


@dataclass
class Comparison:
    """What came out for one case."""

    case: Case
    readings: list[ReadingResult]
    """Truth, and samples for figures, of every reading that was run."""
    records: list[Record]
    """The runs, by reading, solver and setting."""
    options: Options

    @cached_property
    def runs(self) -> pd.DataFrame:
        """A row a reading, solver and setting (columns of ``runs.csv``)."""
        return _frame(RUN_COLUMNS, self.run_rows)

    @cached_property
    def transitions(self) -> pd.DataFrame:
        """A row a transition (columns of ``transitions.csv``)."""
        return _frame(self.transition_columns, self.transition_rows)

    @cached_property
    def sticks(self) -> pd.DataFrame:
        """A row a stick (columns of ``sticks.csv``)."""
        return _frame(STICK_COLUMNS, self.stick_rows)

    @property
    def run_rows(self) -> list[Row]:
        """The rows of :attr:`runs`, a missing value None."""
        return [record.run for record in self.records]

    @property
    def transition_rows(self) -> list[Row]:
        """The rows of :attr:`transitions`."""
        return [row for record in self.records for row in record.transitions]

    @property
    def stick_rows(self) -> list[Row]:
        """The rows of :attr:`sticks`."""
        return [row for record in self.records for row in record.sticks]

    @property
    def transition_columns(self) -> tuple[str, ...]:
        """The contract's columns, then every state by name, then what verdicts rest on."""
        states = [name for result in self.readings for name in result.reading.problem.system.state_names]
        return (*TRANSITION_COLUMNS, *dict.fromkeys((*states, *JUDGED_COLUMNS)))

    def of_reading(self, name: str) -> list[Record]:
        """The runs of one reading."""
        return [record for record in self.records if record.run["reading"] == name]

    def gate_failures(self) -> list[str]:
        """One sentence for every bound of the case's gate that is not met; bounds on what did not run left out."""
        return [
            words
            for result in self.readings
            for words in gate_failures(result.reading, [record.run for record in self.of_reading(result.reading.name)])
        ]


def compare(
    case: Case,
    *,
    solvers: Sequence[str | Solver] | None = None,
    tolerances: Sequence[float] | None = None,
    repeats: int | None = None,
    timeout: float = 10.0,
    processes: int = 2,
) -> Comparison:
    """Run every solver on every reading of a case and score it against the truth.

    Each run is done by a worker (a process of its own with limits on time and memory): a solver that hangs or
    crashes is a row that says so.

    Parameters
    ----------
    case : Case
        From :func:`henon_ref.load_case`.
    solvers : sequence of str or Solver, optional
        Names, or instances of your own; None: those the case lists, or all.
    tolerances : sequence of float, optional
        Relative tolerances in place of the case's, each from 1e-16 to below 1.
    repeats : int, optional
        Timing samples a row, 1 or more; None: as many as fit a fraction of a second.
    timeout : float
        Processor time that one run may take [s], 0.01 or more.
    processes : int
        Runs at work at once, 1 or more.

    Returns
    -------
    Comparison

    Raises
    ------
    CaseError
        For an argument that is not allowed: an unknown solver, none that applies to the case, a tolerance of 0.
    """
    if not isinstance(case, Case):
        raise CaseError(f"case is {case!r}, wanted a Case: henon_ref.load_case(path) reads one")
    options = Options(
        solvers=_listed("solvers", solvers),
        tolerances=_listed("tolerances", tolerances),
        repeats=repeats,
        timeout=timeout,
        processes=processes,
    )
    found: list[Comparison] = []
    compare_all([case], options, found.append)
    return found[0]


def _listed(name: str, values: Sequence[T] | None) -> tuple[T, ...] | None:
    """An argument that is a sequence, as a tuple; one string or number is none."""
    if values is None:
        return None
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise CaseError(f"{name} is {values!r}, wanted a sequence: {name}=[{values!r}]")
    return tuple(values)


def compare_all(
    cases: Sequence[Case],
    options: Options,
    deliver: Callable[[Comparison], None],
    *,
    draw: Draw | None = None,
    ready: Callable[[], None] | None = None,
    observer: Observer | None = None,
) -> None:
    """Compare several cases; each one's comparison is delivered as soon as its last run is in.

    Parameters
    ----------
    cases : sequence of Case
    options : Options
    deliver : callable
    draw : callable, optional
        Makes the job that draws a reading's figures; None: no figures.
    ready : callable, optional
        Imports what such a job needs, see :class:`henon_ref.campaign.campaign.Campaign`.
    observer : Observer, optional
        Is told how it gets on.
    """

    def hand_over(case: Case, readings: list[ReadingResult], records: list[Record]) -> None:
        deliver(Comparison(case, readings, records, options))

    cache_root()  # workers use the folder that is found usable here
    Campaign(cases, options, hand_over, draw=draw, ready=ready, observer=observer).run()


def _frame(columns: Sequence[str], rows: Sequence[Row]) -> pd.DataFrame:
    """A data frame with these columns; a missing value is NaN in a column of numbers, else None."""
    import pandas as pd

    return pd.DataFrame([[row.get(column) for column in columns] for row in rows], columns=list(columns))
