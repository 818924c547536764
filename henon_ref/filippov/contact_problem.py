"""The accelerations of bodies that touch with Coulomb's friction, by Gauss's principle.

Of all accelerations a the bodies take those that make

    1/2 sum of m (a - F/m)^2 + sum of limit_i abs(N_i),   N_i the relative acceleration at contact i,

smallest; at a stop that a body rests on N_i >= 0 is a condition in place of a term. The sum is strictly convex, so that
the accelerations are unique, in loops of contacts and between drives that pull apart as well. In the forces s_i of the
contacts (the dual problem) it says: N = a - W s, each s_i in an interval [lower_i, upper_i], at the upper end where
N_i > 0, at the lower one where N_i < 0; W, the inverse inertia that the contacts see, is positive semidefinite. See
Moreau, *Standard inelastic shocks and the dynamics of unilateral constraints* (1985), Sec. 2; Glocker, *Set-Valued
Force Laws* (2001), Ch. 6; Lötstedt, *SIAM J. Appl. Math.* 42 (1982) 281-296.

A mode is which contacts hold (N_i = 0) and which way the others slip. It is found by block principal pivoting (Júdice
and Pires, *Comput. Oper. Res.* 21 (1994) 587-596), which ends with Murty's rule of the last index where blocks do not
lead on, in double precision; whoever needs more checks the mode that is found in its own numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from henon_ref.errors import ModelError

COMPLIANCE = 1e-9
"""Of each contact, relative to the inverse inertia that it sees: settles how contacts in a loop share their loads."""
TIE = 1e-6
"""Part of its terms below which a relative acceleration may be zero."""
ROUNDING = 1e-12
"""Part of its terms by which a number may be beyond a bound."""
PATIENCE, MOST_PIVOTS = 10, 100
"""Blocks of pivots in a row that bring no fewer contacts out of bounds; pivots a contact."""
RANK = 1e-8
"""Part of a contact's own inverse inertia below which what the others leave of it is none."""

Row = list[Any]
Negative = Callable[[Any, Any], bool]
"""(value, size of its terms) -> whether it is clearly below zero."""


class ContactProblem(NamedTuple):
    """Relative accelerations ``N = free - matrix s`` of m contacts, and the bounds of their forces; any numbers."""

    free: Row
    """N without forces of the contacts, shape (m,)."""
    matrix: list[Row]
    """Shape (m, m); its diagonal is positive."""
    lower: Row
    """Least force of each; None where there is none."""
    upper: Row


class Accelerations(NamedTuple):
    """Solution of a contact problem."""

    forces: NDArray[np.float64]
    """s, shape (m,)."""
    entries: tuple[int, ...]
    """0: the force is between its bounds; -1, +1: at the lower bound, the upper one."""
    slips: tuple[bool, ...]
    """Whether a contact's relative acceleration is plainly not zero."""
    clear: bool
    """Whether all others hold by forces that are plainly between their bounds, and that are the only ones."""


def solved(problem: ContactProblem) -> Accelerations:
    """Solve a contact problem in double precision.

    Raises
    ------
    ModelError
        Where the pivots do not come to an end: the forces are not those of friction.
    """
    count = len(problem.free)
    free = np.array([float(v) for v in problem.free])
    given = np.array([[float(v) for v in row] for row in problem.matrix]).reshape(count, count)
    scale = np.diag(given)
    matrix = given / scale + COMPLIANCE * np.eye(count)  # of forces in units of the acceleration that they give
    lower, upper = (
        scale * np.array([way * np.inf if v is None else float(v) for v in bounds])
        for way, bounds in ((-1, problem.lower), (1, problem.upper))
    )
    entries, fewest, patience = np.zeros(count, dtype=int), count + 1, PATIENCE
    for _ in range(MOST_PIVOTS * (count + 1)):
        held = entries == 0
        forces = np.where(entries > 0, upper, np.where(entries < 0, lower, 0.0))
        rest = free - matrix[:, ~held] @ forces[~held]
        forces[held] = np.linalg.solve(matrix[np.ix_(held, held)], rest[held])
        speeds, sizes = free - matrix @ forces, np.abs(free) + np.abs(matrix) @ np.abs(forces)
        above, below = (
            held & (way * (forces - bound) > ROUNDING * (np.abs(forces) + sizes))
            for way, bound in ((1, upper), (-1, lower))
        )
        back = ~held & (entries * speeds < -ROUNDING * sizes)
        wrong = np.flatnonzero(above | below | back)
        if not wrong.size:
            slips = ~held & (np.abs(speeds) > TIE * sizes)
            room = np.minimum(upper - forces, forces - lower)
            inside = slips | (held & (room > TIE * (np.abs(forces) + sizes)))
            own = np.flatnonzero(held).tolist()
            clear = bool(inside.all()) and (len(own) < 2 or independent_of(problem, own) == own)
            return Accelerations(forces / scale, tuple(entries.tolist()), tuple(slips.tolist()), clear)
        patience = PATIENCE if wrong.size < fewest else patience - 1
        fewest = min(fewest, wrong.size)
        turned = wrong if patience > 0 else wrong[-1:]
        entries[turned] = above[turned].astype(int) - below[turned].astype(int)
    raise ModelError("the forces of contacts that act on each other have no solution that pivoting finds")


def independent_of(problem: ContactProblem, order: Sequence[int]) -> list[int]:
    """Contacts whose accelerations can be chosen freely by their forces, taken in this order while they can."""
    matrix = np.array([[float(v) for v in row] for row in problem.matrix])
    own, chosen = np.diag(matrix).copy(), list[int]()
    for k in order:
        if matrix[k, k] > RANK * own[k]:
            chosen.append(k)
            matrix = matrix - np.outer(matrix[:, k], matrix[k]) / matrix[k, k]
    return chosen


def is_clear(
    problem: ContactProblem, found: Accelerations, settled: Callable[[list[int], int], bool], negative: Negative
) -> bool:
    """Whether a solution holds in the problem's own numbers, with nothing at its limit.

    ``settled``: whether a contact is at rest, by its place, wherever those at some places are.
    """
    held = [k for k, slips in enumerate(found.slips) if not slips]
    room = {k: min(_room(problem, k, float(found.forces[k]))) for k in held}
    chosen = independent_of(problem, sorted(held, key=lambda k: -room[k]))
    if not all(settled(chosen, k) for k in held if k not in chosen):
        return False
    bounds = zip(found.entries, problem.lower, problem.upper, found.forces.tolist(), strict=True)
    forces: Row = [upper if entry > 0 else lower if entry < 0 else force for entry, lower, upper, force in bounds]
    if chosen:
        rows = [
            [*(problem.matrix[k][j] for j in chosen), _speed(problem, k, forces, skipped=chosen)[0]] for k in chosen
        ]
        values = eliminated(rows)
        if values is None:
            return False
        for k, value in zip(chosen, values, strict=True):
            forces[k] = value
            for bound, way in ((problem.lower[k], 1), (problem.upper[k], -1)):
                if bound is not None and not negative(way * (bound - value), abs(bound) + abs(value)):
                    return False
    for k, (entry, slips) in enumerate(zip(found.entries, found.slips, strict=True)):
        speed, size = _speed(problem, k, forces)
        if slips and not negative(-entry * speed, size):
            return False
    return True


def _room(problem: ContactProblem, k: int, force: float) -> list[float]:
    bounds = ((problem.lower[k], 1), (problem.upper[k], -1))
    return [way * (force - float(bound)) for bound, way in bounds if bound is not None] or [np.inf]


def _speed(problem: ContactProblem, k: int, forces: Row, skipped: Sequence[int] = ()) -> tuple[Any, Any]:
    """A relative acceleration, forces at some places left out, and the size of its terms."""
    terms = [
        slope * force
        for j, (slope, force) in enumerate(zip(problem.matrix[k], forces, strict=True))
        if j not in skipped
    ]
    return problem.free[k] - sum(terms, 0 * problem.free[k]), sum(map(abs, terms), abs(problem.free[k]))


def eliminated(matrix: list[Row]) -> Row | None:
    """Solution of a linear system, its right side the last column; None where a pivot may be zero."""
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
