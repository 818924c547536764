"""One line that says what is being done, at a terminal and in a notebook."""

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
"""The cursor goes to the line's start, and what stands in the line goes away."""
PATIENCE = 1.0
"""Seconds after which the line is written."""


@contextmanager
def notice_if_slow(work: str) -> Iterator[None]:
    """Say on standard error (in a notebook: standard output) what is being done, if it is not done within a second.

    Parameters
    ----------
    work : str
        As in ``compiling the system``.
    """
    if not is_watched():
        yield
        return
    stream = sys.stdout if in_notebook() else sys.stderr  # which a notebook shows as if something were wrong
    timer = Timer(PATIENCE, lambda: print(f"henon_ref: {work}, once", file=stream, flush=True))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()  # no thread is left: workers may be forked


def is_watched() -> bool:
    """Whether somebody sees standard error: it is a terminal, or this is a notebook's kernel."""
    return in_notebook() or (sys.stderr is not None and sys.stderr.isatty())


def in_notebook() -> bool:
    """Whether this is a notebook's kernel."""
    shell = sys.modules.get("IPython")
    instance = shell.get_ipython() if shell is not None and hasattr(shell, "get_ipython") else None
    return getattr(instance, "kernel", None) is not None


def is_terminal(stream: TextIO | None) -> bool:
    """Whether a stream is a terminal on which a line can be taken back."""
    return stream is not None and stream.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")


class Line:
    """A line that is written over, on a terminal or among a notebook's outputs; elsewhere nothing is shown.

    It needs no thread, so that workers can be forked, and in a notebook no widgets.

    Parameters
    ----------
    stream : TextIO, optional
        None: standard error, as it is whenever something is shown.

    Attributes
    ----------
    shown : bool
        Whether it stands there.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream
        self._handle: Any = None
        self.shown = False

    def show(self, words: str) -> None:
        """Show what is being done, in the place of what was shown before."""
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

    def end(self, words: str = "") -> None:
        """Take the line back, or leave these words there."""
        if words:
            self.show(words)
        if self.shown:
            self._write("\n" if words else _ERASED)
            self.shown = False

    def _write(self, text: str) -> None:
        print(text, end="", file=self._stream or sys.stderr, flush=True)
