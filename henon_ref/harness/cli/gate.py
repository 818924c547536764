"""Command ``gate``: check reports against the bounds of their cases, required solvers and an earlier comparison.

The exit status is 1 if a bound is violated, if there are bounds and none was checked, if a required solver is wrong,
or if a row is worse than in the baseline.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.atomic_write import replace_file
from henon_ref.commands import application, examples, path_of
from henon_ref.commands.exit_status import DONE, NOT_MET, command_of, say
from henon_ref.errors import CaseError
from henon_ref.harness.cli.compare import names
from henon_ref.harness.report.folder import MANIFEST, RUNS
from henon_ref.harness.report.gate import (
    bounds_left_out,
    demands_state,
    gate_state,
    junit_xml,
    step_summary,
    why_unchecked,
)
from henon_ref.harness.report.manifest import read_bounds
from henon_ref.harness.result_files import rows_in_file
from henon_ref.harness.rows import Key, RunRow
from henon_ref.harness.score.gate import (
    Gate,
    KnownFailure,
    RowKind,
    check_status,
    demand,
    gate,
    held_against,
    row_result,
)
from henon_ref.harness.table import count
from henon_ref.text import did_you_mean, listed, message, shortened

app = application()

SUMMARY = "GITHUB_STEP_SUMMARY"
"""Environment variable with the file to which a step of a GitHub workflow appends its summary."""
MOST_NAMED = 8
"""Largest number of rows named in one message."""


@app.command(
    epilog=examples("gate out", "gate out --require my-solver --junit junit.xml", "gate out --baseline ci/runs.csv")
)
def main(
    report: Annotated[
        Path,
        typer.Argument(
            help="A report's folder, or a folder of reports.", show_default=False, metavar="REPORT", parser=path_of
        ),
    ],
    require: Annotated[
        str | None,
        typer.Option(
            help="Solvers, separated by commas. The gate fails if one of them is wrong through its own fault at its "
            "tightest setting in some reading, or is not judged in any reading.",
            metavar="NAMES",
        ),
    ] = None,
    baseline: Annotated[
        Path | None,
        typer.Option(
            help="An earlier runs.csv, or a folder of reports. The gate fails if the status of a row is worse than "
            "there, or its transition times have lost more than 0.5 digits.",
            metavar="CSV",
            parser=path_of,
        ),
    ] = None,
    known: Annotated[
        Path | None,
        typer.Option(help="List of expected failures. They are reported, but do not fail the gate.", metavar="CSV"),
    ] = None,
    junit: Annotated[
        Path | None, typer.Option(help="Write the rows as JUnit XML, one test case per row.", metavar="FILE")
    ] = None,
) -> int:
    """Check reports against the bounds of their cases, required solvers, and an earlier comparison."""
    runs = runs_in(report)
    rows = [*chain.from_iterable(runs.values())]
    manifests = [file.with_name(MANIFEST) for file in runs]
    bounds = [own for manifest in manifests for own in read_bounds(manifest)]
    if missing := [str(manifest) for manifest in manifests if not manifest.exists()]:
        say(f"gate: the bounds of these reports are unknown, since there is no {listed(missing, MOST_NAMED)}")
    earlier = None if baseline is None else [*chain.from_iterable(runs_in(baseline).values())]
    held = Held(rows, [] if known is None else read_known(known))
    found = gate(bounds, rows)
    unmet = held.bounds_unmet(found)
    demands = {solver: demand(solver, rows, held.is_known) for solver in names(require, "--require") or ()}
    unmet += [f"required: {words}" for solver, own in demands.items() for words in own.unmet(solver)]
    unmet += [] if earlier is None else held.worse(earlier)
    lines = [*unmet, *held.known_lines()]
    for line in lines:
        say(line)
    results = [(row, *held.result(row)) for row in rows]
    if junit is not None:
        _write_junit(junit, junit_xml(results))
    if os.environ.get(SUMMARY):
        _append(Path(os.environ[SUMMARY]), step_summary(results, lines))
    state = gate_state(found, any(line.startswith("gate: ") for line in unmet), wanted=False)
    print(message(f"{report}: {count(len(rows), 'row')}{state}{demands_state(demands)}"))
    return NOT_MET if unmet else DONE


command = command_of(app, "gate")


@dataclass
class Held:
    """Rows, and complaints about each row: violated bounds, and changes for the worse."""

    rows: Sequence[RunRow]
    known: Sequence[KnownFailure]
    complaints: dict[Key, list[str]] = field(default_factory=dict)

    def is_known(self, row: RunRow) -> bool:
        return any(entry.covers(row) for entry in self.known)

    def result(self, row: RunRow) -> tuple[RowKind, str]:
        return row_result(row, self.complaints.get(row.key, ()), known=self.is_known(row))

    def _complain(self, found: Iterable[tuple[RunRow, str, str]], what: str) -> list[str]:
        """Note each complaint (row, words, sentence); return the sentences about unexpected failures."""
        sentences = []
        for row, words, sentence in found:
            self.complaints.setdefault(row.key, []).append(f"{what}: {words}")
            sentences += [] if self.is_known(row) else [sentence]
        return sentences

    def bounds_unmet(self, found: Gate) -> list[str]:
        """Return a sentence for every violated bound that is not an expected failure, or if no bound was checked."""
        unmet = self._complain(((row, words, f"gate: {row.case}: {words}") for row, words in found.unmet), "gate")
        if found.left_out:
            say(f"gate: {bounds_left_out(found)}")
        return [*unmet, f"gate: {why_unchecked(found)}"] if found.missing else unmet

    def worse(self, earlier: Sequence[RunRow]) -> list[str]:
        """Return a sentence for every row that is worse and not an expected failure, or if no row was compared."""
        changes, missing = held_against(self.rows, earlier)
        worse = [(row, words) for row in self.rows if (words := changes.get(row.key))]
        sentences = self._complain(
            ((row, words, f"baseline: {row.name}: {words}") for row, words in worse), "worse than the baseline"
        )
        new = len(self.rows) - len(changes)
        added = f", {count(new, 'new row')}" if new else ""
        say(f"baseline: {count(len(changes), 'row')} compared, {len(sentences) or 'none'} worse{added}")
        if missing:
            named = listed([row.name for row in missing], MOST_NAMED)
            say(f"baseline: {count(len(missing), 'row')} of it did not run this time: {named}")
        return sentences if changes else ["baseline: none of its rows ran this time"]

    def known_lines(self) -> list[str]:
        """Return one line on the present state of each expected failure."""
        lines = []
        for entry in self.known:
            own = [row for row in self.rows if entry.names(row)]
            bad = [row for row in own if row.verdict != "right" or row.repeated or row.key in self.complaints]
            if failing := [f"{row.name}: {row.status_text}" for row in bad if entry.covers(row)]:
                why = f" ({entry.reason})" if entry.reason else ""
                lines.append(f"known: {entry.name}: fails as expected{why}: {listed(failing, MOST_NAMED)}")
            elif own and not bad:
                lines.append(f"known: {entry.name}: fixed: no matching row fails any more; remove the line")
            elif not own:
                lines.append(f"known: {entry.name}: no row matches it")
        return lines


def runs_in(path: Path) -> dict[Path, list[RunRow]]:
    """Read the rows of a ``runs.csv``, or of all reports in a folder, by file; CaseError if there is none."""
    files = [path] if path.is_file() else [path / RUNS] if (path / RUNS).is_file() else sorted(path.glob(f"*/{RUNS}"))
    if not files:
        other = "this is not a regular file" if path.exists() else "there is no such file"
        what = "the folder has no report" if path.is_dir() else other
        raise CaseError(f"{what}; expected a {RUNS}, or a folder of reports", file=str(path))
    found = {file: rows_in_file(RunRow, file) for file in files}
    for file, rows in found.items():
        for row in rows:
            try:
                check_status(row.status)
            except ValueError as error:
                raise CaseError(f"{row.name}: {error}", file=str(file)) from None
    return found


def read_known(path: Path) -> list[KnownFailure]:
    """Read a file of expected failures, one per line; an empty field matches any value."""
    if path.exists() and not path.is_file():  # a pipe can be read only once
        raise CaseError("this is not a regular file", file=str(path))
    header: list[str] = []
    with suppress(OSError, UnicodeDecodeError, csv.Error), path.open(encoding="utf-8-sig", newline="") as file:
        header = next(csv.reader(file), [])  # if it cannot be read, rows_in_file says why
    allowed = KnownFailure.columns()
    for name in map(str.strip, header):
        if name not in (*allowed, *RunRow.columns()):  # the missing column of a misspelt name would match any value
            words = f"unknown column {shortened(name)}; allowed: {', '.join(allowed)}{did_you_mean(name, allowed)}"
            raise CaseError(words, file=str(path), line=1, column=1)
    return rows_in_file(KnownFailure, path)


def _write_junit(path: Path, content: bytes) -> None:
    try:
        path.resolve().parent.mkdir(parents=True, exist_ok=True)
        replace_file(path.resolve(), content)
    except OSError as error:
        raise CaseError(f"cannot write {path}: {error.strerror or error}; --junit needs the name of a file") from error


def _append(path: Path, text: str) -> None:
    """Append the summary of a step; if the file cannot be written, print a message and continue."""
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(f"\n{text}" if file.tell() else text)
    except OSError as error:
        say(f"cannot write the step summary: {path}: {error.strerror or error}")
