"""Result of a campaign for one case: every solver on every reading, scored against the truth, as data frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from henon_ref.casefile.case import Case, Reading
from henon_ref.errors import CaseError
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.result_files import AnyRow
from henon_ref.harness.rows import RunRow, StickRow, TransitionRow
from henon_ref.harness.score.gate import Gate, bounds_of, gate
from henon_ref.harness.score.ranking import standings, standings_table, tightest
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.table import Table
from henon_ref.modes.latex import equations_html
from henon_ref.text import html, message
from henon_ref.trajectory import Samples
from henon_ref.workers.worker import Failure

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from henon_ref.harness.truth import Truth


@dataclass(eq=False)
class ReadingResult:
    """Results of one reading other than the rows of its runs."""

    reading: Reading
    truth: Truth | Failure
    """Failure if no truth is available."""
    samples: Samples | None = None
    """Motion on a grid of times; None if no figures are requested or no solver could sample."""
    sampled_by: str = ""
    drawn: bool = False
    """Whether the figures have been queued."""
    figures: dict[str, bytes] = field(default_factory=dict)
    """File name -> SVG."""
    figures_reason: str = ""
    """Reason why figures are missing."""

    @cached_property
    def expected(self) -> Expected | None:
        """Exact run against which the runs are scored; None if no truth is available."""
        return None if isinstance(self.truth, Failure) else expected_of(self.reading, self.truth)


def expected_of(reading: Reading, truth: Truth) -> Expected:
    """Convert a truth to the form that scoring uses."""
    problem = reading.problem
    # If the case does not state that the exact run fails, it was the computation of the truth that failed.
    partial = truth.status == "failed" and (reading.expect is None or reading.expect.status != "failed")
    return Expected(
        status="ok" if partial else truth.status,
        transitions=truth.transitions,
        start=float(problem.start),
        until=float(problem.until),
        end_time=truth.end_time,
        near_grazes=truth.near_grazes,
        start_size=max((abs(float(value)) for value in problem.initial), default=0.0),
        partial=partial,
    )


@dataclass(repr=False)
class Comparison:
    """Results of one case."""

    case: Case
    readings: list[ReadingResult]
    """Truth and samples of every reading that was run."""
    records: list[Record]
    """Runs, ordered by reading, solver and setting."""
    options: Options

    @cached_property
    def runs(self) -> pd.DataFrame:
        """One row per reading, solver and setting (columns of ``runs.csv``)."""
        return _frame(RunRow, self.run_rows)

    @cached_property
    def transitions(self) -> pd.DataFrame:
        """One row per transition (columns of ``transitions.csv``)."""
        return _frame(TransitionRow, self.transition_rows, self.states)

    @cached_property
    def sticks(self) -> pd.DataFrame:
        """One row per stick (columns of ``sticks.csv``)."""
        return _frame(StickRow, self.stick_rows)

    @property
    def run_rows(self) -> list[RunRow]:
        """Rows of :attr:`runs`; a missing value is None."""
        return [record.run for record in self.records]

    @property
    def transition_rows(self) -> list[TransitionRow]:
        """Rows of :attr:`transitions`."""
        return [row for record in self.records for row in record.transitions]

    @property
    def stick_rows(self) -> list[StickRow]:
        """Rows of :attr:`sticks`."""
        return [row for record in self.records for row in record.sticks]

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states of all readings, which are columns of :attr:`transitions`."""
        names = (name for result in self.readings for name in result.reading.problem.system.state_names)
        return tuple(dict.fromkeys(names))

    def __repr__(self) -> str:
        right = sum(run.verdict == "right" for run in self.run_rows)
        runs = f"{len(self.records)} runs, {right} of them right"
        readings = f"{len(self.readings)} reading{'s' * (len(self.readings) != 1)}"
        head = message(f"Comparison of {self.case.name}: {readings}, {runs}")
        return f"{head}\n{self._table(longest=60).text}" if self.records else head

    def _table(self, longest: int | None = None) -> Table:
        """Table with one row per solver, the best first; ``longest`` limits the characters of a note."""
        notes: dict[str, str] = {}
        for line in standings(self.run_rows):
            wrong = [row for row in tightest(self.run_rows) if row.solver == line.solver and row.verdict != "right"]
            more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
            reason = f": {wrong[0].status_reason}" if wrong and wrong[0].status_reason else ""
            note = f"{wrong[0].status}{reason}{more}" if wrong else ""
            notes[line.solver] = note if longest is None or len(note) <= longest else f"{note[: longest - 3]}..."
        return standings_table(standings(self.run_rows), notes)

    def _repr_html_(self) -> str:
        """HTML for a notebook: the table as printed, and the equations of the case as formulas."""
        problems = {result.reading.name: result.reading.problem for result in self.readings}
        title = f"<p><b>{html(self.case.name)}</b>: {html(self.case.title)}</p>"
        return f"{title}{self._table().html}{equations_html(problems)}"

    def plot(self, reading: str | None = None) -> Axes:
        """Draw the work-precision diagram of one reading: largest error of a transition time over wall time.

        Parameters
        ----------
        reading : str, optional
            Name of the reading; None: the first reading.

        Returns
        -------
        Axes
            Axes of a :mod:`matplotlib.pyplot` figure, which a notebook and ``plt.show()`` display.

        Raises
        ------
        CaseError
            If the reading does not exist, or fewer than two timed runs have an error against a truth.
        """
        from matplotlib import pyplot as plt

        from henon_ref.harness.figures import draw_cost

        name = self.readings[0].reading.name if reading is None else self.case.reading(reading).name
        (result,) = (result for result in self.readings if result.reading.name == name)
        rows = [record.run for record in self.of_reading(name)]
        of = name if len(self.readings) > 1 else ""
        drawn = draw_cost(rows, result.expected, of=of) if result.expected is not None else None
        if drawn is None:
            raise CaseError(f"reading '{name}' has fewer than two timed runs with an error to plot")
        # pyplot creates its figures by calling FigureClass; it registers the returned, finished figure as its own.
        figure = plt.figure(FigureClass=lambda *given, **options: drawn)  # type: ignore[arg-type]
        return figure.axes[0]

    def of_reading(self, name: str) -> list[Record]:
        """Return the runs of one reading."""
        return [record for record in self.records if record.run.reading == name]

    @property
    def gate(self) -> Gate:
        """Result of checking the bounds of the case's gate."""
        return gate(bounds_of(self.case), self.run_rows)

    def gate_failures(self) -> list[str]:
        """Return one sentence per violated bound of the case's gate; skip bounds on solvers that did not run."""
        return [words for _, words in self.gate.unmet]


def _frame(kind: type[AnyRow], rows: Sequence[AnyRow], states: Sequence[str] = ()) -> pd.DataFrame:
    """Make a data frame; a missing value is NaN in a column of numbers, and None in any other column."""
    import pandas as pd

    columns = kind.columns(states)
    return pd.DataFrame([row.values(columns) for row in rows], columns=list(columns))
