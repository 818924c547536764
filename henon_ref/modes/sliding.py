"""Filippov sliding: the convex combination of the fields on both sides of the surfaces, and the guards that end it.

On one surface ``f = (1 + s)/2 f(+1) + (1 - s)/2 f(-1)``. The equivalent sign s in [-1, 1] keeps the rate
``h' = slope s + rest`` at zero: ``s = -rest / slope`` (Filippov, 1988, Sec. 4). On several surfaces the combination is
multi-affine (blending: Alexander and Seidman, *Houston J. Math.* 24, 1998), and ``slope`` is a matrix.

**Attraction.** With the normal velocities v = a - M s in the signs s, the modes that are consistent at a point solve a
complementarity problem on the box [-1, 1]^m. The problem has exactly one solution for every a if and only if all
principal minors of M are positive: M is a P-matrix (Robinson, *Math. Oper. Res.* 17 (1992) 691-714). On two surfaces
sliding then attracts, because positive d_i exist for which the sum of d_i (abs(h_i) - u_i h_i), with the equivalent
signs u_i, decreases (Cross, *Linear Algebra Appl.* 20 (1978) 253-263). If det M < 0, sliding is one of several modes:
the signs of the determinants of all modes add up to 1.

The work on an expression is linear in its size, or is done only for expressions known to be small
(:mod:`henon_ref.expressions.algebra`), because equations are derived from untrusted text, also in processes without a
deadline. Equations that would be too large are refused.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, product

import sympy as sp
from sympy.utilities.iterables import strongly_connected_components

from henon_ref.errors import ModelError
from henon_ref.expressions.algebra import (
    MAX_DERIVED,
    MAX_SIZE,
    coefficients,
    expanded,
    known_positive,
    simplified,
)
from henon_ref.expressions.bounds import put
from henon_ref.expressions.traversal import is_longer, size
from henon_ref.modes.equations import Guard, Refusal, along
from henon_ref.modes.linear_system import Matrix, determinant, solution, surfaces_solved
from henon_ref.modes.switched_field import SwitchedField
from henon_ref.text import listed

EXHAUSTIVE = 4
"""Largest number of coupled surfaces of which all principal minors are checked, not only diagonal and determinant."""


def _interpolated(expression: sp.Expr, signs: tuple[sp.Symbol, ...]) -> sp.Expr:
    """Return the multi-affine interpolation of an expression between the signs -1 and +1 (Filippov's for one sign)."""
    free = expression.free_symbols
    used = [s for s in signs if s in free]
    if coefficients(expression, used) is not None:
        return expression
    if len(used) > 4:  # evaluated at all combinations of the signs
        if expression.is_Add:
            return sp.Add(*(_interpolated(term, signs) for term in expression.args))
        raise ModelError(
            f"a term that is not linear in its signs contains the signs of {len(used)} surfaces that slide together; "
            "write the field so that each sign is in a term of its own"
        )
    total = sp.Integer(0)
    for corner in product((-1, 1), repeat=len(used)):
        weight = sp.Mul(*((1 + c * s) / sp.Integer(2) for c, s in zip(corner, used, strict=True)))
        total += weight * put(expression, {s: sp.Integer(c) for c, s in zip(corner, used, strict=True)})
    return total


def filippov_sliding(
    system: SwitchedField, sliding: tuple[int, ...], kept: Collection[int] = ()
) -> tuple[tuple[sp.Expr, ...], tuple[Guard, ...], dict[int, sp.Expr]]:
    """Return the field of Filippov's combination on the intersection of the surfaces, its guards and equivalent signs.

    ``kept``: states that are at rest for all values of the signs.

    Surfaces that are multiples of each other are one contact: only two fields meet there, and their signs stay equal
    (or opposite) in the combination.
    """
    tied = {j: found for j, found in system.multiples.items() if j in sliding and found[0] in sliding}
    if tied:
        joined = {system.signs[j]: way * system.signs[i] for j, (i, way) in tied.items()}
        lone = replace(system, field=tuple(f.xreplace(joined) for f in system.field))
        field, releases, found = filippov_sliding(lone, tuple(i for i in sliding if i not in tied), kept)
        for j, (i, way) in tied.items():
            own = [g for g in releases if g.kind == "release" and g.index == i]
            releases += tuple(replace(g, index=j, to_sign=way * g.to_sign) for g in own)
            found[j] = way * found[i]
        return field, releases, found
    signs = tuple(system.signs[i] for i in sliding)
    solved, on_surface = surfaces_solved(system, sliding, kept)
    rhs = _small(tuple(_interpolated(put(f, on_surface), signs) for f in system.field), signs)
    slope, rest, normal = _normal_velocities(system, sliding, rhs, on_surface)
    equivalent, guards = _equivalent_signs(system, sliding, slope, rest, normal)
    written = sum(size(f, MAX_SIZE) for f in rhs)
    longest = max(size(e, MAX_SIZE) for e in equivalent.values())
    occurrences = sum(part in signs for f in rhs for part in sp.preorder_traversal(f))
    if written + longest * occurrences > MAX_SIZE:
        raise _too_large(signs)
    result = [f.xreplace(equivalent) for f in rhs]
    for i, k in solved.items():
        # On the surface x_k = r(t, other states): its derivative contains no friction and keeps the surface exactly.
        h = system.surfaces[i]
        rates = [sp.S.Zero if j == k else rate for j, rate in enumerate(result)]
        others = along(h, system.states, tuple(rates))
        result[k] = -put(others, on_surface) / system.constant_slope(h, system.states[k])
    _small((*result, *(g.expression for g in guards)), signs)
    return tuple(result), tuple(guards), {i: equivalent[s] for i, s in zip(sliding, signs, strict=True)}


def _normal_velocities(
    system: SwitchedField, sliding: tuple[int, ...], rhs: Sequence[sp.Expr], on_surface: Mapping[sp.Symbol, sp.Expr]
) -> tuple[Matrix, list[sp.Expr], list[sp.Expr]]:
    """Return ``(slope, rest, normal)`` with ``normal = h' = slope s + rest`` on the surfaces, one row per surface."""
    signs = tuple(system.signs[i] for i in sliding)
    normal = [expanded(put(along(system.surfaces[i], system.states, tuple(rhs)), on_surface)) for i in sliding]
    _small(normal, signs)
    slope: list[list[sp.Expr]] = []
    for n in normal:
        row = coefficients(n, signs)
        if row is None and not is_longer(n, MAX_DERIVED):
            row = {s: d for s in signs if n.has(s) and (d := sp.diff(n, s)) != 0}
        slope.append([simplified(row[s]) if s in row else sp.S.Zero for s in signs] if row is not None else [])
    if any(not row or any(entry.has(*signs) for entry in row) for row in slope):
        raise ModelError(
            "signs that multiply each other on the intersection of "
            + listed([s.name for s in signs])
            + ": Filippov's combination is not unique there; write the field so that each sign is in a term of its own"
        )
    none = {s: sp.Integer(0) for s in signs}
    return slope, [n.xreplace(none) for n in normal], normal


def _equivalent_signs(
    system: SwitchedField, sliding: tuple[int, ...], slope: Matrix, rest: list[sp.Expr], normal: list[sp.Expr]
) -> tuple[dict[sp.Symbol, sp.Expr], list[Guard]]:
    """Return the signs that keep the state on the surfaces, and the guards that end the sliding."""
    signs = tuple(system.signs[i] for i in sliding)
    guards: list[Guard] = []
    names = listed([s.name for s in signs])
    if any(slope[i][j] != 0 for i in range(len(signs)) for j in range(len(signs)) if i != j):
        found = solution(system, slope, [-r for r in rest])
        if found is None:
            raise ModelError(f"the field does not determine the signs of the surfaces it should slide on: {names}")
        equivalent = dict(zip(signs, found, strict=True))
        for i, s in zip(sliding, signs, strict=True):
            guards.append(Guard("release", i, 1, 1 - equivalent[s]))
            guards.append(Guard("release", i, -1, 1 + equivalent[s]))
        return equivalent, guards + attraction_guards(system, sliding, sp.Matrix(slope))
    if any(slope[i][i] == 0 for i in range(len(signs))):
        raise ModelError(f"the field does not depend on the sign of a surface it should slide on: {names}")
    for n, i, s in zip(normal, sliding, signs, strict=True):
        # Sliding attracts while dh/dt < 0 above and > 0 below; it ends when either reaches 0 (tangent points).
        guards.append(Guard("release", i, 1, -n.xreplace({s: sp.Integer(1)})))
        guards.append(Guard("release", i, -1, n.xreplace({s: sp.Integer(-1)})))
    return {s: -rest[i] / slope[i][i] for i, s in enumerate(signs)}, guards


def attraction_guards(system: SwitchedField, sliding: Sequence[int], slopes: sp.Matrix) -> list[Guard]:
    """Return the principal minors of M that may become non-positive, without those implied by smaller minors.

    ``slopes``, shape (m, m), is -M. If the minor of all surfaces that act on each other falls through zero, the run
    ends ``nonunique``, since the determinant falls too; after any other minor it is undecided whether sliding attracts.
    """
    matrix = -slopes
    edges = [(i, j) for i in range(matrix.rows) for j in range(matrix.cols) if matrix[i, j] != 0]
    found = []
    for group in strongly_connected_components((range(matrix.rows), edges)):
        sizes = range(1, len(group) + 1) if len(group) <= EXHAUSTIVE else (1, len(group))
        for chosen in (c for few in sizes for c in combinations(sorted(group), few) if _joined(c, edges)):
            minor = determinant(system, matrix.extract(chosen, chosen))
            if not known_positive(system.numeric(minor)):
                ends: Refusal = "nonunique" if len(chosen) == len(group) else "none"
                found.append(Guard("attracts", sliding[chosen[0]], 0, minor, ends=ends))
    return found


def _joined(chosen: Sequence[int], edges: Iterable[tuple[int, int]]) -> bool:
    """Check whether surfaces are coupled without other surfaces; if not, their minor is a product of smaller ones."""
    inside = [(i, j) for i, j in edges if i in chosen and j in chosen]
    return len(strongly_connected_components((chosen, inside))) == 1


def _small(expressions: Sequence[sp.Expr], signs: Sequence[sp.Symbol]) -> Sequence[sp.Expr]:
    if is_longer(expressions, MAX_SIZE):
        raise _too_large(signs)
    return expressions


def _too_large(signs: Sequence[sp.Symbol]) -> ModelError:
    names = listed([s.name for s in signs])
    return ModelError(f"the equations of sliding on {names} are too large: more than {MAX_SIZE} operations")
