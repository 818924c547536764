"""Symbolic linear systems: signs that keep the state on surfaces, and states that surfaces determine."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import permutations

import sympy as sp
from sympy.matrices import dotprodsimp
from sympy.polys.matrices import DomainMatrix
from sympy.polys.matrices.exceptions import DMNonInvertibleMatrixError
from sympy.solvers.solveset import NonlinearError
from sympy.utilities.iterables import connected_components

from henon_ref.errors import ModelError
from henon_ref.expressions.algebra import measured
from henon_ref.expressions.bounds import terms
from henon_ref.expressions.traversal import is_longer
from henon_ref.modes.switched_field import SwitchedField
from henon_ref.taylor.tape import TIME

MAX_SYMBOLIC = 4
"""Largest number of coupled signs that are solved with symbolic parameters; beyond, their numbers are used."""
EXPLICIT = 3
"""Largest number of rows for which a determinant is a short sum of products for any entries."""
MAX_PRODUCTS = 5_000
"""Largest number of terms of an expanded determinant."""

Matrix = Sequence[Sequence[sp.Expr]]


def solution(system: SwitchedField, matrix: Matrix, right: Sequence[sp.Expr]) -> list[sp.Expr] | None:
    """Return the solution of a linear system; None unless there is exactly one.

    ModelError if the formulas would be too large.
    """
    if len(right) <= MAX_SYMBOLIC:
        return _joint_solution(system, matrix, right)
    indices = range(len(right))
    found: dict[int, sp.Expr] = {}
    edges = [(i, j) for i in indices for j in indices if matrix[i][j] != 0]
    for group in connected_components((list(indices), edges)):
        part = _joint_solution(system, [[matrix[i][j] for j in group] for i in group], [right[i] for i in group])
        if part is None:
            return None
        found.update(zip(group, part, strict=True))
    return [found[i] for i in indices]


def _joint_solution(system: SwitchedField, matrix: Matrix, right: Sequence[sp.Expr]) -> list[sp.Expr] | None:
    """Solve by Cramer's rule if the matrix is not constant: a pivot may vanish although the determinant does not."""
    square = sp.Matrix(matrix)
    if not square.free_symbols & {TIME, *system.states, *system.signs}:
        if len(right) <= MAX_SYMBOLIC and _few_terms(square):
            try:
                return list(square.LUsolve(sp.Matrix(right)))
            except sp.matrices.exceptions.NonInvertibleMatrixError:
                return None
        if len(right) > EXPLICIT:
            return _numeric_solution(system, matrix, right)
    whole = determinant(system, square)
    if whole == 0:
        return None
    with dotprodsimp(simplifies(square)):
        adjugate = square.adjugate(method="berkowitz")
    if multiplies_out(square):
        whole, adjugate = sp.expand(whole), adjugate.applyfunc(sp.expand)
    return None if whole == 0 else list(adjugate * sp.Matrix(right) / whole)


def determinant(system: SwitchedField, matrix: sp.Matrix) -> sp.Expr:
    """Return the determinant of a matrix; a large constant matrix is evaluated in numbers.

    ModelError if it has too many terms.
    """
    if matrix.rows > EXPLICIT and not matrix.free_symbols & {TIME, *system.states, *system.signs}:
        return sp.QQ.to_sympy(rational(system, matrix.tolist()).det())
    if matrix.rows > EXPLICIT and not multiplies_out(matrix):
        raise ModelError(
            f"{matrix.rows} signs of surfaces that slide together act on each other by factors that are not constant: "
            f"the formulas would be too large, more than {MAX_PRODUCTS} products"
        )
    with dotprodsimp(simplifies(matrix)):
        return matrix.det(method="berkowitz")


def simplifies(matrix: sp.Matrix) -> bool | None:
    """SymPy's option to simplify sums of products in a determinant (None: SymPy's default)."""
    return None if matrix.rows <= EXPLICIT and _few_terms(matrix) else False


def _few_terms(matrix: sp.Matrix) -> bool:
    """Check whether the determinant of a small matrix can be simplified with little work."""
    products = (sp.Mul(*(matrix[i, j] for i, j in enumerate(order))) for order in permutations(range(matrix.rows)))
    return measured(sp.Add(*products)) is not None


def multiplies_out(matrix: sp.Matrix) -> bool:
    """Check whether a determinant has few terms when expanded."""
    products = 1
    for i in range(matrix.rows):
        products *= sum(terms(entry, MAX_PRODUCTS) for entry in matrix.row(i) if entry != 0)
        if products > MAX_PRODUCTS:
            return False
    return not any(is_longer(entry, 200) for entry in matrix)


def _numeric_solution(system: SwitchedField, matrix: Matrix, right: Sequence[sp.Expr]) -> list[sp.Expr] | None:
    numbers = rational(system, matrix)
    try:
        inverse = numbers.inv().to_Matrix()
    except DMNonInvertibleMatrixError:
        return None
    return [sp.Add(*(c * r for c, r in zip(inverse.row(i), right, strict=True))) for i in range(len(right))]


def rational(system: SwitchedField, matrix: Matrix) -> DomainMatrix:
    """Return a constant matrix with many rows as a matrix of rational numbers.

    ModelError if its numbers are not rational.
    """
    numbers = sp.Matrix(matrix).applyfunc(system.numeric)
    if not all(entry.is_Rational for entry in numbers):
        raise ModelError(
            f"{len(matrix)} signs of surfaces that slide together act on each other by factors that are not rational "
            "numbers: the formulas would be too large"
        )
    return DomainMatrix.from_Matrix(numbers).convert_to(sp.QQ)


def solved_states(system: SwitchedField, sliding: Sequence[int], kept: Collection[int] = ()) -> dict[int, int]:
    """Return, for each surface that is linear in a state with a constant factor, this state, another for each surface.

    ``kept``: states that are at rest for another reason, so that a surface must determine a different state.
    """
    places = {x: k for k, x in enumerate(system.states) if k not in kept}
    linear = {
        i: [k for k, x in _among(places, h) if system.constant_slope(h, x) is not None]
        for i in sliding
        for h in [system.surfaces[i]]
    }
    taken: dict[int, int] = {}  # state -> its surface
    for i in sliding:
        _give_state(i, linear, taken, set())
    found = {i: k for k, i in taken.items()}
    return {i: found[i] for i in sliding if i in found}


def _among(places: Mapping[sp.Symbol, int], expression: sp.Expr) -> list[tuple[int, sp.Symbol]]:
    """Return the places of the symbols of an expression, in order, with the symbols."""
    return sorted((places[x], x) for x in expression.free_symbols if x in places)


def surfaces_solved(
    system: SwitchedField, sliding: Sequence[int], kept: Collection[int] = ()
) -> tuple[dict[int, int], dict[sp.Symbol, sp.Expr]]:
    """Return :func:`solved_states`, and these states' expressions.

    The expressions are in time and the states that remain free; empty if they are not short.
    """
    solved = solved_states(system, sliding, kept)
    unknown = [system.states[k] for k in solved.values()]
    return solved, _on_surfaces(system, solved, unknown)


def _give_state(surface: int, linear: Mapping[int, Sequence[int]], taken: dict[int, int], tried: set[int]) -> bool:
    """Assign a state to a surface; if necessary, assign a different state to the surface that has it now.

    Otherwise ``v_a - v_b`` could take v_a and leave no state for ``v_a``. (Augmenting paths of a bipartite matching.)
    """
    free = [k for k in linear[surface] if k not in taken]
    if free:
        taken[free[0]] = surface
        return True
    for k in linear[surface]:
        if k not in tried:
            tried.add(k)
            if _give_state(taken[k], linear, taken, tried):
                taken[k] = surface
                return True
    return False


def _on_surfaces(
    system: SwitchedField, solved: dict[int, int], unknown: Sequence[sp.Symbol]
) -> dict[sp.Symbol, sp.Expr]:
    """Return each solved state in terms of time and the states that remain free on the surfaces."""
    surfaces = [system.surfaces[i] for i in solved]
    if all(len(h.free_symbols & set(unknown)) == 1 for h in surfaces):
        return {
            x: sp.expand(-h.xreplace({x: sp.S.Zero}) / system.constant_slope(h, x), deep=False)
            for h, x in zip(surfaces, unknown, strict=True)
        }
    if is_longer(surfaces, 200):
        return {}
    try:
        found = sp.linsolve(surfaces, unknown)
    except NonlinearError:  # each surface is linear in its own state, but not in all of these states
        return {}
    return dict(zip(unknown, next(iter(found)), strict=True)) if len(found) == 1 else {}
