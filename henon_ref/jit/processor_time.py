"""Processor time: what the deadlines of runs are in, and what of it goes into compiling, which counts for no run.

What else a machine does takes wall time from a run, not processor time: where a deadline is in processor time, whether
a run keeps it does not depend on that. Times are those of the calling thread.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter, thread_time


class _Compiled(threading.local):
    """What a thread has spent in :func:`compiling`."""

    processor_s = 0.0
    wall_s = 0.0
    nested = False


_compiled = _Compiled()
_listeners: list[Callable[[float | None], None]] = []


@contextmanager
def compiling() -> Iterator[None]:
    """Take what is done inside off the clock of the run, if there is one: a mode met first in a run, say."""
    if _compiled.nested:
        yield
        return
    _compiled.nested = True
    for listener in _listeners:
        listener(None)
    began, wall = thread_time(), perf_counter()
    try:
        yield
    finally:
        spent = thread_time() - began
        _compiled.processor_s += spent
        _compiled.wall_s += perf_counter() - wall
        _compiled.nested = False
        for listener in _listeners:
            listener(spent)


@contextmanager
def compile_listener(listener: Callable[[float | None], None]) -> Iterator[None]:
    """Call a function with None whenever compiling begins, and with its processor time [s] when it ends."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


def run_time() -> float:
    """Wall time without what went into compiling [s]; differences of it are times of runs."""
    return perf_counter() - _compiled.wall_s


def waited_seconds(pid: int) -> float:
    """Time for which a process was ready to run while no processor was free for it [s]; 0 where nothing tells it.

    By Linux's ``/proc/PID/schedstat``, of the main thread. Wall time without it does not depend on what else a machine
    does: what is left is the process's own work and waiting.
    """
    try:
        with open(f"/proc/{pid}/schedstat", encoding="ascii") as file:
            return int(file.read().split()[1]) * 1e-9
    except (OSError, IndexError, ValueError):  # there is no such process, or no such file
        return 0.0


class Deadline:
    """Processor time that a run may take from now on, compiling apart.

    Parameters
    ----------
    seconds : float, optional
        None: it never passes.

    Attributes
    ----------
    look_at : float
        By :func:`time.perf_counter`: it cannot have passed before, for no thread has more processor time than wall
        time. Whoever looks often compares with this first, which is a tenth of the cost.
    """

    __slots__ = ("_ends", "look_at")

    def __init__(self, seconds: float | None) -> None:
        self.look_at = self._ends = math.inf
        if seconds is not None:
            self.look_at = perf_counter() + seconds
            self._ends = thread_time() - _compiled.processor_s + seconds

    def passed(self) -> bool:
        """Whether so much processor time has been spent."""
        if perf_counter() <= self.look_at:
            return False
        left = self._ends - (thread_time() - _compiled.processor_s)
        self.look_at = perf_counter() + left
        return left <= 0
