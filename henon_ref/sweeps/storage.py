"""Folder of a sweep: one Parquet file for each chunk and table, written atomically.

``points/000000.parquet`` and so on have one row for each point; ``NAME/000000.parquet`` has the rows of an additional
table. A chunk is finished once its file in ``points`` exists, which is written last. ``sweep.yaml``, with a table of
points if necessary, repeats the sweep.

A key of the manifest marks the folder as that of a sweep and lists the sweep's names in it. Nothing else is ever
removed or replaced, and nothing is written through a link.
"""

from __future__ import annotations

import io
import json
import logging
import os
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from henon_ref.atomic_write import replace_file
from henon_ref.errors import CaseError
from henon_ref.sweeps.chunk import POINTS, Tables
from henon_ref.sweeps.plan import Plan
from henon_ref.sweeps.table_files import check_arrow, csv_bytes, parquet, read_parquet
from henon_ref.sweeps.work import Observation
from henon_ref.system.python_arguments import written
from henon_ref.system.tree import as_written
from henon_ref.workers.machine import commit, library_versions, machine

_LOG = logging.getLogger(__name__)

MANIFEST, SWEEP_FILE = "manifest.json", "sweep.yaml"
PAGE = "index.html"
KEY = "henon_ref_sweep"
"""Key of the manifest with the names that belong to the sweep."""


@dataclass(frozen=True)
class Owned:
    """Files and folders that belong to a sweep, in addition to the manifest."""

    content: str
    """Hash of the sweep, its points and chunks included."""
    chunks: int
    """Number of files of each table: 000000.parquet and so on."""
    tables: tuple[str, ...]
    files: tuple[str, ...]
    """Names of other files, and of the folder of figures."""


def owned(folder: Path) -> Owned | None:
    """Return what belongs to a sweep in a folder; None if the manifest does not list it."""
    manifest = folder / MANIFEST
    if manifest.is_symlink() or not manifest.is_file():
        return None
    try:
        found = json.loads(manifest.read_text(encoding="utf-8"))
        own = Owned(**found[KEY])
        names = [*own.tables, *own.files]
        if [*map(type, vars(own).values())] == [str, int, list, list] and all(map(_is_name, names)):
            return own
    except (ValueError, TypeError, KeyError, RecursionError):  # not a manifest of a sweep
        pass
    return None


def chunk_files(folder: Path, table: str) -> list[Path]:
    """Return the existing files of one table of a sweep, in order."""
    own = owned(folder)
    return [] if own is None else [path for _, path in _numbered(folder / table, own.chunks)]


class SweepFolder:
    """Folder for the results of a plan."""

    def __init__(self, path: Path, plan: Plan) -> None:
        check_arrow("a sweep with a folder")
        self.path, self.plan = path, plan

    def begin(self, *, resume: bool, further: Sequence[str] = (PAGE,)) -> None:
        """Create the folder, and write the manifest and the sweep file; ``further`` files are written at the end.

        Files of an earlier sweep are removed, unless it is resumed. CaseError if the folder has files but no sweep, or
        (to resume) a different sweep; if a name is taken by a file that is not the sweep's; or if it cannot be written.
        Only in the last case may something have been changed.
        """
        files = _files(self.plan)
        own = Owned(self.plan.content, len(self.plan.chunks), tuple(self.plan.tables), (*sorted(files), *further))
        try:
            before = owned(self.path)
            if before is None and self.path.exists() and any(f.name[0] != "." for f in self.path.iterdir()):
                raise CaseError("this folder has files, but no sweep; choose another folder", file=str(self.path))
            if resume and before is not None and before.content != own.content:
                other = "this folder holds a different sweep, or different chunks; remove it, or choose another folder"
                raise CaseError(other, file=str(self.path))
            self._check_free(own, before)
            if before is not None and not resume:
                self._remove(before)
            kept = () if before is None else (name for name in before.files if os.path.lexists(self.path / name))
            own = Owned(own.content, own.chunks, own.tables, tuple(dict.fromkeys([*own.files, *kept])))
            self.path.mkdir(parents=True, exist_ok=True)
            text = json.dumps({**_manifest(self.plan), KEY: asdict(own)}, indent=1, ensure_ascii=False)
            for file, content in {MANIFEST: (text + "\n").encode(), **files}.items():
                replace_file(self.path / file, content)
        except OSError as error:
            raise _unwritten(error, self.path, "") from error

    def finished(self) -> Iterator[tuple[int, Tables]]:
        """Yield number and tables of each chunk that is complete and of this plan; other chunks must be run again."""
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
        """Write a chunk; if this fails (for example on a full disk), existing files are unharmed."""
        points = {**self.plan.own_columns(number), **tables.points}
        try:
            for name, columns in {**tables.ragged, POINTS: points}.items():
                folder = self.path / name
                folder.mkdir(exist_ok=True)
                replace_file(folder / _file(number), parquet(columns))
        except OSError as error:
            kept = "finished chunks are kept: --resume (resume=True) continues from them"
            raise _unwritten(error, self.path, kept) from error

    def read(self, number: int) -> Tables | None:
        """Return a finished chunk's tables as observed; None if a file is missing or differs from what was written."""
        tables, chunk = {}, self.plan.chunks[number]
        for name, columns in self.plan.tables.items():
            found = read_parquet(self.path / name / _file(number))
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
        """Raise CaseError if a name to be written is taken by a file that no sweep has written."""
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
        """Remove the files of an earlier sweep, and folders that are then empty; figures are only replaced."""
        for table in sorted(before.tables, key=lambda name: name != POINTS):  # a chunk exists if its points do
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
    """Yield number and path of the chunks' files in a folder, in order; nothing if the folder is a link or missing."""
    if folder.is_symlink() or not folder.is_dir():
        return
    for path in sorted(folder.iterdir()):
        if path.stem.isdecimal() and path.name == _file(int(path.stem)) and int(path.stem) < chunks:
            yield int(path.stem), path


def _same(one: Any, other: Any) -> bool:
    """Check whether two columns are equal to the last bit."""
    if one.dtype != other.dtype or one.shape != other.shape:
        return False
    return bool(one.tolist() == other.tolist()) if one.dtype == object else bool(one.tobytes() == other.tobytes())


def _file(number: int) -> str:
    return f"{number:06d}.parquet"


def _foreign(path: Path) -> CaseError:
    what = "is a link" if path.is_symlink() else "was not written by a sweep"
    return CaseError(f"{what}, so it is not replaced; remove it, or choose another folder", file=str(path))


def _unwritten(error: OSError, folder: Path, kept: str) -> CaseError:
    reason = f"cannot be written: {error.strerror or error}"
    return CaseError("; ".join(part for part in (reason, kept) if part), file=error.filename or str(folder))


def _files(plan: Plan) -> dict[str, bytes]:
    """Return name -> content of the files that repeat the sweep; functions of the user cannot be in them."""
    from ruamel.yaml import YAML

    buffer, yaml = io.StringIO(), YAML(typ="safe", pure=True)
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.width = 120
    points, tables = plan.points, dict[str, bytes]()
    if not points.written and points.values.size <= 2**18:  # larger tables are written as Parquet
        tables["points.csv"] = csv_bytes(points.names, points.values)
    elif not points.written:
        tables["points.parquet"] = parquet({name: points.values[:, k] for k, name in enumerate(points.names)})
    yaml.dump(_sweep_file(plan, *tables), buffer)
    return {SWEEP_FILE: buffer.getvalue().encode(), **tables}


def _sweep_file(plan: Plan, table: str = "") -> dict[str, Any]:
    work, system = plan.work, plan.work.system
    initial = {state: written(work.initial[state], state) for state in system.state}
    mode = {"mode": {str(sign): int(side) for sign, side in work.mode.items()}} if work.mode else {}
    entries = {
        "schema": 1,
        "name": plan.name,
        "title": plan.title,
        "source": plan.source,
        **{key: as_written(node) for key, node in system.tree.entries.items()},
        "initial": {"t": written(work.start, "start"), **initial, **mode},
        "until": written(work.until, "until"),
        "points": dict(plan.points.written) or {"table": table},
        "observe": [_observation(o) for o in work.observations if o.kind != "function"] or [{"status": {}}],
        "rtol": work.rtol,
        "chunk": plan.chunk,
        "max_steps": work.max_steps,
    }
    return {key: value for key, value in entries.items() if value is not None}


def _observation(observation: Observation) -> Mapping[str, Any]:
    given = {f.name: getattr(observation, f.name) for f in fields(observation)}
    return {observation.kind: {name: value for name, value in given.items() if value is not None}}


def _manifest(plan: Plan) -> dict[str, Any]:
    """Return the manifest: how the results were made, and how to repeat them."""
    own = any(o.kind == "function" for o in plan.work.observations)
    return {
        "rerun": shlex.join(["henon-ref", "sweep", SWEEP_FILE, "--out", "again"]),
        "left_out": "functions of the user, which a file cannot hold" if own else "",
        "points": len(plan.points),
        "chunk": plan.chunk,
        "commit": commit(),
        "versions": library_versions(),
        "machine": machine(),
    }
