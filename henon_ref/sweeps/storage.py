"""The folder of a sweep: a Parquet file a chunk and table, each there as a whole or not at all.

``points/000000.parquet`` and so on have a row a point, ``NAME/000000.parquet`` those of a table of its own. A chunk is
finished once its points' file is there, which is written last. ``sweep.yaml`` and ``manifest.json`` run it again.

The manifest says by a key of its own that the folder is a sweep's, and which names in it are: nothing else is ever
removed or replaced, and nothing is written through a link.
"""

from __future__ import annotations

import io
import json
import logging
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from henon_ref.atomic_write import replace_file
from henon_ref.errors import CaseError
from henon_ref.sweeps.chunk import POINTS, Tables
from henon_ref.sweeps.plan import Plan
from henon_ref.sweeps.point_files import check_arrow
from henon_ref.sweeps.runs import Columns

_LOG = logging.getLogger(__name__)

MANIFEST = "manifest.json"
PAGE = "index.html"
"""The page of a finished sweep."""
KEY = "henon_ref_sweep"
"""Of the manifest: what in the folder is the sweep's."""
KEPT = "finished chunks are kept: --resume (resume=True) goes on from them"
OTHER = "holds another sweep, or one of other chunks; remove it, or name another folder"


@dataclass(frozen=True)
class Owned:
    """What in a folder is a sweep's, beside the manifest."""

    content: str
    """Identifies the sweep, its points and chunks included."""
    chunks: int
    """Files of each table: 000000.parquet and so on."""
    tables: tuple[str, ...]
    """Their folders."""
    files: tuple[str, ...]
    """Files, and the folder of pictures."""


def owned(folder: Path) -> Owned | None:
    """What in a folder is a sweep's; None where its manifest does not say so.

    Raises
    ------
    OSError
        Where it cannot be read.
    """
    manifest = folder / MANIFEST
    if manifest.is_symlink() or not manifest.is_file():
        return None
    try:
        found = json.loads(manifest.read_text(encoding="utf-8"))
        own = Owned(**found[KEY])
        names = [*own.tables, *own.files]
        if [*map(type, vars(own).values())] == [str, int, list, list] and all(map(_is_name, names)):
            return own
    except (ValueError, TypeError, KeyError, RecursionError):  # no manifest, or somebody else's
        pass
    return None


def chunk_files(folder: Path, table: str) -> list[Path]:
    """The files of one of a sweep's tables that are there, in order."""
    own = owned(folder)
    return [] if own is None else [path for _, path in _numbered(folder / table, own.chunks)]


class SweepFolder:
    """Where a sweep's results go.

    Parameters
    ----------
    path : Path
    plan : Plan

    Raises
    ------
    UnavailableError
        Where pyarrow is not installed.
    """

    def __init__(self, path: Path, plan: Plan) -> None:
        check_arrow("a sweep with a folder")
        self.path, self.plan = path, plan

    def begin(
        self, files: Mapping[str, bytes], manifest: Mapping[str, Any], *, resume: bool, further: Sequence[str] = (PAGE,)
    ) -> None:
        """Make the folder, and write down what is in it.

        Parameters
        ----------
        files : mapping
            Name -> content of files that stand beside the manifest.
        manifest : mapping
        resume : bool
            Keep chunks that are finished; else the files of an earlier sweep are removed.
        further : sequence of str
            Names of what is written there once the sweep is done.

        Raises
        ------
        CaseError
            Where the folder is no sweep's, or to be resumed and another sweep's; where something of somebody else's is
            in the way; and where it cannot be written. Nothing has been changed then, but in the last case.
        """
        own = Owned(self.plan.content, len(self.plan.chunks), tuple(self.plan.tables), (*sorted(files), *further))
        try:
            before = owned(self.path)
            if before is None and self.path.exists() and any(f.name[0] != "." for f in self.path.iterdir()):
                raise CaseError("this folder holds files, and no sweep's; name another one", file=str(self.path))
            if resume and before is not None and before.content != own.content:
                raise CaseError(f"this folder {OTHER}", file=str(self.path))
            self._check_free(own, before)
            if before is not None and not resume:
                self._remove(before)
            kept = () if before is None else (name for name in before.files if os.path.lexists(self.path / name))
            own = Owned(own.content, own.chunks, own.tables, tuple(dict.fromkeys([*own.files, *kept])))
            self.path.mkdir(parents=True, exist_ok=True)
            text = json.dumps({**manifest, KEY: asdict(own)}, indent=1, ensure_ascii=False)
            for name, content in {MANIFEST: (text + "\n").encode(), **files}.items():
                replace_file(self.path / name, content)
        except OSError as error:
            raise _unwritten(error, self.path, "") from error

    def finished(self) -> Iterator[tuple[int, Tables]]:
        """Number and tables of each chunk that is there, whole and of the plan's points; others are to be run again."""
        for number in range(len(self.plan.chunks)):
            if os.path.lexists(self.path / POINTS / _file(number)):
                found = self.read(number)
                if found is not None:
                    yield number, found
                else:
                    _LOG.warning(
                        "%s: a file of chunk %d is missing or damaged; the chunk is run again", self.path, number
                    )

    def write(self, number: int, tables: Tables) -> None:
        """Write a chunk.

        Raises
        ------
        CaseError
            Where it cannot be written: a full disk, say. Of files that are there none is harmed.
        """
        points = {**self.plan.own_columns(number), **tables.points}
        try:
            for name, columns in {**tables.ragged, POINTS: points}.items():
                folder = self.path / name
                folder.mkdir(exist_ok=True)
                replace_file(folder / _file(number), parquet(columns))
        except OSError as error:
            raise _unwritten(error, self.path, KEPT) from error

    def read(self, number: int) -> Tables | None:
        """A finished chunk's tables, as they were observed; None where they are not all there, as they were written."""
        tables, chunk = {}, self.plan.chunks[number]
        for name, columns in self.plan.tables.items():
            found = _columns(self.path / name / _file(number))
            if found is None or tuple(found) != columns:
                return None
            tables[name] = found
        points = tables.pop(POINTS)
        for name, column in self.plan.own_columns(number).items():
            if not _same(points.pop(name), column):
                return None
        within = all(np.isin(table["point"], chunk).all() for table in tables.values())
        return Tables(points, tables) if within else None

    def _check_free(self, own: Owned, before: Owned | None) -> None:
        """Refuse to write where something stands that no sweep has written."""
        known = () if before is None else (*before.files, *before.tables)
        for name in (*own.files, *own.tables):
            path = self.path / name
            if path.is_symlink() or (os.path.lexists(path) and name not in known):
                raise _foreign(path)
        for table in own.tables:
            there = before.chunks if before is not None and table in before.tables else 0
            for number, path in _numbered(self.path / table, own.chunks):
                if path.is_symlink() or number >= there:
                    raise _foreign(path)

    def _remove(self, before: Owned) -> None:
        """Remove the files of an earlier sweep, and folders that nothing else is in; pictures are only replaced."""
        for table in sorted(before.tables, key=lambda name: name != POINTS):  # a chunk is there with its points
            folder = self.path / table
            for _, path in _numbered(folder, before.chunks):
                path.unlink()
            with suppress(OSError):
                folder.rmdir()
        for name in before.files:
            path = self.path / name
            if path.is_file() and not path.is_symlink():
                path.unlink()


def _is_name(name: object) -> bool:
    return isinstance(name, str) and name not in ("", "..") and Path(name).name == name


def _numbered(folder: Path, chunks: int) -> Iterator[tuple[int, Path]]:
    """Number and path of the chunks' files in a folder, in order; of one that is a link, or not there, none."""
    if folder.is_symlink() or not folder.is_dir():
        return
    for path in sorted(folder.iterdir()):
        if path.stem.isdecimal() and path.name == _file(int(path.stem)) and int(path.stem) < chunks:
            yield int(path.stem), path


def parquet(columns: Columns) -> bytes:
    """Columns as a Parquet file: the same bytes for the same columns."""
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


def _columns(file: Path) -> Columns | None:
    """The columns of a file; None where it is not there, or not whole: every page has its checksum."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if not file.is_file():
        return None
    try:
        # One file, not a dataset: the folders' names mean nothing.
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


def _same(one: Any, other: Any) -> bool:
    """Whether two columns are the same to the last bit."""
    if one.dtype != other.dtype or one.shape != other.shape:
        return False
    return bool(one.tolist() == other.tolist()) if one.dtype == object else bool(one.tobytes() == other.tobytes())


def _file(number: int) -> str:
    return f"{number:06d}.parquet"


def _foreign(path: Path) -> CaseError:
    what = "is a link" if path.is_symlink() else "was not written by a sweep"
    return CaseError(f"{what}, so it is not replaced; remove it, or name another folder", file=str(path))


def _unwritten(error: OSError, folder: Path, kept: str) -> CaseError:
    told = f"cannot be written: {error.strerror or error}"
    return CaseError("; ".join(part for part in (told, kept) if part), file=error.filename or str(folder))
