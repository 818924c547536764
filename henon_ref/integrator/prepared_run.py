"""Prepared runs of the reference: integrator compiled and start decided, at the order for a tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.records import HENON
from henon_ref.integrator.run import run_to_horizon
from henon_ref.integrator.start import NO_LIMIT
from henon_ref.modes.kinks import HiddenKinks
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory

ROUNDING = 2e-16
"""Smallest local error: below it rounding dominates."""


def local_error(rtol: float) -> float:
    """Return the local error of a step for a tolerance."""
    return max(0.1 * rtol, ROUNDING)


def order_for(tolerance: float) -> int:
    """Return the order of the Taylor method for a tolerance, 4 to 24: 1 - 0.75 ln(tolerance).

    Jorba and Zou (2005) use 1 - ln(tolerance) / 2, which is optimal if the cost of a step grows as order^2. Here a step
    has other costs (events, sines), and the cost of a coefficient grows more slowly: at a tolerance of 1e-13 the longer
    runs of the shipped cases are fastest at orders 20 to 24, within a few percent; runs of a few steps are fastest at
    lower orders, and beyond 26 most runs take longer.
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
        Tolerance; the local error of a step is a tenth of it (:func:`local_error`).
    landing : int
        One of :data:`henon_ref.integrator.records.LANDINGS`.
    sample_times : ndarray, shape (k,), optional
        Increasing times at which the state is sampled.
    deadline : float, optional
        Limit on the processor time of the run [s].

    Returns
    -------
    callable
        Does the entire run again at each call.
    """
    error = local_error(rtol)
    integrator = Integrator(problem.system, order_for(error))
    # The deadline, not a number of steps, limits the run.
    start = integrator.start(problem, tolerance=error, landing=landing, most_steps=NO_LIMIT)
    kinks = HiddenKinks(problem.system) if problem.system.kinks else None
    return partial(run_to_horizon, integrator, start, sample_times, deadline, kinks)
