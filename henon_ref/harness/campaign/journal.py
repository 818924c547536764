"""Finished rows on disk, so that an interrupted comparison goes on where it stopped.

One JSON line a row with a checksum of its own, written through to the disk before the next run starts. A line that is
damaged in any way (one that was cut short, say) is told, and set aside in a file beside; its row is run again. The
journal lies in the case's report folder, and who asked for it removes it once the report is there.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import re
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from henon_ref.atomic_write import replace_file
from henon_ref.casefile.case import Reading
from henon_ref.harness.campaign.options import Options, Setting
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.rows import RunRow, StickRow, TransitionRow
from henon_ref.harness.score.reference import Expected

_LOG = logging.getLogger(__name__)

FORMAT = 4
"""Raised where what a line holds, or how a run is scored, changes."""
FILE = ".partial"
SET_ASIDE = ".partial.damaged"
"""Where damaged lines are kept."""
BASELINES = "baselines"
"""A folder of ``henon_ref`` where it is installed, and beside it in a checkout."""
PACKAGES = ("henon_ref", f"henon_ref.{BASELINES}")
LANGUAGES = (".py", ".c", ".h", ".m")
"""How the names of modules, and of programs in other languages, end."""
_CHECKSUM = re.compile(rb',"checksum":"([0-9a-f]{64})"\}\n\Z')
_PARTS = {"key": str, "run": dict, "transitions": list, "sticks": list, "samples": list}
"""What a line holds."""


@dataclass(frozen=True)
class _Kept:
    """What a journal holds."""

    rows: dict[str, Record] = field(default_factory=dict)
    """By key."""
    lines: list[bytes] = field(default_factory=list)
    """The lines of these rows."""
    damaged: list[tuple[int, bytes, str]] = field(default_factory=list)
    """Number, line and what is wrong with it."""


class Journal:
    """The finished rows of one case.

    Parameters
    ----------
    folder : Path
        The case's report folder, of the case's name; it is made with the first row.
    resume : bool
        Whether rows that are there already are used; if not, the first new row replaces them.
    """

    def __init__(self, folder: Path, *, resume: bool) -> None:
        self.path = folder / FILE
        kept = _kept(self.path) if resume else _Kept()
        self._rows = kept.rows
        self._started = resume
        if kept.damaged:
            _set_aside(self.path, kept)

    def get(self, key: str) -> Record | None:
        """The finished row of this key."""
        return self._rows.get(key)

    def add(self, key: str, record: Record) -> None:
        """Put a finished row on the disk.

        Raises
        ------
        OSError
            Where it cannot be written; the rows before it are safe.
        """
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("ab" if self._started else "wb") as file:
            file.write(line_of(key, record))
            file.flush()
            os.fsync(file.fileno())
        self._started = True


def line_of(key: str, record: Record) -> bytes:
    """A row as a line of the journal."""
    rows = {"transitions": list(map(vars, record.transitions)), "sticks": list(map(vars, record.sticks))}
    parts = {"key": key, "run": vars(record.run), **rows, "samples": record.samples}
    body = json.dumps(parts, separators=(",", ":")).encode()
    return body[:-1] + f',"checksum":"{hashlib.sha256(body).hexdigest()}"}}\n'.encode()


def read(path: Path) -> dict[str, Record]:
    """The finished rows that a journal holds, by key; empty where there is none."""
    return _kept(path).rows


def _kept(path: Path) -> _Kept:
    kept = _Kept()
    lines = path.read_bytes().splitlines(keepends=True) if path.exists() else []
    for number, line in enumerate(lines, 1):
        try:
            key, record = _row(line, case=path.parent.name)
        except ValueError as error:
            kept.damaged.append((number, line, str(error)))
        else:
            kept.rows[key] = record
            kept.lines.append(line)
    return kept


def _row(line: bytes, *, case: str) -> tuple[str, Record]:
    """Key and row of a line; ValueError where it is not such as :func:`line_of` writes for a row of this case."""
    found = _CHECKSUM.search(line)
    if found is None:
        raise ValueError("it is cut short, or no row of this version")
    body = line[: found.start()] + b"}"
    if hashlib.sha256(body).hexdigest().encode() != found[1]:
        raise ValueError("its checksum does not fit")
    content = json.loads(body)
    if not isinstance(content, dict) or {name: type(part) for name, part in content.items()} != _PARTS:
        raise ValueError("it is no row of this version")
    try:
        run = RunRow(**content["run"])
        transitions = [TransitionRow(**row) for row in content["transitions"]]
        sticks = [StickRow(**row) for row in content["sticks"]]
    except TypeError:
        raise ValueError("its columns are those of another version") from None
    if run.case != case:
        raise ValueError("it is a row of another case")
    return content["key"], Record(run, transitions, sticks, content["samples"])


def _set_aside(path: Path, kept: _Kept) -> None:
    """Keep the damaged lines in a file beside, and only the others in the journal; say so."""
    aside = path.with_name(SET_ASIDE)
    with aside.open("ab") as file:
        file.writelines(line.rstrip(b"\r\n") + b"\n" for _, line, _ in kept.damaged)
    replace_file(path, b"".join(kept.lines))
    number, _, reason = kept.damaged[0]
    others = f" and {len(kept.damaged) - 1} more" if len(kept.damaged) > 1 else ""
    _LOG.warning("%s: line %d is damaged (%s)%s; set aside in %s, run again", path, number, reason, others, aside)


def reading_key(case: str, reading: Reading, expected: Expected | None) -> str:
    """A hash of all that the rows of one reading share: whose they are, the problem, what they are scored against."""
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
    """A hash of everything that decides what a row says, wall times apart; ``reading``: its :func:`reading_key`."""
    how = [options.timeout, options.repeats, options.timed]
    return _hashed([code_version(), reading, solver, version, asdict(setting), *how])


def _hashed(parts: list[Any]) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()


@cache
def code_version() -> str:
    """A hash of the text of every module and program at work, the same whether it is committed or installed."""
    digest = hashlib.sha256()
    for name in PACKAGES:
        for top in import_module(name).__path__:
            for path in sorted(code_files(top)):
                with open(path, "rb") as file:
                    text = file.read()
                digest.update(f"{name} {path.removeprefix(top)} {len(text)}\n".encode() + text)
    return digest.hexdigest()


def code_files(top: str) -> list[str]:
    """Paths of a package's modules and programs, the baselines aside (Path.rglob takes twenty times as long)."""
    found = []
    for folder, below, files in os.walk(top):
        if folder == top and BASELINES in below:
            below.remove(BASELINES)
        found += [os.path.join(folder, file) for file in files if file.endswith(LANGUAGES)]
    return found
