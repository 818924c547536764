"""What the adapters share: a solver that integrates one smooth mode after another with a library.

A new library is a subclass of :class:`SmoothMode` with one method, ``integrate``, and a :class:`ModeSolver` that
names it. Modes, sliding, what follows an event, and the match against the truth are the driver's. The adapters here are
made of the same class, and of an :class:`~henon_ref.baselines.adapter.Adapter` where a library has more to say of
itself; heyoka's compiles its modes and is a :class:`henon_ref.baselines.flow.Flow` of its own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.adapter import Adapter, ConfiguredLibrary
from henon_ref.baselines.callbacks import LastSeen, counted_field
from henon_ref.baselines.flow import Stop
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import Fresh, GatedGuards, Watcher
from henon_ref.baselines.work import Stalled, Work
from henon_ref.errors import ContractError
from henon_ref.modes.callables import Jacobian


class SmoothMode(ABC):
    """One smooth mode on a library: a subclass fills in :meth:`integrate`.

    An object is made once for every mode that a problem visits, and used again in every run. What is done once a
    mode (compiling, building the library's own integrator) goes into an ``__init__`` that hands its arguments on.

    In all methods t is a time [s], a float, and x the unknowns at that time, an array of shape (N,): the n states in
    the order of ``model.states``, and behind them a copy of each guard that is not linear in the states, so that error
    control sees it, too (N = n where all are linear).

    Parameters
    ----------
    library : ConfiguredLibrary
    model : ModeFunctions
        The equations.
    work : Work
        Counters: an integrator adds to ``work.steps``, what it is handed here counts itself.
    horizon : float
        Length of the whole run [s].
    """

    wanted: NDArray[np.float64] | None = None
    """Increasing times [s] after the start at which the state is wanted, for figures only; None where it is not."""

    def __init__(self, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float) -> None:
        self.library, self.model, self.work, self.horizon = library, model, work, horizon
        self.states = len(model.states)
        """n."""
        self.gates = GatedGuards(model, library.adapter.restart, library.errors)
        """The guards under the restart; the library's event functions are made of their ``watchers``."""
        self.last = LastSeen(self.states, work.count_event)
        """The event function behind the guards: its root is divergence."""

    @abstractmethod
    def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
        """Advance the mode from (t, x) until a guard falls through zero, or to the horizon.

        Parameters
        ----------
        t, x
            Start; no guard counts as fallen there.
        until : float
            Horizon, later than t [s].

        Returns
        -------
        Stop
            Of one of these: ``self.stopped(t, x, fallen)`` at the first time at which a component of :meth:`guards`
            has fallen from positive to zero or below, ``fallen`` the indices of those that have;
            ``self.stopped(until, x)`` at the horizon; ``self.failed(reason)`` where the library gives up.

        Raises
        ------
        DeadlinePassed
            Out of :meth:`rhs` and :meth:`guards` once the run has used up its time; leave it alone, the driver ends
            the run as ``timeout``. An exception of any other kind is a run ``failed``, all its transitions lost.
        """

    @property
    def rtol(self) -> float:
        """Relative tolerance."""
        return self.library.rtol

    @property
    def atol(self) -> float:
        """Absolute tolerance [unit of each state]."""
        return self.library.atol

    def rhs(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Time derivatives of the unknowns, shape (N,) [unit of each / s]; all NaN where one has no value."""
        return np.array(self._field(t, x))

    def guards(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """The guards, shape (m + 1,): positive inside the mode, which ends where one falls through zero.

        The first m are those of ``model.guards``, in units of their surfaces; one that starts at zero, since its
        surface has just been left, reads 1 until it can be told from zero. The last one is 1e100 minus the sum of
        abs(x): the state has diverged where it falls. NaN where a guard has no value.

        Raises
        ------
        Stalled
            Where the time has not moved for 2000 calls; the driver ends the run as ``failed`` or ``diverged``.
        """
        return np.array([watcher(t, x) for watcher in self._watchers] + [self.last.value(t, x)])

    def jacobian(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivative of :meth:`rhs` in the unknowns, shape (N, N) [unit of row / (s unit of column)]."""
        return self._jacobian(t, x)

    @cached_property
    def _field(self) -> Callable[[float, NDArray[np.float64]], Any]:
        return counted_field(self.model, "python", self.work)

    @cached_property
    def _jacobian(self) -> Jacobian:
        return self.model.jacobian("python")

    @cached_property
    def _watchers(self) -> list[Watcher]:
        return self.gates.watchers(self.work.count_event)

    def advance(
        self,
        t: float,
        low: float,
        x: Sequence[float],
        until: float,
        fresh: Sequence[Fresh],
        wanted: NDArray[np.float64] | None,
    ) -> Stop:
        """What the driver calls (:class:`henon_ref.baselines.flow.Flow`): sets the guards, then :meth:`integrate`."""
        self.gates.open(t, x, fresh, self.horizon)
        self.last.start(t, tuple(x))
        self.wanted = wanted
        with np.errstate(all="ignore"):
            try:
                stop = self.integrate(t, self.model.start(t, x), until)
            except Stalled as error:
                return self.failed(str(error))
        if not isinstance(stop, Stop):
            raise ContractError(f"integrate returned {stop!r}, wanted what self.stopped or self.failed returns")
        return stop

    def stopped(
        self,
        t: float,
        x: Sequence[float] | NDArray[np.float64],
        fallen: Sequence[int] | NDArray[np.intp] | None = None,
        samples: NDArray[np.float64] | None = None,
    ) -> Stop:
        """Where the library stopped.

        Parameters
        ----------
        t, x
            Time [s], and the unknowns there (the states alone will do).
        fallen : sequence of int, optional
            Components of :meth:`guards` that have a root at t; None at the horizon.
        samples : ndarray, optional
            States at the wanted times up to t, shape (k, n).

        Raises
        ------
        ContractError
            Where ``fallen`` holds anything but indices: the run is ``failed`` then.
        """
        state = tuple(map(float, x[: self.states]))
        if not all(map(isfinite, state)):
            return self.failed(f"the state is not finite after t = {self.last.t:.17g}")
        if fallen is None:
            return Stop("horizon", t, 0.0, state, samples=samples)
        last = len(self.model.guards)
        for k in fallen:
            if isinstance(k, (bool, np.bool_)) or not 0 <= k <= last:
                raise ContractError(f"a guard that fell is named by {k!r}, wanted its index, 0 to {last}")
        hits = tuple(int(k) for k in fallen if k < last)
        return Stop("event" if hits else "diverged", t, 0.0, state, hits, samples=samples)

    def failed(self, reason: str) -> Stop:
        """The library gave up, or raised: where it was is what the last call of :meth:`guards` saw."""
        return Stop("failed", self.last.t, 0.0, self.last.x, reason=reason)


@dataclass(frozen=True)
class ModeSolver(Adapter):
    """A solver made of a :class:`SmoothMode`: what an entry point of the group ``henon_ref.solvers`` names.

    Event times are taken to be located to rounding, 4 eps (1 + abs(t)).

    Examples
    --------
    >>> SOLVER = ModeSolver("my-rk", RungeKutta, landing="bisection", distribution="my-rk")  # doctest: +SKIP
    """

    mode: type[SmoothMode]
    """Its class for one mode."""
    landing: str = field(kw_only=True)  # type: ignore[misc]  # an adapter's class has one, here each object
    """How it puts a step's end on the surface, for the ``landing`` column."""
    distribution: str = field(kw_only=True)  # type: ignore[misc]
    """The package it comes from, whose version stands in the results."""
    implicit: bool = field(default=False, kw_only=True)
    """Whether its steps are solved by an iteration that the tolerances stop: it then leaves a part of them in the state
    from the first step on."""

    def load(self) -> None:
        """Nothing: what the library needs is imported with the class for its modes."""

    def start_errors(self, rtol: float, atol: float) -> tuple[float, float]:
        """An explicit method's first step is as exact as it is short."""
        return super().start_errors(rtol, atol) if self.implicit else (EPSILON, 0.0)

    def location_error(self, t: float) -> float:
        """Rounding of the time."""
        return 4.0 * EPSILON * (1.0 + abs(t))

    def flow(self, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float) -> SmoothMode:
        """One mode."""
        return self.mode(library, model, work, horizon)
