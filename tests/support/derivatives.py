"""Derivatives of the flow over a span of time, from the tangent vectors and saltation matrices of the library."""

from __future__ import annotations

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.analysis.saltation import Matrix, rank_lost
from henon_ref.analysis.variational import TangentFlow, TangentTransition
from henon_ref.errors import UnsupportedError
from henon_ref.modes.problem import Problem


def fundamental_matrix(problem: Problem, since: sp.Expr, until: sp.Expr, *, tolerance: float) -> tuple[Matrix, int]:
    """Return the derivative of the state at ``until`` [s] by the state at ``since`` [s], shape (n, n), and its rank.

    In sliding at ``since`` it is the derivative along the surfaces, and maps directions normal to them to zero. The
    rank, an upper bound, follows from the sticks entered, not from digits. UnsupportedError if the solution ends before
    ``until``, or if several surfaces change at one instant.
    """
    flow = TangentFlow(problem, tolerance=tolerance)
    rank = n = len(problem.system.states)
    for stage in (since, until):
        along = flow.spaces.basis(flow.mode, flow.time, flow.state)
        flow.vectors = along @ along.T
        rank = flow.spaces.dimension(flow.mode)
        while isinstance(event := flow.advance(stage), TangentTransition):
            flow.vectors = event.saltation @ flow.vectors
            rank = min(rank, flow.spaces.dimension(flow.mode))
            if event.jumps:
                rank = min(rank, n - rank_lost(event.saltation))
        if event.status != "ok":
            raise UnsupportedError(f"no derivative up to t = {float(stage):.17g}: {event.reason}")
    return flow.vectors, rank


def floquet_multipliers(
    problem: Problem, *, since: sp.Expr | float, period: sp.Expr | float, tolerance: float = 2e-16
) -> NDArray[np.complex128]:
    """Return the n Floquet multipliers of the periodic orbit on which a problem's trajectory is, largest first.

    They are exactly 0 for directions that a stick has removed. The trajectory is on the orbit at the time ``since``
    [s]; the problem's own ``until`` is not used. ``period`` [s] may be an integer multiple of the period, and is an
    exact number if known; ``tolerance`` is the local error of a step. UnsupportedError if the solution ends early, or
    if several surfaces change at one instant.
    """
    matrix, rank = fundamental_matrix(problem, since, since + period, tolerance=tolerance)
    multipliers = np.linalg.eigvals(matrix).astype(complex)
    multipliers = multipliers[np.argsort(-np.abs(multipliers), kind="stable")]
    multipliers[rank:] = 0.0
    return multipliers
