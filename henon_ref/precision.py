"""The precision of python-flint, which belongs to the process: one lock for all that set it, and for SymPy."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from flint import ctx

_LOCK = threading.RLock()


@contextmanager
def working_precision(bits: int) -> Iterator[None]:
    """Numbers of python-flint have so many bits; other threads that want theirs wait.

    A precision set in one thread is seen in all of them (python-flint 0.9), and so is the length of series.
    """
    with _LOCK, ctx.workprec(bits):
        yield


@contextmanager
def one_at_a_time() -> Iterator[None]:
    """Derive equations, or compile what follows from them, while no other thread does, nor sets a precision.

    SymPy makes no promise to threads. The lock is the same: who has one of two might wait for the other.
    """
    with _LOCK:
        yield
