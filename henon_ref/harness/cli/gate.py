"""The command: whether reports hold: the bounds of their cases, solvers that have to be right, an earlier comparison.

Exit status 1: a bound is not met or none was checked, a required solver is wrong, a row is worse than in the baseline;
for the others see :mod:`henon_ref.commands.exit_status`.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.atomic_write import replace_file
from henon_ref.commands.exit_status import DONE, NOT_MET, command_of, say
from henon_ref.commands.typer_app import application, examples
from henon_ref.errors import CaseError
from henon_ref.harness.cli.compare import names
from henon_ref.harness.report.folder import MANIFEST, RUNS
from henon_ref.harness.report.manifest import read_bounds
from henon_ref.harness.report.text.gate import (
    bounds_left_out,
    demands_state,
    gate_state,
    junit_xml,
    step_summary,
    why_unchecked,
)
from henon_ref.harness.rows import AnyRow, Key, RunRow, TableError, read_rows
from henon_ref.harness.score.gate import Gate, demand, gate, held_against
from henon_ref.harness.score.row_result import KnownFailure, RowResult, check_status, row_result
from henon_ref.harness.table import count
from henon_ref.text import did_you_mean, listed, message, shortened

app = application()

SUMMARY = "GITHUB_STEP_SUMMARY"
"""Environment variable: the file to which a step of a GitHub workflow appends its summary."""
MOST_NAMED = 8
"""Rows that one message names."""
EXAMPLES = ("gate out", "gate out --require my-solver --junit junit.xml", "gate out --baseline ci/runs.csv")


@app.command(epilog=examples(*EXAMPLES))
def main(
    report: Annotated[
        Path, typer.Argument(help="A report's folder, or a folder of reports.", show_default=False, metavar="REPORT")
    ],
    require: Annotated[
        str | None,
        typer.Option(
            help="Solvers with commas: one that is wrong by its own fault in some reading, at its tightest setting, or "
            "is not judged in any, does not pass.",
            metavar="NAMES",
        ),
    ] = None,
    baseline: Annotated[
        Path | None,
        typer.Option(
            help="An earlier runs.csv, or a folder of reports: a row whose status got worse, or the digits of its "
            "times by more than 0.5, does not pass.",
            metavar="CSV",
        ),
    ] = None,
    known: Annotated[
        Path | None,
        typer.Option(help="Failures that are expected: they are told, and count for nothing.", metavar="CSV"),
    ] = None,
    junit: Annotated[
        Path | None, typer.Option(help="Write the rows as JUnit XML, a test case a row.", metavar="FILE")
    ] = None,
) -> int:
    """Tell whether reports hold: the bounds of their cases, required solvers, an earlier comparison."""
    runs = runs_in(report)
    rows = [*chain.from_iterable(runs.values())]
    bounds = [own for file in runs for own in read_bounds(file.with_name(MANIFEST))]
    earlier = None if baseline is None else [*chain.from_iterable(runs_in(baseline).values())]
    held = Held(rows, [] if known is None else read_known(known))
    found = gate(bounds, rows)
    unmet = held.bounds_unmet(found)
    demands = {solver: demand(solver, rows, held.is_known) for solver in names(require) or ()}
    unmet += [f"required: {words}" for solver, own in demands.items() for words in own.unmet(solver)]
    unmet += [] if earlier is None else held.worse(earlier)
    told = [*unmet, *held.known_lines()]
    for line in told:
        say(line)
    results = [(row, held.result(row)) for row in rows]
    if junit is not None:
        _write_junit(junit, junit_xml(results))
    if os.environ.get(SUMMARY):
        _append(Path(os.environ[SUMMARY]), step_summary(results, told))
    state = gate_state(found, any(line.startswith("gate: ") for line in unmet), wanted=False)
    print(message(f"{report}: {count(len(rows), 'row')}{state}{demands_state(demands)}"))
    return NOT_MET if unmet else DONE


command = command_of(app, "gate")


@dataclass
class Held:
    """Rows, and what is wrong with each besides its status: bounds that are not met, what is worse than it was."""

    rows: Sequence[RunRow]
    known: Sequence[KnownFailure]
    complaints: dict[Key, list[str]] = field(default_factory=dict)

    def is_known(self, row: RunRow) -> bool:
        """Whether a failure of this row is expected."""
        return any(entry.covers(row) for entry in self.known)

    def result(self, row: RunRow) -> RowResult:
        """What a row is to a test runner."""
        return row_result(row, self.complaints.get(row.key, ()), known=self.is_known(row))

    def _complain(self, found: Iterable[tuple[RunRow, str, str]], what: str) -> list[str]:
        """Note each complaint (row, words, sentence); the sentences on what is not expected."""
        told = []
        for row, words, sentence in found:
            self.complaints.setdefault(row.key, []).append(f"{what}: {words}")
            told += [] if self.is_known(row) else [sentence]
        return told

    def bounds_unmet(self, found: Gate) -> list[str]:
        """A sentence for every bound that is not met, expected ones left out; that none was checked."""
        unmet = self._complain(((row, words, f"gate: {row.case}: {words}") for row, words in found.unmet), "gate")
        if found.left_out:
            say(f"gate: {bounds_left_out(found)}")
        return [*unmet, f"gate: {why_unchecked(found)}"] if found.missing else unmet

    def worse(self, earlier: Sequence[RunRow]) -> list[str]:
        """A sentence for every row that is worse than it was, expected ones left out; that none was compared."""
        regression = held_against(self.rows, earlier)
        changes = ((row, regression.worse[row.key]) for row in self.rows if row.key in regression.worse)
        sentences = self._complain(
            ((row, words, f"baseline: {row.name}: {words}") for row, words in changes), "worse than the baseline"
        )
        new = len(self.rows) - regression.compared
        beside = f", {count(new, 'row')} of now not in it" if new else ""
        say(f"baseline: {count(regression.compared, 'row')} compared, {len(sentences) or 'none'} worse{beside}")
        if regression.missing:
            named = listed([row.name for row in regression.missing], MOST_NAMED)
            say(f"baseline: {count(len(regression.missing), 'row')} did not run now: {named}")
        return sentences if regression.compared else ["baseline: none of its rows is among those that ran"]

    def known_lines(self) -> list[str]:
        """What became of each failure that was expected, a line each."""
        lines = []
        for entry in self.known:
            own = [row for row in self.rows if entry.names(row)]
            bad = [row for row in own if row.verdict != "right" or row.repeated or row.key in self.complaints]
            if failing := [f"{row.name}: {row.status_text}" for row in bad if entry.covers(row)]:
                why = f" ({entry.reason})" if entry.reason else ""
                lines.append(f"known: {entry.name}: fails as expected{why}: {listed(failing, MOST_NAMED)}")
            elif own and not bad:
                lines.append(f"known: {entry.name}: mended: nothing of it fails any more; take the line out")
            elif not own:
                lines.append(f"known: {entry.name}: no row is meant by it")
        return lines


def runs_in(path: Path) -> dict[Path, list[RunRow]]:
    """The rows of the ``runs.csv`` that a path is, or of those of the reports in a folder, by file.

    Raises
    ------
    CaseError
        Where there is none, or a file that is none.
    """
    files = [path] if path.is_file() else [path / RUNS] if (path / RUNS).is_file() else sorted(path.glob(f"*/{RUNS}"))
    if not files:
        what = "no report is in it" if path.is_dir() else "there is no such file"
        raise CaseError(f"{what}; wanted is a {RUNS}, or a folder of reports", file=str(path))
    found = {file: rows_of(RunRow, file) for file in files}
    for file, rows in found.items():
        for row in rows:
            try:
                check_status(row.status)
            except ValueError as error:
                raise CaseError(f"{row.name}: {error}", file=str(file)) from None
    return found


def rows_of(kind: type[AnyRow], path: Path) -> list[AnyRow]:
    """The rows of a file.

    Raises
    ------
    CaseError
        For a file that cannot be read, or is none: with line and column.
    """
    try:
        return read_rows(kind, path)
    except TableError as error:
        raise CaseError(str(error), file=str(path), line=error.line, column=error.column) from None
    except (OSError, UnicodeDecodeError) as error:
        raise CaseError(f"cannot be read: {error}", file=str(path)) from None


def read_known(path: Path) -> list[KnownFailure]:
    """Failures that are expected, a line each; an empty field stands for any.

    Raises
    ------
    CaseError
        For a file that is none, with line and column.
    """
    found = rows_of(KnownFailure, path)
    with path.open(encoding="utf-8-sig", newline="") as file:
        header = next(csv.reader(file), [])
    allowed = KnownFailure.columns()
    for name in map(str.strip, header):
        if name not in (*allowed, *RunRow.columns()):  # a word that is misspelt would stand for any
            words = f"{shortened(name)} is no column here; there are {', '.join(allowed)}{did_you_mean(name, allowed)}"
            raise CaseError(words, file=str(path), line=1, column=1)
    return found


def _write_junit(path: Path, content: bytes) -> None:
    try:
        path.resolve().parent.mkdir(parents=True, exist_ok=True)
        replace_file(path.resolve(), content)
    except OSError as error:
        raise CaseError(f"cannot write {path}: {error.strerror or error}; --junit needs the name of a file") from error


def _append(path: Path, text: str) -> None:
    """Append a step's summary; where the runner's file cannot be written, that is told and changes nothing else."""
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(f"\n{text}" if file.tell() else text)
    except OSError as error:
        say(f"the step's summary cannot be written: {path}: {error.strerror or error}")
