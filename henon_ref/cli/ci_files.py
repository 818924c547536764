"""Files that a comparison is held against: earlier rows, and failures that are expected."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from henon_ref.errors import CaseError
from henon_ref.report.files.write import RUNS
from henon_ref.rows import RUN_COLUMNS, RunRow
from henon_ref.score.known import KnownFailure
from henon_ref.text import did_you_mean, from_cell, listed, shortened
from henon_ref.trajectory import Status

STATUSES: tuple[str, ...] = get_args(Status)
"""What a row's status may be."""
NUMBERS = ("rtol", "step_s", "max_time_error_s", "time_unit_s", "end_time_s", "reference_radius_s")
KNOWN_COLUMNS = ("case", "reading", "solver", "rtol", "step_s", "status", "reason")
"""Columns of a file of expected failures; others of a ``runs.csv`` may stand there, too, and say nothing."""
BASELINE_COLUMNS = ("case", "reading", "solver", "rtol", "step_s", "status", "max_time_error_s")
"""Columns that earlier rows must have."""
_FIELD = re.compile(r'(?:^|,)("(?:[^"]|"")*"|[^,"]*)(?=,|$)')


@dataclass(frozen=True)
class Field:
    """One value of a table, and where it stands."""

    text: str
    file: str
    line: int
    column: int

    def error(self, message: str) -> CaseError:
        """What is wrong with it."""
        return CaseError(message, file=self.file, line=self.line, column=self.column)


def read_baseline(path: Path) -> list[RunRow]:
    """Earlier rows: of a ``runs.csv``, or of all reports in a folder.

    Raises
    ------
    CaseError
        For a file that is none, with line and column; a folder without a report.
    """
    files = [path]
    if path.is_dir():
        files = [path / RUNS] if (path / RUNS).exists() else sorted(path.glob(f"*/{RUNS}"))
        if not files:
            raise CaseError(f"no report is in it; --baseline needs a {RUNS} or a folder of reports", file=str(path))
    return [row for file in files for row in _earlier(file)]


def _earlier(path: Path) -> Iterator[RunRow]:
    for fields in _table(path, required=BASELINE_COLUMNS, allowed=None):
        if not fields["status"].text:
            raise fields["status"].error(f"a row has a status: {listed(STATUSES)}")
        _check_status(fields["status"])
        texts = ("case", "reading", "solver", "status", "status_reason", "verdict")
        own: dict[str, Any] = {name: fields[name].text or None for name in texts if name in fields}
        own |= {name: _number(fields[name]) for name in NUMBERS if name in fields}
        yield RunRow(**own)


def read_known(path: Path) -> list[KnownFailure]:
    """Failures that are expected, a line each; an empty field stands for any.

    Raises
    ------
    CaseError
        For a file that is none, with line and column.
    """
    return [_known(fields) for fields in _table(path, required=(), allowed=(*KNOWN_COLUMNS, *RUN_COLUMNS))]


def _known(fields: dict[str, Field]) -> KnownFailure:
    words = {name: fields[name].text or None for name in ("case", "reading", "solver", "status") if name in fields}
    numbers = {name: _number(fields[name]) for name in ("rtol", "step_s") if name in fields}
    first = next(iter(fields.values()))
    if not any(words.get(name) for name in ("case", "reading", "solver")):
        raise first.error("such a line would be any failure; name a case, a reading or a solver")
    if words.get("status"):
        _check_status(fields["status"])
    if words.get("status") == "ok":
        raise fields["status"].error("'ok' is no failure; leave it empty, or give the status with which it fails")
    reason = fields["reason"].text if "reason" in fields else ""
    return KnownFailure(**words, **numbers, reason=reason, place=f"{first.file}:{first.line}")  # type: ignore[arg-type]


def _check_status(field: Field) -> None:
    if field.text not in STATUSES:
        hint = did_you_mean(field.text, STATUSES)
        raise field.error(f"{shortened(field.text)} is no status; there are {listed(STATUSES)}{hint}")


def _number(field: Field) -> float | None:
    if not field.text:
        return None
    try:
        value = float(field.text)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise field.error(f"{shortened(field.text)} is no number; a number, or nothing, stands here")
    return value


def _table(path: Path, *, required: Sequence[str], allowed: Sequence[str] | None) -> Iterator[dict[str, Field]]:
    """The lines of a CSV file as fields by column; empty lines are left out."""
    lines = _lines(path)
    if not lines or not lines[0].strip():
        columns = required or KNOWN_COLUMNS
        raise CaseError(f"the first line names the columns: {','.join(columns)}", file=str(path), line=1, column=1)
    header = _fields(path, 1, lines[0])
    for place, field in enumerate(header):
        if allowed is not None and field.text not in allowed:
            hint = did_you_mean(field.text, allowed)
            raise field.error(f"{shortened(field.text)} is no column here; there are {', '.join(KNOWN_COLUMNS)}{hint}")
        if field.text in [other.text for other in header[:place]]:
            raise field.error(f"the column {shortened(field.text)} is there twice")
    names = [field.text for field in header]
    for name in required:
        if name not in names:
            raise header[0].error(f"there is no column '{name}'; a {RUNS} of this program has {', '.join(required)}")
    for number, line in enumerate(lines[1:], 2):
        if not line.strip():
            continue
        fields = _fields(path, number, line)
        if len(fields) != len(names):
            raise fields[min(len(fields), len(names)) - 1].error(
                f"{len(fields)} fields; there are {len(names)} columns, as the first line has them"
            )
        yield dict(zip(names, fields, strict=True))


def _lines(path: Path) -> list[str]:
    if not path.is_file():
        what = "this is no regular file" if path.exists() else "there is no such file"
        raise CaseError(what, file=str(path))
    try:
        data = path.read_bytes()
    except OSError as error:
        raise CaseError(f"cannot be read: {error.strerror or error}", file=str(path)) from None
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n").split("\n")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = error.start - data.rfind(b"\n", 0, error.start)
        raise CaseError("not UTF-8; save the file as UTF-8", file=str(path), line=line, column=column) from None


def _fields(path: Path, number: int, line: str) -> list[Field]:
    """The fields of a line with their places; one that is quoted does not go on to the next line."""
    places = [found.start(1) + 1 for found in _FIELD.finditer(line)]
    try:
        (texts,) = csv.reader([line], strict=True)
    except (csv.Error, ValueError):
        texts = []
    if len(texts) != len(places):
        column = line.find('"') + 1
        raise CaseError(
            'the quotes do not match; a quote within a quoted field is written ""',
            file=str(path),
            line=number,
            column=max(column, 1),
        )
    return [Field(from_cell(text.strip()), str(path), number, at) for text, at in zip(texts, places, strict=True)]
