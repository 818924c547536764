"""Base class of a library's integration of one smooth mode; a subclass implements one method.

The driver handles modes, sliding and events. heyoka's mode does not call Python and is not a subclass.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.library import LIMIT, Library, Stalled, Stop, Work
from henon_ref.baselines.mode_functions import EPSILON, Callbacks, ModeFunctions
from henon_ref.baselines.restart import Fresh, GatedGuards, Watcher
from henon_ref.errors import ContractError
from henon_ref.modes.callables import ARITHMETIC, Jacobian

STALL = 2000
"""Largest number of successive evaluations within four roundings of the same time; more mean that steps stall."""


class SmoothMode(ABC):
    """One smooth mode on a library; a subclass implements :meth:`integrate`.

    An object is made once for every mode that a problem visits, and is used again in every run. Work that is done
    once per mode (compiling, building the library's integrator) belongs in an ``__init__`` that first calls this
    class's ``__init__``.

    In all methods t is a time [s], a float, and x the unknowns at that time, an array of shape (N,): the n states in
    the order of ``model.states``, followed by a copy of each guard that is not linear in time and states, so that
    error control includes the guard. N = n if all guards are linear.

    Parameters
    ----------
    library : Library
    model : ModeFunctions
        The equations.
    work : Work
        Counters. A subclass adds its accepted steps to ``work.steps``; the methods of this class count evaluations.
    horizon : float
        Length of the whole run [s].
    """

    wanted: NDArray[np.float64] | None = None
    """Increasing sample times [s] after the start, for figures only; None if no samples are requested."""

    def __init__(self, library: Library, model: ModeFunctions, work: Work, horizon: float) -> None:
        self.library, self.model, self.work, self.horizon = library, model, work, horizon
        self.states = len(model.states)
        """Number n of states."""
        self.gates = GatedGuards(model, library.solver.restart, library.errors)
        """Guards under the restart policy; their ``watchers`` are the library's event functions."""
        self.last = LastSeen(self.states, work.count_event)
        """Event function that falls through zero if the state diverges; it follows the guards."""

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
            One of three: ``self.stopped(t, x, fallen)`` at the first time at which components of :meth:`guards` fall
            from positive to zero or below, with their indices ``fallen``; ``self.stopped(until, x)`` at the horizon;
            ``self.failed(reason)`` if the library gives up.

        Raises
        ------
        DeadlinePassed
            From :meth:`rhs` and :meth:`guards` once the run has used its time. Do not catch it: the driver ends the
            run as ``timeout``. After any other exception the run is ``failed`` and all its transitions are lost.
        """

    @property
    def rtol(self) -> float:
        return self.library.rtol

    @property
    def atol(self) -> float:
        """Absolute tolerance [unit of each state]."""
        return self.library.atol

    def rhs(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Time derivatives of the unknowns, shape (N,) [unit of each / s]; all NaN if one has no value."""
        return np.array(self._field(t, x))

    def guards(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Evaluate the guards, shape (m + 1,). They are positive inside the mode; it ends when one falls through zero.

        The first m are those of ``model.guards``, in units of their surfaces. A guard that starts at zero, because
        its surface has just been left, has the value 1 until it differs from zero by more than rounding
        (``event-free-step``). The last component is 1e100 minus the sum of abs(x); if it falls, the state has
        diverged. A guard without a value is NaN.

        Raises
        ------
        Stalled
            If the time has not moved for 2000 calls; the driver ends the run as ``failed`` or ``diverged``.
        """
        return np.array([watcher(t, x) for watcher in self._watchers] + [self.last.value(t, x)])

    def jacobian(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Jacobian of :meth:`rhs`, shape (N, N) [unit of row / (s unit of column)]."""
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
        """Set the guards and call :meth:`integrate`; the driver calls this (:data:`.library.Advance`)."""
        self.gates.open(t, x, fresh, self.horizon)
        self.last.start(t, tuple(x))
        self.wanted = wanted
        with np.errstate(all="ignore"):
            try:
                stop = self.integrate(t, self.model.start(t, x), until)
            except Stalled as error:
                return self.failed(str(error))
        if not isinstance(stop, Stop):
            raise ContractError(f"integrate must return the result of self.stopped or self.failed, not {stop!r}")
        return stop

    def stopped(
        self,
        t: float,
        x: Sequence[float] | NDArray[np.float64],
        fallen: Sequence[int] | NDArray[np.intp] | None = None,
        samples: NDArray[np.float64] | None = None,
    ) -> Stop:
        """Return the stop of the library at an event or the horizon.

        Parameters
        ----------
        t, x
            Time [s], and the unknowns at that time (the states are enough).
        fallen : sequence of int, optional
            Components of :meth:`guards` that have a root at t; None at the horizon.
        samples : ndarray, optional
            States at the sample times up to t, shape (k, n).

        Raises
        ------
        ContractError
            If ``fallen`` contains a value that is not an index; the run is then ``failed``.
        """
        state = tuple(map(float, x[: self.states]))
        if not all(map(math.isfinite, state)):
            return self.failed(f"the state is not finite after t = {self.last.t:.17g}")
        if fallen is None:
            return Stop("horizon", t, 0.0, state, samples=samples)
        last = len(self.model.guards)
        for k in fallen:
            if isinstance(k, (bool, np.bool_)) or not 0 <= k <= last:
                raise ContractError(f"'fallen' must contain indices of guards, 0 to {last}, not {k!r}")
        hits = tuple(int(k) for k in fallen if k < last)
        return Stop("event" if hits else "diverged", t, 0.0, state, hits, samples=samples)

    def failed(self, reason: str) -> Stop:
        """Return the stop of a library that gave up or raised; time and state are those of the last event function."""
        return Stop("failed", self.last.t, 0.0, self.last.x, reason=reason)


class LastSeen:
    """Event function ``1e100 - sum of abs(x)``, whose root is divergence. It stores the latest evaluated point.

    Libraries evaluate it at every accepted step. Hence the stored point is the end of a run that fails, and stalled
    steps are detected: at a pole some libraries continue for ever without moving the time. The state is the first
    ``states`` entries of the arrays; ``count`` is called at every evaluation.
    """

    def __init__(self, states: int, count: Callable[[], None]) -> None:
        self._states, self._count = states, count
        self._mark, self._still = -math.inf, 0
        self.t = -math.inf
        self.x: tuple[float, ...] = ()

    def start(self, t: float, x: tuple[float, ...]) -> None:
        """Begin a run of a mode at (t, x)."""
        self.t, self.x = t, x
        self._mark, self._still = t, 0

    def value(self, t: float, x: NDArray[np.float64]) -> float:
        """Evaluate 1e100 - sum of abs(x).

        Raises
        ------
        Stalled
            If the time has not moved for :data:`STALL` evaluations.
        """
        self._count()
        values = x[: self._states].tolist()
        if t > self._mark + 4.0 * EPSILON * abs(t):
            self._mark, self._still = t, 0
        else:
            self._still += 1
            if self._still > STALL:
                raise Stalled(f"the steps no longer move the time t = {t:.17g}")
        size = sum(map(abs, values))
        if t > self.t and size < math.inf:  # false if a value is NaN
            self.t, self.x = float(t), tuple(values)
        return LIMIT - size


def counted_field(
    model: ModeFunctions, callbacks: Callbacks, work: Work
) -> Callable[[float, NDArray[np.float64]], Any]:
    """Return the function of the time derivatives of a mode's unknowns; NaN if the field has no value.

    Every call is counted and raises after the deadline. The counting is done in Python even if the field is compiled.
    """
    n, count = len(model.unknowns), work.count_rhs
    if callbacks == "numba":
        fill, _ = model.compiled_derivatives()
        fill(0.0, np.ones(n), np.empty(n))  # compiles now, not in the run

        def jitted(t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
            count()
            out = np.empty(n)
            fill(t, x, out)
            return out

        return jitted
    field, nowhere = model.derivatives, (math.nan,) * n

    def interpreted(t: float, x: NDArray[np.float64]) -> tuple[float, ...]:
        count()
        try:
            return field(t, *x.tolist())
        except ARITHMETIC:
            return nowhere

    return interpreted
