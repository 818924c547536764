"""Equations of all modes in one set, and their derivation for contacts that do not act on each other.

With m surfaces there are 3^m modes. If every surface is x_k = r(t), each in a state of its own, and its sign acts only
on the rate of that state (blocks on a belt, each with its own dry friction), sliding on one surface replaces one rate
by dr/dt and leaves the other rates unchanged. One set of equations with switches then serves all modes: a rate is
``slip f + slide r'``, and the two guards of a surface are ``slip s h - slide N(+1)`` and ``slip + slide N(-1)``, where
N is dh/dt on the surface (Filippov's conditions, 1988, Sec. 2.10). For a contact with static friction, the two ends of
its hold zone replace ``-N(+1)`` and ``N(-1)``.

In addition to contacts there may be surfaces without sliding: sections, kinks, and jumps of a force that do not change
the rate of their own surface function. These surfaces have only two sides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

import sympy as sp

from henon_ref.expressions.algebra import leaves_out
from henon_ref.expressions.bounds import put
from henon_ref.method_cache import cached_method
from henon_ref.modes.equations import Guard, ModeEquations, by_pattern
from henon_ref.modes.mode import Mode
from henon_ref.modes.switched_field import SwitchedField
from henon_ref.taylor.tape import TIME

Entries = tuple[Mapping[sp.Symbol, sp.Expr], ...]
"""Substitutions for the sign and the two switches of a surface, for the entries -1, 0 and +1 in this order."""


def entries_of(signs: Sequence[sp.Symbol]) -> tuple[Entries, ...]:
    """Return the entries of each surface; a sliding surface's sign, +1, occurs only in terms that are switched off."""
    found = []
    for i, sign in enumerate(signs):
        slip, slide = (sp.Symbol(f"{name}_{i}", real=True) for name in ("slip", "slide"))
        values = ((sp.Integer(s or 1), sp.Integer(abs(s)), sp.Integer(1 - abs(s))) for s in (-1, 0, 1))
        found.append(tuple(dict(zip((sign, slip, slide), own, strict=True)) for own in values))
    return tuple(found)


@dataclass(frozen=True)
class Contact:
    """Part of the equations that belongs to one surface."""

    row: int
    """State on whose rate the sign acts."""
    slipping: sp.Expr
    """This rate in slip, with the sign."""
    sliding: sp.Expr
    """This rate in sliding, which keeps the surface."""
    ends: tuple[Guard, Guard]
    """Guards that end the sliding."""


@dataclass(frozen=True)
class SwitchedEquations:
    """Equations of every mode, in time, states, parameters and switches."""

    system: SwitchedField
    entries: tuple[Entries, ...]
    contacts: tuple[Contact | None, ...]
    """One per surface; None without sliding."""
    rates: tuple[sp.Expr, ...] = ()
    """x' of all states if the contacts act on each other."""
    definitions: tuple[tuple[sp.Symbol, sp.Expr], ...] = ()
    """Names in ``rates`` and in the ends of the contacts, with their expressions in earlier names."""

    @property
    def coupled(self) -> bool:
        """Whether contacts act on each other (:mod:`henon_ref.modes.coupled_contacts`)."""
        return bool(self.rates)

    @cached_property
    def crossed(self) -> frozenset[int]:
        """Surfaces without sliding."""
        return frozenset(i for i, contact in enumerate(self.contacts) if contact is None)

    @cached_property
    def field(self) -> tuple[sp.Expr, ...]:
        """x' of all states."""
        if self.coupled:
            return self.rates
        field = list(self.system.field)
        for own, contact in zip(self.entries, self.contacts, strict=True):
            if contact is not None:
                _, slip, slide = own[0]
                field[contact.row] = slip * contact.slipping + slide * contact.sliding
        return tuple(field)

    @cached_property
    def outputs(self) -> tuple[sp.Expr, ...]:
        """Two guards per surface, then the ``valid`` expressions; all positive inside a mode."""
        outputs: list[sp.Expr] = []
        for h, own, contact in zip(self.system.surfaces, self.entries, self.contacts, strict=True):
            sign, slip, slide = own[0]
            if contact is None:
                outputs += [sign * h, sp.S.One]
                continue
            first, second = (end.expression for end in contact.ends)
            outputs += [slip * sign * h - slide * (-first), slip + slide * second]
        return (*outputs, *self.system.valid)

    @cached_property
    def owner(self) -> Mapping[sp.Symbol, int]:
        """Sign or switch -> its surface."""
        return {symbol: i for i, own in enumerate(self.entries) for symbol in own[0]}

    @cached_property
    def _guards(self) -> tuple[Mapping[int, tuple[Guard, Guard]], ...]:
        """For each surface and entry, its two guards; in slip the second guard is constant."""
        found = []
        for i, (h, contact) in enumerate(zip(self.system.surfaces, self.contacts, strict=True)):
            never = Guard("release", i, -1, sp.S.One)
            slips = {s: (Guard("surface", i, -s, s * h), never) for s in (-1, 1)}
            found.append({**slips, 0: slips[1] if contact is None else contact.ends})
        return tuple(found)

    @cached_property
    def _valid(self) -> tuple[Guard, ...]:
        return tuple(Guard("valid", i, 0, e, ends="invalid") for i, e in enumerate(self.system.valid))

    def guards(self, mode: Mode) -> tuple[Guard, ...]:
        """Return the guards of a mode, one per output."""
        pairs = (own[entry] for own, entry in zip(self._guards, mode, strict=True))
        return (*chain.from_iterable(pairs), *self._valid)

    def rows(self, mode: Mode) -> list[int]:
        """Return the output that each guard of the mode's own equations is, in their order."""
        slips = [2 * i for i, entry in enumerate(mode) if entry]
        ends = [2 * i + k for i, entry in enumerate(mode) if not entry for k in (0, 1)]
        return [*slips, *ends, *range(2 * len(mode), len(self.outputs))]

    def places(self, mode: Mode) -> tuple[int, ...]:
        """Return the index of each of :meth:`guards` among the guards of the mode's own equations, or -1."""
        places = {row: place for place, row in enumerate(self.rows(mode))}
        return tuple(places.get(row, -1) for row in range(len(self.outputs)))

    def own_guards(self, mode: Mode) -> tuple[Guard, ...]:
        """Return the guards of the mode's own equations."""
        guards, sides = self.guards(mode), self.sides(mode)
        own = (guards[row] for row in self.rows(mode))
        if not sides:
            return tuple(own)
        beside = self.beside(sides)
        return tuple(replace(g, expression=put(g.expression, beside)) if g.kind == "release" else g for g in own)

    def sides(self, mode: Mode) -> Mode:
        """Return the entries of the surfaces without sliding."""
        return tuple(mode[i] for i in sorted(self.crossed))

    def beside(self, sides: Mode) -> dict[sp.Symbol, sp.Expr]:
        """Sign of each surface without sliding -> its entry."""
        return {self.system.signs[i]: sp.Integer(s) for i, s in zip(sorted(self.crossed), sides, strict=True)}

    def values(self, mode: Mode) -> dict[sp.Symbol, sp.Expr]:
        return {
            symbol: value for own, s in zip(self.entries, mode, strict=True) for symbol, value in own[s + 1].items()
        }

    def equations(self, mode: Mode) -> ModeEquations:
        """Return the equations of one mode.

        With the normal velocities N below and above, Filippov's equivalent sign is (N(-1) + N(+1)) / (N(-1) - N(+1)).
        """
        rates = tuple(self._rate(row, tuple(mode[i] for i in acting)) for row, acting in enumerate(self._acting))
        sides, slid = self.sides(mode), {i for i, s in enumerate(mode) if not s} - self.crossed
        signs = {i: self._equivalent_sign(i, sides) for i in sorted(slid - self.system.overrides.keys())}
        return ModeEquations(rates, self.own_guards(mode), signs)

    @cached_property
    def _acting(self) -> tuple[tuple[int, ...], ...]:
        """Surfaces whose signs or switches are in each row of the field."""
        owner = self.owner
        return tuple(tuple(sorted({owner[s] for s in rate.free_symbols & owner.keys()})) for rate in self.field)

    @cached_method
    def _rate(self, row: int, entries: Mode) -> sp.Expr:
        """Return a row of the field, given the entries of the surfaces that act on it."""
        pairs = zip(self._acting[row], entries, strict=True)
        return put(self.field[row], {s: value for i, entry in pairs for s, value in self.entries[i][entry + 1].items()})

    @cached_method
    def _equivalent_sign(self, index: int, sides: Mode) -> sp.Expr:
        contact = self.contacts[index]
        assert contact is not None  # something slides on the surface
        above, below = (end.expression / 2 for end in contact.ends)
        return put((below - above) / (below + above), self.beside(sides))


def switched_equations(system: SwitchedField) -> SwitchedEquations | None:
    """Return one set of equations for all modes; None if the surfaces act on each other or on several rates."""
    contacts: list[Contact | None] = []
    acting = acting_rows(system)
    for i in range(len(system.surfaces)):
        contact = _contact(system, i, acting[system.signs[i]])
        if contact is None and not is_crossed(system, i, acting[system.signs[i]]):
            return None
        contacts.append(contact)
    slid = {sign for sign, contact in zip(system.signs, contacts, strict=True) if contact is not None}
    own = [contact for contact in contacts if contact is not None]
    if not own or len({contact.row for contact in own}) < len(own):
        return None
    if any(len(contact.slipping.free_symbols & slid) != 1 for contact in own):
        return None
    if any(end.expression.free_symbols & slid for contact in own for end in contact.ends):
        return None
    beside = {sign for sign in system.signs if sign not in slid}
    if beside and any(_friction_changes(contact, slid, beside) for contact in own):
        return None
    return SwitchedEquations(system, entries_of(system.signs), tuple(contacts))


def _friction_changes(contact: Contact, slid: set[sp.Symbol], beside: set[sp.Symbol]) -> bool:
    """Check whether kinetic friction depends on the side of another surface; it may be zero on one side."""
    above, below = (put(contact.slipping, dict.fromkeys(slid, sp.Integer(side))) for side in (1, -1))
    return not sp.expand(above - below).free_symbols.isdisjoint(beside)


def acting_rows(system: SwitchedField) -> dict[sp.Symbol, list[int]]:
    """Return, for each sign, the rows of the field that contain it."""
    acting: dict[sp.Symbol, list[int]] = {sign: [] for sign in system.signs}
    for row, rate in enumerate(system.field):
        for symbol in rate.free_symbols & acting.keys():
            acting[symbol].append(row)
    return acting


def is_crossed(system: SwitchedField, index: int, acting: Sequence[int]) -> bool:
    """Check whether nothing slides on a surface, since no force jump changes the velocity normal to it.

    ``acting``: rows of the field that contain its sign.
    """
    h, sign = system.surfaces[index], system.signs[index]
    if index in system.overrides or system.open_kinks or _branching(h):
        return False
    loads = [end.expression for i in system.overrides for end in system.hold_guards(i)]
    rates = [system.field[row] for row in acting] + [load for load in loads if load.has(sign)]
    sides, moving = [{sign: sp.Integer(side)} for side in (-1, 1)], {TIME, *system.states}
    if any(leaves_out(rate, put(rate, side), side, moving) for rate in rates for side in sides):
        return False
    return not rates or system.normal_velocity(index).free_symbols.isdisjoint(system.signs)


def _contact(system: SwitchedField, index: int, acting: Sequence[int]) -> Contact | None:
    """Return a surface's part, or None; ``acting``: rows of the field with its sign."""
    h, sign, places = system.surfaces[index], system.signs[index], system.places
    row = _own_state(h, places)
    if row is None or acting != [row]:
        return None
    x, rate, override = system.states[row], system.field[row], system.overrides.get(index)
    ends, held = (Guard("release", index, 1, sp.S.Zero), Guard("release", index, -1, sp.S.Zero)), tuple[sp.Expr, ...]()
    if override is not None:
        if override.entry != "inside" or len(override.release) != 2:
            return None
        first, second = system.hold_guards(index)
        ends, held = (first, second), (override.field[row], first.expression, second.expression)
    moving = (s for s in sorted(rate.free_symbols, key=lambda symbol: symbol.name) if s in places)
    made = by_pattern(_in_slip_and_slide, h, x, sign, rate, sp.Tuple(*moving), *held)
    if made is None or (held and _moves_others(system, index, row, {x: sp.expand(x - h / sp.diff(h, x))})):
        return None
    speed, above, below = made
    return Contact(row, rate, speed, (replace(ends[0], expression=above), replace(ends[1], expression=below)))


def _in_slip_and_slide(
    h: sp.Expr, x: sp.Symbol, sign: sp.Symbol, rate: sp.Expr, moving: sp.Tuple, *held: sp.Expr
) -> tuple[sp.Expr, sp.Expr, sp.Expr] | None:
    """Return the rate that keeps a surface and the guards of its sliding; None if not the same in all modes.

    ``held``: rate and ends of static friction as written.
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
    """Check whether a rate has a value in every mode: no branch of its own, and no branch point on the surface."""
    sides = [{sign: sp.Integer(side)} for side in (-1, 1)]
    return not any(e.has(x) for e in _branching(rate)) and not any(
        leaves_out(rate, put(rate, side), side, moving) for side in sides
    )


def _branching(expression: sp.Expr) -> list[sp.Expr]:
    found = expression.atoms(sp.Pow, sp.log, sp.asin, sp.acos)
    return [e for e in found if not (e.is_Pow and e.exp.is_Integer)]


def _moves_others(system: SwitchedField, index: int, row: int, there: Mapping[sp.Symbol, sp.Expr]) -> bool:
    """Check whether an override moves states that the surface does not determine."""
    others = (pair for k, pair in enumerate(zip(system.overrides[index].field, system.field, strict=True)) if k != row)
    return any(kept != moved and put(kept, there) != put(moved, there) for kept, moved in others)


def _own_state(surface: sp.Expr, places: Mapping[sp.Symbol, int]) -> int | None:
    """Return the only state in a surface if the surface is linear in it with a constant factor; else None."""
    own = surface.free_symbols & places.keys()
    if len(own) != 1:
        return None
    (x,) = own
    slope = sp.diff(surface, x).free_symbols
    return None if TIME in slope or slope & places.keys() else places[x]
