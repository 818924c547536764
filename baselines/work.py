"""Counters of one run, and the deadline that stops the run from inside a callback."""

from __future__ import annotations

from importlib import metadata
from time import perf_counter

from henon_ref.jit.processor_time import Deadline
from henon_ref.trajectory import Counts


class DeadlinePassed(Exception):  # noqa: N818  (not an error: it leaves a library's own loop)
    """Raised inside a callback to leave a library whose processor time is used up."""


class Stalled(Exception):  # noqa: N818
    """Raised inside a callback to leave a library whose steps no longer move the time."""


class Work:
    """Counters of one run, reset at its start.

    ``deadline`` is the processor time that the run may use [s], without compilation. Once that time is used up,
    ``count_rhs``, ``count_event`` and ``check`` raise :class:`DeadlinePassed`.
    """

    __slots__ = ("clock", "deadline", "events", "rhs", "steps", "stop_at")

    def __init__(self, deadline: float | None) -> None:
        self.deadline = deadline
        self.start()

    def start(self) -> None:
        """Set all counts to zero and start the clock."""
        self.steps = self.rhs = self.events = 0
        self.clock = Deadline(self.deadline)
        self.stop_at = self.clock.look_at

    def count_rhs(self) -> None:
        """Count one evaluation of the right-hand side."""
        self.rhs += 1
        if perf_counter() > self.stop_at:
            self._check_clock()

    def count_event(self) -> None:
        """Count one evaluation of one guard."""
        self.events += 1
        if perf_counter() > self.stop_at:
            self._check_clock()

    def check(self) -> None:
        """Check the clock without counting."""
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
    """Version of a package; empty if it is not installed."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""
