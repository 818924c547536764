"""One smooth mode on a library, as the adapters have it: a subclass fills in one method.

Modes, sliding, what follows an event, and the match against the truth are the driver's; heyoka's mode, which calls no
Python back, is a :class:`henon_ref.baselines.library.Flow` of its own.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.library import LIMIT, Library, Stop
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.numba_callbacks import Callbacks
from henon_ref.baselines.restart import Fresh, GatedGuards, Watcher
from henon_ref.baselines.work import Stalled, Work
from henon_ref.errors import ContractError
from henon_ref.modes.callables import ARITHMETIC, Jacobian

STALL = 2000
"""Evaluations in a row, at accepted steps and while a root is sought, within four roundings of one time."""


class SmoothMode(ABC):
    """One smooth mode on a library: a subclass fills in :meth:`integrate`.

    An object is made once for every mode that a problem visits, and used again in every run. What is done once a
    mode (compiling, building the library's own integrator) goes into an ``__init__`` that hands its arguments on.

    In all methods t is a time [s], a float, and x the unknowns at that time, an array of shape (N,): the n states in
    the order of ``model.states``, and behind them a copy of each guard that is not linear in the states, so that error
    control sees it, too (N = n where all are linear).

    Parameters
    ----------
    library : Library
    model : ModeFunctions
        The equations.
    work : Work
        Counters: an integrator adds to ``work.steps``, what it is handed here counts itself.
    horizon : float
        Length of the whole run [s].
    """

    wanted: NDArray[np.float64] | None = None
    """Increasing times [s] after the start at which the state is wanted, for figures only; None where it is not."""

    def __init__(self, library: Library, model: ModeFunctions, work: Work, horizon: float) -> None:
        self.library, self.model, self.work, self.horizon = library, model, work, horizon
        self.states = len(model.states)
        """n."""
        self.gates = GatedGuards(model, library.restart, library.errors)
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
        """What the driver calls (:class:`.library.Flow`): sets the guards, then :meth:`integrate`."""
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
        if not all(map(math.isfinite, state)):
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


class LastSeen:
    """The function ``1e100 - sum of abs(x)``, whose root is divergence; remembers the latest point it was asked at.

    Libraries evaluate it at every accepted step, so what it remembers is where a run was when it failed, and it
    notices where steps no longer move the time: some libraries go on then, at a pole for ever. The state is the first
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
        """1e100 - sum of abs(x).

        Raises
        ------
        Stalled
            Where the time has not moved for :data:`STALL` evaluations.
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
        if t > self.t and size < math.inf:  # not so where a value is NaN
            self.t, self.x = float(t), tuple(values)
        return LIMIT - size


def counted_field(
    model: ModeFunctions, callbacks: Callbacks, work: Work
) -> Callable[[float, NDArray[np.float64]], Any]:
    """Time derivatives of a mode's unknowns on an array; NaN where the field has no value.

    Every call counts, and past the deadline raises; that stays in Python where the field itself is compiled.
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
