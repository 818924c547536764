"""Comparisons: every solver on every reading of a case, scored against the truth, as data frames."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

from henon_ref.casefile.case import Case
from henon_ref.casefile.notebook import equations_html
from henon_ref.errors import CaseError
from henon_ref.harness.campaign.campaign import Campaign
from henon_ref.harness.campaign.options import Draw, Observer, Options
from henon_ref.harness.campaign.progress import ProgressLine, is_seen
from henon_ref.harness.campaign.results import ReadingResult
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.rows import AnyRow, RunRow, StickRow, TransitionRow
from henon_ref.harness.score.gate import Gate, bounds_of, gate
from henon_ref.harness.score.standing import RIGHT, standings, tightest
from henon_ref.harness.table import Table
from henon_ref.jit.cache_folder import cache_root
from henon_ref.solver import Solver
from henon_ref.text import html, message

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

T = TypeVar("T")


@dataclass(repr=False)
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
        return _frame(RunRow, self.run_rows)

    @cached_property
    def transitions(self) -> pd.DataFrame:
        """A row a transition (columns of ``transitions.csv``)."""
        return _frame(TransitionRow, self.transition_rows, self.states)

    @cached_property
    def sticks(self) -> pd.DataFrame:
        """A row a stick (columns of ``sticks.csv``)."""
        return _frame(StickRow, self.stick_rows)

    @property
    def run_rows(self) -> list[RunRow]:
        """The rows of :attr:`runs`, a missing value None."""
        return [record.run for record in self.records]

    @property
    def transition_rows(self) -> list[TransitionRow]:
        """The rows of :attr:`transitions`."""
        return [row for record in self.records for row in record.transitions]

    @property
    def stick_rows(self) -> list[StickRow]:
        """The rows of :attr:`sticks`."""
        return [row for record in self.records for row in record.sticks]

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states of all readings: columns of :attr:`transitions`."""
        names = (name for result in self.readings for name in result.reading.problem.system.state_names)
        return tuple(dict.fromkeys(names))

    def __repr__(self) -> str:
        wrong = sum(run.verdict != "right" for run in self.run_rows)
        runs = f"{len(self.records)} runs, {len(self.records) - wrong} of them right"
        readings = f"{len(self.readings)} reading{'s' * (len(self.readings) != 1)}"
        head = message(f"Comparison of {self.case.name}: {readings}, {runs}")
        return f"{head}\n{summary(self.run_rows, longest=LONGEST_NOTE).text}" if self.records else head

    def _repr_html_(self) -> str:
        """What a notebook shows: the table that ``print`` shows, and the case's equations as formulas."""
        problems = {result.reading.name: result.reading.problem for result in self.readings}
        title = f"<p><b>{html(self.case.name)}</b>: {html(self.case.title)}</p>"
        return f"{title}{summary(self.run_rows).html}{equations_html(problems)}"

    def plot(self, reading: str | None = None) -> Axes:
        """The work-precision diagram of one reading, which the title names: worst error of a time over wall time.

        Parameters
        ----------
        reading : str, optional
            Name of the reading; None: the first one.

        Returns
        -------
        Axes
            Of a figure that belongs to :mod:`matplotlib.pyplot`: a notebook shows it, ``plt.show()`` too.

        Raises
        ------
        CaseError
            Where there is no such reading, no truth to measure errors by, or fewer than two timed runs that have one.
        """
        from matplotlib import pyplot as plt

        from henon_ref.harness.figures.cost import draw_cost

        name = self.readings[0].reading.name if reading is None else self.case.reading(reading).name
        (result,) = (result for result in self.readings if result.reading.name == name)
        rows = [record.run for record in self.of_reading(name)]
        of = name if len(self.readings) > 1 else ""
        drawn = draw_cost(rows, result.expected, of=of) if result.expected is not None else None
        if drawn is None:
            raise CaseError(f"reading '{name}' has fewer than two timed runs with an error to plot")
        # pyplot makes its figures by calling this: so the one that is drawn becomes its own.
        figure = plt.figure(FigureClass=lambda *given, **options: drawn)  # type: ignore[arg-type]
        return figure.axes[0]

    def of_reading(self, name: str) -> list[Record]:
        """The runs of one reading."""
        return [record for record in self.records if record.run.reading == name]

    @property
    def gate(self) -> Gate:
        """What became of the bounds of the case's gate."""
        return gate(bounds_of(self.case), self.run_rows)

    def gate_failures(self) -> list[str]:
        """One sentence for every bound of the case's gate that is not met; bounds on what did not run left out."""
        return [words for _, words in self.gate.unmet]


def compare(
    case: Case,
    *,
    solvers: Sequence[str | Solver] | None = None,
    tolerances: Sequence[float] | None = None,
    repeats: int | None = None,
    timeout: float = 10.0,
    processes: int = 2,
    progress: bool | None = None,
) -> Comparison:
    """Run every solver on every reading of a case and score it against the truth.

    Each run is done by a worker (a process of its own with limits on time and memory): a solver that hangs or
    crashes is a row that says so. An interrupt (Ctrl-C, a notebook's stop button) ends all of them. A script needs no
    ``if __name__ == "__main__"`` guard, unless it has threads and hands over a solver that it defines itself; in a
    notebook such a solver must be imported from a module.

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
    progress : bool, optional
        Whether a line on standard error tells how many rows are done; None: where that is a terminal or a notebook.

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
    if progress not in (None, True, False):
        raise CaseError(f"progress is {progress!r}, wanted None, True or False")
    found: list[Comparison] = []
    shown = sys.stderr is not None and (is_seen(sys.stderr) if progress is None else progress)
    with ProgressLine(sys.stderr, case.name) if shown else nullcontext() as line:
        compare_all([case], options, found.append, observer=line)
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
    observer : Observer, optional
        Is told how it gets on.
    """

    def hand_over(case: Case, readings: list[ReadingResult], records: list[Record]) -> None:
        deliver(Comparison(case, readings, records, options))

    cache_root()  # workers use the folder that is found usable here
    Campaign(cases, options, hand_over, draw=draw, observer=observer).run()


def _frame(kind: type[AnyRow], rows: Sequence[AnyRow], states: Sequence[str] = ()) -> pd.DataFrame:
    """A data frame with these columns; a missing value is NaN in a column of numbers, else None."""
    import pandas as pd

    columns = kind.columns(states)
    return pd.DataFrame([row.values(columns) for row in rows], columns=list(columns))


COLUMNS = ("solver", "right of judged", "digits", "time [ms]", "times as long", "note")
LONGEST_NOTE = 60
"""Characters of a note where the table is printed."""


def summary_rows(rows: Sequence[RunRow]) -> list[tuple[str, ...]]:
    """A row a solver (:data:`COLUMNS`), the one that is right most often first, among equals the fastest.

    ``digits`` are the fewest of any reading in which it is right, ``time`` is the median of its right runs, ``times as
    long`` the geometric mean over readings of its time over the fastest right solver's. All of them are of each
    reading's tightest setting.
    """
    last = tightest(rows)
    return [
        (
            line.solver,
            f"{line.right} of {line.judged}",
            "" if line.digits is None else f"{line.digits:.1f}",
            "" if line.time_s is None else _three(1e3 * line.time_s),
            "" if line.times_as_long is None else _three(line.times_as_long),
            _note([row for row in last if row.solver == line.solver and row.verdict != RIGHT]),
        )
        for line in standings(last)
    ]


def _three(value: float) -> str:
    """A number to three places, without an exponent up to a million."""
    return f"{float(f'{value:.3g}'):g}"


def _note(rows: Sequence[RunRow]) -> str:
    """What became of the first run that is not right, and how many others there are."""
    if not rows:
        return ""
    reason = rows[0].status_reason or ""
    more = f" (and {len(rows) - 1} more)" if len(rows) > 1 else ""
    return f"{rows[0].status}{': ' if reason else ''}{reason}{more}"


def summary(rows: Sequence[RunRow], *, longest: int | None = None) -> Table:
    """The same as a table; ``longest``: characters of a note."""
    lines = summary_rows(rows)
    if longest is not None:
        short = [note if len(note) <= longest else f"{note[: longest - 3]}..." for *_, note in lines]
        lines = [(*line[:-1], note) for line, note in zip(lines, short, strict=True)]
    return Table(COLUMNS, "lrrrrl", lines)
