"""Journal of finished rows on disk, from which an interrupted comparison continues.

Each row is one JSON line with its own checksum, flushed to the disk before the next run starts. A damaged line, for
example a truncated one, is reported and moved to a separate file; its row is run again. The journal is in the report
folder of the case. The caller removes it after the report is written.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import re
from collections.abc import Iterable
from dataclasses import asdict
from functools import cache
from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from henon_ref.atomic_write import naming, replace_file
from henon_ref.casefile.case import Reading
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options, Setting
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.rows import RunRow, StickRow, TransitionRow
from henon_ref.harness.score.reference import Expected

_LOG = logging.getLogger(__name__)

FORMAT = 4
"""Version of the journal; increased if the contents of a line or the scoring of a run change."""
FILE = ".partial"
SET_ASIDE = ".partial.damaged"
"""File of the damaged lines."""
BASELINES = "baselines"
"""Folder of the baselines: in ``henon_ref`` if installed, next to ``henon_ref`` in a checkout."""
PACKAGES = ("henon_ref", f"henon_ref.{BASELINES}")
LANGUAGES = (".py", ".c", ".h", ".m")
"""Suffixes of source files."""


class Journal:
    """Journal of the finished rows of one case, in its report folder, which is named after the case.

    With ``resume``, the rows of an existing journal are used; otherwise the first new row replaces them.
    """

    def __init__(self, folder: Path, *, resume: bool) -> None:
        self.path = folder / FILE
        self.rows: dict[str, Record] = {}
        """By key, those of earlier runs."""
        self._started = resume
        if resume:
            self.rows, intact, damaged = _kept(self.path)
            if damaged:
                _set_aside(self.path, intact, damaged)

    def add(self, key: str, record: Record) -> None:
        """Write a finished row to the disk; if that raises an OSError, earlier rows are not affected."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with naming(self.path), self.path.open("ab" if self._started else "wb") as file:
            file.write(line_of(key, record))
            file.flush()
            os.fsync(file.fileno())
        self._started = True


def line_of(key: str, record: Record) -> bytes:
    rows = {"transitions": list(map(vars, record.transitions)), "sticks": list(map(vars, record.sticks))}
    parts = {"key": key, "run": vars(record.run), **rows, "samples": record.samples}
    body = json.dumps(parts, separators=(",", ":")).encode()
    return body[:-1] + f',"checksum":"{hashlib.sha256(body).hexdigest()}"}}\n'.encode()


def read(path: Path) -> dict[str, Record]:
    """Read the finished rows of a journal, by key; empty if the file does not exist."""
    return _kept(path)[0]


Damaged = list[tuple[int, bytes, str]]
"""Number, content and fault of every damaged line."""


def _kept(path: Path) -> tuple[dict[str, Record], list[bytes], Damaged]:
    """Return the rows of a journal by key, their lines, and the damaged lines."""
    rows: dict[str, Record] = {}
    intact: list[bytes] = []
    damaged: Damaged = []
    for number, line in enumerate(path.read_bytes().splitlines(keepends=True) if path.exists() else (), 1):
        try:
            key, record = _row(line, case=path.parent.name)
        except ValueError as error:
            damaged.append((number, line, str(error)))
        else:
            rows[key] = record
            intact.append(line)
    return rows, intact, damaged


def _row(line: bytes, *, case: str) -> tuple[str, Record]:
    """Parse a line into key and row; ValueError if :func:`line_of` would not write it for a row of this case."""
    found = re.search(rb',"checksum":"([0-9a-f]{64})"\}\n\Z', line)
    if found is None:
        raise ValueError("it is truncated, or not written by this version")
    body = line[: found.start()] + b"}"
    if hashlib.sha256(body).hexdigest().encode() != found[1]:
        raise ValueError("its checksum is wrong")
    content = json.loads(body)
    parts = {"key": str, "run": dict, "transitions": list, "sticks": list, "samples": list}
    if not isinstance(content, dict) or {name: type(part) for name, part in content.items()} != parts:
        raise ValueError("it was not written by this version")
    try:
        run = RunRow(**content["run"])
        transitions = [TransitionRow(**row) for row in content["transitions"]]
        sticks = [StickRow(**row) for row in content["sticks"]]
    except TypeError:
        raise ValueError("its columns are those of another version") from None
    if run.case != case:
        raise ValueError("it is a row of another case")
    return content["key"], Record(run, transitions, sticks, content["samples"])


def _set_aside(path: Path, intact: list[bytes], damaged: Damaged) -> None:
    aside = path.with_name(SET_ASIDE)
    with aside.open("ab") as file:
        file.writelines(line.rstrip(b"\r\n") + b"\n" for _, line, _ in damaged)
    replace_file(path, b"".join(intact))
    number, _, reason = damaged[0]
    others = f" and {len(damaged) - 1} more" if len(damaged) > 1 else ""
    _LOG.warning("%s: line %d is damaged (%s)%s; set aside in %s, run again", path, number, reason, others, aside)


def reading_key(case: str, reading: Reading, expected: Expected | None) -> str:
    """Return a hash of the data that the rows of one reading share: case, reading, problem and exact run."""
    parts = [
        FORMAT,
        case,
        reading.name,
        reading.mathematics_hash,
        reading.measure_after,
        reading.published and asdict(reading.published),
        reading.expect and asdict(reading.expect),
        expected and asdict(expected),
    ]
    return _hashed(parts)


def row_key(reading: str, solver: str, version: str, setting: Setting, options: Options) -> str:
    """Return a hash of all data that determine a row except its wall times; ``reading`` is a :func:`reading_key`."""
    how = [options.timeout, options.repeats, options.timed]
    package = registry.third_party_package(solver)
    return _hashed([code_version(), package_code(package), reading, solver, version, asdict(setting), *how])


def _hashed(parts: list[Any]) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()


@cache
def code_version() -> str:
    """Return a hash of the source files of the package and its baselines; equal in a checkout and an installation."""
    return _hash_of((name, top) for name in PACKAGES for top in import_module(name).__path__)


@cache
def package_code(package: str) -> str:
    """Return a hash of the code of a top-level module or package, which is not imported; empty if it does not exist.

    The version of a package that is being developed stays the same while its code changes.
    """
    try:
        spec = find_spec(package) if package else None
    except ValueError:  # a module without a spec, such as __main__
        spec = None
    if spec is None:
        return ""
    tops = spec.submodule_search_locations or [spec.origin or ""]
    return _hash_of(((package, top) for top in tops), suffixes=(*LANGUAGES, *EXTENSION_SUFFIXES))


def _hash_of(places: Iterable[tuple[str, str]], *, suffixes: tuple[str, ...] = LANGUAGES) -> str:
    """Return a hash of files of code; ``places`` has names of packages, and the folder or the only file of each."""
    digest = hashlib.sha256()
    for name, top in places:
        for path in [top] if os.path.isfile(top) else sorted(code_files(top, suffixes)):
            if not os.path.isfile(path):  # a link to nothing, such as the lock of an editor
                continue
            with open(path, "rb") as file:
                text = file.read()
            digest.update(f"{name} {path.removeprefix(top)} {len(text)}\n".encode() + text)
    return digest.hexdigest()


def code_files(top: str, suffixes: tuple[str, ...] = LANGUAGES) -> list[str]:
    """List the files of code of a package except our baselines (``Path.rglob`` takes twenty times as long)."""
    found = []
    for folder, below, files in os.walk(top):
        if folder == top and os.path.basename(top) == PACKAGES[0] and BASELINES in below:
            below.remove(BASELINES)
        found += [os.path.join(folder, file) for file in files if file.endswith(suffixes)]
    return found
