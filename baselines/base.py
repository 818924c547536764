"""What the adapters share: a solver that integrates one smooth mode after another with a library.

A new library is a subclass of :class:`Adapter` with its names and a :class:`Flow`; one that calls Python back for
right-hand sides and guards takes :class:`CallbackFlow`, which leaves one method to fill in, ``solve``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib import metadata
from math import isfinite
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from baselines.callbacks import LastSeen
from baselines.driver import prepared, tolerances
from baselines.flow import Flow, Library, Stop
from baselines.mode_functions import ModeFunctions
from baselines.restart import STOPPED, Fresh, GatedGuards, Restart
from baselines.work import Work
from henon_ref.errors import UnavailableError
from henon_ref.filippov.problem import Problem
from henon_ref.solver import Run

SCOUTING = 1e-6
"""Tolerance of the run that finds out which modes a problem visits: loose enough to cost nothing beside compiling."""


@dataclass(frozen=True)
class Adapter(ABC):
    """A library as a :class:`henon_ref.solver.Solver`."""

    name: str
    restart: Restart = field(default="event-free-step", kw_only=True)
    fixed_step: ClassVar[bool] = False
    landing: ClassVar[str]
    distribution: ClassVar[str]
    """The package that has to be installed, as messages name it."""
    least_rtol: ClassVar[float] = 0.0
    """A smaller ``rtol`` is raised to this."""
    warm_up: ClassVar[bool] = False
    """Whether preparing runs once, since compiling a mode costs more than a run."""

    @property
    def version(self) -> str:
        """The library's version, empty where it is not installed."""
        try:
            return metadata.version(self.distribution)
        except metadata.PackageNotFoundError:
            return ""

    def prepare(
        self,
        problem: Problem,
        *,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        sample_times: NDArray[np.float64] | None = None,
        deadline: float | None = None,
    ) -> Run:
        """Make every mode ready (lambdify, compile); see :meth:`henon_ref.solver.Solver.prepare`."""
        library = self.library(*tolerances(self.name, rtol, atol, step))
        return prepared(problem, library, sample_times=sample_times, deadline=deadline, warm_up=self.warm_up)

    def library(self, rtol: float, atol: float) -> ConfiguredLibrary:
        """The library at these tolerances, for the driver.

        Raises
        ------
        UnavailableError
            Where it is not installed.
        """
        try:
            module = self.load()
        except ImportError as error:
            raise UnavailableError(f"{self.distribution} is not installed") from error
        return ConfiguredLibrary(self, module, max(rtol, self.least_rtol), atol)

    @abstractmethod
    def load(self) -> Any:
        """Import what the flows call (a module, a class, a function)."""

    @abstractmethod
    def flow(self, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float) -> Flow:
        """All that is done once a mode; see :meth:`baselines.flow.Library.flow`."""

    @abstractmethod
    def location_error(self, t: float) -> float:
        """See :meth:`baselines.flow.Library.location_error`."""

    def accuracy(self, rtol: float, atol: float) -> tuple[float, float]:
        """Relative and absolute error that the tolerances allow a step."""
        return rtol, atol

    def start_errors(self, rtol: float, atol: float) -> tuple[float, float]:
        """Relative and absolute error just after a start: here an implicit step's, whose iteration is stopped."""
        return STOPPED * rtol, STOPPED * atol

    def loosened(self, library: ConfiguredLibrary) -> Library:
        """The library at tolerances for finding out which modes are visited."""
        return replace(library, rtol=max(library.rtol, SCOUTING), atol=max(library.atol, SCOUTING))


@dataclass(frozen=True)
class ConfiguredLibrary:
    """A library with its tolerances, as the driver sees it (:class:`baselines.flow.Library`)."""

    adapter: Adapter
    module: Any
    """What its ``load`` imported."""
    rtol: float
    atol: float

    @property
    def landing(self) -> str:
        return self.adapter.landing

    @property
    def accuracy(self) -> tuple[float, float]:
        return self.adapter.accuracy(self.rtol, self.atol)

    @property
    def errors(self) -> tuple[float, float]:
        return self.adapter.start_errors(self.rtol, self.atol)

    def loosened(self) -> Library:
        return self.adapter.loosened(self)

    def location_error(self, t: float) -> float:
        return self.adapter.location_error(t)

    def flow(self, model: ModeFunctions, work: Work, horizon: float) -> Flow:
        return self.adapter.flow(self, model, work, horizon)


class CallbackFlow(ABC):
    """One mode on a library that calls Python back for right-hand sides and guards.

    Parameters
    ----------
    library : ConfiguredLibrary
    model : ModeFunctions
    work : Work
    horizon : float
        Length of the whole run [s].
    """

    def __init__(self, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float) -> None:
        self.library, self.model, self.work, self.horizon = library, model, work, horizon
        self.states = len(model.states)
        self.gates = GatedGuards(model, library.adapter.restart, library.errors)
        """The guards under the restart; the library's event functions are made of their ``watchers``."""
        self.last = LastSeen(self.states, work.count_event)
        """The event function behind the guards: its root is divergence."""

    def advance(
        self,
        t: float,
        low: float,
        x: Sequence[float],
        until: float,
        fresh: Sequence[Fresh],
        wanted: NDArray[np.float64] | None,
    ) -> Stop:
        """See :class:`baselines.flow.Flow`."""
        self.gates.open(t, x, fresh, self.horizon)
        self.last.start(t, tuple(x))
        with np.errstate(all="ignore"):
            return self.solve(t, x, until, wanted)

    @abstractmethod
    def solve(self, t: float, x: Sequence[float], until: float, wanted: NDArray[np.float64] | None) -> Stop:
        """Call the library from (t, x), count its steps, and say by :meth:`stopped` or :meth:`failed` what it found."""

    def stopped(
        self,
        t: float,
        x: tuple[float, ...],
        events: Sequence[int] | None,
        samples: NDArray[np.float64] | None = None,
    ) -> Stop:
        """Where the library stopped.

        Parameters
        ----------
        t, x
            Time [s] and state.
        events : sequence of int, optional
            Event functions that have a root at t, divergence behind the guards; None at the horizon.
        samples : ndarray, optional
            States at the wanted times up to t, shape (k, n).
        """
        if not all(map(isfinite, x)):
            return self.failed(f"the state is not finite after t = {self.last.t:.17g}")
        if events is None:
            return Stop("horizon", t, 0.0, x, samples=samples)
        hits = tuple(k for k in events if k < len(self.model.guards))
        return Stop("event" if hits else "diverged", t, 0.0, x, hits, samples=samples)

    def failed(self, reason: str) -> Stop:
        """The library gave up, or raised: where it was is what its last step saw."""
        return Stop("failed", self.last.t, 0.0, self.last.x, reason=reason)
