"""Filippov's sliding: the convex combination of the fields beside the surfaces, and where it ends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import sympy as sp
from sympy.solvers.solveset import NonlinearError

from henon_ref.errors import ModelError
from henon_ref.model.attraction import attraction_guards
from henon_ref.model.equations import TIME, Guard, along

if TYPE_CHECKING:
    from henon_ref.model.system import FilippovSystem


def _solved_state(surface: sp.Expr, states: tuple[sp.Symbol, ...], taken: set[int]) -> int | None:
    """A state in which the surface is linear with a constant factor, so that the surface is x_k = r(t, others)."""
    for k, x in enumerate(states):
        slope = sp.diff(surface, x)
        if k not in taken and slope != 0 and not slope.free_symbols & ({TIME} | set(states)):
            return k
    return None


def _interpolated(expression: sp.Expr, signs: tuple[sp.Symbol, ...]) -> sp.Expr:
    """The multi-affine interpolation of an expression between the signs -1 and +1 (for one sign: Filippov's)."""
    free = expression.free_symbols
    used = [s for s in signs if s in free]
    if all(sp.diff(expression, s, 2) == 0 for s in used):
        return expression
    total = sp.Integer(0)
    for corner in product((-1, 1), repeat=len(used)):
        weight = sp.Mul(*((1 + c * s) / sp.Integer(2) for c, s in zip(corner, used, strict=True)))
        total += weight * expression.xreplace({s: sp.Integer(c) for c, s in zip(corner, used, strict=True)})
    return total


def filippov_sliding(
    system: FilippovSystem, sliding: tuple[int, ...]
) -> tuple[tuple[sp.Expr, ...], tuple[Guard, ...], dict[int, sp.Expr]]:
    """Filippov's convex combination on the intersection of the sliding surfaces.

    Surfaces that are one another's multiples are one contact: there are but two fields beside it, and their signs stay
    equal (or opposite) in the combination of these.
    """
    tied = {j: found for j, found in system.multiples.items() if j in sliding}
    if tied:
        joined = {system.signs[j]: way * system.signs[i] for j, (i, way) in tied.items()}
        lone = replace(system, field=tuple(f.xreplace(joined) for f in system.field))
        field, releases, found = filippov_sliding(lone, tuple(i for i in sliding if i not in tied))
        for j, (i, way) in tied.items():
            own = [g for g in releases if g.kind == "release" and g.index == i]
            releases += tuple(replace(g, index=j, to_sign=way * g.to_sign) for g in own)
            found[j] = way * found[i]
        return field, releases, found
    states = system.states
    solved: dict[int, int] = {}
    for i in sliding:
        k = _solved_state(system.surfaces[i], states, set(solved.values()))
        if k is not None:
            solved[i] = k
    on_surface = _surface_substitution(system, solved)
    signs = tuple(system.signs[i] for i in sliding)
    rhs = [_interpolated(f.xreplace(on_surface), signs) for f in system.field]
    normal = [
        sp.expand(along(system.surfaces[i], states, tuple(rhs)).xreplace(on_surface), deep=False) for i in sliding
    ]
    slope = [[_simplified(sp.diff(n, s)) if n.has(s) else sp.S.Zero for s in signs] for n in normal]
    if any(entry.has(*signs) for row in slope for entry in row):
        raise ModelError(
            "signs that multiply each other on the intersection of "
            + ", ".join(s.name for s in signs)
            + ": Filippov's combination is not unique there; write the field so that each sign stands alone"
        )
    none = {s: sp.Integer(0) for s in signs}
    rest = [n.xreplace(none) for n in normal]
    coupled = any(slope[i][j] != 0 for i in range(len(signs)) for j in range(len(signs)) if i != j)
    guards: list[Guard] = []
    if coupled:
        solution = _solution(sp.Matrix(slope), -sp.Matrix(rest), {TIME, *states, *system.signs})
        if solution is None:
            names = ", ".join(s.name for s in signs)
            raise ModelError(f"the field does not settle the signs of the surfaces it should slide on: {names}")
        equivalent = {s: solution[i] for i, s in enumerate(signs)}
        for i, s in zip(sliding, signs, strict=True):
            guards.append(Guard("release", i, 1, 1 - equivalent[s]))
            guards.append(Guard("release", i, -1, 1 + equivalent[s]))
        guards += attraction_guards(system, sliding, sp.Matrix(slope))
    else:
        if any(slope[i][i] == 0 for i in range(len(signs))):
            raise ModelError(f"the field does not depend on the sign of a surface it should slide on: {signs}")
        equivalent = {s: -rest[i] / slope[i][i] for i, s in enumerate(signs)}
        for n, i, s in zip(normal, sliding, signs, strict=True):
            # Sliding attracts while dh/dt < 0 beyond and > 0 before; it ends where either reaches 0 (tangent points).
            guards.append(Guard("release", i, 1, -n.xreplace({s: sp.Integer(1)})))
            guards.append(Guard("release", i, -1, n.xreplace({s: sp.Integer(-1)})))
    result = [f.xreplace(equivalent) for f in rhs]
    for i, k in solved.items():
        # x_k = r(t, others) on the surface: its derivative needs no friction force, and keeps the surface exactly.
        h = system.surfaces[i]
        rates = [sp.S.Zero if j == k else rate for j, rate in enumerate(result)]
        others = along(h, states, tuple(rates))
        result[k] = -others.xreplace(on_surface) / sp.diff(h, states[k])
    return tuple(result), tuple(guards), {i: equivalent[s] for i, s in zip(sliding, signs, strict=True)}


def _solution(matrix: sp.Matrix, right: sp.Matrix, moving: set[sp.Symbol]) -> sp.Matrix | None:
    """Solution of a linear system; None where there is none, or more than one.

    Where the matrix moves by Cramer's rule: a pivot of an elimination may vanish where the determinant does not.
    """
    if not matrix.free_symbols & moving:
        try:
            return matrix.LUsolve(right)
        except sp.matrices.exceptions.NonInvertibleMatrixError:
            return None
    determinant = sp.expand(matrix.det(method="berkowitz"))
    if determinant == 0:
        return None
    return matrix.adjugate(method="berkowitz").applyfunc(sp.expand) * right / determinant


def _simplified(slope: sp.Expr) -> sp.Expr:
    """A slope in few terms; a product is so already (SymPy loads all its units, 0.2 s, before it simplifies)."""
    return sp.simplify(slope) if slope.has(sp.Add, sp.Function) else slope


def _surface_substitution(system: FilippovSystem, solved: Mapping[int, int]) -> dict[sp.Symbol, sp.Expr]:
    """Each solved state in terms of time and the states that are left free on the surfaces."""
    if not solved:
        return {}
    unknown = [system.states[k] for k in solved.values()]
    try:
        solution = sp.linsolve([system.surfaces[i] for i in solved], unknown)
    except NonlinearError:  # each is linear in its own state, but not all of them in all
        return {}
    if solution == sp.EmptySet or len(solution) != 1:
        return {}
    return dict(zip(unknown, next(iter(solution)), strict=True))
