"""Loops of contacts: surfaces that depend on each other, and how much their contacts hold together.

Where two blocks touch a wall and each other, ``v_a``, ``v_b`` and ``v_a - v_b`` are zero at once: the surfaces h_i obey
relations, sum of c_i h_i = 0. The motion of bodies that all these contacts hold is settled, and the loads are not: a
load that goes round the loop, in proportion to c, moves nothing (statics calls them indeterminate). Held are the
contacts while *some* distribution of the loads has each within its limit. Loads q that balance the other forces are
q0 plus any combination of the relations; such a one with abs(q_i) <= limit_i exists if and only if

    abs(sum of y_i q0_i) <= sum of abs(y_i) limit_i

for every elementary vector y that is normal to the relations, one of which no other has a part of the non-zero entries
(Rockafellar, in *Combinatorial Mathematics and its Applications*, 1969, 104-127). Between bodies on a line these are
the cuts that part the bodies in two, and the theorem is Hoffman's on circulations (*Proc. Symp. Appl. Math.* 10 (1960)
113-127), the maximum flow being the minimum cut; y is the relative velocity at each contact as one part moves off, so
in mechanics it is the kinematic theorem of limit analysis (Drucker, Prager and Greenberg, *Q. Appl. Math.* 9 (1952)
381-389). Each cut has two guards, one a way. A contact in no loop is a cut by itself.

A stop that a body rests on is a contact whose velocity is h'. Its load, the reaction, has 0 for one limit and none the
other way, so that a cut which would move the body into the stop has no guard.
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
from henon_ref.modes.algebra import AGREE, expanded, sample, simplified
from henon_ref.modes.bounds import put
from henon_ref.modes.equations import Guard
from henon_ref.modes.switched_field import SwitchedField
from henon_ref.text import listed

SIDES = (1, -1)
Relation = Mapping[int, sp.Rational]
"""Surface -> its factor, not 0, in a sum that is zero at all times."""


@lru_cache(maxsize=1024)
def relations(system: SwitchedField, surfaces: tuple[int, ...]) -> tuple[Relation, ...]:
    """A basis of the relations among surfaces; the last surface of each is in no other, with the factor 1.

    Found are those with rational factors, of surfaces multiplied out; one that is zero at all times counts as none.
    """
    rows = {i: _terms(system, i) for i in surfaces}
    rows, left = {i: row for i, row in rows.items() if row}, -1
    while left != len(rows):  # a term that no other surface has
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
    """The terms of a surface with their factors; its expression itself where a factor is not rational."""
    surface = expanded(system.numeric(system.surfaces[index]))
    found = {term: factor for term, factor in surface.as_coefficients_dict().items() if factor != 0}
    return found if all(factor.is_Rational for factor in found.values()) else {surface: sp.S.One}


def independent(system: SwitchedField, surfaces: Sequence[int]) -> tuple[int, ...]:
    """Surfaces of which the others are combinations."""
    settled = {max(relation) for relation in relations(system, tuple(surfaces))}
    return tuple(i for i in surfaces if i not in settled)


@lru_cache(maxsize=1024)
def closed(system: SwitchedField, surfaces: frozenset[int], others: tuple[int, ...]) -> frozenset[int]:
    """Surfaces, with those of ``others`` that are zero wherever these are."""
    found = set(surfaces)
    for i in others:
        if i not in found and len(independent(system, sorted({*found, i}))) == len(independent(system, sorted(found))):
            found.add(i)
    return frozenset(found)


def loops(found: Sequence[Relation]) -> list[tuple[Relation, ...]]:
    """Relations, parted into those that have surfaces in common, directly or by way of each other."""
    edges = [(j, k) for j, k in combinations(range(len(found)), 2) if found[j].keys() & found[k].keys()]
    return [tuple(found[k] for k in sorted(part)) for part in connected_components((range(len(found)), edges))]


def cuts(loop: Sequence[Relation]) -> Iterator[dict[int, int]]:
    """Elementary vectors normal to the relations of a loop, each once, whole numbers without a common divisor."""
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
    """Relations of a loop of which no other has a part of the surfaces, each once, as those of :func:`cuts`."""
    surfaces = sorted(set().union(*loop))
    matrix = [[relation.get(i, sp.S.Zero) for i in surfaces] for relation in loop]
    normals = DomainMatrix.from_list_sympy(len(loop), len(surfaces), matrix).convert_to(sp.QQ).nullspace().to_Matrix()
    rows = (dict(zip(surfaces, normals.row(k), strict=True)) for k in range(normals.rows))
    yield from cuts([{i: factor for i, factor in row.items() if factor != 0} for row in rows])


def guard_count(system: SwitchedField, surfaces: Collection[int]) -> int:
    """Guards of the cuts of all loops of some surfaces, at most."""
    found = loops(relations(system, tuple(sorted(surfaces))))
    return sum(2 for loop in found for _ in cuts(loop))


def loop_ends(
    system: SwitchedField,
    found: Sequence[Relation],
    zones: Mapping[int, Sequence[Guard]],
    signs: Mapping[sp.Symbol, sp.Expr],
) -> dict[int, tuple[Guard, ...]]:
    """The ends of what contacts hold that are in loops, by surface: those of each cut beside its first contact.

    Parameters
    ----------
    system : SwitchedField
    found : sequence of Relation
    zones : mapping
        Surface -> the two ends of its hold zone, in signs of other surfaces; the one end of a rest.
    signs : mapping
        What stands for signs, in those of the surfaces that relations settle, which are free.

    Raises
    ------
    ModelError
        Where what goes round a loop is not in proportion to the relation, as forces and counterforces are.
    """
    guards: dict[int, tuple[Guard, ...]] = {}
    for loop in loops(found):
        ends = {i: _ends(system, i, zones) for i in sorted(set().union(*loop))}
        weights = _weights(system, loop, ends, signs)
        guards |= dict.fromkeys(ends, ())
        for cut in cuts(loop):
            first = min(cut, key=lambda i: (len(ends[i]) < len(SIDES), i))  # where there is one, not a rest
            for way in SIDES:
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
    """The end of a contact's hold zone for each sign that it is released into."""
    ends = {guard.to_sign: guard for guard in zones.get(index, ())}
    if len(zones.get(index, ())) != len(ends) or set(ends) not in ({-1, 1}, {1}):
        name = system.sign_names[index]
        raise ModelError(f"{name} is in a loop of contacts that hold together, and has not one end of its hold a way")
    return ends


def _weights(
    system: SwitchedField,
    loop: Sequence[Relation],
    ends: Mapping[int, Mapping[int, Guard]],
    signs: Mapping[sp.Symbol, sp.Expr],
) -> dict[int, sp.Expr]:
    """Unit in which each contact of a loop has its ends, relative to one of them: 1 where all are forces."""
    weights: dict[int, sp.Expr] = {}
    left = list(loop)
    while left:
        relation = next((r for r in left if any(i in weights for i in r)), left[0])
        left.remove(relation)
        free = system.signs[max(relation)]
        others = {system.signs[max(r)]: sp.S.Zero for r in loop if r is not relation}
        shares = {i: _share(system, ends[i], signs, free, others) / factor for i, factor in relation.items()}
        known = next((i for i in relation if i in weights), max(relation))
        unit = weights.setdefault(known, sp.S.One) / shares[known]
        for i, share in shares.items():
            weight = unit * share
            size, old = sample(system, (weight, weights.get(i, weight)))
            if not size > 0 or abs(size - old) > AGREE * size:
                names = listed([system.sign_names[k] for k in sorted(relation)])
                raise ModelError(f"what the contacts of the loop {names} carry is no force and counterforce: {weight}")
            weights[i] = sp.S.One if abs(size - 1) <= AGREE else simplified(weight)
    return weights


def _share(
    system: SwitchedField,
    ends: Mapping[int, Guard],
    signs: Mapping[sp.Symbol, sp.Expr],
    free: sp.Symbol,
    others: Mapping[sp.Symbol, sp.Expr],
) -> sp.Expr:
    """How much a contact's load grows with a free sign."""
    slopes = [-way * sp.diff(put(put(ends[way].expression, signs), dict(others)), free) for way in sorted(ends)]
    share, last = sample(system, (slopes[0], slopes[-1]))
    if abs(last - share) > AGREE * (1 + abs(share)) or share == 0:
        raise ModelError(f"{system.sign_names[ends[1].index]} does not carry what goes round the loop that it is in")
    return slopes[0]
