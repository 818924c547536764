"""Proof that a solution of a contact problem is the unique one: the conditions of the minimum, in balls.

Gauss's sum is strictly convex in the accelerations, so accelerations that satisfy the conditions of the minimum are the
unique minimum, regardless of the method that found them (:mod:`henon_ref.modes.contact_problem`). The conditions: the
force of each holding contact is within its bounds, and every other contact slips against its force, which is at a
bound. In loops, where some holding contacts determine the remaining ones, those farthest from their bounds are chosen.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from henon_ref.modes.contact_problem import Accelerations, ContactProblem, Row, Settled, independent_of


def is_proven(problem: ContactProblem, found: Accelerations, settled: Settled) -> bool:
    """Check whether a double-precision solution is proven for the problem in balls, with no force at its limit.

    Parameters
    ----------
    problem : ContactProblem
        In balls.
    found : Accelerations
        Which contacts hold, and the slip directions of the rest.
    settled : callable
    """
    held = [k for k, slips in enumerate(found.slips) if not slips]
    room = {k: min(_room(problem, k, float(found.forces[k]))) for k in held}
    chosen = independent_of(problem, sorted(held, key=lambda k: -room[k]))
    if not all(settled(chosen, k) for k in held if k not in chosen):
        return False
    bounds = zip(found.entries, problem.lower, problem.upper, found.forces.tolist(), strict=True)
    forces: Row = [upper if entry > 0 else lower if entry < 0 else force for entry, lower, upper, force in bounds]
    if chosen:
        rows = [[*(problem.matrix[k][j] for j in chosen), _speed(problem, k, forces, skipped=chosen)] for k in chosen]
        values = _eliminated(rows)
        if values is None:
            return False
        for k, value in zip(chosen, values, strict=True):
            forces[k] = value
            for bound, way in ((problem.lower[k], 1), (problem.upper[k], -1)):
                if bound is not None and not way * (value - bound) > 0:
                    return False
    for k, (entry, slips) in enumerate(zip(found.entries, found.slips, strict=True)):
        if slips and not entry * _speed(problem, k, forces) > 0:
            return False
    return True


def _room(problem: ContactProblem, k: int, force: float) -> list[float]:
    bounds = ((problem.lower[k], 1), (problem.upper[k], -1))
    return [way * (force - float(bound)) for bound, way in bounds if bound is not None] or [np.inf]


def _speed(problem: ContactProblem, k: int, forces: Row, skipped: Sequence[int] = ()) -> Any:
    """Relative acceleration of a contact, without the forces of the skipped contacts."""
    terms = [
        slope * force
        for j, (slope, force) in enumerate(zip(problem.matrix[k], forces, strict=True))
        if j not in skipped
    ]
    return problem.free[k] - sum(terms, 0 * problem.free[k])


def _eliminated(matrix: list[Row]) -> Row | None:
    """Solve a linear system, given as an augmented matrix; None if a pivot may be zero."""
    count = len(matrix)
    for k in range(count):
        pivot = max(range(k, count), key=lambda r: abs(float(matrix[r][k])))
        matrix[k], matrix[pivot] = matrix[pivot], matrix[k]
        largest = max(abs(float(entry)) for entry in matrix[k][:count])
        if not abs(matrix[k][k]) > 1e-9 * largest:
            return None
        for r in range(count):
            if r != k:
                factor = matrix[r][k] / matrix[k][k]
                matrix[r] = [entry - factor * top for entry, top in zip(matrix[r], matrix[k], strict=True)]
    return [row[count] / row[k] for k, row in enumerate(matrix)]
