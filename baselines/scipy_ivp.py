"""SciPy's ``solve_ivp`` with terminal events: RK45, DOP853, Radau, BDF, LSODA.

SciPy uses the sign of each event function at the starting point. A zero there (or a value one rounding on the wrong
side) is reported as a root at once, unless a direction excludes it. With direction -1, a function that starts at +0
has a root at once if the first step ends below zero; a function that starts one rounding below zero loses a true root
in the first step. The default restart ``offset`` starts the guard clearly positive. Roots are located by ``brentq`` on
the dense output to ``4 eps (1 + abs(t))`` [s]; for Radau (a cubic) it is less accurate than the steps. Two roots of one
function inside one step are not detected. What SciPy's documentation advises: ``docs/solvers.md``.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.adapter import SCOUTING, Adapter
from henon_ref.baselines.library import Library, Stop, Work
from henon_ref.baselines.mode_functions import EPSILON, Callbacks, ModeFunctions
from henon_ref.baselines.restart import Restart
from henon_ref.baselines.smooth_mode import SmoothMode


class _Mode(SmoothMode):
    """``solve_ivp`` on one mode."""

    def __init__(self, library: Library, model: ModeFunctions, work: Work, horizon: float) -> None:
        super().__init__(library, model, work, horizon)
        own: ScipyIvp = library.solver
        self._rhs, self._root_tolerance = self.counted_field(own.callbacks), own.root_tolerance
        self._options: dict[str, Any] = {"method": own.method, "rtol": library.rtol, "atol": library.atol}
        if own.implicit:
            self._options["jac"] = model.jacobian(own.callbacks)
        self._events: list[Any] = [*self.watchers, lambda t, x: self.divergence(t, x)]
        for event in self._events:  # SciPy reads both attributes
            event.terminal, event.direction = True, self.root_direction
        self._events[-1].direction = -1

    def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
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
        """Locate an event again on the dense output of its step; keep SciPy's time if no sign changes on the step."""
        from scipy.optimize import brentq

        def value(t: float) -> float:
            return self._events[event](t, step(t))

        if value(step.t_old) * value(step.t) < 0.0:
            end = brentq(value, step.t_old, step.t, xtol=tolerance, rtol=4.0 * EPSILON)
        return end, tuple(step(end)[: self.states].tolist())


@dataclass(frozen=True)
class ScipyIvp(Adapter):
    """SciPy's ``solve_ivp``, called for one smooth mode after another.

    Tolerances are passed to SciPy unchanged (``rtol`` at least 100 eps, SciPy's own limit). The implicit methods get
    a Jacobian derived by SymPy.

    Counts: ``steps`` are accepted steps (those cut by an event included); ``rhs_evaluations`` all calls of the
    right-hand side; ``event_evaluations`` all calls of event functions, one per guard, with the guard against
    divergence. Jacobians are not counted.
    """

    method: Literal["RK45", "DOP853", "Radau", "BDF", "LSODA"]
    restart: Restart = field(default="offset", kw_only=True)
    callbacks: Callbacks = "python"
    """Right-hand side and Jacobian in plain Python or compiled; the event functions are always plain Python."""
    root_tolerance: float | None = None
    """Absolute tolerance of an event time [s], or None for SciPy's own, 4 eps. ``solve_ivp`` has no option for it, so
    that the root is located a second time on the dense output of the last step."""
    mode = _Mode
    landing = "brentq"
    distribution = "SciPy"
    module = "scipy.integrate"
    samples = True
    least_rtol = 100.0 * EPSILON  # SciPy raises a smaller rtol to this value, with a warning

    @property
    def implicit(self) -> bool:  # type: ignore[override]
        return self.method in ("Radau", "BDF", "LSODA")


RK45 = ScipyIvp("scipy-rk45", "RK45")
DOP853 = ScipyIvp("scipy-dop853", "DOP853")
RADAU = ScipyIvp("scipy-radau", "Radau")
BDF = ScipyIvp("scipy-bdf", "BDF")
LSODA = ScipyIvp("scipy-lsoda", "LSODA")


def scouting(_adapter: Adapter, rtol: float, atol: float) -> Library:
    """``loosened`` of a library that compiles its modes: ``DOP853`` finds the visited modes without compiling."""
    return DOP853.library(SCOUTING, SCOUTING)
