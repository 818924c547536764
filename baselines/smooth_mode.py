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

from henon_ref.baselines.library import LIMIT, Library, Stalled, Stop, Times, Work
from henon_ref.baselines.mode_functions import EPSILON, Callbacks, ModeFunctions
from henon_ref.baselines.restart import LONGEST, SPAN, Fresh, lift, quiet_until
from henon_ref.errors import ContractError
from henon_ref.modes.callables import ARITHMETIC, Jacobian

Watcher = Callable[[float, NDArray[np.float64]], float]
"""A guard as an event function ``g(t, x)`` of a library."""


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
        self.root_direction = 0 if library.solver.restart == "none" else -1
        """Direction of the roots that count: -1 (falling) or 0 (either)."""
        self.quiet = [-math.inf] * len(model.guards)
        """Time up to which the event function of each guard is 1 (-1 for a guard that must rise before it counts)."""
        self.lifts = [0.0] * len(model.guards)
        self.last: tuple[float, tuple[float, ...]] = (-math.inf, ())
        """Time and state at the latest call of :meth:`divergence`: the end of a run that fails."""
        self._mark, self._still = -math.inf, 0

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
        return np.array([watcher(t, x) for watcher in self.watchers] + [self.divergence(t, x)])

    def jacobian(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Jacobian of :meth:`rhs`, shape (N, N) [unit of row / (s unit of column)]."""
        return self._jacobian(t, x)

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
            If t is not finite, an array has another shape, or ``fallen`` is empty or contains a value that is not an
            index; the run is then ``failed``.
        """
        if not math.isfinite(t):
            raise ContractError(f"'t' must be a time, not {t!r}")
        n, unknowns = self.states, len(self.model.unknowns)
        if np.shape(x) not in ((n,), (unknowns,)):
            raise ContractError(f"'x' must have the {n} states or all {unknowns} unknowns, not the shape {np.shape(x)}")
        if samples is not None and (samples.ndim != 2 or samples.shape[1] != n):
            raise ContractError(f"'samples' must have the shape (k, {n}), not {samples.shape}")
        state = tuple(map(float, x[: self.states]))
        if not all(map(math.isfinite, state)):
            return self.failed(f"the state is not finite after t = {self.last[0]:.17g}")
        if fallen is None:
            return Stop("horizon", t, 0.0, state, samples=samples)
        last = len(self.model.guards)
        if not len(fallen):
            raise ContractError(f"'fallen' must contain indices of guards, 0 to {last}; leave it out at the horizon")
        for k in fallen:
            if isinstance(k, (bool, np.bool_)) or not 0 <= k <= last:
                raise ContractError(f"'fallen' must contain indices of guards, 0 to {last}, not {k!r}")
        hits = tuple(int(k) for k in fallen if k < last)
        return Stop("event" if hits else "diverged", t, 0.0, state, hits, samples=samples)

    def failed(self, reason: str) -> Stop:
        """Return the stop of a library that gave up or raised; time and state are those of the last event function."""
        return Stop("failed", self.last[0], 0.0, self.last[1], reason=reason)

    def advance(
        self, t: float, low: float, x: Sequence[float], until: float, fresh: Sequence[Fresh], wanted: Times
    ) -> Stop:
        """Set the guards and call :meth:`integrate`; the driver calls this (:data:`.library.Advance`)."""
        self._restart(t, x, fresh)
        self.last, self.wanted = (t, tuple(x)), wanted
        self._mark, self._still = t, 0
        with np.errstate(all="ignore"):
            try:
                stop = self.integrate(t, self.model.start(t, x), until)
            except Stalled as error:
                return self.failed(str(error))
        if not isinstance(stop, Stop):
            raise ContractError(f"integrate must return the result of self.stopped or self.failed, not {stop!r}")
        return stop

    @cached_property
    def _field(self) -> Callable[[float, NDArray[np.float64]], Any]:
        return self.counted_field("python")

    @cached_property
    def _jacobian(self) -> Jacobian:
        return self.model.jacobian("python")

    def counted_field(self, callbacks: Callbacks) -> Callable[[float, NDArray[np.float64]], Any]:
        """Return the function of the time derivatives of the unknowns; NaN if the field has no value.

        Every call is counted and raises after the deadline. The counting is done in Python even if the field is
        compiled.
        """
        n, count = len(self.model.unknowns), self.work.count_rhs
        if callbacks == "numba":
            fill, _ = self.model.compiled_derivatives()
            fill(0.0, np.ones(n), np.empty(n))  # compiles now, not in the run

            def jitted(t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
                count()
                out = np.empty(n)
                fill(t, x, out)
                return out

            return jitted
        field, nowhere = self.model.derivatives, (math.nan,) * n

        def interpreted(t: float, x: NDArray[np.float64]) -> tuple[float, ...]:
            count()
            try:
                return field(t, *x.tolist())
            except ARITHMETIC:
                return nowhere

        return interpreted

    @cached_property
    def watchers(self) -> list[Watcher]:
        """Event functions of the guards under the restart policy."""
        return [self.watcher(k) for k in range(len(self.quiet))]

    def watcher(self, k: int, value: Watcher | None = None) -> Watcher:
        """Return the event function of guard ``k``, which counts its evaluations.

        ``value`` replaces the mode's own ``g(t, x)`` by another function with the same roots.
        """
        quiet, lifts, count = self.quiet, self.lifts, self.work.count_event
        guard, n = self.model.guard[k], self.states
        resting = -1.0 if self.model.guards[k].rising_only else 1.0
        plain = value or (lambda t, x: guard(t, *x[:n].tolist())[0])

        def watched(t: float, x: NDArray[np.float64]) -> float:
            count()
            if t <= quiet[k]:
                return resting
            try:
                return plain(t, x) + lifts[k]
            except ARITHMETIC:
                return np.nan

        return watched

    def divergence(self, t: float, x: NDArray[np.float64]) -> float:
        """Event function 1e100 - sum of abs(x), whose root is divergence; it follows the guards.

        Libraries evaluate it at every accepted step. Hence stalled steps are detected here: at a pole some libraries
        continue for ever without moving the time.

        Raises
        ------
        Stalled
            If the time has not moved by more than four roundings for 2000 evaluations.
        """
        self.work.count_event()
        values = x[: self.states].tolist()
        if t > self._mark + 4.0 * EPSILON * abs(t):
            self._mark, self._still = t, 0
        else:
            self._still += 1
            if self._still > 2000:
                raise Stalled(f"the steps no longer move the time t = {t:.17g}")
        size = sum(map(abs, values))
        if t > self.last[0] and size < math.inf:  # false if a value is NaN
            self.last = float(t), tuple(values)
        return LIMIT - size

    def _restart(self, t: float, x: Sequence[float], fresh: Sequence[Fresh]) -> None:
        """Set quiet intervals and lifts for a start of the mode at (t, x)."""
        model, solver, horizon = self.model, self.library.solver, self.horizon
        self.quiet[:] = [-math.inf] * len(self.quiet)
        self.lifts[:] = [0.0] * len(self.lifts)
        if fresh and solver.restart == "offset":
            for item in fresh:
                self.lifts[item[0]] = lift(model, item, t, x, horizon)
        elif fresh and solver.restart == "event-free-step":
            levels = [
                model.size(guard, t, x, *self.library.errors) + EPSILON * speed * SPAN * horizon
                for guard, speed, _ in fresh
            ]
            ends = quiet_until(model, fresh, t, x, levels, LONGEST * horizon)
            for (guard, *_), end in zip(fresh, ends, strict=True):
                self.quiet[guard] = end
