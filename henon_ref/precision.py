"""Precision of python-flint, which is global to the process: one lock for all changes of it, and for SymPy."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from flint import ctx

_LOCK = threading.RLock()


@contextmanager
def working_precision(bits: int) -> Iterator[None]:
    """Set the bits of python-flint's numbers; other threads that set a precision wait.

    A precision set in one thread applies to all threads (python-flint 0.9), and so does the length of series.
    """
    with _LOCK, ctx.workprec(bits):
        yield


@contextmanager
def one_at_a_time() -> Iterator[None]:
    """Exclude other threads from SymPy, from compilation and from changes of the precision.

    SymPy is not documented as thread-safe. One lock serves both purposes, since two locks could deadlock.
    """
    with _LOCK:
        yield
