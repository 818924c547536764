"""One line about work that takes long, where somebody waits for it: at a terminal, and in a notebook."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer

PATIENCE = 1.0
"""Seconds after which the line is written."""


@contextmanager
def notice_if_slow(work: str) -> Iterator[None]:
    """Say on standard error what is being done, if it is not done within a second.

    Parameters
    ----------
    work : str
        As in ``compiling the system``.
    """
    if not is_watched():
        yield
        return
    timer = Timer(PATIENCE, lambda: print(f"henon_ref: {work}, once", file=sys.stderr, flush=True))
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
    return type(instance).__name__ == "ZMQInteractiveShell"
