"""Matrix of a folder of reports, ``matrix.csv``: a row per reading and solver, which summarises all settings.

Index and page are made from the matrix, and therefore still cover the cases whose folders have been removed.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from henon_ref.errors import CaseError
from henon_ref.grouping import grouped
from henon_ref.harness import registry
from henon_ref.harness.report.folder import MANIFEST, MATRIX, RUNS, mapping
from henon_ref.harness.result_files import AnyRow, TableError, read_rows, refuse_pipe
from henon_ref.harness.rows import ReadingRow, RunRow
from henon_ref.harness.score.ranking import LEVELS, best_of, by_solver, reaching, readings_of
from henon_ref.text import message


@dataclass(frozen=True)
class MatrixRow(ReadingRow):
    """Summary of a solver on a reading over all settings; digits and times are rounded."""

    kind: str | None
    """Kind of the reading (:func:`henon_ref.harness.score.reference.kind_of`)."""
    solver: str
    settings: int = 0
    """Number of settings tried."""
    judged: int = 0
    right: int = 0
    status: str = ""
    """Status of the right run with the most digits, else of the last run; verdict and digits are of the same run."""
    verdict: str | None = None
    digits: float | None = None
    wall_s: float | None = None
    """Shortest time of a right run [s]."""
    wall_3_s: float | None = None
    """Shortest time of a right run with at least three digits in its worst transition [s]."""
    wall_6_s: float | None = None
    wall_9_s: float | None = None
    wall_12_s: float | None = None
    commit: str | None = None
    """Commit of the program that made the runs."""

    def wall(self, digits: int | None) -> float | None:
        """Return the shortest time of a right run with a number of digits [s]; None: with any digits."""
        found: float | None = getattr(self, wall_column(digits))
        return found


def wall_column(digits: int | None) -> str:
    """Return the column of the times for a number of digits in ``LEVELS``; None: for any right run."""
    return f"wall_{digits}_s" if digits else "wall_s"


def summary(rows: Sequence[RunRow], *, kind: str | None = None, commit: str = "") -> MatrixRow:
    """Summarise the runs of one solver on one reading, at least one, in one row."""
    best, right = best_of(rows), [row for row in rows if row.verdict == "right"]
    walls = {wall_column(digits): _shortest(reaching(rows, digits)) for digits in LEVELS}
    return MatrixRow(
        best.case,
        best.reading,
        kind,
        best.solver,
        settings=len(rows),
        judged=sum(row.judged for row in rows),
        right=len(right),
        status=best.status,
        verdict=best.verdict,
        digits=None if best.digits is None else math.floor(best.digits * 1000) / 1000,
        wall_s=_shortest(right),
        commit=commit,
        **walls,
    )


def _shortest(rows: Sequence[RunRow]) -> float | None:
    walls = [row.wall_s for row in rows if row.wall_s is not None]
    return float(f"{min(walls):.4g}") if walls else None


def solvers_of(rows: Iterable[MatrixRow | RunRow]) -> list[str]:
    """Return the solvers of some rows, in the order of the registry."""
    return registry.in_order(row.solver for row in rows)


def commits_of(rows: Sequence[MatrixRow]) -> list[str]:
    return list(dict.fromkeys(row.commit for row in rows if row.commit))


def read_report(folder: Path) -> tuple[Mapping[str, Any], list[RunRow]]:
    """Read the manifest and the runs of a case's report; CaseError if they were not written by this package."""
    file = folder / MANIFEST
    try:
        refuse_pipe(file)
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, RecursionError, ValueError) as error:
        raise CaseError(f"cannot be read: {error}", file=str(file)) from error
    if not isinstance(mapping(content).get("title"), str):
        raise CaseError("is not the manifest of a report: it has no title", file=str(file))
    return content, _rows(RunRow, folder / RUNS, "list of runs")


def _text(value: object) -> str | None:
    return value if isinstance(value, str) and value else None


def read_matrix(folder: Path) -> list[MatrixRow]:
    """Read the rows of a folder's matrix; empty if there is none, CaseError if this package has not written it."""
    file = folder / MATRIX
    return _rows(MatrixRow, file, "matrix") if file.exists() else []


def _rows(kind: type[AnyRow], file: Path, what: str) -> list[AnyRow]:
    try:
        return read_rows(kind, file)
    except (OSError, UnicodeDecodeError) as error:
        raise CaseError(f"cannot be read: {error}", file=str(file)) from error
    except TableError as error:
        raise CaseError(f"is not a {what} of this package: {error}", file=str(file)) from error


def rows_of_report(folder: Path) -> tuple[list[MatrixRow], list[str]]:
    """Make the rows of the matrix for one case from the folder of its report; return them and all its readings."""
    manifest, runs = read_report(folder)
    commit, readings = _text(manifest.get("commit")) or "", mapping(manifest.get("readings"))
    commit = commit.rstrip("+")[:12] + ("+" if commit.endswith("+") else "")  # + marks a modified checkout
    kinds = {reading: _text(mapping(own).get("kind")) for reading, own in readings.items()}  # None in old manifests
    rows = [
        replace(summary(own, kind=kinds.get(reading), commit=commit), case=folder.name)
        for (_, reading), rows in readings_of(runs).items()
        for own in by_solver(rows).values()
    ]
    named = manifest.get("case_readings", manifest.get("readings"))  # old manifests list the readings that ran
    return rows, list(map(str, named)) if isinstance(named, list | dict) else []


def merged(folder: Path) -> list[MatrixRow]:
    """Merge the reports in a folder into the rows of its matrix, sorted by case, reading and solver.

    An earlier row is kept if the case has no report in the folder, or if the report did not run the solver. A report
    that cannot be read is skipped with a message. A matrix that cannot be read is an error.
    """
    cases = grouped(read_matrix(folder), lambda row: row.case)
    for report in sorted(file.parent for file in folder.glob(f"*/{MANIFEST}") if file.with_name(RUNS).exists()):
        try:
            fresh, readings = rows_of_report(report)
        except CaseError as error:
            print(message(f"left out of the index: {error}"), file=sys.stderr)
            continue
        cases[report.name] = updated(cases.get(report.name, []), fresh, readings)
    return [row for case in sorted(cases) for row in cases[case]]


def updated(earlier: Sequence[MatrixRow], fresh: Sequence[MatrixRow], readings: Collection[str]) -> list[MatrixRow]:
    """Merge the rows of one case after a comparison of some of its solvers.

    Earlier rows of readings that are not in ``readings`` are removed. The kinds of the fresh rows replace earlier ones.
    """
    ran = {(row.reading, row.solver) for row in fresh}
    rows = [*fresh, *(row for row in earlier if (row.reading, row.solver) not in ran and row.reading in readings)]
    kinds = {row.problem: row.kind for row in (*earlier, *fresh) if row.kind}
    rows = [replace(row, kind=kinds.get(row.problem)) for row in rows]
    places, solvers = {reading: k for k, reading in enumerate(readings)}, solvers_of(rows)
    return sorted(rows, key=lambda row: (places.get(row.reading, len(places)), solvers.index(row.solver)))
