"""Processor time: the unit of deadlines of runs, without the time of compilation, which counts for no run.

Other work on the machine takes wall time from a run, but not processor time. A deadline in processor time therefore
does not depend on the machine's load. Times are those of the calling thread.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter, thread_time


class _Compiled(threading.local):
    """Time that a thread has spent in :func:`compiling`."""

    processor_s = 0.0
    wall_s = 0.0
    nested = False


_compiled = _Compiled()
_listeners: list[Callable[[float | None], None]] = []


@contextmanager
def compiling() -> Iterator[None]:
    """Exclude the time of a block from the run's deadline, for example for a mode first reached in a run."""
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
    """Call a function with None when a compilation begins, and with its processor time [s] when it ends."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


def run_time() -> float:
    """Wall time without compilation [s]; differences are times of runs."""
    return perf_counter() - _compiled.wall_s


def waited_seconds(pid: int) -> float:
    """Time in which a process was ready to run while no processor was free [s]; 0 if unknown.

    From Linux's ``/proc/PID/schedstat``, for the main thread. Wall time minus this time does not depend on the
    machine's load: it is the process's own work and waiting.
    """
    try:
        with open(f"/proc/{pid}/schedstat", encoding="ascii") as file:
            return int(file.read().split()[1]) * 1e-9
    except (OSError, IndexError, ValueError):  # no such process, or not Linux
        return 0.0


class Deadline:
    """Limit of the processor time of a run from now on, without compilation [s]; None: no limit.

    ``look_at`` is the earliest possible time of passing, by :func:`time.perf_counter`, since a thread has no more
    processor time than wall time. A frequent caller compares with it before it calls :meth:`passed`: a tenth of the
    cost.
    """

    __slots__ = ("_ends", "look_at")

    def __init__(self, seconds: float | None) -> None:
        self.look_at = self._ends = math.inf
        if seconds is not None:
            self.look_at = perf_counter() + seconds
            self._ends = thread_time() - _compiled.processor_s + seconds

    def passed(self) -> bool:
        if perf_counter() <= self.look_at:
            return False
        left = self._ends - (thread_time() - _compiled.processor_s)
        self.look_at = perf_counter() + left
        return left <= 0
