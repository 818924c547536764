"""Progress of a comparison that is called from Python: one line, written over, on a terminal or in a notebook."""

from __future__ import annotations

import sys
import time
from contextlib import AbstractContextManager
from typing import TextIO

from henon_ref.campaign.options import Silent
from henon_ref.campaign.rows import Record
from henon_ref.text import message

PERIOD = 0.2
"""Seconds between two pictures of the line."""
SELDOM = 5.0
"""Seconds between two lines where none can be written over: in a file."""
WIDTH = 78
"""Characters of the line."""


class ProgressLine(Silent, AbstractContextManager["ProgressLine"]):
    """How many rows are done, and which run was begun last.

    It never starts a thread, so that workers can be forked.

    Parameters
    ----------
    stream : TextIO
        Usually standard error.
    name : str
        Of the case.
    """

    def __init__(self, stream: TextIO, name: str) -> None:
        self._stream, self._name = stream, name
        self._over = is_seen(stream)
        self._what, self._done, self._total, self._latest = "truths", 0, 0, ""
        self._began = time.monotonic()
        self._shown = -SELDOM
        self._written = 0

    def __exit__(self, *exception: object) -> None:
        self._show(f"{self._name}: {self._counted()}, {time.monotonic() - self._began:.1f} s", "\n")

    def truths(self, readings: int) -> None:
        """The truths of so many readings are being computed."""
        self._what, self._done, self._total = "truths", 0, readings

    def truth(self, name: str) -> None:
        """The truth of a reading is known."""
        self._done += 1

    def runs(self, rows: int, kept: int) -> None:
        """So many rows are to be made."""
        self._what, self._done, self._total = "rows", kept, rows

    def begun(self, case: str, what: str) -> None:
        """A run is begun."""
        self._latest = what
        self.tick()

    def row(self, finished: Record) -> None:
        """A row is finished."""
        self._done += 1

    def tick(self) -> None:
        """Some time has passed: show the line, now and then."""
        now = time.monotonic()
        if now - self._shown >= (PERIOD if self._over else SELDOM):
            self._shown = now
            latest = f"; at work: {self._latest}" if self._latest else ""
            self._show(
                f"{self._name}: {self._counted()}, {now - self._began:.0f} s{latest}", "" if self._over else "\n"
            )

    def _counted(self) -> str:
        return f"{self._done} of {self._total} {self._what}"

    def _show(self, line: str, end: str) -> None:
        line = message(line)[:WIDTH]
        padded = line.ljust(self._written)  # what was longer is written over
        self._stream.write(f"\r{padded}{end}" if self._over else f"{line}{end}")
        self._stream.flush()
        self._written = len(line)


def is_seen(stream: TextIO | None) -> bool:
    """Whether somebody watches a stream and a line of it can be written over: a terminal, or a notebook."""
    if stream is None:
        return False
    shell = sys.modules.get("IPython")
    in_notebook = shell is not None and getattr(shell.get_ipython(), "kernel", None) is not None
    return in_notebook or stream.isatty()
