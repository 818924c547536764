"""Finished rows on disk, so that an interrupted comparison goes on where it stopped.

One JSON line a row, written through to the disk before the next run starts; a last line that was cut short is
ignored. The file lies in the case's report folder and is removed once the report is there.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

from henon_ref.model.case import Reading
from henon_ref.score.metrics import Expected
from henon_ref.score.rows import Record
from henon_ref.score.settings import Setting

FORMAT = 2
"""Raised where what a line holds, or how a run is scored, changes."""
FILE = ".partial"


class Journal:
    """The finished rows of one case.

    Parameters
    ----------
    folder : Path
        The case's report folder; it is made with the first row.
    resume : bool
        Whether rows that are there already are used; if not, the first new row replaces them.
    """

    def __init__(self, folder: Path, *, resume: bool) -> None:
        self.path = folder / FILE
        self._rows = read(self.path) if resume else {}
        self._started = resume and self.path.exists()

    def get(self, key: str) -> Record | None:
        """The finished row of this key."""
        line = self._rows.get(key)
        return None if line is None else Record(line["run"], line["transitions"], line["sticks"], line["samples"])

    def add(self, key: str, record: Record) -> None:
        """Put a finished row on the disk.

        Raises
        ------
        OSError
            Where it cannot be written; the rows before it are safe.
        """
        line = json.dumps({"key": key, **vars(record)}, separators=(",", ":")) + "\n"
        self.path.parent.mkdir(parents=True, exist_ok=True)
        # A line that was cut short must not swallow this one.
        lead = "\n" if self._started and not _ends_with_newline(self.path) else ""
        with self.path.open("a" if self._started else "w", encoding="utf-8") as file:
            file.write(lead + line)
            file.flush()
            os.fsync(file.fileno())
        self._started = True

    def remove(self) -> None:
        """The report is written: the rows are no longer needed here."""
        self.path.unlink(missing_ok=True)


def read(path: Path) -> dict[str, dict[str, Any]]:
    """The whole lines of a journal, by key; empty where there is none."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except FileNotFoundError:
        return {}
    rows: dict[str, dict[str, Any]] = {}
    for line in text.splitlines():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        if isinstance(row, dict) and "key" in row:
            rows[row["key"]] = row
    return rows


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


def row_key(
    reading: str,
    *,
    solver: str,
    version: str,
    setting: Setting,
    timeout: float,
    repeats: int | None,
    timed: bool,
) -> str:
    """A hash of everything that decides what a row says, wall times apart; ``reading``: its :func:`reading_key`."""
    return _hashed([reading, solver, version, asdict(setting), timeout, repeats, timed])


def _hashed(parts: list[Any]) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()


def _ends_with_newline(path: Path) -> bool:
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - 1))
        return size == 0 or file.read(1) == b"\n"
