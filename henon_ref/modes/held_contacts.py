"""Equations of modes in which several surfaces slide and static friction holds some of them.

A held contact on which no sliding surface acts moves as its ``sliding`` override states. Contacts that act on each
other at one instant are held by the loads that keep all of their surfaces: the velocity of each surface is constant, a
linear system for the signs. The sign of a held contact is its load over its kinetic friction and may exceed 1, since
static friction limits the loads, not the signs (:mod:`henon_ref.modes.held_groups`, with literature). A body at rest on
a stop is one more contact of its group: its velocity is h', its sign is the reaction, which must not become negative.
If surfaces depend on each other, the system has many solutions with one motion. The solution used gives zero load to
contacts whose surfaces follow from other surfaces; :mod:`henon_ref.modes.contact_loops` has the limits.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import combinations

import sympy as sp
from sympy.utilities.iterables import connected_components

from henon_ref.errors import ModelError
from henon_ref.expressions.algebra import MAX_SIZE, coefficients, expanded, simplified
from henon_ref.expressions.bounds import put
from henon_ref.expressions.traversal import is_longer
from henon_ref.modes.contact_loops import independent, loop_ends, relations
from henon_ref.modes.equations import Guard, along
from henon_ref.modes.linear_system import solution, surfaces_solved
from henon_ref.modes.sliding import attraction_guards, filippov_sliding
from henon_ref.modes.switched_field import AGREE, SwitchedField
from henon_ref.text import listed


def held_sliding(
    system: SwitchedField, reacting: SwitchedField, sliding: frozenset[int]
) -> tuple[tuple[sp.Expr, ...], tuple[Guard, ...], dict[int, sp.Expr]]:
    """Return the field with several contacts held, or with one contact held while other surfaces slide.

    ``reacting``: the system with bodies at rest as contacts; ``sliding``: all surfaces that slide, held ones included.
    The guards end the sliding; equivalent signs are those of the surfaces without static friction.

    ModelError if the loads of coupled contacts have no unique solution, or if a ``sliding`` override contradicts the
    balance of forces.
    """
    held = sorted(i for i in sliding if i in system.overrides)
    _, on_surface = surfaces_solved(system, independent(system, held))
    slipping = tuple(put(rate, on_surface) for rate in system.field)
    stuck = {i: tuple(put(rate, on_surface) for rate in system.overrides[i].field) for i in held}
    field, guards, decided = list(slipping), list[Guard](), set[int]()
    signs: dict[sp.Symbol, sp.Expr] = {}
    ends = {i: system.hold_guards(i) for i in held}
    for group in _groups(system, slipping, stuck, sliding):
        decided |= set(group)
        if len(group) == 1:
            (i,) = group
            field = [own if own != rate else kept for own, rate, kept in zip(stuck[i], slipping, field, strict=True)]
            continue
        own = [i for i in group if i in stuck]
        if not all(_balanced(system, i) for i in own):
            raise ModelError(
                "surfaces that act on each other cannot slide together if a 'sliding' override among them "
                f"contradicts the balance of forces on its surface: {_names(system, sorted(sliding))}"
            )
        made = _Joint(reacting, group, frozenset(held))
        ends |= _with_reactions(system, reacting, own)
        field = [made.field[k] if k in made.rows else kept for k, kept in enumerate(field)]
        if any(map(system.rests, own)):  # a body at rest stays where it is, to the last bit
            field = [put(rate, made.on_surface) for rate in field]
        on_surface = {**on_surface, **made.on_surface}
        signs |= made.signs
        guards += made.guards
        ends |= made.loop_ends(ends)
    equivalent = {i: signs[system.signs[i]] for i in sorted(decided.difference(held))}
    if others := tuple(sorted(sliding - decided)):
        field, more, found = _slides_beside(system, field, others, held)
        guards, equivalent = [*guards, *more], equivalent | found
    known = signs | {system.signs[i]: sign for i, sign in equivalent.items()}
    limits = [guard for zone in ends.values() for guard in zone]
    releases = [replace(g, expression=put(put(g.expression, on_surface), known)) for g in limits]
    return tuple(field), tuple(sorted(releases + guards, key=lambda g: (g.kind == "attracts", g.index))), equivalent


def _slides_beside(
    system: SwitchedField, field: Sequence[sp.Expr], others: tuple[int, ...], held: Collection[int]
) -> tuple[list[sp.Expr], tuple[Guard, ...], dict[int, sp.Expr]]:
    """Return Filippov's sliding on surfaces that do not act on the ``held`` contacts, whose field is given."""
    if any(system.multiples[j][0] not in others for j in others if j in system.multiples):
        raise ModelError("a surface that is a multiple of one with a 'sliding' override cannot slide with it")
    rested = [system.overrides[i].field for i in held if system.rests(i)]
    still = {k for own in rested for k, rate in enumerate(own) if rate != system.field[k]}
    made, guards, signs = filippov_sliding(replace(system, field=tuple(field)), others, still)
    return list(made), guards, signs


def _groups(
    system: SwitchedField,
    slipping: Sequence[sp.Expr],
    stuck: Mapping[int, Sequence[sp.Expr]],
    sliding: Collection[int],
) -> list[tuple[int, ...]]:
    """Partition the sliding surfaces into groups that act on each other at one instant; keep those with a held contact.

    ``slipping``, ``stuck``: rates of all states in slip, and with a contact held.
    """
    rows: dict[int, set[int]] = {}
    for i in sliding:
        own = stuck.get(i, slipping)
        rows[i] = {k for k, rate in enumerate(slipping) if rate.has(system.signs[i]) or rate != own[k]}
        if system.rests(i):  # its reaction may act although no force presses it alone
            rows[i] |= {k for k, push in enumerate(system.overrides[i].push) if push != 0}
    plain = [i for i in sorted(sliding) if i not in stuck]
    edges = [(i, j) for i, j in combinations(plain, 2) if rows[i] & rows[j]]
    for i in stuck:
        moved = [e for k in rows[i] for e in (slipping[k], stuck[i][k])]
        loads = [guard.expression for guard in system.hold_guards(i)]
        for j in sliding:
            if j != i and (rows[i] & rows[j] or any(e.has(system.signs[j]) for e in (*moved, *loads))):
                edges.append((i, j))
    parts = connected_components((sorted(sliding), edges))
    groups = [(tuple(sorted(part)), tuple(i for i in part if i in stuck)) for part in parts]
    # Friction without hold does not move a body at rest: such a slide is derived from the field at rest, not jointly.
    return [own if len(own) == 1 and system.rests(own[0]) else part for part, own in groups if own]


def _with_reactions(
    system: SwitchedField, reacting: SwitchedField, held: Sequence[int]
) -> dict[int, tuple[Guard, ...]]:
    """Return the guards of a group's limits, with the loads that the signs of contacts acting only at rest add."""
    sliding = set().union(*(rate.free_symbols for rate in system.field))
    own = {i: system.signs[i] for i in held if system.overrides[i].push}
    signs = {i: s for i, s in own.items() if system.rests(i) or s not in sliding}
    ends: dict[int, tuple[Guard, ...]] = {}
    for i in held:
        zone, inertia = system.hold_guards(i), system.overrides[i].inertia
        if system.rests(i):
            ends[i] = tuple(replace(guard, expression=reacting.signs[i]) for guard in zone)
            continue
        others = [s for j, s in signs.items() if j != i]
        added = sp.Add(*(f * s for s, f in (coefficients(reacting.normal_velocity(i), others) or {}).items()))
        if added == 0:
            continue
        if inertia is None:
            raise ModelError(
                f"the effect of the reaction on a body at rest on the load of {reacting.sign_names[i]} is unknown: "
                "its 'sliding' override does not give it"
            )
        ends[i] = tuple(replace(end, expression=end.expression - end.to_sign * inertia * added) for end in zone)
    return ends


class _Joint:
    """Sliding of a group of surfaces that act on each other at one instant, some of them held."""

    def __init__(self, system: SwitchedField, group: tuple[int, ...], held: frozenset[int]) -> None:
        self.system, self.group = system, group
        self.relations = relations(system, group)
        self.own = independent(system, group)
        symbols = [system.signs[i] for i in self.own]
        solved, self.on_surface = surfaces_solved(system, self.own)
        rates = tuple(put(rate, self.on_surface) for rate in system.field)
        scales = self._scales(rates, symbols)
        speeds = [expanded(put(along(system.surfaces[i], system.states, rates), self.on_surface)) for i in self.own]
        slopes = [coefficients(speed, symbols) for speed in speeds]
        if any(slope is None for slope in slopes):
            raise ModelError(f"the signs of surfaces that slide together multiply each other: {_names(system, group)}")
        none = dict.fromkeys(symbols, sp.S.Zero)
        # The unknowns are the contributions of the contacts to one rate each: their factors, masses, are constant even
        # if the friction is not.
        matrix = [
            [simplified(slope.get(s, sp.S.Zero) / scales[s]) for s in symbols] for slope in slopes if slope is not None
        ]
        found = solution(system, matrix, [-speed.xreplace(none) for speed in speeds])
        if found is None:
            raise ModelError(f"the loads of contacts that hold together are not determined: {_names(system, group)}")
        self.shared = {s: value / scales[s] for s, value in zip(symbols, found, strict=True)}
        self.signs = self._without_loop_loads(rates)
        field = [put(rate, self.signs) for rate in rates]
        signs = [system.signs[i] for i in group]
        self.rows = {k for k, rate in enumerate(rates) if rate.has(*signs)} | set(solved.values())
        for k in solved.values():
            x = system.states[k]
            if x in self.on_surface:  # its derivative needs no force, and keeps the surface exactly
                field[k] = along(self.on_surface[x], system.states, tuple(field))
        if is_longer(field, MAX_SIZE):
            raise ModelError(f"the equations of contacts that hold together are too large: {_names(system, group)}")
        self.field = tuple(field)
        self.guards = self._plain(matrix, scales, held)

    def _without_loop_loads(self, rates: Sequence[sp.Expr]) -> dict[sp.Symbol, sp.Expr]:
        """Return signs in which the contacts whose surfaces follow from the other surfaces carry no load."""
        if not self.relations:
            return self.shared
        free = [self.system.signs[max(relation)] for relation in self.relations]
        none = dict.fromkeys(free, sp.S.Zero)
        found = {s: put(value, none) for s, value in self.shared.items()} | none
        moved = self.system.sample([put(rate, self.shared) - put(rate, found) for rate in rates])
        sizes = self.system.sample([put(rate, found) for rate in rates])
        if any(abs(change) > AGREE * (1 + abs(size)) for change, size in zip(moved, sizes, strict=True)):
            raise ModelError(
                "contacts that hold together in a loop have more than one motion: " + _names(self.system, self.group)
            )
        return found

    def loop_ends(self, zones: Mapping[int, Sequence[Guard]]) -> dict[int, tuple[Guard, ...]]:
        """Return the guards of the limits of contacts in loops, each listed with one of its contacts."""
        if not self.relations:
            return {}
        there = {i: [replace(g, expression=put(g.expression, self.on_surface)) for g in zones[i]] for i in zones}
        return loop_ends(self.system, self.relations, there, self.shared)

    def _scales(self, rates: Sequence[sp.Expr], symbols: Sequence[sp.Symbol]) -> dict[sp.Symbol, sp.Expr]:
        """Return, for each sign, its factor in the first rate on which it acts."""
        found: dict[sp.Symbol, sp.Expr] = {}
        for rate in rates:
            for s, factor in (coefficients(rate, [s for s in symbols if s not in found]) or {}).items():
                found[s] = factor
        if len(found) < len(symbols):
            lacking = [i for i, s in zip(self.own, symbols, strict=True) if s not in found]
            raise ModelError(
                "contacts that hold together require kinetic friction, which shows where their loads act: "
                + _names(self.system, lacking)
            )
        return found

    def _plain(
        self, matrix: Sequence[Sequence[sp.Expr]], scales: Mapping[sp.Symbol, sp.Expr], held: frozenset[int]
    ) -> list[Guard]:
        """Return the guards of the slides that are not held: equivalent sign at -1 or +1, and attraction."""
        plain = [i for i in self.own if i not in held]
        if not plain:
            return []
        signs = [self.system.signs[i] for i in plain]
        guards = [
            Guard("release", i, w, 1 - w * self.signs[s]) for i, s in zip(plain, signs, strict=True) for w in (1, -1)
        ]
        rows = [self.own.index(i) for i in plain]
        stuck = [k for k in range(len(self.own)) if k not in rows]
        whole = sp.Matrix(matrix)
        inner = whole.extract(stuck, stuck)
        reduced = whole.extract(rows, rows) - whole.extract(rows, stuck) * inner.inv() * whole.extract(stuck, rows)
        factors = sp.diag(*(scales[s] for s in signs))
        return guards + attraction_guards(self.system, plain, (reduced * factors).applyfunc(simplified))


@lru_cache(maxsize=256)
def _balanced(system: SwitchedField, index: int) -> bool:
    """Check at a sample point whether an override agrees with the balance of forces that keeps its surface."""
    own = system.overrides[index]
    if own.push:
        return True
    if own.entry != "inside":
        return False
    made = _Joint(system, (index,), frozenset((index,)))
    count = len(own.field)
    values = system.sample([put(e, made.on_surface) for e in (*own.field, *made.field)])
    pairs = zip(values[:count], values[count:], strict=True)
    return all(abs(kept - derived) <= AGREE * (1 + abs(derived)) for kept, derived in pairs)


def _names(system: SwitchedField, surfaces: Collection[int]) -> str:
    return listed([system.sign_names[i] for i in surfaces])
