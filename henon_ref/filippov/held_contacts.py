"""Equations of modes in which several surfaces slide and some of them are held by static friction.

A contact that holds while none that slides acts on it moves as its ``sliding`` override says. Contacts that act on each
other at once hold by the loads that keep all of them: each surface's velocity is constant, which is a linear system for
the signs that stand for the loads (a load over the friction in sliding, so that it may be larger than 1). Static
friction limits the loads, not these signs: see :mod:`henon_ref.filippov.held_groups` and the literature named there.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import sympy as sp
from sympy.utilities.iterables import connected_components

from henon_ref.errors import ModelError
from henon_ref.filippov.affine import coefficients
from henon_ref.filippov.algebra import MAX_SIZE, expanded, simplified
from henon_ref.filippov.attraction import attraction_guards
from henon_ref.filippov.bounds import put
from henon_ref.filippov.equations import Guard, along
from henon_ref.filippov.linear_system import solution, surfaces_solved
from henon_ref.filippov.switched_field import SwitchedField
from henon_ref.taylor.size import total_size
from henon_ref.taylor.tape import TIME
from henon_ref.text import listed

DIGITS, AGREE = 40, sp.Float("1e-25")
"""Digits with which two forms of a field are compared, and how far apart they may be of their size."""


class Held(Protocol):
    """What is read of a ``sliding`` override."""

    @property
    def field(self) -> tuple[sp.Expr, ...]: ...

    @property
    def entry(self) -> str: ...


@dataclass(frozen=True)
class HeldField:
    """A field with the rates of held contacts put in."""

    field: tuple[sp.Expr, ...]
    on_surface: Mapping[sp.Symbol, sp.Expr]
    """States that the held contacts' surfaces settle."""
    signs: Mapping[sp.Symbol, sp.Expr]
    """What stands for the signs of surfaces that are decided here."""
    guards: tuple[Guard, ...]
    """Ends of slides without static friction that act on held contacts at once."""
    decided: frozenset[int]
    """Surfaces whose sliding is in the field."""


def held_field(
    system: SwitchedField,
    held: Mapping[int, Held],
    loads: Mapping[int, Sequence[sp.Expr]],
    sliding: Collection[int],
) -> HeldField:
    """The field with several contacts held, or one beside others that slide.

    Parameters
    ----------
    system : SwitchedField
    held : mapping
        Surface -> its override.
    loads : mapping
        Surface -> its release functions.
    sliding : collection of int
        All surfaces that slide, the held ones among them.

    Raises
    ------
    ModelError
        Where the loads of contacts that act on each other are not settled, or what one of them does is not what the
        balance of forces says.
    """
    _, on_surface = surfaces_solved(system, tuple(sorted(held)))
    slipping = tuple(put(rate, on_surface) for rate in system.field)
    stuck = {i: tuple(put(rate, on_surface) for rate in own.field) for i, own in held.items()}
    rates, guards, decided = list(slipping), [], set()
    signs: dict[sp.Symbol, sp.Expr] = {}
    for group in _groups(system, held, loads, slipping, stuck, sliding):
        if len(group) == 1:
            (i,) = group
            rates = [own if own != rate else kept for own, rate, kept in zip(stuck[i], slipping, rates, strict=True)]
        else:
            _check_balance(system, held, sliding, group)
            made = _Joint(system, group, frozenset(held))
            rates = [
                new if k in made.rows else kept for k, (new, kept) in enumerate(zip(made.field, rates, strict=True))
            ]
            on_surface = {**on_surface, **made.on_surface}
            signs |= made.signs
            guards += made.guards
        decided |= set(group)
    return HeldField(tuple(rates), on_surface, signs, tuple(guards), frozenset(decided))


def _groups(
    system: SwitchedField,
    held: Mapping[int, Held],
    loads: Mapping[int, Sequence[sp.Expr]],
    slipping: Sequence[sp.Expr],
    stuck: Mapping[int, Sequence[sp.Expr]],
    sliding: Collection[int],
) -> list[tuple[int, ...]]:
    """Sliding surfaces, parted into those that act on each other at once; groups with a held contact only."""
    rows: dict[int, set[int]] = {}
    for i in sliding:
        own = stuck.get(i, slipping)
        rows[i] = {k for k, rate in enumerate(slipping) if rate.has(system.signs[i]) or rate != own[k]}
    edges = []
    for i in held:
        moved = [e for k in rows[i] for e in (slipping[k], stuck[i][k])]
        for j in sliding:
            if j != i and (rows[i] & rows[j] or any(e.has(system.signs[j]) for e in (*moved, *loads[i]))):
                edges.append((i, j))
    parts = connected_components((sorted(sliding), edges))
    groups = [(tuple(sorted(part)), tuple(i for i in part if i in held)) for part in parts]
    # A body at rest stays where it is, whatever plain friction does to it: that slides beside it, in the field at rest.
    return [own if len(own) == 1 and held[own[0]].entry == "resting" else part for part, own in groups if own]


class _Joint:
    """Sliding of a group of surfaces that act on each other at once, some of them held."""

    def __init__(self, system: SwitchedField, group: tuple[int, ...], held: frozenset[int]) -> None:
        self.system, self.group = system, group
        symbols = [system.signs[i] for i in group]
        solved, self.on_surface = surfaces_solved(system, group)
        rates = tuple(put(rate, self.on_surface) for rate in system.field)
        scales = self._scales(rates, symbols)
        speeds = [expanded(put(along(system.surfaces[i], system.states, rates), self.on_surface)) for i in group]
        slopes = [coefficients(speed, symbols) for speed in speeds]
        if any(slope is None for slope in slopes):
            raise ModelError(f"signs that multiply each other where they slide together: {_names(system, group)}")
        none = dict.fromkeys(symbols, sp.S.Zero)
        # Unknown is what each contact adds to one rate: its factors, masses, are constant where the friction is not.
        matrix = [
            [simplified(slope.get(s, sp.S.Zero) / scales[s]) for s in symbols] for slope in slopes if slope is not None
        ]
        found = solution(system, matrix, [-speed.xreplace(none) for speed in speeds])
        if found is None:
            raise ModelError(f"the loads of contacts that hold together are not settled: {_names(system, group)}")
        self.signs = {s: value / scales[s] for s, value in zip(symbols, found, strict=True)}
        field = [put(rate, self.signs) for rate in rates]
        self.rows = {k for k, rate in enumerate(rates) if rate.has(*symbols)} | set(solved.values())
        for k in solved.values():
            x = system.states[k]
            if x in self.on_surface:  # its derivative needs no force, and keeps the surface exactly
                field[k] = along(self.on_surface[x], system.states, tuple(field))
        if total_size(field, MAX_SIZE) > MAX_SIZE:
            raise ModelError(f"the equations of contacts that hold together are too large: {_names(system, group)}")
        self.field = tuple(field)
        self.guards = self._plain(matrix, scales, held)

    def _scales(self, rates: Sequence[sp.Expr], symbols: Sequence[sp.Symbol]) -> dict[sp.Symbol, sp.Expr]:
        """For each sign its factor in the first rate that it acts on."""
        found: dict[sp.Symbol, sp.Expr] = {}
        for rate in rates:
            for s, factor in (coefficients(rate, [s for s in symbols if s not in found]) or {}).items():
                found[s] = factor
        if len(found) < len(symbols):
            lacking = [i for i, s in zip(self.group, symbols, strict=True) if s not in found]
            raise ModelError(
                "contacts that hold together need a friction in sliding, by whose place their loads are known: "
                + _names(self.system, lacking)
            )
        return found

    def _plain(
        self, matrix: Sequence[Sequence[sp.Expr]], scales: Mapping[sp.Symbol, sp.Expr], held: frozenset[int]
    ) -> list[Guard]:
        """Ends of the slides that are not held, at an equivalent sign of -1 or +1, and of their attraction."""
        plain = [i for i in self.group if i not in held]
        if not plain:
            return []
        signs = [self.system.signs[i] for i in plain]
        guards = [
            Guard("release", i, w, 1 - w * self.signs[s]) for i, s in zip(plain, signs, strict=True) for w in (1, -1)
        ]
        rows = [self.group.index(i) for i in plain]
        stuck = [k for k in range(len(self.group)) if k not in rows]
        whole = sp.Matrix(matrix)
        inner = whole.extract(stuck, stuck)
        reduced = whole.extract(rows, rows) - whole.extract(rows, stuck) * inner.inv() * whole.extract(stuck, rows)
        factors = sp.diag(*(scales[s] for s in signs))
        return guards + attraction_guards(self.system, plain, (reduced * factors).applyfunc(simplified))


def _check_balance(
    system: SwitchedField, held: Mapping[int, Held], sliding: Collection[int], group: Sequence[int]
) -> None:
    """Refuse a group in which an override does not do what the balance of forces says."""
    for i in group:
        if i in held and (held[i].entry != "inside" or not _balanced(system, i, held[i].field)):
            raise ModelError(
                "surfaces that act on each other at once, one with a 'sliding' override that is not what keeps its "
                f"surface, cannot slide together: {_names(system, sorted(sliding))}"
            )


@lru_cache(maxsize=256)
def _balanced(system: SwitchedField, index: int, field: tuple[sp.Expr, ...]) -> bool:
    """Whether an override's field is the slip field with the sign that keeps the surface, at a point of it."""
    made = _Joint(system, (index,), frozenset((index,)))
    symbols = sorted(set().union(*(e.free_symbols for e in (*made.field, *field))), key=str)
    numbers = {s: sp.Rational(sp.prime(k + 7), sp.prime(k + 17)) for k, s in enumerate(symbols)}
    numbers |= {TIME: sp.Rational(3, 7), **system.parameters}
    for own, derived in zip(field, made.field, strict=True):
        values = [sp.N(put(put(e, made.on_surface), numbers), DIGITS) for e in (own, derived)]
        if not abs(values[0] - values[1]) <= AGREE * (1 + abs(values[1])):
            return False
    return True


def _names(system: SwitchedField, surfaces: Collection[int]) -> str:
    return listed([system.sign_names[i] for i in surfaces])
