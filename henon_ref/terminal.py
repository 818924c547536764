"""A progress line, in a terminal and in a notebook."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from typing import Any, TextIO

from henon_ref.text import message

_ERASED = "\r\x1b[2K"
"""Moves the cursor to the start of the line and erases the line."""
NOTICE_DELAY = 1.0
"""Delay before a notice is written [s]."""


@contextmanager
def notice_if_slow() -> Iterator[None]:
    """Print on standard error (in a notebook: standard output) that a system is compiled, if it takes over a second."""
    if not is_watched():
        yield
        return
    stream = sys.stdout if in_notebook() else sys.stderr  # a notebook shows standard error as an error
    timer = Timer(NOTICE_DELAY, lambda: print("henon_ref: compiling the system, once", file=stream, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()  # leave no thread behind, since workers may be forked


def is_watched() -> bool:
    """Check whether a user can see standard error: it is a terminal, or this is the kernel of a notebook."""
    return in_notebook() or (sys.stderr is not None and sys.stderr.isatty())


def in_notebook() -> bool:
    """Check whether this is the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    instance = shell.get_ipython() if shell is not None and hasattr(shell, "get_ipython") else None
    return getattr(instance, "kernel", None) is not None


def is_terminal(stream: TextIO | None) -> bool:
    """Check whether a stream is a terminal in which a line can be erased."""
    return stream is not None and stream.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")


class Line:
    """Line that is updated in place, in a terminal or in a notebook; elsewhere nothing is shown.

    It uses no thread, so that workers can be forked, and no notebook widgets. ``stream``: None for the standard error
    stream at the time of each update. :attr:`shown`: whether the line is currently visible.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream
        self._handle: Any = None
        self.shown = False

    def show(self, words: str) -> None:
        """Show what is being done in place of the previous text."""
        stream = self._stream or sys.stderr
        if in_notebook():
            if self._handle is None:
                from IPython.display import display

                self._handle = display({"text/plain": message(words)}, raw=True, display_id=True)
            else:
                self._handle.update({"text/plain": message(words)}, raw=True)
        elif is_terminal(stream):
            room = shutil.get_terminal_size().columns - 1
            self._write(f"{_ERASED if self.shown else ''}{message(words)[:room]}")
            self.shown = True

    def clear(self, words: str = "") -> None:
        """Erase the line, or replace it by a final text."""
        if words:
            self.show(words)
        if self.shown:
            self._write("\n" if words else _ERASED)
            self.shown = False

    def _write(self, text: str) -> None:
        print(text, end="", file=self._stream or sys.stderr, flush=True)
