"""The folder of a sweep: a Parquet file a chunk and table, each there as a whole or not at all.

``points/00000.parquet`` and so on have a row a point, ``NAME/00000.parquet`` those of a table of its own. A chunk is
finished once its points' file is there, which is written last. ``sweep.yaml`` and ``manifest.json`` run it again.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from henon_ref.errors import CaseError
from henon_ref.sweeps.chunk import Tables
from henon_ref.sweeps.runs import Columns

POINTS = "points"
MANIFEST = "manifest.json"
PAGE = "index.html"
"""The page of a finished sweep, which :mod:`henon_ref.report` writes."""
KEPT = "finished chunks are kept: --resume (resume=True) goes on from them"
OTHER = "holds another sweep, or one of other chunks; remove it, or name another folder"


class SweepFolder:
    """Where a sweep's results go.

    Parameters
    ----------
    path : Path
    content : str
        Identifies the sweep, its points and chunks included.
    """

    def __init__(self, path: Path, content: str) -> None:
        self.path, self.content = path, content

    def begin(self, files: Mapping[str, str], manifest: Mapping[str, Any], *, resume: bool) -> None:
        """Make the folder, and write down what is in it.

        Parameters
        ----------
        files : mapping
            Name -> text of files that stand beside the manifest.
        manifest : mapping
        resume : bool
            Keep chunks that are finished; else those of an earlier sweep are removed.

        Raises
        ------
        CaseError
            Where the folder is no sweep's, or to be resumed and another sweep's; and where it cannot be written.
        """
        try:
            before = self._manifest()
            if before is None and self.path.exists() and any(f.name[0] != "." for f in self.path.iterdir()):
                raise CaseError("this folder holds files, and no sweep's; name another one", file=str(self.path))
            if resume and before is not None and before.get("content") != self.content:
                raise CaseError(f"this folder {OTHER}", file=str(self.path))
            for pattern in ("*/.*.part",) if resume else ("*/.*.part", "*/*.parquet", PAGE):
                for file in self.path.glob(pattern):
                    file.unlink()
            self.path.mkdir(parents=True, exist_ok=True)
            for name, text in files.items():
                self._put(self.path / name, text.encode())
            text = json.dumps({**manifest, "content": self.content}, indent=1, ensure_ascii=False)
            self._put(self.path / MANIFEST, (text + "\n").encode())
        except OSError as error:
            raise _unwritten(error, self.path, "") from error

    def finished(self, chunks: Sequence[range]) -> set[int]:
        """Numbers of the chunks that are there, whole."""
        return {number for number, chunk in enumerate(chunks) if self._is_whole(number, len(chunk))}

    def write(self, number: int, first: int, points: Columns, ragged: Mapping[str, Columns]) -> None:
        """Write a chunk.

        Raises
        ------
        CaseError
            Where it cannot be written: a full disk, say. Of files that are there none is harmed.
        """
        count = len(next(iter(points.values())))
        own = {"point": np.arange(first, first + count, dtype=np.int64), **points}
        try:
            for name, columns in {**ragged, POINTS: own}.items():
                folder = self.path / name
                folder.mkdir(exist_ok=True)
                self._put(folder / _file(number), parquet(columns))
        except OSError as error:
            raise _unwritten(error, self.path, KEPT) from error

    def read(self, number: int) -> Tables:
        """A finished chunk's tables, as they were observed."""
        files = {file.parent.name: file for file in self.path.glob(f"*/{_file(number)}")}
        tables = {name: _columns(file) for name, file in files.items()}
        points = tables.pop(POINTS)
        del points["point"]
        return Tables(points, tables)

    def _is_whole(self, number: int, rows: int) -> bool:
        import pyarrow.lib
        import pyarrow.parquet as pq

        try:
            return int(pq.read_metadata(self.path / POINTS / _file(number)).num_rows) == rows
        except (OSError, pyarrow.lib.ArrowInvalid):
            return False

    def _manifest(self) -> dict[str, Any] | None:
        try:
            found = json.loads((self.path / MANIFEST).read_text(encoding="utf-8"))
        except (FileNotFoundError, NotADirectoryError, ValueError):
            return None
        return found if isinstance(found, dict) else None

    def _put(self, path: Path, content: bytes) -> None:
        """Write a file under another name, and give it its own once it is whole on the disk."""
        part = path.with_name(f".{path.name}.part")
        try:
            with part.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
        except BaseException:
            with suppress(OSError):
                part.unlink()
            raise


def parquet(columns: Columns) -> bytes:
    """Columns as a Parquet file: the same bytes for the same columns."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    made = {
        name: pa.array(column, type=pa.string() if column.dtype == object else None, from_pandas=True)
        for name, column in columns.items()
    }
    buffer = io.BytesIO()
    pq.write_table(pa.table(made), buffer, compression="snappy", version="2.6", store_schema=False)
    return buffer.getvalue()


def _columns(file: Path) -> Columns:
    import pyarrow as pa
    import pyarrow.parquet as pq

    # One file, not a dataset: the folders' names mean nothing.
    table = pq.ParquetFile(file).read()
    return {
        name: np.array(column.to_pylist(), dtype=object)
        if pa.types.is_string(column.type)
        else column.to_numpy(zero_copy_only=False).astype(np.float64 if pa.types.is_floating(column.type) else np.int64)
        for name, column in zip(table.column_names, table.columns, strict=True)
    }


def _file(number: int) -> str:
    return f"{number:06d}.parquet"


def _unwritten(error: OSError, folder: Path, kept: str) -> CaseError:
    told = f"cannot be written: {error.strerror or error}"
    return CaseError("; ".join(part for part in (told, kept) if part), file=error.filename or str(folder))
