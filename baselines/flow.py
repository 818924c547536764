"""What a library has to offer: to integrate one smooth mode until something stops it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.mode_functions import ModeFunctions
from henon_ref.baselines.restart import Fresh
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
            Increasing times > t at which the state is wanted.

        Raises
        ------
        DeadlinePassed
        """
        ...


class Library(Protocol):
    """A library with its tolerances: makes one flow a mode."""

    @property
    def landing(self) -> str:
        """Its way of putting an event on the surface, as in the solver's ``landing``."""
        ...

    @property
    def errors(self) -> tuple[float, float]:
        """Relative and absolute error that the library leaves in a state just after a start."""
        ...

    @property
    def accuracy(self) -> tuple[float, float]:
        """Relative and absolute error that the tolerances allow a step."""
        ...

    def flow(self, model: ModeFunctions, work: Work, horizon: float) -> Flow:
        """All that is done once a mode (compilation too).

        Parameters
        ----------
        model : ModeFunctions
        work : Work
            Counters to keep, and the deadline.
        horizon : float
            Length of the whole run [s].
        """
        ...

    def loosened(self) -> Library:
        """The same at tolerances cheap enough for a first look at which modes a problem visits."""
        ...

    def location_error(self, t: float) -> float:
        """How far the library's event times are from its own root [s]: guards closer than this are one event."""
        ...
