"""SciPy's ``solve_ivp`` with terminal events: RK45, DOP853, Radau, BDF, LSODA.

At its starting point SciPy takes the sign of each event function as it is. A zero there (or one rounding on
the wrong side of it) is a root at once unless a direction excludes it; with direction -1 it is a root at
once if it starts at +0 and the first step ends below, and a true root in the first step is lost if it starts
one rounding below. Hence the event-free step as default (:mod:`baselines.restart`); ``offset``,
``direction`` and ``none`` can be chosen to see what they do.

Two roots of one event function inside one step are not seen. Roots are located by ``brentq`` on the dense
output to ``4 eps (1 + abs(t))``, an absolute time; the state after an event is the dense output's, which
for Radau (a cubic) is less accurate than its steps.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import metadata
from math import isfinite
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from baselines.callbacks import LastSeen, counted_field
from baselines.driver import prepared, tolerances
from baselines.flow import Library, Stop
from baselines.functions import Callbacks
from baselines.mode_functions import EPSILON, ModeFunctions
from baselines.restart import STOPPED, Fresh, GatedGuards, Restart
from baselines.work import Stalled, Work
from henon_ref.errors import UnavailableError
from henon_ref.filippov.problem import Problem
from henon_ref.solver import Run

Method = Literal["RK45", "DOP853", "Radau", "BDF", "LSODA"]

IMPLICIT = ("Radau", "BDF", "LSODA")
LEAST_RTOL = 100.0 * EPSILON
"""SciPy raises a smaller ``rtol`` to this, with a warning."""


@dataclass(frozen=True)
class ScipyIvp:
    """``solve_ivp`` on one smooth mode after another.

    Tolerances go to SciPy as they are (``rtol`` no smaller than 100 eps, SciPy's own limit). The implicit
    methods get the Jacobian that SymPy derives.

    Counts: ``steps`` are accepted steps (those cut off by an event too); ``rhs_evaluations`` all calls of
    the right-hand side; ``event_evaluations`` all calls of event functions, one guard each, the guard
    against divergence among them. Jacobians are not counted.
    """

    name: str
    method: Method
    callbacks: Callbacks = "python"
    """Right-hand side and Jacobian in plain Python or compiled; the event functions are plain Python."""
    restart: Restart = "event-free-step"
    fixed_step: bool = False
    landing: str = "brentq"

    @property
    def version(self) -> str:
        """SciPy's version."""
        try:
            return metadata.version("scipy")
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
        """Lambdify (or compile) every mode; see :meth:`henon_ref.solver.Solver.prepare`."""
        library = self.library(*tolerances(self.name, rtol, atol, step))
        return prepared(problem, library, sample_times=sample_times, deadline=deadline)

    def library(self, rtol: float, atol: float) -> Library:
        """``solve_ivp`` at these tolerances, for the driver."""
        try:
            from scipy.integrate import solve_ivp
        except ImportError as error:
            raise UnavailableError("SciPy is not installed") from error
        return _Library(self, solve_ivp, max(rtol, LEAST_RTOL), atol)


@dataclass(frozen=True)
class _Library:
    """``solve_ivp`` with its tolerances."""

    solver: ScipyIvp
    solve: Callable[..., Any]
    rtol: float
    atol: float

    @property
    def landing(self) -> str:
        return self.solver.landing

    @property
    def accuracy(self) -> tuple[float, float]:
        return self.rtol, self.atol

    @property
    def errors(self) -> tuple[float, float]:
        # An explicit method's first step is as exact as it is short; an implicit one's iteration is stopped.
        return (STOPPED * self.rtol, STOPPED * self.atol) if self.solver.method in IMPLICIT else (EPSILON, 0.0)

    def loosened(self) -> _Library:
        return replace(self, rtol=max(self.rtol, 1e-6), atol=max(self.atol, 1e-6))

    def location_error(self, t: float) -> float:
        return 4.0 * EPSILON * (1.0 + abs(t))

    def flow(self, model: ModeFunctions, work: Work, horizon: float) -> _Flow:
        return _Flow(self, model, work, horizon)


class _Flow:
    """``solve_ivp`` on one mode."""

    def __init__(self, library: _Library, model: ModeFunctions, work: Work, horizon: float) -> None:
        solver = library.solver
        implicit = solver.method in IMPLICIT
        self._library, self._model, self._work, self._horizon = library, model, work, horizon
        self._rhs = counted_field(model, solver.callbacks, work)
        self._gates = GatedGuards(model, solver.restart, library.errors)
        self._last = LastSeen(len(model.states), work.count_event)
        self._options = {"jac": model.jacobian(solver.callbacks)} if implicit else {}
        direction = self._gates.direction
        guards = self._gates.watchers(work.count_event)
        self._events = [*(_event(g, direction) for g in guards), _event(self._last.value, -1)]

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
        library, last, n = self._library, self._last, len(self._model.states)
        self._gates.open(t, x, fresh, self._horizon)
        last.start(t, tuple(x))
        with warnings.catch_warnings(record=True) as said, np.errstate(all="ignore"):
            warnings.simplefilter("always")
            try:
                result = library.solve(
                    self._rhs,
                    (t, until),
                    self._model.start(t, x),
                    method=library.solver.method,
                    rtol=library.rtol,
                    atol=library.atol,
                    events=self._events,
                    dense_output=wanted is not None,
                    **self._options,
                )
            except (ValueError, np.linalg.LinAlgError, Stalled) as error:
                # SciPy's linear algebra refuses NaN and infinity; where it was is what the last step saw.
                return Stop("failed", last.t, 0.0, last.x, reason=str(error))
        self._work.steps += result.t.size - 1
        end, state = float(result.t[-1]), tuple(result.y[:n, -1].tolist())
        samples = None
        if wanted is not None:
            times = wanted[wanted <= end]
            samples = np.ascontiguousarray(result.sol(times)[:n].T) if times.size else np.empty((0, n))
        if result.status < 0:
            words = " ".join([result.message, *(str(w.message) for w in said)])
            return Stop("failed", end, 0.0, state, reason=words, samples=samples)
        if not all(map(isfinite, state)):
            return Stop("failed", last.t, 0.0, last.x, reason=f"the state is not finite after t = {last.t:.17g}")
        if result.status == 0:
            return Stop("horizon", end, 0.0, state, samples=samples)
        hits = tuple(k for k, times in enumerate(result.t_events[:-1]) if times.size)
        return Stop("event" if hits else "diverged", end, 0.0, state, hits, samples=samples)


def _event(
    function: Callable[[float, NDArray[np.float64]], float], direction: int
) -> Callable[[float, NDArray[np.float64]], float]:
    """A terminal event: SciPy reads both attributes off the function."""

    def event(t: float, x: NDArray[np.float64]) -> float:
        return function(t, x)

    event.terminal = True  # type: ignore[attr-defined]
    event.direction = direction  # type: ignore[attr-defined]
    return event


RK45 = ScipyIvp("scipy-rk45", "RK45")
DOP853 = ScipyIvp("scipy-dop853", "DOP853")
RADAU = ScipyIvp("scipy-radau", "Radau")
BDF = ScipyIvp("scipy-bdf", "BDF")
LSODA = ScipyIvp("scipy-lsoda", "LSODA")
RK45_NUMBA = ScipyIvp("scipy-rk45+numba", "RK45", callbacks="numba")
DOP853_NUMBA = ScipyIvp("scipy-dop853+numba", "DOP853", callbacks="numba")
RADAU_NUMBA = ScipyIvp("scipy-radau+numba", "Radau", callbacks="numba")
BDF_NUMBA = ScipyIvp("scipy-bdf+numba", "BDF", callbacks="numba")
LSODA_NUMBA = ScipyIvp("scipy-lsoda+numba", "LSODA", callbacks="numba")
