"""One line about work that takes long, where somebody waits for it: at a terminal, and in a notebook."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from typing import Any

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


class NotebookLine:
    """A line among a notebook's outputs that is written over, by what every notebook has: no widgets are needed."""

    def __init__(self) -> None:
        self._handle: Any = None

    def show(self, words: str) -> None:
        """Show a line in the place of the last one."""
        if self._handle is None:
            from IPython.display import display

            self._handle = display({"text/plain": words}, raw=True, display_id=True)
        else:
            self._handle.update({"text/plain": words}, raw=True)
