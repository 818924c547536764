"""What the page of a sweep's folder draws, as JSON: columns of the points and tables, packed.

It is made from the folder alone: ``sweep.yaml`` and the Parquet files.
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
"""Bytes that the points, and the rows of all tables, may have before they are written as base64 text."""
MOST_READ = 2_000_000
"""Points of which a page is made, and rows that are read of a table; a sweep of more points has none."""
MOST_WORDS = 255
"""Different texts that a column of the page may have."""


def kept_points(plan: Plan, bytes_a_point: int) -> NDArray[np.int64]:
    """Numbers of the points that the page keeps: all, or as many as there is room for, evenly.

    Of a grid some values of each axis are kept, so that it stays a grid.
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
    """Values of each axis of a grid; empty where the points are none."""
    values = plan.points.values
    sizes = tuple(len(np.unique(values[:, k])) for k in range(values.shape[1]))
    whole = plan.points.chain == 1 and "grid" in plan.points.written and np.prod(sizes) == len(values)
    return sizes if whole else ()


def bytes_a_point(columns: Mapping[str, Any], swept: Sequence[str]) -> int:
    """Bytes of a point's row: its number and its columns."""
    return 4 + sum(8 if name in swept else 4 if _is_number(dtype) else 1 for name, dtype in columns.items())


def point_columns(table: pd.DataFrame, swept: Sequence[str]) -> list[dict[str, Any]]:
    """The columns of the points that are kept: swept values in full, other numbers as single precision, texts."""
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
    """What a map of two swept names shows first: a column of few texts, else one of numbers."""
    others = {name: own for name, own in table.items() if name not in swept and own.nunique() > 1}
    few = [name for name, own in others.items() if not _is_number(own.dtype) and own.nunique() <= MOST_BASINS]
    numbers = [name for name, own in others.items() if _is_number(own.dtype)]
    return one_line(str((few + numbers + [""])[0]))


def frame_content(name: str, frame: pd.DataFrame, rows: int, kept: NDArray[np.int64], tables: int) -> dict[str, Any]:
    """A table with several rows a point (its column ``point``): those of kept points, thinned where they are many.

    ``rows`` are those of the whole table, of which ``frame`` may be a part; ``tables`` share the page's room.
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
    """A row a column, over all points: how many have a value, least, median, greatest; of texts the shares."""
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
    """A table of a sweep's folder, its chunks in order; of more than ``most`` rows every second, third ... one."""
    stride = max(-(-rows_of(folder, name) // most), 1) if most else 1
    parts, before = [], 0
    for file in chunk_files(folder, name):
        part = pd.read_parquet(file)
        parts.append(part.iloc[-before % stride :: stride])
        before += len(part)
    return pd.concat(parts, ignore_index=True)


def rows_of(folder: Path, name: str = POINTS) -> int:
    """Rows of a table of a sweep's folder."""
    import pyarrow.parquet as pq

    return sum(int(pq.read_metadata(file).num_rows) for file in chunk_files(folder, name))


def tables_of(folder: Path) -> list[str]:
    """Names of the tables with several rows a point."""
    own = owned(folder)
    return sorted(set(own.tables) - {POINTS}) if own is not None else []


def _is_number(dtype: Any) -> bool:
    return getattr(dtype, "kind", "O") in "iuf"


def packed_numbers(values: Any, kind: str) -> str:
    """Numbers of a NumPy kind, little-endian, as base64 text."""
    with np.errstate(over="ignore"):  # what single precision does not hold is infinite
        return b64encode(np.asarray(values).astype(kind).tobytes()).decode("ascii")
