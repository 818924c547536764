"""The matrix of a folder of reports, ``matrix.csv``: a row a reading and solver, with what its settings come to.

The index is made from it alone, so that it still knows every case where most cases' own folders have been removed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from henon_ref.errors import CaseError
from henon_ref.harness.report.files.write import MATRIX, RUNS
from henon_ref.harness.report.text.ranking import best_of, by_solver, reaching, readings_of
from henon_ref.harness.rows import NOT_RUN, AnyRow, Row, RunRow, TableError, read_rows

SHORT = 12
"""Characters that a commit is told by, as in a report."""
UNJUDGED = (None, "not judged")
"""Verdicts of runs that were not judged."""


@dataclass(frozen=True)
class MatrixRow(Row):
    """A solver on a reading, over all settings; digits and times are rounded, as far as an overview needs them."""

    case: str
    title: str
    """The case's."""
    reading: str
    kind: str | None
    """The reading's (:mod:`henon_ref.harness.score.kinds`)."""
    solver: str
    settings: int = 0
    """Settings that were tried."""
    judged: int = 0
    right: int = 0
    status: str = ""
    """Of the right run with the most digits, else of the last one; so are verdict and digits."""
    verdict: str | None = None
    digits: float | None = None
    wall_s: float | None = None
    """Shortest time of a right run [s]."""
    wall_3_s: float | None = None
    """The same of runs that get the worst transition to three digits [s]."""
    wall_6_s: float | None = None
    wall_9_s: float | None = None
    wall_12_s: float | None = None
    commit: str | None = None
    """The program's when the runs were made."""

    @property
    def problem(self) -> tuple[str, str]:
        """Case and reading."""
        return self.case, self.reading

    def wall(self, digits: int | None) -> float | None:
        """Shortest time to so many digits [s]; None: of any right run."""
        times = {None: self.wall_s, 3: self.wall_3_s, 6: self.wall_6_s, 9: self.wall_9_s, 12: self.wall_12_s}
        return times[digits]


def summary(rows: Sequence[RunRow], *, title: str = "", kind: str | None = None, commit: str = "") -> MatrixRow:
    """What the settings of one solver on one reading come to; at least one."""
    best, right = best_of(rows), [row for row in rows if row.verdict == "right"]
    return MatrixRow(
        best.case,
        title,
        best.reading,
        kind,
        best.solver,
        settings=len(rows),
        judged=sum(row.status not in NOT_RUN and row.verdict not in UNJUDGED for row in rows),
        right=len(right),
        status=best.status,
        verdict=best.verdict,
        digits=None if best.digits is None else math.floor(best.digits * 1000) / 1000,
        wall_s=_shortest(right),
        wall_3_s=_shortest(reaching(rows, 3)),
        wall_6_s=_shortest(reaching(rows, 6)),
        wall_9_s=_shortest(reaching(rows, 9)),
        wall_12_s=_shortest(reaching(rows, 12)),
        commit=commit,
    )


def _shortest(rows: Sequence[RunRow]) -> float | None:
    walls = [row.wall_s for row in rows if row.wall_s is not None]
    return float(f"{min(walls):.4g}") if walls else None


def rows_of_report(manifest: Path) -> list[MatrixRow]:
    """The matrix's rows of one case, from the folder of its report.

    Raises
    ------
    CaseError
        Where manifest or runs are not what this package writes.
    """
    content, runs = _content(manifest), _rows(RunRow, manifest.with_name(RUNS), "list of runs")
    commit, readings = short_commit(_text(content.get("commit")) or "", SHORT), content.get("readings")
    case = manifest.parent.name
    return [
        replace(summary(own, title=content["title"], kind=_kind(readings, reading), commit=commit), case=case)
        for (_, reading), rows in readings_of(runs).items()
        for own in by_solver(rows).values()
    ]


def _rows(kind: type[AnyRow], file: Path, what: str) -> list[AnyRow]:
    try:
        return read_rows(kind, file)
    except (OSError, UnicodeDecodeError) as error:
        raise CaseError(f"cannot be read: {error}", file=str(file)) from error
    except TableError as error:
        raise CaseError(f"is no {what} of this package: {error}", file=str(file)) from error


def case_readings(manifest: Path) -> list[str]:
    """All readings of a report's case, of whatever solvers; of an earlier version's report those that it has.

    Raises
    ------
    CaseError
        Where it is not what this package writes.
    """
    content = _content(manifest)
    named = content.get("case_readings", content.get("readings"))
    return [str(reading) for reading in named] if isinstance(named, list | dict) else []


def _content(manifest: Path) -> dict[str, Any]:
    try:
        content = json.loads(manifest.read_text(encoding="utf-8"))
    except (OSError, RecursionError, ValueError) as error:
        raise CaseError(f"cannot be read: {error}", file=str(manifest)) from error
    if not isinstance(content, dict) or not isinstance(content.get("title"), str):
        raise CaseError("is no manifest of a report: it names no title", file=str(manifest))
    return content


def short_commit(commit: str, length: int) -> str:
    """The beginning of a commit, with the mark of files that differed from it.

    Examples
    --------
    >>> short_commit("9994b95c2562ec65", 7), short_commit("9994b95c2562ec65+", 7), short_commit("9994b95+", 7)
    ('9994b95', '9994b95+', '9994b95+')
    """
    return commit.rstrip("+")[:length] + ("+" if commit.endswith("+") else "")


def commits_of(rows: Sequence[MatrixRow], length: int = SHORT) -> list[str]:
    """The commits of the program that made some rows of the matrix, each once, in the rows' order."""
    return list(dict.fromkeys(short_commit(row.commit, length) for row in rows if row.commit))


def _kind(readings: object, reading: str) -> str | None:
    """The kind that a manifest gives a reading; those of earlier versions give none."""
    own = readings.get(reading) if isinstance(readings, dict) else None
    return _text(own.get("kind")) if isinstance(own, dict) else None


def _text(value: object) -> str | None:
    return value if isinstance(value, str) and value else None


def read_matrix(folder: Path) -> list[MatrixRow]:
    """The rows of a folder's matrix; none where it has none.

    Raises
    ------
    CaseError
        Where it is not what this package writes.
    """
    file = folder / MATRIX
    return _rows(MatrixRow, file, "matrix") if file.exists() else []
