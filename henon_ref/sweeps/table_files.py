"""Tables as files: reading tables of points, of bounded size, and writing and reading tables of results."""

from __future__ import annotations

import io
import stat
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.errors import ArgumentError, UnavailableError
from henon_ref.text import listed

if TYPE_CHECKING:
    import pyarrow as pa

Vector = NDArray[np.float64]
Columns = dict[str, NDArray[Any]]

MOST_NUMBERS = 2**25
"""Largest number of values of all points of a sweep: 256 MiB."""


def check_size(points: int, names: int, what: str) -> None:
    """Raise ArgumentError if points have more than ``MOST_NUMBERS`` values, before memory is allocated."""
    if points * names > MOST_NUMBERS:
        width = "1 name" if names == 1 else f"{names} names"
        raise ArgumentError(f"{what} has {points} points of {width}; at most {MOST_NUMBERS // names} are allowed")


def check_arrow(what: str) -> None:
    """Raise UnavailableError if pyarrow, which ``what`` requires, is not installed."""
    if find_spec("pyarrow") is None:
        raise UnavailableError(f"{what} needs pyarrow, which is not installed: pip install 'henon-ref[sweep]'")


def read_table(path: Path) -> Mapping[str, Vector]:
    """Read the columns of a CSV or Parquet file; ArgumentError if it is not a file, not a table, or too large."""
    check_arrow("a table of points")
    import pyarrow as pa

    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise ArgumentError(f"the table {path} is not a regular file; wanted a CSV or Parquet file")
        return _parquet_columns(path) if path.suffix == ".parquet" else _csv_columns(path)
    except ArgumentError:
        raise
    except (OSError, ValueError, pa.ArrowException) as error:
        reason = getattr(error, "strerror", None) or str(error)[:200]
        raise ArgumentError(f"the table {path} cannot be read: {reason}") from None


def _parquet_columns(path: Path) -> Mapping[str, Vector]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    with pq.ParquetFile(path) as file:
        schema = file.schema_arrow
        index = {name for name in (schema.pandas_metadata or {}).get("index_columns", []) if isinstance(name, str)}
        names = [name for name in schema.names if name not in index]
        _check_names(path, names)
        check_size(file.metadata.num_rows, max(len(names), 1), f"the table {path}")
        for name in names:
            kind = schema.field(name).type
            if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
                raise ArgumentError(f"the table {path}: the column '{name[:60]}' holds {kind}; wanted numbers")
        table = file.read(columns=names)
    return {name: table[name].to_numpy() for name in names}


def _csv_columns(path: Path) -> Mapping[str, Vector]:
    """Read the columns of a CSV file in blocks, so that long files and long lines need little memory."""
    import pyarrow as pa
    import pyarrow.csv as csv

    options: Any = csv.ReadOptions
    blocks = options(block_size=2**20, use_threads=False)  # no line may be longer
    with csv.open_csv(path, read_options=blocks) as head:
        names = head.schema.names
    _check_names(path, names)
    as_text = csv.ConvertOptions(column_types=dict.fromkeys(names, pa.string()))
    parts: list[list[Vector]] = [[] for _ in names]
    rows = 0
    with csv.open_csv(path, read_options=blocks, convert_options=as_text) as batches:
        for batch in batches:
            check_size(rows + batch.num_rows, len(names), f"the table {path}")
            for name, part, column in zip(names, parts, batch.columns, strict=True):
                try:
                    part.append(_doubles(column))
                except ValueError:
                    row, word = next((k, w) for k, w in enumerate(column.to_pylist(), rows + 1) if not _is_number(w))
                    words = f"the column '{name[:60]}' has '{word[:60]}' in row {row}; wanted numbers"
                    raise ArgumentError(f"the table {path}: {words}") from None
            rows += batch.num_rows
    return {name: np.concatenate(part or [np.zeros(0)]) for name, part in zip(names, parts, strict=True)}


def _doubles(column: pa.Array) -> Vector:
    """Convert a column of text to the nearest doubles."""
    import pyarrow as pa

    try:
        return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)
    except pa.ArrowInvalid:  # Python accepts more formats, such as +1.5
        words = column.to_pylist()
        if not all(map(_is_number, words)):
            raise ValueError from None
        return np.array(words, dtype=np.float64)


def _is_number(word: str) -> bool:
    """Check whether text is a number, without the underscores and digits of other scripts that Python allows."""
    try:
        float(word)
    except ValueError:
        return False
    return word.isascii() and "_" not in word


def _check_names(path: Path, names: list[str]) -> None:
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise ArgumentError(f"the table {path} has the column {listed([name[:60] for name in twice], 1)} twice")


def csv_bytes(names: tuple[str, ...], values: Vector) -> bytes:
    """Return points as a CSV file; each number reads back as the same double."""
    rows = (",".join(map(repr, row)) for row in values.tolist())
    return "".join(f"{row}\n" for row in (",".join(names), *rows)).encode()


def parquet(columns: Columns) -> bytes:
    """Return columns as a Parquet file; equal columns give equal bytes."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    made = {
        name: pa.array(column, type=pa.string() if column.dtype == object else None, from_pandas=True)
        for name, column in columns.items()
    }
    buffer = io.BytesIO()
    pq.write_table(
        pa.table(made), buffer, compression="snappy", version="2.6", store_schema=False, write_page_checksum=True
    )
    return buffer.getvalue()


def read_parquet(file: Path) -> Columns | None:
    """Read columns written by :func:`parquet`; None if the file is missing or damaged (by its checksums)."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not file.is_file():
        return None
    try:
        # Read as one file, not as a dataset, which would interpret the names of folders.
        with pq.ParquetFile(file, page_checksum_verification=True) as found:
            table = found.read()
        return {
            name: np.array(column.to_pylist(), dtype=object)
            if pa.types.is_string(column.type)
            else column.to_numpy(zero_copy_only=False).astype(
                np.float64 if pa.types.is_floating(column.type) else np.int64
            )
            for name, column in zip(table.column_names, table.columns, strict=True)
        }
    except (OSError, ValueError, TypeError, pa.ArrowException):
        return None
