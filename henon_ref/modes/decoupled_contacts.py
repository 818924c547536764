"""Equations of all modes at once, and those of contacts that do not act on each other.

With m surfaces there are 3^m modes. Where every surface is x_k = r(t), each in a state of its own, and its sign
acts on that state's rate alone (blocks on a belt, each with its own dry friction), sliding on one of them
replaces one rate by dr/dt and leaves the others as they are. So one set of equations serves all modes, with
numbers that switch: a rate is ``slip f + slide r'``, and a surface's two guards are ``slip s h - slide N(+1)``
and ``slip + slide N(-1)``, N being dh/dt on the surface (Filippov's conditions, 1988, Sec. 2.10). Of a contact with
static friction the two ends of its hold zone stand in the place of ``-N(+1)`` and ``N(-1)``.

Beside contacts there may be surfaces on which nothing slides: sections, and those at which a force has a kink or jumps
that changes no speed on them. They have no more than their sides.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Protocol

import sympy as sp

from henon_ref.modes.bounds import put
from henon_ref.modes.branches import leaves_out
from henon_ref.modes.equations import Guard, ModeEquations, along
from henon_ref.modes.mode import Mode
from henon_ref.modes.overrides import SlidingOverride
from henon_ref.modes.patterns import by_pattern
from henon_ref.taylor.tape import TIME


class Contacts(Protocol):
    """What is read of a Filippov system."""

    @property
    def states(self) -> tuple[sp.Symbol, ...]: ...

    @property
    def signs(self) -> tuple[sp.Symbol, ...]: ...

    @property
    def surfaces(self) -> tuple[sp.Expr, ...]: ...

    @property
    def field(self) -> tuple[sp.Expr, ...]: ...

    @property
    def valid(self) -> tuple[sp.Expr, ...]: ...

    @property
    def overrides(self) -> Mapping[int, SlidingOverride]: ...

    @property
    def open_kinks(self) -> frozenset[int]: ...

    def hold_guards(self, index: int) -> tuple[Guard, ...]:
        """The release guards of a surface's override."""
        ...


@dataclass(frozen=True)
class ModeIndicators:
    """The symbols that one surface's entry of the mode sets."""

    sign: sp.Symbol
    slip: sp.Symbol
    slide: sp.Symbol

    def values(self, entry: int) -> dict[sp.Symbol, sp.Expr]:
        """Their values; a sliding surface's own sign then only stands in terms that are switched off."""
        return {
            self.sign: sp.Integer(entry or 1),
            self.slip: sp.Integer(abs(entry)),
            self.slide: sp.Integer(1 - abs(entry)),
        }


@dataclass(frozen=True)
class Contact:
    """One surface's part of the equations."""

    row: int
    """The state whose rate its sign acts on."""
    slipping: sp.Expr
    """That rate in slip, with the sign."""
    sliding: sp.Expr
    """The rate that keeps the surface."""
    ends: tuple[Guard, Guard]
    """Ends of its sliding."""


@dataclass(frozen=True)
class SwitchedEquations:
    """Equations of every mode, in time, states, parameters and switches."""

    system: Contacts
    switches: tuple[ModeIndicators, ...]
    """One a surface."""
    contacts: tuple[Contact | None, ...]
    """None for a surface on which nothing slides."""
    rates: tuple[sp.Expr, ...] = ()
    """x' of all states, where the contacts act on each other."""
    definitions: tuple[tuple[sp.Symbol, sp.Expr], ...] = ()
    """Names in it, and in the ends of the contacts' slides, and what they stand for: each in names before it."""

    @property
    def coupled(self) -> bool:
        """Whether contacts act on each other (:mod:`henon_ref.modes.coupled_contacts`)."""
        return bool(self.rates)

    @cached_property
    def crossed(self) -> frozenset[int]:
        """Surfaces on which nothing slides."""
        return frozenset(i for i, contact in enumerate(self.contacts) if contact is None)

    def sides(self, mode: Mode) -> dict[sp.Symbol, sp.Expr]:
        """What a mode puts for their signs."""
        return {self.system.signs[i]: sp.Integer(mode[i]) for i in self.crossed}

    @cached_property
    def field(self) -> tuple[sp.Expr, ...]:
        """x' of all states."""
        if self.coupled:
            return self.rates
        field = list(self.system.field)
        for own, contact in zip(self.switches, self.contacts, strict=True):
            if contact is not None:
                field[contact.row] = own.slip * contact.slipping + own.slide * contact.sliding
        return tuple(field)

    @cached_property
    def outputs(self) -> tuple[sp.Expr, ...]:
        """Two guards a surface, then the ``valid`` expressions; positive inside a mode."""
        outputs: list[sp.Expr] = []
        for h, own, contact in zip(self.system.surfaces, self.switches, self.contacts, strict=True):
            if contact is None:
                outputs += [own.sign * h, sp.S.One]
                continue
            first, second = (end.expression for end in contact.ends)
            outputs += [own.slip * own.sign * h - own.slide * (-first), own.slip + own.slide * second]
        return (*outputs, *self.system.valid)

    @cached_property
    def entries(self) -> tuple[tuple[Mapping[sp.Symbol, sp.Expr], ...], ...]:
        """For every surface what its entry -1, 0 or +1 (in this order) puts for its switches."""
        return tuple(tuple(own.values(s) for s in (-1, 0, 1)) for own in self.switches)

    @cached_property
    def owner(self) -> Mapping[sp.Symbol, int]:
        """Switch -> its surface."""
        return {symbol: i for i, own in enumerate(self.switches) for symbol in (own.sign, own.slip, own.slide)}

    def guards(self, mode: Mode) -> tuple[Guard, ...]:
        """What each output stands for in a mode; a surface in slip has no second guard, its output stays at 1."""
        pairs = (own[entry] for own, entry in zip(self._pairs, mode, strict=True))
        return (*chain.from_iterable(pairs), *self._valid)

    @cached_property
    def _pairs(self) -> tuple[Mapping[int, tuple[Guard, Guard]], ...]:
        """For each surface and entry its two guards."""
        found = []
        for i, contact in enumerate(self.contacts):
            first, second = self.outputs[2 * i : 2 * i + 2]
            slips = {s: (Guard("surface", i, -s, first), Guard("release", i, -1, second)) for s in (-1, 1)}
            if contact is None:
                found.append({**slips, 0: slips[1]})
                continue
            above, below = contact.ends
            found.append({**slips, 0: (replace(above, expression=first), replace(below, expression=second))})
        return tuple(found)

    @cached_property
    def _valid(self) -> tuple[Guard, ...]:
        return tuple(Guard("valid", i, 0, e, ends="invalid") for i, e in enumerate(self.system.valid))

    def places(self, mode: Mode) -> tuple[int, ...]:
        """Where each of :meth:`guards` stands among those of the mode's own equations; -1 where it does not."""
        slips, slides = 0, 0
        found = []
        count = sum(map(abs, mode))
        for entry in mode:
            found += [slips, -1] if entry else [count + 2 * slides, count + 2 * slides + 1]
            slips, slides = slips + abs(entry), slides + 1 - abs(entry)
        return (*found, *(count + 2 * slides + k for k in range(len(self.outputs) - 2 * len(mode))))

    def rows(self, mode: Mode) -> list[int]:
        """Of the guards of the mode's own equations, in their order, the place among the outputs."""
        return [row for _, row in sorted((place, row) for row, place in enumerate(self.places(mode)) if place >= 0)]

    def values(self, mode: Mode) -> dict[sp.Symbol, sp.Expr]:
        """What a mode puts for the switches."""
        return {symbol: value for i, s in enumerate(mode) for symbol, value in self.entries[i][s + 1].items()}

    def equations(self, mode: Mode) -> ModeEquations:
        """Equations of one mode, put together from those of its contacts."""
        field, held, sides = list(self.system.field), self.system.overrides, self.sides(mode)
        for i, (entry, contact) in enumerate(zip(mode, self.contacts, strict=True)):
            if contact is not None:
                field[contact.row] = self._slipping[i][entry] if entry else contact.sliding
        signs = {i: self._equivalent_sign(i) for i, entry in enumerate(mode) if not entry and i not in held}
        if sides:
            field, signs = [put(rate, sides) for rate in field], {i: put(e, sides) for i, e in signs.items()}
        return ModeEquations(tuple(field), self.own_guards(mode), signs)

    def _equivalent_sign(self, index: int) -> sp.Expr:
        """Filippov's, by the normal velocities N below and above: (N(-1) + N(+1)) / (N(-1) - N(+1))."""
        if index not in self._equivalent_signs:
            contact = self.contacts[index]
            assert contact is not None
            above, below = (end.expression / 2 for end in contact.ends)
            self._equivalent_signs[index] = (below - above) / (below + above)
        return self._equivalent_signs[index]

    @cached_property
    def _equivalent_signs(self) -> dict[int, sp.Expr]:
        return {}

    def own_guards(self, mode: Mode) -> tuple[Guard, ...]:
        """Their guards."""
        slips = (self._leaving[i][entry] for i, entry in enumerate(mode) if entry)
        held = (own for entry, own in zip(mode, self.contacts, strict=True) if not entry and own is not None)
        ends: Iterable[Guard] = chain.from_iterable(own.ends for own in held)
        if sides := self.sides(mode):
            ends = (replace(end, expression=put(end.expression, sides)) for end in ends)
        return (*slips, *ends, *self._valid)

    @cached_property
    def _leaving(self) -> tuple[Mapping[int, Guard], ...]:
        """For each surface its guard on either side."""
        surfaces = enumerate(self.system.surfaces)
        return tuple({s: Guard("surface", i, -s, s * h) for s in (-1, 1)} for i, h in surfaces)

    @cached_property
    def _slipping(self) -> tuple[Mapping[int, sp.Expr], ...]:
        """For each surface the rate in slip either way."""
        pairs = zip(self.system.signs, self.contacts, strict=True)
        return tuple(
            {s: put(contact.slipping, {sign: sp.Integer(s)}) for s in (-1, 1)} if contact is not None else {}
            for sign, contact in pairs
        )


def switched_equations(system: Contacts) -> SwitchedEquations | None:
    """One set of equations for all modes; None where the surfaces act on each other or on several rates."""
    contacts: list[Contact | None] = []
    acting = acting_rows(system)
    places = {x: row for row, x in enumerate(system.states)}
    for i in range(len(system.surfaces)):
        contact = _contact(system, i, acting[system.signs[i]], places)
        if contact is None and not is_crossed(system, i, acting[system.signs[i]]):
            return None
        contacts.append(contact)
    slid = {sign for sign, contact in zip(system.signs, contacts, strict=True) if contact is not None}
    own = [contact for contact in contacts if contact is not None]
    if len({contact.row for contact in own}) < len(own) or any(
        len(contact.slipping.free_symbols & slid) != 1 for contact in own
    ):
        return None
    if not own or any(end.expression.free_symbols & slid for contact in own for end in contact.ends):
        return None
    beside = {sign for sign in system.signs if sign not in slid}
    if beside and any(_friction_changes(contact, slid, beside) for contact in own):
        return None
    return SwitchedEquations(system, indicators(system.signs), tuple(contacts))


def _friction_changes(contact: Contact, slid: set[sp.Symbol], beside: set[sp.Symbol]) -> bool:
    """Whether friction in sliding depends on the side of another surface: on one it may be none, and no sign holds."""
    above, below = (put(contact.slipping, dict.fromkeys(slid, sp.Integer(side))) for side in (1, -1))
    return not sp.expand(above - below).free_symbols.isdisjoint(beside)


def acting_rows(system: Contacts) -> dict[sp.Symbol, list[int]]:
    """Of each sign the rows of the field that hold it."""
    acting: dict[sp.Symbol, list[int]] = {sign: [] for sign in system.signs}
    for row, rate in enumerate(system.field):
        for symbol in rate.free_symbols & acting.keys():
            acting[symbol].append(row)
    return acting


def is_crossed(system: Contacts, index: int, acting: Sequence[int]) -> bool:
    """Whether nothing slides on a surface, which is seen on both sides of it: no force changes the speed with which it
    is reached, or it acts on none. ``acting``: rows of the field that hold its sign."""
    h, sign = system.surfaces[index], system.signs[index]
    if index in system.overrides or system.open_kinks or _branching(h):
        return False
    loads = [end.expression for i in system.overrides for end in system.hold_guards(i)]
    rates = [system.field[row] for row in acting] + [load for load in loads if load.has(sign)]
    sides, moving = [{sign: sp.Integer(side)} for side in (-1, 1)], {TIME, *system.states}
    if any(leaves_out(rate, put(rate, side), side, moving) for rate in rates for side in sides):
        return False
    return not rates or along(h, system.states, system.field).free_symbols.isdisjoint(system.signs)


def indicators(signs: Sequence[sp.Symbol]) -> tuple[ModeIndicators, ...]:
    """The symbols that the entries of a mode set, one set a surface."""
    return tuple(
        ModeIndicators(s, sp.Symbol(f"slip_{i}", real=True), sp.Symbol(f"slide_{i}", real=True))
        for i, s in enumerate(signs)
    )


def _contact(system: Contacts, index: int, acting: Sequence[int], places: Mapping[sp.Symbol, int]) -> Contact | None:
    """A surface's part, if it has one; ``acting``: the rows of the field that hold its sign, ``places``: of states."""
    h, sign = system.surfaces[index], system.signs[index]
    row = _own_state(h, places)
    if row is None or acting != [row]:
        return None
    x, rate, held = system.states[row], system.field[row], ()
    if index in system.overrides:
        ends = _two_ends(system, index)
        if ends is None:
            return None
        held = system.overrides[index].field[row], *(end.expression for end in ends)
    moving = (s for s in sorted(rate.free_symbols, key=str) if s in places)
    made = by_pattern(_in_slip_and_slide, h, x, sign, rate, sp.Tuple(*moving), *held)
    if made is None:
        return None
    speed, first, second = made
    if not held:
        return Contact(row, rate, speed, (Guard("release", index, 1, first), Guard("release", index, -1, second)))
    if _moves_others(system, index, row, {x: sp.expand(x - h / sp.diff(h, x))}):
        return None
    return Contact(row, rate, speed, (replace(ends[0], expression=first), replace(ends[1], expression=second)))


def _in_slip_and_slide(
    h: sp.Expr, x: sp.Symbol, sign: sp.Symbol, rate: sp.Expr, moving: sp.Tuple, *held: sp.Expr
) -> tuple[sp.Expr, sp.Expr, sp.Expr] | None:
    """The rate that keeps a surface, and the two ends of its slide; None where these are not those of all modes.

    ``held``: of static friction, the rate and the ends as they are written.
    """
    if not common_to_all(rate, x, sign, {TIME, *moving}):
        return None
    slope = sp.diff(h, x)
    there = sp.expand(x - h / slope)
    speed = sp.diff(there, TIME)
    if held:
        kept, first, second = (put(e, {x: there}) for e in held)
        return None if sp.expand(kept - speed) != 0 else (speed, first, second)
    normal = sp.expand(slope * (rate.xreplace({x: there}) - speed), deep=False)
    beyond, before = (normal.xreplace({sign: sp.Integer(side)}) for side in (1, -1))
    return speed, -beyond, before


def common_to_all(rate: sp.Expr, x: sp.Symbol, sign: sp.Symbol, moving: set[sp.Symbol]) -> bool:
    """Whether a rate has values in every mode: no branch of its own, nor a branch point that the surface may be on."""
    sides = [{sign: sp.Integer(side)} for side in (-1, 1)]
    return not any(e.has(x) for e in _branching(rate)) and not any(
        leaves_out(rate, put(rate, side), side, moving) for side in sides
    )


def _branching(expression: sp.Expr) -> list[sp.Expr]:
    """Its parts that have branch points."""
    found = expression.atoms(sp.Pow, sp.log, sp.asin, sp.acos)
    return [e for e in found if not (e.is_Pow and e.exp.is_Integer)]


def _two_ends(system: Contacts, index: int) -> tuple[Guard, Guard] | None:
    """Ends of what static friction holds."""
    ends = system.hold_guards(index)
    return (ends[0], ends[1]) if system.overrides[index].entry == "inside" and len(ends) == 2 else None


def _moves_others(system: Contacts, index: int, row: int, there: Mapping[sp.Symbol, sp.Expr]) -> bool:
    """Whether an override moves other states than the surface does."""
    others = (pair for k, pair in enumerate(zip(system.overrides[index].field, system.field, strict=True)) if k != row)
    return any(kept != moved and put(kept, there) != put(moved, there) for kept, moved in others)


def _own_state(surface: sp.Expr, places: Mapping[sp.Symbol, int]) -> int | None:
    """The one state of a surface that is linear in it with a constant factor."""
    own = surface.free_symbols & places.keys()
    if len(own) != 1:
        return None
    (x,) = own
    slope = sp.diff(surface, x).free_symbols
    return None if TIME in slope or slope & places.keys() else places[x]
