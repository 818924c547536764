"""The result files: rows as CSV, numbers in full, a missing value an empty field."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from henon_ref.columns import Row
from henon_ref.text import cell, from_cell

NAMES = frozenset({"case", "title", "reading", "kind", "solver", "commit"})
"""Columns that hold text, even where it could be read as a number (a reading named ``1e5``)."""


def csv_text(columns: Sequence[str], rows: Iterable[Row]) -> str:
    """Rows as CSV (RFC 4180, with plain line feeds)."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(map(field, columns))
    for row in rows:
        writer.writerow([field(row.get(column)) for column in columns])
    return buffer.getvalue()


def field(value: object) -> str:
    """One value: floats with the fewest digits that read back the same, missing ones empty, never 0.

    Examples
    --------
    >>> field(1e-12), field(3), field(None), field(float("nan")), field("ok")
    ('1e-12', '3', '', '', 'ok')
    >>> field(-1), field("-1"), field("=A1")
    ('-1', '-1', "'=A1")
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, float):
        return repr(float(value))
    return cell(str(value))


def read_rows(path: Path) -> list[Row]:
    """Rows of a result file; empty fields come back as None, numbers as float, names and all else as text.

    Raises
    ------
    ValueError, csv.Error
        Where it is no such file.
    """
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file, strict=True))
    if any(None in row for row in rows):
        raise ValueError("a row has more fields than there are columns")
    return [{key: _value(key, text) for key, text in row.items()} for row in rows]


def _value(column: str, text: str | None) -> object:
    if not text:
        return None
    if column in NAMES:
        return from_cell(text)
    try:
        return float(text)
    except ValueError:
        return from_cell(text)
