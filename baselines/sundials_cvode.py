"""SUNDIALS CVODE by scikit-sundae, with its own rootfinding: Adams and BDF.

At its starting point CVODE takes an event function that is exactly zero out of play until it has left zero,
so it does not fire again there; one that is a rounding off zero it takes at its sign. The first steps
(order 1, with Newton's iteration stopped at a part of the tolerance) move a guard by about the tolerance,
which after a tangential release can make a root that the solution does not have. Hence the event-free step
as default (:mod:`baselines.restart`), long enough for the guard to leave the tolerance behind.

Roots are located by the Illinois method on the Nordsieck polynomial to ``100 eps (abs(t) + abs(h))``; a
pair of roots inside one step is not seen. scikit-sundae keeps the events of earlier calls of one object, so
every run of a mode gets a new object; its ``max_num_steps`` counts between outputs and does not bound a run:
the deadline does, inside the callbacks.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from baselines.callbacks import LastSeen, filling_field
from baselines.driver import prepared, tolerances
from baselines.flow import Stop
from baselines.functions import Callbacks
from baselines.mode_functions import ModeFunctions
from baselines.restart import Fresh, GatedGuards, Restart
from baselines.sundials import (
    LEAST_RTOL,
    STEPS_BETWEEN_OUTPUTS,
    SundialsLibrary,
    event_function,
    sampled,
    stopped,
    sundae_version,
)
from baselines.work import Stalled, Work
from henon_ref.errors import UnavailableError
from henon_ref.filippov.problem import Problem
from henon_ref.solver import Run


@dataclass(frozen=True)
class SundialsCvode:
    """CVODE on one smooth mode after another, dense Newton iteration with the Jacobian that SymPy derives.

    Counts: ``steps`` are internal steps; ``rhs_evaluations`` are CVODE's own count of right-hand sides
    (Jacobians not counted); ``event_evaluations`` all evaluations of one guard each, the guard against
    divergence among them. A second pass for samples is not counted.
    """

    name: str
    method: Literal["Adams", "BDF"]
    callbacks: Callbacks = "python"
    """Right-hand side and Jacobian in plain Python or compiled; the event function is plain Python."""
    restart: Restart = "event-free-step"
    fixed_step: bool = False
    landing: str = "illinois"

    @property
    def version(self) -> str:
        """scikit-sundae's version."""
        return sundae_version()

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
        rtol, atol = tolerances(self.name, rtol, atol, step)
        try:
            from sksundae.cvode import CVODE
        except ImportError as error:
            raise UnavailableError("scikit-sundae is not installed") from error
        library = _Library(self, CVODE, max(rtol, LEAST_RTOL), atol)
        return prepared(problem, library, sample_times=sample_times, deadline=deadline)


class _Library(SundialsLibrary):
    """CVODE with its tolerances."""

    def flow(self, model: ModeFunctions, work: Work, horizon: float) -> _Flow:
        return _Flow(self, model, work, horizon)


class _Flow:
    """CVODE on one mode."""

    def __init__(self, library: _Library, model: ModeFunctions, work: Work, horizon: float) -> None:
        solver = library.solver
        self._cvode, self._model, self._work, self._horizon = library.make, model, work, horizon
        self._gates = GatedGuards(model, solver.restart, library.errors)
        self._last = LastSeen(len(model.states), work.count_event)
        self._rhs = filling_field(model, solver.callbacks, work)
        jacobian = model.jacobian(solver.callbacks)

        def jacfn(t: float, x: NDArray[np.float64], xp: NDArray[np.float64], out: NDArray[np.float64]) -> None:
            jacobian.fill(t, x, out)

        self._options = {
            "method": solver.method,
            "rtol": library.rtol,
            "atol": library.atol,
            "jacfn": jacfn,
            "max_num_steps": STEPS_BETWEEN_OUTPUTS,
        }
        guards = self._gates.watchers(work.count_event)
        self._events = {
            "eventsfn": event_function(guards, self._last, self._gates.direction),
            "num_events": len(guards) + 1,
        }

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
        self._gates.open(t, x, fresh, self._horizon)
        self._last.start(t, tuple(x))
        work, said, start, n = self._work, io.StringIO(), self._model.start(t, x), len(x)
        before = work.rhs
        # scikit-sundae prints its errors.
        with redirect_stdout(said), np.errstate(all="ignore"):
            try:
                result = self._cvode(self._rhs, **self._options, **self._events).solve([t, until], start)
            except (RuntimeError, Stalled) as error:
                return Stop("failed", self._last.t, 0.0, self._last.x, reason=f"{error} {said.getvalue().strip()}")
            work.steps += result.t.size - 1
            work.rhs = before + int(result.nfev)
            stop = stopped(result, n, until, said.getvalue(), self._last)
            if wanted is None:
                return stop
            kept = work.rhs
            samples = sampled(
                lambda times: self._cvode(self._rhs, **self._options).solve(times, start), wanted, t, stop.t, n
            )
            work.rhs = kept
        return stop._replace(samples=samples)


ADAMS = SundialsCvode("cvode-adams", "Adams")
BDF = SundialsCvode("cvode-bdf", "BDF")
ADAMS_NUMBA = SundialsCvode("cvode-adams+numba", "Adams", callbacks="numba")
BDF_NUMBA = SundialsCvode("cvode-bdf+numba", "BDF", callbacks="numba")
