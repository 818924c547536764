"""A run of the reference, ready to go: its integrator compiled and its start decided, at the order of a tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.records import HENON
from henon_ref.integrator.run import Run
from henon_ref.integrator.start import NO_LIMIT
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory, without_hidden_kinks

ROUNDING = 2e-16
"""Local errors below this are rounding's."""


def local_error(rtol: float) -> float:
    """Local error of a step for a tolerance."""
    return max(0.1 * rtol, ROUNDING)


def order_for(tolerance: float) -> int:
    """Order of the Taylor method for a tolerance, 4 to 24: 1 - 0.75 ln(tolerance).

    Jorba and Zou (2005) put -ln(tolerance) / 2 + 1, best where a step costs as much as order^2. Here steps
    carry other costs (events, sines) and a coefficient costs less than its order: at a tolerance of 1e-13 the
    longer runs of the shipped cases are quickest at orders 20 to 24, within some percent of each other, those of a
    few steps at lower ones, and beyond 26 most take longer.
    """
    return min(max(math.ceil(1 - 0.75 * math.log(tolerance)), 4), 24)


def prepared_run(
    problem: Problem,
    *,
    rtol: float,
    landing: int = HENON,
    sample_times: NDArray[np.float64] | None = None,
    deadline: float | None = None,
) -> Callable[[], Trajectory]:
    """Compile a problem and decide its start.

    Parameters
    ----------
    problem : Problem
    rtol : float
        Tolerance; a step's local error is a tenth of it (:func:`local_error`).
    landing : int
        One of :data:`henon_ref.integrator.records.LANDINGS`.
    sample_times : ndarray, shape (k,), optional
        Increasing times at which the state is wanted.
    deadline : float, optional
        Processor time that the run may take [s].

    Returns
    -------
    callable
        Does the whole run, afresh at each call.
    """
    error = local_error(rtol)
    integrator = Integrator(problem.system, order_for(error))
    # A deadline bounds it, not a number of steps.
    start = integrator.start(problem, tolerance=error, landing=landing, most_steps=NO_LIMIT)

    def run() -> Trajectory:
        return Run(integrator, start, sample_times, deadline).to_horizon()

    # What a system without kinks has no use for is no call of its run: these are some percent of a short one.
    return (lambda: without_hidden_kinks(run(), problem.system)) if problem.system.kinks else run
