"""Collect the data of the page of a sweep as JSON: packed columns of the points and of the tables.

The data comes from the folder of the sweep only: ``sweep.yaml`` and the Parquet files.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from henon_ref.figures.sweeps import MOST_BASINS
from henon_ref.sweeps.chunk import POINTS
from henon_ref.sweeps.plan import Plan
from henon_ref.sweeps.storage import chunk_files, owned
from henon_ref.text import one_line

POINT_BYTES, ROW_BYTES = 1_500_000, 1_100_000
"""Largest size of the points, and of the rows of all tables, before encoding as base64 text [bytes]."""
MOST_READ = 2_000_000
"""Largest number of points of a sweep with a page, and of rows read from a table."""
MOST_WORDS = 255
"""Largest number of different texts in a column of the page."""


def kept_points(plan: Plan, bytes_a_point: int) -> NDArray[np.int64]:
    """Return the numbers of the points on the page: all points, or an even selection that fits into the page.

    The selection of a grid is again a grid.
    """
    most = max(POINT_BYTES // bytes_a_point, 1)
    count, sizes = len(plan.points), grid_sizes(plan)
    if count <= most:
        return np.arange(count)
    if not sizes:
        return np.arange(0, count, -(-count // most))
    stride = 1
    while np.prod([-(-size // stride) for size in sizes]) > most:
        stride += 1
    kept = np.meshgrid(*(np.arange(0, size, stride) for size in sizes), indexing="ij")
    return np.ravel_multi_index([own.ravel() for own in kept], sizes).astype(np.int64)


def grid_sizes(plan: Plan) -> tuple[int, ...]:
    """Return the number of values on each axis of a grid; empty if the points are not a grid."""
    values = plan.points.values
    sizes = tuple(len(np.unique(values[:, k])) for k in range(values.shape[1]))
    whole = plan.points.chain == 1 and "grid" in plan.points.written and np.prod(sizes) == len(values)
    return sizes if whole else ()


def bytes_a_point(columns: Mapping[str, Any], swept: Sequence[str]) -> int:
    """Return the size of the row of a point: its number and its columns [bytes]."""
    return 4 + sum(8 if name in swept else 4 if _is_number(dtype) else 1 for name, dtype in columns.items())


def point_columns(table: pd.DataFrame, swept: Sequence[str]) -> list[dict[str, Any]]:
    """Pack the columns of the selected points: swept values in double precision, other numbers in single, texts."""
    made: list[dict[str, Any]] = []
    for name, own in table.items():
        if name in swept:
            packed: dict[str, Any] = {"kind": "double", "data": packed_numbers(own, "<f8")}
        elif _is_number(own.dtype):
            packed = {"kind": "single", "data": packed_numbers(own, "<f4")}
        elif own.nunique() < MOST_WORDS:
            codes, words = pd.factorize(own.fillna(""), sort=True)
            texts = [one_line(str(word)) for word in words]
            packed = {"kind": "word", "words": texts, "data": packed_numbers(codes, "u1")}
        else:
            continue
        made.append({"name": one_line(str(name)), **packed})
    return made


def coloured(table: pd.DataFrame, swept: Sequence[str]) -> str:
    """Choose the column that a map shows first: one of few different texts, else one of numbers."""
    others = {name: own for name, own in table.items() if name not in swept and own.nunique() > 1}
    few = [name for name, own in others.items() if not _is_number(own.dtype) and own.nunique() <= MOST_BASINS]
    numbers = [name for name, own in others.items() if _is_number(own.dtype)]
    return one_line(str((few + numbers + [""])[0]))


def frame_content(name: str, frame: pd.DataFrame, rows: int, kept: NDArray[np.int64], tables: int) -> dict[str, Any]:
    """Pack a table with several rows per point (column ``point``): the rows of selected points, thinned if too many.

    ``rows`` is the number of rows of the whole table, of which ``frame`` may be a part. ``tables`` is the number of
    tables that share the space of the page.
    """
    own = frame[frame["point"].isin(kept)]
    place = np.searchsorted(kept, own["point"].to_numpy())
    numbers = [column for column in own.columns if column != "point" and _is_number(own[column].dtype)]
    most = max(ROW_BYTES // (tables * (4 + 4 * len(numbers))), 1)
    stride = max(-(-len(own) // most), 1)
    own, place = own.iloc[::stride], place[::stride]
    return {
        "name": one_line(name),
        "rows": rows,
        "point": packed_numbers(place, "<u4"),
        "columns": [{"name": one_line(name), "data": packed_numbers(own[name], "<f4")} for name in numbers],
    }


def observed_rows(table: pd.DataFrame) -> list[tuple[str, ...]]:
    """Return one row per column: number of values, minimum, median and maximum, or the shares of texts."""
    made = []
    for name, column in table.items():
        own = column.dropna()
        cells = ["", "", "", ""]
        if not _is_number(own.dtype):
            shares = own.value_counts(normalize=True)
            cells[3] = ", ".join(f"{one_line(str(word))} {share:.2%}" for word, share in shares.head(6).items())
            cells[3] += f" and {len(shares) - 6} more" if len(shares) > 6 else ""
        elif len(own):
            cells[:3] = (f"{value:.6g}" for value in (own.min(), own.median(), own.max()))
        made.append((one_line(str(name)), f"{len(own):,}", *cells))
    return made


def read_table(folder: Path, name: str = POINTS, *, most: int | None = None) -> pd.DataFrame:
    """Read a table of a sweep from its chunks in order; use a stride if it has more than ``most`` rows."""
    stride = max(-(-rows_of(folder, name) // most), 1) if most else 1
    parts, before = [], 0
    for file in chunk_files(folder, name):
        part = pd.read_parquet(file)
        parts.append(part.iloc[-before % stride :: stride])
        before += len(part)
    return pd.concat(parts, ignore_index=True)


def rows_of(folder: Path, name: str = POINTS) -> int:
    import pyarrow.parquet as pq

    return sum(int(pq.read_metadata(file).num_rows) for file in chunk_files(folder, name))


def tables_of(folder: Path) -> list[str]:
    own = owned(folder)
    return sorted(set(own.tables) - {POINTS}) if own is not None else []


def _is_number(dtype: Any) -> bool:
    return getattr(dtype, "kind", "O") in "iuf"


def packed_numbers(values: Any, kind: str) -> str:
    """Encode numbers of a NumPy type (little-endian) as base64 text."""
    with np.errstate(over="ignore"):  # values beyond single precision become infinite
        return b64encode(np.asarray(values).astype(kind).tobytes()).decode("ascii")
