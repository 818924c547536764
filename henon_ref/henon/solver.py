"""The reference as solvers: ``henon``, and the same integrator with the landings ``newton`` and ``brent``."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from henon_ref.errors import UnsupportedError
from henon_ref.filippov.problem import Problem
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.integrator import Integrator
from henon_ref.henon.records import BRENT, HENON, LANDINGS, NEWTON
from henon_ref.henon.run import Run
from henon_ref.henon.start import NO_LIMIT, Start
from henon_ref.solver import Run as PreparedRun
from henon_ref.trajectory import Trajectory, without_hidden_kinks


@dataclass(frozen=True)
class HenonSolver:
    """Adaptive Taylor method with Hénon's landing, compiled, mode loop and all.

    ``rtol`` is the local error of a step relative to each state's (and guard's) own size on the step, so
    the units of a model do not matter; ``atol`` is not used. Order and step follow from ``rtol``.

    ``steps`` counts Taylor steps (a step cut by an event counts once), ``rhs_evaluations`` Taylor
    expansions, evaluations of the two normal velocities at an event, and of slopes where a step might have led over
    a branch point; ``event_evaluations`` evaluations of a guard's polynomial by the landing.
    """

    name: str = "henon"
    method: int = HENON
    fixed_step: bool = False

    @property
    def landing(self) -> str:
        return LANDINGS[self.method]

    @property
    def version(self) -> str:
        return version("henon-ref")

    def prepare(
        self,
        problem: Problem,
        *,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        sample_times: NDArray[np.float64] | None = None,
        deadline: float | None = None,
    ) -> PreparedRun:
        """See :class:`henon_ref.solver.Solver`."""
        if rtol is None:
            raise UnsupportedError(f"{self.name} chooses its own step: give rtol")
        tolerance = max(0.1 * rtol, 2e-16)
        integrator = Integrator(problem.system, order_for(tolerance))
        # A deadline bounds it, not a number of steps.
        start = replace(integrator.start(problem, tolerance=tolerance, landing=self.method), most_steps=NO_LIMIT)
        start.kept = start.written()
        run = partial(_run, integrator, start, sample_times, deadline)
        # What a system without kinks has no use for is no call of its run: these are some percent of a short one.
        return partial(_run_with_kinks, run, problem.system) if problem.system.kinks else run


def _run(
    integrator: Integrator, start: Start, sample_times: NDArray[np.float64] | None, deadline: float | None
) -> Trajectory:
    return Run(integrator, start, sample_times, deadline).to_horizon()


def _run_with_kinks(run: PreparedRun, system: FilippovSystem) -> Trajectory:
    return without_hidden_kinks(run(), system)


def order_for(tolerance: float) -> int:
    """Order of the Taylor method for a tolerance, 4 to 24: 1 - 0.75 ln(tolerance).

    Jorba and Zou (2005) put -ln(tolerance) / 2 + 1, best where a step costs as much as order^2. Here steps
    carry other costs (events, sines) and a coefficient costs less than its order: at a tolerance of 1e-13 the
    longer runs of the shipped cases are quickest at orders 20 to 24, within some percent of each other, those of a
    few steps at lower ones, and beyond 26 most take longer.
    """
    return min(max(math.ceil(1 - 0.75 * math.log(tolerance)), 4), 24)


HENON_SOLVER = HenonSolver()
HENON_NEWTON = HenonSolver("henon-newton", NEWTON)
HENON_BRENT = HenonSolver("henon-brent", BRENT)
