"""A library as the driver sees it: at its tolerances it integrates one smooth mode until something stops it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import Fresh, Restart
from henon_ref.baselines.work import Work

LIMIT = 1e100
"""A state beyond this has diverged (no smaller bound is right in all units)."""


class Stop(NamedTuple):
    """Where and why a library stopped."""

    status: Literal["event", "horizon", "diverged", "failed"]
    t: float
    low: float
    """What rounding ``t`` lost, where the library keeps it (0 elsewhere)."""
    x: tuple[float, ...]
    hits: tuple[int, ...] = ()
    """Indices of the guards that fell through zero at t (``event``)."""
    reason: str = ""
    """The library's own words (``failed``)."""
    samples: NDArray[np.float64] | None = None
    """(k, n) states at the wanted times up to t."""


class Flow(Protocol):
    """One library on one mode."""

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
            Start.
        until : float
            Horizon.
        fresh : sequence of Fresh
            Guards that start at zero: the restart policy is about these.
        wanted : ndarray or None
            Increasing times > t at which the state is wanted; they may be left alone.

        Raises
        ------
        DeadlinePassed
        """
        ...


class Library(NamedTuple):
    """A library at its tolerances."""

    solver: Any
    """The adapter, whose options its modes read."""
    module: Any
    """What its ``load`` imported."""
    rtol: float
    atol: float
    landing: str
    restart: Restart
    accuracy: tuple[float, float]
    """Relative and absolute error that the tolerances allow a step."""
    errors: tuple[float, float]
    """Relative and absolute error that the library leaves in a state just after a start."""
    located: tuple[float, float]
    """How far its event times are from its own root: so many roundings of so many seconds more than the time."""
    mode: Callable[[Library, ModeFunctions, Work, float], Flow]
    """All that is done once a mode (compilation too), for a run of so many seconds."""
    loosened: Callable[[], Library]
    """One whose tolerances are cheap enough for a first look at which modes a problem visits."""

    def flow(self, model: ModeFunctions, work: Work, horizon: float) -> Flow:
        """The library on one mode, in a run of a length ``horizon`` [s]."""
        return self.mode(self, model, work, horizon)

    def location_error(self, t: float) -> float:
        """How far an event time is from the library's own root [s]: guards closer than this are one event."""
        roundings, more = self.located
        return roundings * EPSILON * (more + abs(t))
