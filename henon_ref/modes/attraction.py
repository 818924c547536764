"""Whether sliding on an intersection attracts, where its surfaces act on each other.

With the normal velocities v = a - M s in the signs s, the modes that are consistent at a point solve a complementarity
problem on the box [-1, 1]^m. It has one solution whatever a is just where all principal minors of M are positive, M is
a P-matrix (Robinson, *Math. Oper. Res.* 17 (1992) 691-714). On two surfaces sliding then attracts, for there are
positive d_i with the sum of d_i (abs(h_i) - u_i h_i) falling (Cross, *Linear Algebra Appl.* 20 (1978) 253-263). Where
det M < 0 sliding is one of several modes: the signs of the determinants of all of them add up to 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations

import sympy as sp
from sympy.utilities.iterables import strongly_connected_components

from henon_ref.modes.algebra import known_positive
from henon_ref.modes.equations import Guard, Refusal
from henon_ref.modes.linear_system import EXPLICIT, determinant, rational
from henon_ref.modes.switched_field import SwitchedField
from henon_ref.taylor.tape import TIME

EXHAUSTIVE = 4
"""Of more surfaces that act on each other only the diagonal and the determinant are looked at."""


def attraction_guards(system: SwitchedField, sliding: Sequence[int], slopes: sp.Matrix) -> list[Guard]:
    """Principal minors of M that may not be positive; those that follow from smaller ones are left out.

    ``slopes``, shape (m, m), is -M. A minor of all surfaces that act on each other ends a run as ``nonunique`` where
    it falls, for the determinant falls with it; beyond another one it is not told whether sliding still attracts.
    """
    matrix = -slopes
    edges = [(i, j) for i in range(matrix.rows) for j in range(matrix.cols) if matrix[i, j] != 0]
    found = []
    for group in strongly_connected_components((range(matrix.rows), edges)):
        sizes = range(1, len(group) + 1) if len(group) <= EXHAUSTIVE else (1, len(group))
        for chosen in (c for size in sizes for c in combinations(sorted(group), size) if _joined(c, edges)):
            minor = _determinant(system, matrix.extract(chosen, chosen))
            if not known_positive(system.numeric(minor)):
                ends: Refusal = "nonunique" if len(chosen) == len(group) else "none"
                found.append(Guard("attracts", sliding[chosen[0]], 0, minor, ends=ends))
    return found


def _determinant(system: SwitchedField, matrix: sp.Matrix) -> sp.Expr:
    """The determinant of a matrix; of a large one that is constant in numbers."""
    if matrix.rows > EXPLICIT and not matrix.free_symbols & {TIME, *system.states, *system.signs}:
        return sp.QQ.to_sympy(rational(system, matrix.tolist()).det())
    return determinant(matrix)


def _joined(chosen: Sequence[int], edges: Iterable[tuple[int, int]]) -> bool:
    """Whether surfaces act on each other without the help of others; else their minor is a product of smaller ones."""
    inside = [(i, j) for i, j in edges if i in chosen and j in chosen]
    return len(strongly_connected_components((chosen, inside))) == 1
