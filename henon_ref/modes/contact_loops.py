"""Loops of contacts: surfaces that depend on each other, and the largest loads that their contacts hold together.

If two blocks touch a wall and each other, ``v_a``, ``v_b`` and ``v_a - v_b`` are zero together: the surfaces h_i
satisfy relations, sum of c_i h_i = 0. If all these contacts hold, the motion of the bodies is unique but the loads are
not: loads in proportion to c around the loop cause no acceleration (statically indeterminate). The contacts hold while
*some* distribution of the loads keeps each within its limit. The loads q that balance the other forces are q0 plus any
combination of the relations; one with abs(q_i) <= limit_i exists if and only if

    abs(sum of y_i q0_i) <= sum of abs(y_i) limit_i

for every elementary vector y normal to the relations, that is, a normal vector with minimal support (Rockafellar, in
*Combinatorial Mathematics and its Applications*, 1969, 104-127). For bodies on a line these vectors are the cuts that
separate the bodies into two sets, and the theorem is Hoffman's on circulations (*Proc. Symp. Appl. Math.* 10 (1960)
113-127), with maximum flow equal to minimum cut. y is the relative velocity at each contact as one set moves off, so in
mechanics this is the kinematic theorem of limit analysis (Drucker, Prager and Greenberg, *Q. Appl. Math.* 9 (1952)
381-389). Each cut has two guards, one per direction. A contact in no loop is a cut by itself.

A stop on which a body rests is a contact with velocity h'. Its load, the reaction, is limited by 0 in one direction and
unlimited in the other, so a cut that would move the body into the stop has no guard.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain, combinations

import sympy as sp
from sympy.polys.matrices import DomainMatrix
from sympy.utilities.iterables import connected_components

from henon_ref.errors import ModelError
from henon_ref.expressions.algebra import expanded, simplified
from henon_ref.expressions.bounds import put
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.modes.switched_field import AGREE, SwitchedField
from henon_ref.text import listed

Relation = Mapping[int, sp.Rational]
"""Surface -> its non-zero factor in a sum that is zero at all times."""


@lru_cache(maxsize=1024)
def relations(system: SwitchedField, surfaces: tuple[int, ...]) -> tuple[Relation, ...]:
    """Return a basis of the relations among surfaces; the last surface of each is in no other and has factor 1.

    Only relations with rational factors between expanded surfaces are found; a surface that is always zero is ignored.
    """
    rows = {i: _terms(system, i) for i in surfaces}
    rows, left = {i: row for i, row in rows.items() if row}, -1
    while left != len(rows):  # a surface with a term of its own is in no relation
        uses, left = Counter(chain.from_iterable(rows.values())), len(rows)
        rows = {i: row for i, row in rows.items() if all(uses[term] > 1 for term in row)}
    if not rows:
        return ()
    order = sorted(rows)
    terms = list(dict.fromkeys(term for row in rows.values() for term in row))
    matrix = [[rows[i].get(term, sp.S.Zero) for i in order] for term in terms]
    reduced, pivots = DomainMatrix.from_list_sympy(len(terms), len(order), matrix).convert_to(sp.QQ).rref()
    factors = reduced.to_Matrix()
    found = []
    for at, i in enumerate(order):
        if at not in pivots:
            own = {order[p]: -factors[row, at] for row, p in enumerate(pivots) if factors[row, at] != 0}
            found.append({**own, i: sp.S.One})
    return tuple(found)


def _terms(system: SwitchedField, index: int) -> dict[sp.Expr, sp.Rational]:
    """Return the terms of a surface with their factors; the surface as one term if a factor is not rational."""
    surface = expanded(system.numeric(system.surfaces[index]))
    found = {term: factor for term, factor in surface.as_coefficients_dict().items() if factor != 0}
    return found if all(factor.is_Rational for factor in found.values()) else {surface: sp.S.One}


def independent(system: SwitchedField, surfaces: Sequence[int]) -> tuple[int, ...]:
    """Return surfaces of which all other given surfaces are linear combinations."""
    settled = {max(relation) for relation in relations(system, tuple(surfaces))}
    return tuple(i for i in surfaces if i not in settled)


@lru_cache(maxsize=1024)
def closed(system: SwitchedField, surfaces: frozenset[int], others: tuple[int, ...]) -> frozenset[int]:
    """Return surfaces, together with those of ``others`` that are zero whenever these surfaces are."""
    found = set(surfaces)
    for i in others:
        if i not in found and len(independent(system, sorted({*found, i}))) == len(independent(system, sorted(found))):
            found.add(i)
    return frozenset(found)


def loops(found: Sequence[Relation]) -> list[tuple[Relation, ...]]:
    """Partition relations into loops: relations connected by common surfaces."""
    edges = [(j, k) for j, k in combinations(range(len(found)), 2) if found[j].keys() & found[k].keys()]
    return [tuple(found[k] for k in sorted(part)) for part in connected_components((range(len(found)), edges))]


def cuts(loop: Sequence[Relation]) -> Iterator[dict[int, int]]:
    """Yield the elementary vectors normal to the relations of a loop, as coprime integers, each once."""
    surfaces = sorted(set().union(*loop))
    known = set()
    for support in combinations(surfaces, len(loop) + 1):
        matrix = [[relation.get(i, sp.S.Zero) for i in support] for relation in loop]
        normal = DomainMatrix.from_list_sympy(len(loop), len(support), matrix).convert_to(sp.QQ).nullspace().to_Matrix()
        if normal.rows != 1:
            continue
        whole = normal / sp.gcd(list(normal))
        first = next(v for v in whole if v != 0)
        cut = {i: int(v * sp.sign(first)) for i, v in zip(support, whole, strict=True) if v != 0}
        key = tuple(cut.items())
        if key not in known:
            known.add(key)
            yield cut


def circuits(loop: Sequence[Relation]) -> Iterator[dict[int, int]]:
    """Yield the relations of a loop with minimal support, in the form of :func:`cuts`, each once."""
    surfaces = sorted(set().union(*loop))
    matrix = [[relation.get(i, sp.S.Zero) for i in surfaces] for relation in loop]
    normals = DomainMatrix.from_list_sympy(len(loop), len(surfaces), matrix).convert_to(sp.QQ).nullspace().to_Matrix()
    rows = (dict(zip(surfaces, normals.row(k), strict=True)) for k in range(normals.rows))
    yield from cuts([{i: factor for i, factor in row.items() if factor != 0} for row in rows])


def is_possible(system: SwitchedField, mode: Mode, surfaces: tuple[int, ...]) -> bool:
    """Check whether no relation among surfaces excludes their signs in a mode: states near the point have them."""
    for loop in loops(relations(system, surfaces)):
        for circuit in circuits(loop):
            sides = {factor * mode[i] > 0 for i, factor in circuit.items() if mode[i]}
            if len(sides) == 1:
                return False
    return True


def guard_count(system: SwitchedField, surfaces: Collection[int]) -> int:
    """Return an upper bound of the number of guards of the cuts of all loops of some surfaces."""
    found = loops(relations(system, tuple(sorted(surfaces))))
    return sum(2 for loop in found for _ in cuts(loop))


def loop_ends(
    system: SwitchedField,
    found: Sequence[Relation],
    zones: Mapping[int, Sequence[Guard]],
    signs: Mapping[sp.Symbol, sp.Expr],
) -> dict[int, tuple[Guard, ...]]:
    """Return the guards of contacts in loops, by surface: the guards of a cut are listed with its first contact.

    ``zones``: surface -> the two ends of its hold zone, in signs of other surfaces; one end for a rest. ``signs``: sign
    -> its expression in the signs of the surfaces that the relations ``found`` determine, which are free. ModelError if
    the loads around a loop are not in proportion to the relation, as action and reaction are.
    """
    guards: dict[int, tuple[Guard, ...]] = {}
    for loop in loops(found):
        ends = {i: _ends(system, i, zones) for i in sorted(set().union(*loop))}
        weights = _weights(system, loop, ends, signs)
        guards |= dict.fromkeys(ends, ())
        for cut in cuts(loop):
            first = min(cut, key=lambda i: (len(ends[i]) < 2, i))  # a rest only if all are rests
            for way in (1, -1):
                sides = {i: way if y > 0 else -way for i, y in cut.items()}
                if any(side not in ends[i] for i, side in sides.items()):
                    continue
                order = sorted(sides, key=lambda i: (i != first, i))
                parts = [abs(y) * ends[i][sides[i]].expression / weights[i] for i, y in cut.items()]
                end = replace(
                    ends[first][sides[first]], expression=sp.Add(*parts), cut=tuple((i, sides[i]) for i in order)
                )
                guards[first] += (end,)
    return guards


def _ends(system: SwitchedField, index: int, zones: Mapping[int, Sequence[Guard]]) -> dict[int, Guard]:
    """Return the end of a contact's hold zone for each sign into which it is released."""
    ends = {guard.to_sign: guard for guard in zones.get(index, ())}
    if len(zones.get(index, ())) != len(ends) or set(ends) not in ({-1, 1}, {1}):
        name = system.sign_names[index]
        raise ModelError(
            f"{name} is in a loop of contacts that hold together: it requires one end of its hold zone per direction"
        )
    return ends


def _weights(
    system: SwitchedField,
    loop: Sequence[Relation],
    ends: Mapping[int, Mapping[int, Guard]],
    signs: Mapping[sp.Symbol, sp.Expr],
) -> dict[int, sp.Expr]:
    """Return the unit of each contact's ends, relative to one contact of the loop: 1 if all are forces."""
    weights: dict[int, sp.Expr] = {}
    left = list(loop)
    while left:
        relation = next((r for r in left if any(i in weights for i in r)), left[0])
        left.remove(relation)
        free, shares = system.signs[max(relation)], dict[int, sp.Expr]()
        others = {system.signs[max(r)]: sp.S.Zero for r in loop if r is not relation}
        for i, factor in relation.items():  # slopes of the loads in the free sign
            slopes = [
                -way * sp.diff(put(put(end.expression, signs), others), free) for way, end in sorted(ends[i].items())
            ]
            share, last = system.sample((slopes[0], slopes[-1]))
            if abs(last - share) > AGREE * (1 + abs(share)) or share == 0:
                raise ModelError(f"{system.sign_names[i]} does not carry the load around its loop of contacts")
            shares[i] = slopes[0] / factor
        known = next((i for i in relation if i in weights), max(relation))
        unit = weights.setdefault(known, sp.S.One) / shares[known]
        for i, share in shares.items():
            weight = unit * share
            size, old = system.sample((weight, weights.get(i, weight)))
            if not size > 0 or abs(size - old) > AGREE * size:
                names = listed([system.sign_names[k] for k in sorted(relation)])
                raise ModelError(f"the loads of the contacts of the loop {names} are not action and reaction: {weight}")
            weights[i] = sp.S.One if abs(size - 1) <= AGREE else simplified(weight)
    return weights
