"""What a comparison does for a test runner: JUnit XML, a step's summary, a baseline, failures that are expected."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from henon_ref.campaign.comparison import Comparison
from henon_ref.cli.ci_files import read_baseline, read_known
from henon_ref.cli.exit_status import say
from henon_ref.cli.request import Request
from henon_ref.report.files.junit import check_junit, write_junit
from henon_ref.report.text.formats import count
from henon_ref.report.text.step_summary import step_summary
from henon_ref.rows import Key, RunRow
from henon_ref.score.gate import unmet_bounds
from henon_ref.score.known import KnownFailure, fails, found
from henon_ref.score.regression import Regression, held_against, names
from henon_ref.score.row_result import RowResult, row_result
from henon_ref.text import listed

SUMMARY = "GITHUB_STEP_SUMMARY"
"""Environment variable: the file to which a step of a GitHub workflow appends its summary."""
MOST_NAMED = 8
"""Rows that one message names."""


@dataclass
class CiOutputs:
    """Collects the rows of a comparison, and tells a test runner of them.

    Parameters
    ----------
    junit, summary : Path, optional
        Files to write, and to append to.
    earlier : list of RunRow, optional
        Rows to hold those of now against.
    known : sequence of KnownFailure
    gated : bool
        Whether a bound of a gate that is not met is a failure.
    """

    junit: Path | None = None
    summary: Path | None = None
    earlier: list[RunRow] | None = None
    known: Sequence[KnownFailure] = ()
    gated: bool = False
    rows: list[RunRow] = field(default_factory=list)
    complaints: dict[Key, list[str]] = field(default_factory=dict)
    """What is wrong with a row besides its status: bounds that are not met, what is worse than it was."""
    failing: set[Key] = field(default_factory=set)
    """Rows with a complaint, or a bound that is not met where that decides nothing."""

    def is_known(self, row: RunRow) -> bool:
        """Whether a failure of this row is expected."""
        return any(entry.covers(row) for entry in self.known)

    def gate_failures(self, comparison: Comparison) -> list[str]:
        """A sentence for every bound of a case's gate that is not met, expected ones left out; keeps the rows."""
        self.rows += comparison.run_rows
        sentences = []
        for result in comparison.readings:
            own = [record.run for record in comparison.of_reading(result.reading.name)]
            for row, words in unmet_bounds(result.reading, own):
                self.failing.add(row.key)
                if self.gated:
                    self.complaints.setdefault(row.key, []).append(f"gate: {words}")
                if not self.is_known(row):
                    sentences.append(f"{comparison.case.name}: {words}")
        return sentences

    def worse(self) -> list[str]:
        """A sentence for every row that is worse than it was, expected ones left out; that none was compared."""
        if self.earlier is None:
            return []
        regression = held_against(self.rows, self.earlier)
        by_key = {row.key: row for row in self.rows}
        for key, words in regression.worse.items():
            self.failing.add(key)
            self.complaints.setdefault(key, []).append(f"worse than the baseline: {words}")
        sentences = [
            f"{by_key[key].name}: {words}" for key, words in regression.worse.items() if not self.is_known(by_key[key])
        ]
        for line in _compared(regression, self.rows, worse=len(sentences)):
            say(line)
        return sentences if regression.compared else ["none of its rows is among those that ran"]

    def write(self, unmet: Mapping[str, Sequence[str]]) -> None:
        """Tell of expected failures, and write the files; ``unmet``: the sentences that the command tells, by option.

        Raises
        ------
        CaseError
            Where the JUnit file cannot be written any more.
        """
        told = self._known_lines()
        for line in told:
            say(line)
        results = [(row, self._result(row)) for row in self.rows]
        if self.summary is not None:
            lines = [f"{what}: {words}" for what, sentences in unmet.items() for words in sentences]
            _append(self.summary, step_summary(results, [*lines, *told]))
        if self.junit is not None:
            write_junit(self.junit, results)

    def _result(self, row: RunRow) -> RowResult:
        return row_result(row, self.complaints.get(row.key, ()), known=self.is_known(row))

    def _known_lines(self) -> list[str]:
        """What became of each failure that was expected, a line each."""
        lines, nowhere = [], []
        for state in found(self.known, self.rows, lambda row: fails(row) or row.key in self.failing):
            where = f"known: {state.entry.place}: "
            if state.mended:
                lines.append(f"{where}mended: nothing of it fails any more; take the line out")
            elif state.failing:
                shown = [f"{row.name}: {row.status_text}" for row in state.failing]
                why = f" ({state.entry.reason})" if state.entry.reason else ""
                lines.append(f"{where}fails as expected{why}: {listed(shown, MOST_NAMED)}")
            elif not state.named:
                nowhere.append(state.entry.place)
        if nowhere:
            lines.append(f"known: no row of this run is meant by {listed(nowhere, MOST_NAMED)}")
        return lines


def ci_outputs(request: Request) -> CiOutputs:
    """What a command was asked to do for a test runner, all files read and every path looked at.

    Raises
    ------
    CaseError
        For a file that cannot be read, and a JUnit file that cannot be written.
    """
    earlier = None if request.baseline is None else read_baseline(request.baseline)
    known = [] if request.known is None else read_known(request.known)
    if request.junit is not None:
        check_junit(request.junit, [path for path in (*request.cases, request.baseline, request.known) if path])
    summary = os.environ.get(SUMMARY)
    return CiOutputs(request.junit, Path(summary) if summary else None, earlier, known, gated=request.gate)


def _append(path: Path, text: str) -> None:
    """Append a step's summary; where the runner's file cannot be written, that is told and changes nothing else."""
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(f"\n{text}" if file.tell() else text)
    except OSError as error:
        say(f"the step's summary cannot be written: {path}: {error.strerror or error}")


def _compared(regression: Regression, rows: Sequence[RunRow], *, worse: int) -> list[str]:
    """How many rows were held against the baseline, and which could not be."""
    new = len(rows) - regression.compared
    beside = f", {count(new, 'row')} of now not in it" if new else ""
    lines = [f"baseline: {count(regression.compared, 'row')} compared, {worse or 'none'} worse{beside}"]
    if regression.missing:
        missing = count(len(regression.missing), "row")
        lines.append(f"baseline: {missing} did not run now: {_names_of_missing(regression.missing, rows)}")
    return lines


def _names_of_missing(missing: Sequence[Key], rows: Sequence[RunRow]) -> str:
    """Earlier rows by the case or the solver that did not run at all, the others one by one."""
    cases, solvers = {row.case for row in rows}, {row.solver for row in rows}
    by: dict[str, list[str]] = {"case": [], "solver": [], "row": []}
    for key in missing:
        case, _, solver, *_ = key
        if case not in cases:
            by["case"].append(case)
        elif solver not in solvers:
            by["solver"].append(solver)
        else:
            by["row"] += names([key])
    parts = ((what, list(dict.fromkeys(named))) for what, named in by.items())
    return "; ".join(f"{what}{'s' * (len(named) > 1)} {listed(named, MOST_NAMED)}" for what, named in parts if named)
