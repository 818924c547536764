"""Floating-point operations of a run, counted in its LLVM code, and their rate relative to that of a matrix product."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp

from henon_ref.harness.campaign.timing import interleaved
from henon_ref.harness.report.text.model import mode_tape
from henon_ref.harness.rows import Row
from henon_ref.integrator.integrator import Integrator, order_for
from henon_ref.integrator.records import HENON
from henon_ref.integrator.run import run_to_horizon
from henon_ref.jit.ir_writer import count
from henon_ref.modes.problem import Problem
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.llvm.step_end import step_end_ir
from henon_ref.trajectory import Trajectory

RTOL = 1e-12
ROUNDS = 60
SIZE, PRODUCTS = 60, 20
"""Rows of the square matrices whose product measures the peak rate (three matrices fit into the first cache level), and
number of products that are timed together."""


@dataclass(frozen=True)
class Work(Row):
    """Operations and time of a run."""

    expansion: int
    """Operations of one Taylor expansion in slip."""
    stick: int
    """Operations of one Taylor expansion in stick."""
    closing: int
    """Operations at the end of a step."""
    steps: int
    expansions: int
    in_stick: int
    """Expansions made while the motion sticks."""
    landed: int
    """Evaluations of a guard's polynomial in landings."""
    order: int
    """Degree of the polynomials."""
    wall_s: float
    """Median time of the run [s]."""
    peak: float
    """Rate of operations of a matrix product on one core [1/s]."""

    @property
    def total(self) -> int:
        """Operations of the run: expansions, ends of steps, polynomials (a product and a sum per degree)."""
        slip = self.expansions - self.in_stick
        landing = 2 * self.order * self.landed
        return slip * self.expansion + self.in_stick * self.stick + self.steps * self.closing + landing

    @property
    def rate(self) -> float:
        """Rate of operations [1/s]."""
        return self.total / self.wall_s


def work(problem: Problem) -> Work:
    """Count and time a run of a problem with one surface at tolerance 1e-12."""
    tolerance = 0.1 * RTOL
    order, system = order_for(tolerance), problem.system
    n = len(system.states)
    slip, stick = (count(expansion_ir(mode_tape(system, own), n, order, "expansion")) for own in ((), (0,)))
    integrator = Integrator(system, order)

    def run_to(until: sp.Expr) -> Callable[[], Trajectory]:
        start = integrator.start(replace(problem, until=until), tolerance=tolerance, landing=HENON)
        return lambda: run_to_horizon(integrator, start)

    a = np.linspace(0, 1, SIZE * SIZE).reshape(SIZE, SIZE)
    out = np.empty_like(a)

    def product() -> None:
        for _ in range(PRODUCTS):
            np.matmul(a, a, out=out)

    run = run_to(problem.until)
    times = interleaved({"run": run, "product": product}, rounds=ROUNDS)
    whole = run()
    ends = [sp.Rational(t.time) for t in whole.transitions]
    spent = [0, *(run_to(end)().counts.rhs_evaluations for end in ends), whole.counts.rhs_evaluations]
    stuck = [mode == (0,) for mode in (whole.transitions[0].from_mode, *(t.to_mode for t in whole.transitions))]
    return Work(
        expansion=slip,
        stick=stick,
        closing=count(step_end_ir(n, 1, order, "closing")),
        steps=whole.counts.steps,
        expansions=whole.counts.rhs_evaluations,
        in_stick=int(np.diff(spent)[stuck].sum()),
        landed=whole.counts.event_evaluations,
        order=order,
        wall_s=times.median("run"),
        peak=PRODUCTS * 2 * SIZE**3 / times.median("product"),
    )
