"""The matrix of a folder of reports, ``matrix.csv``: a row a reading and solver, with what its settings come to.

The index is made from it alone, so that it still knows every case where most cases' own folders have been removed.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from henon_ref.columns import RUN_COLUMNS, Row
from henon_ref.errors import CaseError
from henon_ref.report.files.csv_files import read_rows
from henon_ref.report.files.write import MATRIX, RUNS
from henon_ref.report.text.ranking import LEVELS, NOT_RUN, best_of, by_solver, number, reaching

SHORT = 12
"""Characters that a commit is told by, as in a report."""
UNJUDGED = (None, "not judged")
"""Verdicts of runs that were not judged."""
EVERY_REPORT_HAS = RUN_COLUMNS[: RUN_COLUMNS.index("undecided_after_s")]
"""Columns of a list of runs of this package; reports that were made earlier lack those behind them."""
MATRIX_COLUMNS = (
    "case", "title", "reading", "kind", "solver", "settings", "judged", "right", "status", "verdict", "digits",
    "wall_s", *(f"wall_{level}_s" for level in LEVELS), "commit",
)  # fmt: skip
"""A row a reading and solver; digits and times are rounded, as far as an overview needs them.

* ``title``: the case's; ``kind``: the reading's (:mod:`henon_ref.score.kinds`);
* ``settings``, ``judged``, ``right``: settings that were tried, of these judged, of these right;
* ``status``, ``verdict``, ``digits``: of the right run with the most digits, else of the last one;
* ``wall_s``: shortest time of a right run; ``wall_N_s``: of one that gets the worst transition to N digits;
* ``commit``: the program's when the runs were made.
"""


def summary(rows: Sequence[Row]) -> Row:
    """What the settings of one solver on one reading come to: the columns from ``settings`` to the last time.

    Parameters
    ----------
    rows : sequence of Row
        Of :data:`henon_ref.columns.RUN_COLUMNS`; at least one.
    """
    best = best_of(rows)
    right = [row for row in rows if row["verdict"] == "right"]
    return {
        "settings": len(rows),
        "judged": sum(row["status"] not in NOT_RUN and row["verdict"] not in UNJUDGED for row in rows),
        "right": len(right),
        "status": best["status"],
        "verdict": best["verdict"],
        "digits": None if best["digits"] is None else math.floor(number(best, "digits") * 1000) / 1000,
        "wall_s": _shortest(right),
        **{f"wall_{level}_s": _shortest(reaching(rows, level)) for level in LEVELS},
    }


def _shortest(rows: Sequence[Row]) -> float | None:
    walls = [number(row, "wall_s") for row in rows if row["wall_s"] is not None]
    return float(f"{min(walls):.4g}") if walls else None


def rows_of_report(manifest: Path) -> list[Row]:
    """The matrix's rows of one case, from the folder of its report.

    Raises
    ------
    CaseError
        Where manifest or runs are not what this package writes.
    """
    content, file = _content(manifest), manifest.with_name(RUNS)
    try:
        runs = read_rows(file)
    except (OSError, ValueError, csv.Error) as error:
        raise CaseError(f"cannot be read: {error}", file=str(file)) from error
    by_reading: dict[str, list[Row]] = {}
    for row in runs:
        missing = [column for column in EVERY_REPORT_HAS if column not in row]
        if missing:
            raise CaseError(f"is no list of runs of this package: it has no column {missing[0]}", file=str(file))
        by_reading.setdefault(str(row["reading"]), []).append(row)
    shared = {
        "case": manifest.parent.name,
        "title": content["title"],
        "commit": short_commit(_text(content.get("commit")) or "", SHORT),
    }
    readings = content.get("readings")
    return [
        {**shared, "reading": reading, "kind": _kind(readings, reading), "solver": solver, **summary(own)}
        for reading, rows in by_reading.items()
        for solver, own in by_solver(rows).items()
    ]


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


def commits_of(rows: Sequence[Row], length: int = SHORT) -> list[str]:
    """The commits of the program that made some rows of the matrix, each once, in the rows' order."""
    return list(dict.fromkeys(short_commit(str(row["commit"]), length) for row in rows if row["commit"]))


def _kind(readings: object, reading: str) -> str | None:
    """The kind that a manifest gives a reading; those of earlier versions give none."""
    own = readings.get(reading) if isinstance(readings, dict) else None
    return _text(own.get("kind")) if isinstance(own, dict) else None


def _text(value: object) -> str | None:
    return value if isinstance(value, str) and value else None


def read_matrix(folder: Path) -> list[Row]:
    """The rows of a folder's matrix; none where it has none.

    Raises
    ------
    CaseError
        Where it is not what this package writes.
    """
    file = folder / MATRIX
    try:
        rows = read_rows(file)
    except FileNotFoundError:
        return []
    except (OSError, ValueError, csv.Error) as error:
        raise CaseError(f"cannot be read: {error}", file=str(file)) from error
    for row in rows:
        missing = [column for column in MATRIX_COLUMNS if column not in row]
        if missing:
            raise CaseError(f"is no matrix of this package: it has no column {missing[0]}", file=str(file))
    return rows
