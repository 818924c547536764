"""Tables of points: files that are read within bounds, whatever they are, and files that are written."""

from __future__ import annotations

import stat
from collections.abc import Callable, Iterator, Mapping
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

MOST_NUMBERS = 2**25
"""Numbers that all points of a sweep may have, together: a quarter of a GiB."""
LONGEST_LINE = 2**20
"""Bytes of a CSV file that are read at a time; no line may be longer."""
MOST_WRITTEN = 2**18
"""Numbers of a table that is written as CSV; more are written as Parquet."""
CSV, PARQUET = "points.csv", "points.parquet"
"""Names of the table of points beside a sweep's results."""


def check_size(points: int, names: int, what: str) -> None:
    """Check that points are not too many, before anything is made of them.

    Raises
    ------
    ArgumentError
        For more numbers than ``MOST_NUMBERS``.
    """
    if points * names > MOST_NUMBERS:
        told = "1 name" if names == 1 else f"{names} names"
        raise ArgumentError(f"{what} has {points} points of {told}; at most {MOST_NUMBERS // names} are allowed")


def written_table(values: Vector) -> dict[str, str]:
    """What a sweep file says of points that stand in a table beside it."""
    return {"table": CSV if values.size <= MOST_WRITTEN else PARQUET}


def check_arrow(what: str) -> None:
    """Check that there is pyarrow, which what is named needs.

    Raises
    ------
    UnavailableError
        Where it is not installed.
    """
    if find_spec("pyarrow") is None:
        raise UnavailableError(f"{what} needs pyarrow, which is not installed: pip install 'henon-ref[sweep]'")


def read_table(path: Path) -> Mapping[str, Vector]:
    """The columns of a CSV or Parquet file.

    Raises
    ------
    ArgumentError
        For what is no regular file, no table, or too large.
    UnavailableError
        Where pyarrow is not installed.
    """
    check_arrow("a table of points")
    import pyarrow as pa

    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise ArgumentError(f"the table {path} is no regular file; wanted a CSV or Parquet file")
        return _parquet_columns(path) if path.suffix == ".parquet" else _csv_columns(path)
    except ArgumentError:
        raise
    except (OSError, ValueError, pa.ArrowException) as error:
        raise ArgumentError(f"the table {path} cannot be read: {str(error)[:200]}") from None


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
    """Columns of a CSV file, read in blocks, so that neither a long file nor a long line takes memory."""
    import pyarrow as pa
    import pyarrow.csv as csv

    options: Callable[..., Any] = csv.ReadOptions
    with csv.open_csv(path, read_options=options(block_size=LONGEST_LINE, use_threads=False)) as head:
        names = head.schema.names
    _check_names(path, names)
    as_text = csv.ConvertOptions(column_types=dict.fromkeys(names, pa.string()))
    parts: list[list[Vector]] = [[] for _ in names]
    rows = 0
    with csv.open_csv(
        path, read_options=options(block_size=LONGEST_LINE, use_threads=False), convert_options=as_text
    ) as batches:
        for batch in batches:
            rows += batch.num_rows
            check_size(rows, len(names), f"the table {path}")
            for part, column in zip(parts, batch.columns, strict=True):
                part.append(_doubles(column))
    return {name: np.concatenate(part or [np.zeros(0)]) for name, part in zip(names, parts, strict=True)}


def _doubles(column: pa.Array) -> Vector:
    """Numbers of a column of text, each to the nearest double."""
    import pyarrow as pa

    try:
        return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)
    except pa.ArrowInvalid:  # Python reads more, such as +1.5
        return np.array(column.to_pylist(), dtype=np.float64)


def _check_names(path: Path, names: list[str]) -> None:
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise ArgumentError(f"the table {path} has the column {listed([name[:60] for name in twice], 1)} twice")


def csv_rows(names: tuple[str, ...], values: Vector) -> Iterator[str]:
    """Lines of points as CSV, each number as it reads back to the same double."""
    yield ",".join(names)
    for row in values.tolist():
        yield ",".join(map(repr, row))
