"""Read and write the rows of result files as CSV."""

from __future__ import annotations

import csv
import errno
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from henon_ref.errors import CaseError
from henon_ref.harness.rows import STATE, Row, TransitionRow
from henon_ref.text import cell, from_cell, shortened

AnyRow = TypeVar("AnyRow", bound=Row)


def csv_text(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Write rows of values as CSV (RFC 4180, with plain line feeds)."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(map(csv_field, columns))
    writer.writerows(map(csv_field, row) for row in rows)
    return buffer.getvalue()


def rows_text(kind: type[AnyRow], rows: Iterable[AnyRow], states: Sequence[str] = ()) -> str:
    """Write rows of one kind as CSV; ``states``: names of the states if the rows have them."""
    columns = kind.columns(states)
    return csv_text(columns, (row.values(columns) for row in rows))


def csv_field(value: object) -> str:
    """Write one value: floats with the fewest digits that read back the same, missing values empty.

    >>> csv_field(1e-12), csv_field(3), csv_field(None), csv_field(float("nan")), csv_field("ok")
    ('1e-12', '3', '', '', 'ok')
    >>> csv_field(-1), csv_field("-1"), csv_field("=A1")
    ('-1', '-1', "'=A1")
    """
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, float):
        return repr(float(value))
    return cell(str(value))


class TableError(ValueError):
    """A fault of a result file, with line and column (of a character), counted from 1."""

    def __init__(self, message: str, line: int = 1, column: int = 1) -> None:
        super().__init__(message)
        self.line, self.column = line, column


def refuse_pipe(path: Path) -> None:
    """Raise OSError if a file to be read is a named pipe, which would be waited for."""
    if path.is_fifo():
        raise OSError(errno.EINVAL, "this is a named pipe", str(path))


def read_rows(kind: type[AnyRow], path: Path) -> list[AnyRow]:
    """Read the rows of a result file; columns that are not fields are states, or ignored.

    OSError or UnicodeDecodeError if the file cannot be read, TableError if it is not a valid result file of this kind.
    """
    refuse_pipe(path)
    with path.open(encoding="utf-8-sig", newline="") as file:
        lines = list(file)
    reader, rows = csv.reader(lines, strict=True), []
    try:
        present = [name.strip() for name in next(reader, [])]
        readers = _readers(kind, present)
        for cells in filter(None, reader):
            if len(cells) != len(present):
                raise TableError(f"{len(cells)} fields; there are {len(present)} columns", reader.line_num)
            line = dict(zip(present, map(str.strip, cells), strict=True))
            where = reader.line_num, lines[reader.line_num - 1]
            values = {name: _read(read, line[name], *where) for name, read in readers.items()}
            if kind is TransitionRow:
                values[STATE] = {name: values.pop(name) for name in readers if name not in kind.columns()}
            try:
                rows.append(kind(**values))
            except ValueError as error:
                raise TableError(str(error), reader.line_num) from None
    except csv.Error as error:
        raise TableError(str(error), reader.line_num) from error
    return rows


def rows_in_file(kind: type[AnyRow], path: Path) -> list[AnyRow]:
    """Read the rows of a file; CaseError with line and column if it cannot be read, or is invalid."""
    try:
        return read_rows(kind, path)
    except TableError as error:
        raise CaseError(str(error), file=str(path), line=error.line, column=error.column) from None
    except UnicodeDecodeError:
        raise CaseError("cannot be read: it is not UTF-8; save the file as UTF-8", file=str(path)) from None
    except OSError as error:
        raise CaseError(f"cannot be read: {error.strerror or error}", file=str(path)) from None


def earlier_rows(kind: type[AnyRow], path: Path) -> list[AnyRow]:
    """Read the rows of a result file; empty if the file is missing or invalid."""
    try:
        return read_rows(kind, path)
    except (OSError, ValueError):
        return []


Reader = Callable[[str], Any]


def _readers(kind: type[Row], present: Sequence[str]) -> dict[str, Reader]:
    """Reader of each column, by the field's type; additional columns of a transition's row are states."""
    types = get_type_hints(kind)
    needed = [own.name for own in fields(kind) if own.default is MISSING and own.default_factory is MISSING]
    for column in needed:
        if column not in present:
            raise TableError(f"there is no column '{column}'; needed are {', '.join(needed)}")
    if len(set(present)) < len(present):
        raise TableError("a column name occurs twice")
    known = {column: _READERS[types[column]] for column in kind.columns() if column in present}
    states = [name for name in present if name not in known] if kind is TransitionRow else []
    return known | dict.fromkeys(states, _READERS[float | None])


def _number(text: str) -> float:
    value = float(text)
    if math.isnan(value):
        raise ValueError(text)
    return value


def _count(text: str) -> int:
    value = float(text)
    if not value.is_integer():
        raise ValueError(text)
    return int(value)


def _optional(read: Reader) -> Reader:
    return lambda text: read(text) if text else None


_READERS: Mapping[object, Reader] = {
    str: from_cell,
    int: _count,
    float: _number,
    str | None: _optional(from_cell),
    int | None: _optional(_count),
    float | None: _optional(_number),
}
"""Reader of a field, by its type."""


def _read(reader: Reader, text: str, line: int, written: str) -> Any:
    try:
        return reader(text)
    except (OverflowError, ValueError):
        words = f"{shortened(text)} is no number: the field takes a number or nothing"
        raise TableError(words, line, written.find(text) + 1) from None
