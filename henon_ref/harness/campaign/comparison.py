"""What a campaign finds of a case: every solver on every reading, scored against the truth, as data frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from henon_ref.casefile.case import Case, Reading
from henon_ref.casefile.notebook import equations_html
from henon_ref.errors import CaseError
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.campaign.truth_job import Statement
from henon_ref.harness.rows import AnyRow, RunRow, StickRow, TransitionRow
from henon_ref.harness.score.gate import Gate, bounds_of, gate
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.score.standing import RIGHT, standings, standings_table, tightest
from henon_ref.harness.table import Table
from henon_ref.text import html, message
from henon_ref.trajectory import Samples

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

LONGEST_NOTE = 60
"""Characters of a note where the table is printed."""


@dataclass(eq=False)
class ReadingResult:
    """What is known of one reading besides the runs' rows."""

    reading: Reading
    statement: Statement
    samples: Samples | None = None
    """The motion on a grid of times, where figures are asked for and a solver could sample."""
    sampled_by: str = ""
    drawn: bool = False
    """Whether its figures have been asked for."""
    figures: dict[str, bytes] = field(default_factory=dict)
    """File name -> SVG."""
    figures_reason: str = ""
    """Why figures are missing."""

    @property
    def expected(self) -> Expected | None:
        """What its runs are scored against; None where no truth could be had."""
        return self.statement.expected


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
        right = sum(run.verdict == RIGHT for run in self.run_rows)
        runs = f"{len(self.records)} runs, {right} of them right"
        readings = f"{len(self.readings)} reading{'s' * (len(self.readings) != 1)}"
        head = message(f"Comparison of {self.case.name}: {readings}, {runs}")
        return f"{head}\n{self._table(LONGEST_NOTE).text}" if self.records else head

    def _table(self, longest: int | None = None) -> Table:
        """A row a solver, the best first; ``longest``: characters of a note."""
        notes: dict[str, str] = {}
        for line in standings(self.run_rows):
            wrong = [row for row in tightest(self.run_rows) if row.solver == line.solver and row.verdict != RIGHT]
            more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
            reason = f": {wrong[0].status_reason}" if wrong and wrong[0].status_reason else ""
            note = f"{wrong[0].status}{reason}{more}" if wrong else ""
            notes[line.solver] = note if longest is None or len(note) <= longest else f"{note[: longest - 3]}..."
        return standings_table(standings(self.run_rows), notes)

    def _repr_html_(self) -> str:
        """What a notebook shows: the table that ``print`` shows, and the case's equations as formulas."""
        problems = {result.reading.name: result.reading.problem for result in self.readings}
        title = f"<p><b>{html(self.case.name)}</b>: {html(self.case.title)}</p>"
        return f"{title}{self._table().html}{equations_html(problems)}"

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


def _frame(kind: type[AnyRow], rows: Sequence[AnyRow], states: Sequence[str] = ()) -> pd.DataFrame:
    """A data frame with these columns; a missing value is NaN in a column of numbers, else None."""
    import pandas as pd

    columns = kind.columns(states)
    return pd.DataFrame([row.values(columns) for row in rows], columns=list(columns))
