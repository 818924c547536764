"""The matrix of a folder of reports brought up to date: fresh rows in the place of a solver's earlier ones."""

from __future__ import annotations

import sys
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

from henon_ref.errors import CaseError
from henon_ref.report.files.write import MANIFEST, RUNS
from henon_ref.report.text.matrix import solvers_of
from henon_ref.report.text.matrix_rows import MatrixRow, case_readings, read_matrix, rows_of_report
from henon_ref.text import message


def merged(folder: Path) -> list[MatrixRow]:
    """The matrix's rows by case, reading and solver: of the reports in a folder, and earlier ones of its matrix.

    An earlier row stays where the case has no report there, and where the report's comparison did not run the solver.
    A report that cannot be read is named, and left out.

    Raises
    ------
    CaseError
        Where the matrix is not what this package writes.
    """
    cases: dict[str, list[MatrixRow]] = {}
    for row in read_matrix(folder):
        cases.setdefault(row.case, []).append(row)
    for manifest in sorted(folder.glob(f"*/{MANIFEST}")):
        if manifest.with_name(RUNS).exists():
            try:
                fresh, readings = rows_of_report(manifest), case_readings(manifest)
            except CaseError as error:
                print(message(f"left out of the index: {error}"), file=sys.stderr)
                continue
            case = manifest.parent.name
            cases[case] = updated(cases.get(case, []), fresh, readings)
    return [row for case in sorted(cases) for row in cases[case]]


def updated(earlier: Sequence[MatrixRow], fresh: Sequence[MatrixRow], readings: Collection[str]) -> list[MatrixRow]:
    """The rows of one case after a comparison of some of its solvers.

    Parameters
    ----------
    earlier, fresh : sequence of MatrixRow
        Of the matrix; title and kind of the fresh ones hold for all.
    readings : collection of str
        Those that the case has now; earlier rows of others go.
    """
    ran = {(row.reading, row.solver) for row in fresh}
    rows = [*fresh, *(row for row in earlier if (row.reading, row.solver) not in ran and row.reading in readings)]
    kinds = {row.problem: row.kind for row in (*earlier, *fresh) if row.kind}
    titles = [row.title for row in fresh][:1]
    rows = [replace(row, kind=kinds.get(row.problem), title=titles[0] if titles else row.title) for row in rows]
    places, solvers = {reading: k for k, reading in enumerate(readings)}, solvers_of(rows)
    return sorted(rows, key=lambda row: (places.get(row.reading, len(places)), solvers.index(row.solver)))
