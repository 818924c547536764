"""What one run has spent: counts, and the deadline that stops it from inside a callback."""

from __future__ import annotations

from importlib import metadata
from time import perf_counter

from henon_ref.jit.processor_time import Deadline
from henon_ref.trajectory import Counts


class DeadlinePassed(Exception):  # noqa: N818  (not an error: a way out of a library's own loop)
    """Raised inside a callback to leave a library that would go on."""


class Stalled(Exception):  # noqa: N818
    """Raised inside a callback to leave a library whose steps no longer move the time."""


class Work:
    """Counters of one run, reset at its start, which may take so much processor time [s], what it compiles apart.

    The two that count, and ``check``, raise :class:`DeadlinePassed` once that is used up.
    """

    __slots__ = ("clock", "deadline", "events", "rhs", "steps", "stop_at")

    def __init__(self, deadline: float | None) -> None:
        self.deadline = deadline
        self.start()

    def start(self) -> None:
        """Begin a run: all counts zero, the clock set."""
        self.steps = self.rhs = self.events = 0
        self.clock = Deadline(self.deadline)
        self.stop_at = self.clock.look_at

    def count_rhs(self) -> None:
        """One right-hand side."""
        self.rhs += 1
        if perf_counter() > self.stop_at:
            self._check_clock()

    def count_event(self) -> None:
        """One evaluation of one guard."""
        self.events += 1
        if perf_counter() > self.stop_at:
            self._check_clock()

    def check(self) -> None:
        """Look at the clock only."""
        if perf_counter() > self.stop_at:
            self._check_clock()

    def _check_clock(self) -> None:
        if self.clock.passed():
            raise DeadlinePassed
        self.stop_at = self.clock.look_at

    @property
    def counts(self) -> Counts:
        return Counts(self.steps, self.rhs, self.events)


def installed_version(distribution: str) -> str:
    """Version of a package, empty where it is not installed."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""
