"""SciPy's ``solve_ivp`` with terminal events: RK45, DOP853, Radau, BDF, LSODA.

At its starting point SciPy takes the sign of each event function as it is. A zero there (or one rounding on
the wrong side of it) is a root at once unless a direction excludes it; with direction -1 it is a root at
once if it starts at +0 and the first step ends below, and a true root in the first step is lost if it starts
one rounding below. Hence ``offset`` as default (:mod:`henon_ref.baselines.restart`), the restart with which every
method is right most often over the suite: the guard starts clearly positive. ``event-free-step``, ``direction`` and
``none`` can be chosen to see what they do. Which of SciPy's own advice is followed: ``docs/solvers.md``.

Two roots of one event function inside one step are not seen. Roots are located by ``brentq`` on the dense
output to ``4 eps (1 + abs(t))``, an absolute time; the state after an event is the dense output's, which
for Radau (a cubic) is less accurate than its steps.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.adapter import SCOUTING, Adapter
from henon_ref.baselines.library import Library, Stop
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.numba_callbacks import Callbacks
from henon_ref.baselines.restart import Restart
from henon_ref.baselines.smooth_mode import SmoothMode, counted_field
from henon_ref.baselines.work import Work

IMPLICIT = ("Radau", "BDF", "LSODA")


class _Mode(SmoothMode):
    """``solve_ivp`` on one mode."""

    def __init__(self, library: Library, model: ModeFunctions, work: Work, horizon: float) -> None:
        super().__init__(library, model, work, horizon)
        own: ScipyIvp = library.solver
        self._rhs, self._root_tolerance = counted_field(model, own.callbacks, work), own.root_tolerance
        self._options: dict[str, Any] = {"method": own.method, "rtol": library.rtol, "atol": library.atol}
        if own.method in IMPLICIT:
            self._options["jac"] = model.jacobian(own.callbacks)
        guards = self.gates.watchers(work.count_event)
        self._events = [*(_event(g, self.gates.direction) for g in guards), _event(self.last.value, -1)]

    def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
        """See :class:`henon_ref.baselines.smooth_mode.SmoothMode`."""
        wanted = self.wanted
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            try:
                result = self.library.module.solve_ivp(
                    self._rhs,
                    (t, until),
                    x,
                    events=self._events,
                    dense_output=wanted is not None or self._root_tolerance is not None,
                    **self._options,
                )
            except (ValueError, np.linalg.LinAlgError) as error:
                # SciPy's linear algebra refuses NaN and infinity.
                return self.failed(str(error))
        self.work.steps += result.t.size - 1
        end, state = float(result.t[-1]), tuple(result.y[: self.states, -1].tolist())
        samples = None
        if wanted is not None:
            times = wanted[wanted <= end]
            samples = np.empty((0, self.states))
            if times.size:
                samples = np.ascontiguousarray(result.sol(times)[: self.states].T)
        if result.status < 0:
            words = " ".join([result.message, *(str(w.message) for w in said)])
            return Stop("failed", end, 0.0, state, reason=words, samples=samples)
        events = None if result.status == 0 else [k for k, times in enumerate(result.t_events) if times.size]
        if events and self._root_tolerance is not None:
            last = next(k for k in events if result.t_events[k][-1] == end)
            end, state = self._located(result.sol.interpolants[-1], last, end, self._root_tolerance)
        return self.stopped(end, state, events, samples)

    def _located(self, step: Any, event: int, end: float, tolerance: float) -> tuple[float, tuple[float, ...]]:
        """Time and state of an event on its step's dense output; those that SciPy has where no sign changes there."""
        from scipy.optimize import brentq

        def value(t: float) -> float:
            return self._events[event](t, step(t))

        if value(step.t_old) * value(step.t) < 0.0:
            end = brentq(value, step.t_old, step.t, xtol=tolerance, rtol=4.0 * EPSILON)
        return end, tuple(step(end)[: self.states].tolist())


def _event(
    function: Callable[[float, NDArray[np.float64]], float], direction: int
) -> Callable[[float, NDArray[np.float64]], float]:
    """A terminal event: SciPy reads both attributes off the function."""

    def event(t: float, x: NDArray[np.float64]) -> float:
        return function(t, x)

    event.terminal = True  # type: ignore[attr-defined]
    event.direction = direction  # type: ignore[attr-defined]
    return event


@dataclass(frozen=True)
class ScipyIvp(Adapter):
    """``solve_ivp`` on one smooth mode after another.

    Tolerances go to SciPy as they are (``rtol`` no smaller than 100 eps, SciPy's own limit). The implicit
    methods get the Jacobian that SymPy derives.

    Counts: ``steps`` are accepted steps (those cut off by an event too); ``rhs_evaluations`` all calls of
    the right-hand side; ``event_evaluations`` all calls of event functions, one guard each, the guard
    against divergence among them. Jacobians are not counted.
    """

    method: Literal["RK45", "DOP853", "Radau", "BDF", "LSODA"]
    restart: Restart = field(default="offset", kw_only=True)
    callbacks: Callbacks = "python"
    """Right-hand side and Jacobian in plain Python or compiled; the event functions are plain Python."""
    root_tolerance: float | None = None
    """Absolute tolerance of an event's time [s]: the root is located again with it on the last step's dense output,
    with the same relative one, 4 eps, since ``solve_ivp`` fixes both at 4 eps; None: it is left as it is."""
    mode = _Mode
    landing = "brentq"
    distribution = "SciPy"
    module = "scipy.integrate"
    samples = True
    least_rtol = 100.0 * EPSILON  # SciPy raises a smaller one to this, with a warning

    @property
    def implicit(self) -> bool:  # type: ignore[override]
        """Whether the method is."""
        return self.method in IMPLICIT


RK45 = ScipyIvp("scipy-rk45", "RK45")
DOP853 = ScipyIvp("scipy-dop853", "DOP853")
RADAU = ScipyIvp("scipy-radau", "Radau")
BDF = ScipyIvp("scipy-bdf", "BDF")
LSODA = ScipyIvp("scipy-lsoda", "LSODA")


def scouting(_adapter: Adapter, rtol: float, atol: float) -> Library:
    """``loosened`` of a library that compiles its modes: which are visited is found out by ``DOP853``, without that."""
    return DOP853.library(SCOUTING, SCOUTING)
