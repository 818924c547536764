"""The accelerations of bodies that touch with Coulomb's friction, by Gauss's principle, found by pivoting.

The principle and its literature stand at the head of :mod:`henon_ref.modes.held_groups`. In the forces s_i of the
contacts, the dual problem, it says: the relative accelerations are N = a - W s, each s_i in an interval [lower_i,
upper_i], at the upper end where N_i > 0, at the lower one where N_i < 0.

A mode is which contacts hold (N_i = 0) and which way the others slip. It is found by block principal pivoting (Júdice
and Pires, *Comput. Oper. Res.* 21 (1994) 587-596), which ends with Murty's rule of the last index where blocks do not
lead on, in double precision; who needs a proof holds the solution against the conditions of the minimum in balls
(:mod:`henon_ref.enclosure.contact_proof`).
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
Settled = Callable[[list[int], int], bool]
"""(places of contacts, place) -> whether a contact is at rest wherever those are."""
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
