"""Interface between the driver and a library that integrates one smooth mode up to an event or the horizon."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import Fresh
from henon_ref.jit.processor_time import Deadline
from henon_ref.trajectory import Counts

Times = NDArray[np.float64] | None
"""Increasing sample times [s], for figures; None if no samples are requested."""
LIMIT = 1e100
"""A run with a larger state component has diverged. A smaller bound could be wrong in some units."""


class DeadlinePassed(Exception):  # noqa: N818  (not an error: it leaves a library's own loop)
    """Raised inside a callback to leave a library whose processor time is used up."""


class Stalled(Exception):  # noqa: N818
    """Raised inside a callback to leave a library that makes no progress; the message is the reason."""


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


class Stop(NamedTuple):
    """Time, state and reason at which a library stopped."""

    status: Literal["event", "horizon", "diverged", "failed"]
    t: float
    low: float
    """Part of the time that rounding to ``t`` has lost, if the library keeps it; otherwise 0."""
    x: tuple[float, ...]
    hits: tuple[int, ...] = ()
    """Indices of the guards that fell through zero at ``t`` (status ``event``)."""
    reason: str = ""
    """The library's message (status ``failed``)."""
    samples: NDArray[np.float64] | None = None
    """States at the sample times up to ``t``, shape (k, n)."""


Advance = Callable[[float, float, Sequence[float], float, Sequence[Fresh], Times], Stop]
"""A library prepared for one mode: ``advance(t, low, x, until, fresh, wanted)`` integrates from the time t + low, where
``low`` is the rounding remainder, and the state x to the first guard that falls through zero, or to ``until`` > t. The
restart policy applies only to the guards ``fresh``, which start at zero. ``wanted`` are sample times > t; a library
without sampling ignores them. After the deadline it raises :class:`DeadlinePassed`."""


class Library(NamedTuple):
    """A library at its tolerances."""

    solver: Any
    """The :class:`.adapter.Adapter`; the modes read its options."""
    module: Any
    """Result of the adapter's ``load``."""
    rtol: float
    atol: float
    accuracy: tuple[float, float]
    """Relative and absolute error that the tolerances allow per step."""
    errors: tuple[float, float]
    """Relative and absolute error of the state just after a start."""

    def flow(self, model: ModeFunctions, work: Work, horizon: float) -> Any:
        """Prepare the library for one mode of a run of length ``horizon`` [s]; its method is :data:`Advance`."""
        return self.solver.mode(self, model, work, horizon)

    def loosened(self) -> Library:
        """Return the library at loose tolerances, for the run that finds the visited modes."""
        found: Library = self.solver.loosened(self.rtol, self.atol)
        return found

    def location_error(self, t: float) -> float:
        """Return the largest error of an event time [s]. Roots of several guards within this time are one event."""
        roundings: float
        roundings, more = self.solver.located
        return roundings * EPSILON * (more + abs(t))
