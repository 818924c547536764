"""The reference integrator as solvers: ``henon``, and two variants with the landings ``newton`` and ``brent``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from henon_ref.errors import UnsupportedError
from henon_ref.integrator.records import LANDINGS
from henon_ref.integrator.run import prepared_run
from henon_ref.kernel.library import kernel
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run
from henon_ref.workers.machine import library_versions


@dataclass(frozen=True)
class HenonSolver:
    """Adaptive Taylor method with Hénon's landing. The whole run is compiled, the loop over the modes included.

    ``rtol`` is the local error of a step relative to the size of each state (and guard) on the step, so that the
    units of a model do not matter; ``atol`` is not used. ``rtol`` sets the order and the step sizes.

    ``steps`` counts Taylor steps (a step cut by an event counts once). ``rhs_evaluations`` counts Taylor expansions,
    evaluations of the two normal velocities at an event, and evaluations of slopes if a step may have crossed a branch
    point. ``event_evaluations`` counts evaluations of a guard's polynomial by the landing.
    """

    name: str = "henon"
    method: int = kernel.HENON
    fixed_step: bool = False

    @property
    def landing(self) -> str:
        return LANDINGS[self.method]

    @property
    def version(self) -> str:
        return library_versions(("henon-ref",))["henon-ref"] or "not installed"

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
        """See :class:`henon_ref.solver.Solver`."""
        if rtol is None:
            raise UnsupportedError(f"{self.name} chooses its own step: give rtol")
        return prepared_run(problem, rtol=rtol, landing=self.method, sample_times=sample_times, deadline=deadline)


HENON_SOLVER = HenonSolver()
HENON_NEWTON = HenonSolver("henon-newton", kernel.NEWTON)
HENON_BRENT = HenonSolver("henon-brent", kernel.BRENT)
