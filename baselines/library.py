"""Interface between the driver and a library that integrates one smooth mode up to an event or the horizon."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import Fresh, Restart
from henon_ref.baselines.work import Work

LIMIT = 1e100
"""A run with a larger state component has diverged. A smaller bound could be wrong in some units."""


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


class Flow(Protocol):
    """A library prepared for one mode."""

    def advance(
        self,
        t: float,
        low: float,
        x: Sequence[float],
        until: float,
        fresh: Sequence[Fresh],
        wanted: NDArray[np.float64] | None,
    ) -> Stop:
        """Integrate from (t + low, x) to the first guard that falls through zero, or to ``until`` > t.

        Parameters
        ----------
        t, low, x
            Start: time, its rounding remainder, and state.
        until : float
            Horizon.
        fresh : sequence of Fresh
            Guards that start at zero; the restart policy applies to these guards only.
        wanted : ndarray or None
            Increasing sample times > t. A library without sampling ignores them.

        Raises
        ------
        DeadlinePassed
            If the run has used its processor time.
        """
        ...


class Library(NamedTuple):
    """A library at its tolerances."""

    solver: Any
    """The adapter; the modes read its options."""
    module: Any
    """Result of the adapter's ``load``."""
    rtol: float
    atol: float
    landing: str
    restart: Restart
    accuracy: tuple[float, float]
    """Relative and absolute error that the tolerances allow per step."""
    errors: tuple[float, float]
    """Relative and absolute error of the state just after a start."""
    located: tuple[float, float]
    """(k, s): an event time t differs from the library's own root by at most k eps (s + abs(t)), s in seconds."""
    mode: Callable[[Library, ModeFunctions, Work, float], Flow]
    """Prepares one mode (compilation included); arguments: library, model, work, length of the run [s]."""
    loosened: Callable[[], Library]
    """Returns the library at loose tolerances, for the run that finds the visited modes."""

    def flow(self, model: ModeFunctions, work: Work, horizon: float) -> Flow:
        """Prepare the library for one mode of a run of length ``horizon`` [s]."""
        return self.mode(self, model, work, horizon)

    def location_error(self, t: float) -> float:
        """Return the largest error of an event time [s]. Roots of several guards within this time are one event."""
        roundings, more = self.located
        return roundings * EPSILON * (more + abs(t))
