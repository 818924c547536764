"""Filippov systems: one expression with sign symbols, and the smooth equations of each of its modes.

A piecewise-smooth system is ``x' = f(t, x, s)`` with surfaces ``h_i(t, x) = 0`` and sign symbols
``s_i = sign(h_i)``; f is smooth in t and x for every value of s. See Filippov, *Differential Equations
with Discontinuous Righthand Sides* (1988), and Eqs. (6)-(8) of Olejnik and Awrejcewicz (2013).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.expressions.algebra import has_no_value, leaves_out
from henon_ref.expressions.bounds import put
from henon_ref.method_cache import cached_method
from henon_ref.modes.contact_loops import closed, independent, relations
from henon_ref.modes.equations import Guard, ModeEquations, Refusal
from henon_ref.modes.linear_system import solved_states
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.sliding import filippov_sliding
from henon_ref.modes.switched_field import SwitchedField
from henon_ref.precision import one_at_a_time
from henon_ref.taylor.tape import TIME

if TYPE_CHECKING:
    from henon_ref.modes.decoupled_contacts import SwitchedEquations

FEW_SURFACES = 3
"""Largest number of surfaces for which each mode has its own equations; above it, modes share one set."""


@dataclass(frozen=True, eq=False)
class FilippovSystem(SwitchedField):
    """``x' = f(t, x, s)`` with surfaces ``h_i(t, x)`` and sign symbols ``s_i``.

    ModelError from :meth:`equations`, if a mode has no equations (signs that multiply each other on an intersection,
    held contacts that act on each other without a solution).
    """

    written: Mapping[sp.Symbol, str] = dataclass_field(default_factory=dict)
    """State or sign -> the text of its rate or surface in the case file (empty for a scene)."""
    kinks: frozenset[int] = frozenset()
    """Surfaces of kinks or jumps written as such in the field (``abs``, ``piecewise`` ...)."""
    sections: tuple[sp.Expr, ...] = ()
    """Signs of surfaces whose text has kinks (``abs(x) - 1``), written with the signs of their kinks; these kinks are
    in use."""
    conditions: tuple[sp.Expr, ...] = ()
    """Expressions in the parameters that these equations require to be positive (``a`` if ``abs(a - x)`` meets ``x``);
    other values are refused, or have other equations."""
    effects: tuple[str, ...] = ()
    """Names of the effects of a scene (empty for a system without a scene)."""

    def equations(self, mode: Mode) -> ModeEquations:
        """Return the equations of one mode, with the signs of surfaces in slip replaced by -1 or +1."""
        return self.shared.equations(mode) if self.shared is not None else self._equations(mode)

    @cached_method
    def _equations(self, mode: Mode) -> ModeEquations:
        with one_at_a_time():
            shared = self.shared_equations(frozenset(i for i, s in enumerate(mode) if s == 0))
            slip = self.slip_signs(mode)
            made = ModeEquations(
                field=tuple(put(e, slip) for e in shared.field),
                guards=tuple(self._in_mode(guard, mode, slip) for guard in shared.guards),
                equivalent_signs={i: put(e, slip) for i, e in shared.equivalent_signs.items()},
            )
            if any(e.has(sp.zoo, sp.nan) for e in (*made.field, *(g.expression for g in made.guards))):
                raise ModelError("a contact that slides has no load in this mode, so no sign keeps it on its surface")
            return made

    def has_equations(self, mode: Mode) -> bool:
        try:
            return self.switched is not None or bool(self.equations(mode))
        except ModelError:
            return False

    def guards(self, mode: Mode) -> tuple[Guard, ...]:
        return self.switched.own_guards(mode) if self.switched is not None else self.equations(mode).guards

    @cached_method
    def hides(self, index: int, mode: Mode) -> bool:
        """Check whether the sign of a surface in slip is in no field, other guard or section of a mode."""
        if not mode[index]:
            return False
        if self.switched is not None:
            return self._hides_in_all(index, self.switched.sides(mode))
        sliding = frozenset(i for i, s in enumerate(mode) if s == 0)
        if not self.can_slide(sliding):
            return False
        shared = self.shared_equations(sliding)
        slip = {s: side for s, side in self.slip_signs(mode).items() if s != self.signs[index]}
        guards = [guard.expression for guard in shared.guards if guard.index != index or guard.kind != "surface"]
        return not any(put(e, slip).has(self.signs[index]) for e in (*shared.field, *guards, *self.sections))

    @cached_method
    def _hides_in_all(self, index: int, sides: Mode) -> bool:
        """Apply :meth:`hides` to the shared equations, given the sides of the surfaces on which nothing slides."""
        made = self.switched
        assert made is not None
        if index not in made.crossed:
            return False
        slip = {s: side for s, side in made.beside(sides).items() if s != self.signs[index]}
        guards = [e for k, e in enumerate(made.outputs) if k // 2 != index]
        written = (*made.field, *(e for _, e in made.definitions), *guards, *self.sections)
        return not any(put(e, slip).has(self.signs[index]) for e in written)

    @cached_method
    def unused_kinks(self, mode: Mode) -> frozenset[int]:
        """Return the kinks without effect in a mode that are undecided (``open_kinks``) or have no real value in it."""
        positive = [s * self.numeric(h) for h, s in zip(self.surfaces, mode, strict=True) if s and self.kinks]
        found = {i for i in self.kinks - self.open_kinks if has_no_value(self.numeric(self.surfaces[i]), positive)}
        return frozenset(i for i in found | self.open_kinks if self.hides(i, mode))

    def _in_mode(self, guard: Guard, mode: Mode, slip: Mapping[sp.Symbol, sp.Expr]) -> Guard:
        """Return a shared guard in one mode; it ends the run if kinks come into use beyond that have no value here."""
        if guard.kind != "surface":
            return replace(guard, expression=put(guard.expression, slip))
        unused, beyond = self.unused_kinks(mode), replaced(mode, guard.index, -mode[guard.index])
        if guard.index in unused:
            return replace(guard, to_sign=beyond[guard.index], expression=sp.S.One)
        ends: Refusal | None = None if unused <= self.unused_kinks(beyond) else "none"
        return replace(guard, to_sign=beyond[guard.index], expression=put(guard.expression, slip), ends=ends)

    @cached_method
    def common_equations(self, mode: Mode) -> tuple[Mode | frozenset[int], ModeEquations]:
        """Return the equations that a mode shares with other modes, with their key.

        These are the shared equations of its sliding surfaces, with symbols for the slip signs. If the shared equations
        or normal velocities contain operations of branches that the mode does not use, or if it has unused kinks, the
        mode shares nothing: the result is its own equations.
        """
        sliding = frozenset(i for i, s in enumerate(mode) if s == 0)
        shared = self.shared_equations(sliding)
        slip, own = self.slip_signs(mode), self.equations(mode)
        beside = [(self.normal_velocity(i), self.signs[i]) for i, entry in enumerate(mode) if entry]
        speeds = [speed for normal, s in beside for speed in (normal, normal.xreplace({s: -s}))]
        pairs = zip((*shared.of_signs, *speeds), (*own.of_signs, *(e.xreplace(slip) for e in speeds)), strict=True)
        alone = bool(self.unused_kinks(mode)) or any(leaves_out(*pair, slip, {TIME, *self.states}) for pair in pairs)
        return (mode, own) if alone else (sliding, shared)

    @cached_property
    def observed(self) -> frozenset[int]:
        """Sections: surfaces whose signs occur in no force, override or reset, so that no motion depends on them."""
        forces = [*self.field]
        for own in self.overrides.values():
            forces += [*own.field, *(end.when for end in own.release)]
        used = set().union(*(force.free_symbols for force in set(forces)))
        unused = (i for i, sign in enumerate(self.signs) if sign not in used)
        return frozenset(unused) - self.overrides.keys() - self.resets.keys()

    @cached_property
    def switched(self) -> SwitchedEquations | None:
        """One set of equations for all modes of many contacts; None for few surfaces or other systems."""
        if len(self.surfaces) <= FEW_SURFACES:
            return None
        from henon_ref.modes.coupled_contacts import coupled_equations  # few systems have many contacts
        from henon_ref.modes.decoupled_contacts import switched_equations

        return switched_equations(self) or coupled_equations(self)

    @property
    def shared(self) -> SwitchedEquations | None:
        """:attr:`switched` if its contacts do not act on each other, so that it gives a mode's own equations."""
        return None if self.switched is None or self.switched.coupled else self.switched

    @cached_method
    def shared_equations(self, sliding: frozenset[int]) -> ModeEquations:
        """Return the equations that all modes with this set of sliding surfaces share, with symbols for slip signs.

        A ``surface`` guard is then ``s_i h_i``; its ``to_sign``, ``-s_i``, depends on the mode and is 0 here.
        """
        overridden = sliding & set(self.overrides)
        releases: tuple[Guard, ...] = ()
        signs: dict[int, sp.Expr] = {}
        if not sliding:
            rhs = self.field
        elif overridden and len(sliding) == 1:
            (i,) = sliding
            rhs, releases = self.overrides[i].field, self.hold_guards(i)
        elif overridden:
            from henon_ref.modes.held_contacts import held_sliding

            rhs, releases, signs = held_sliding(self, self.with_reactions(self.reacting & overridden), sliding)
        elif any((i in sliding) != (j in sliding) for j, (i, _) in self.multiples.items()):
            raise ModelError("surfaces that are multiples of each other slide together or not at all")
        else:
            rhs, releases, signs = filippov_sliding(self, tuple(sorted(sliding)))
        outside = (i for i in range(len(self.surfaces)) if i not in sliding)
        surfaces = tuple(Guard("surface", i, 0, self.signs[i] * self.surfaces[i]) for i in outside)
        valid = tuple(Guard("valid", i, 0, e, ends="invalid") for i, e in enumerate(self.valid))
        return ModeEquations(tuple(rhs), surfaces + releases + valid, signs)

    def can_slide(self, surfaces: frozenset[int]) -> bool:
        try:
            self.shared_equations(surfaces)
        except ModelError:
            return False
        return True

    @cached_property
    def resting(self) -> frozenset[int]:
        """Surfaces on which a body can rest."""
        return frozenset(i for i in self.overrides if self.rests(i))

    @cached_property
    def reacting(self) -> frozenset[int]:
        """Surfaces whose forces act only at rest: reactions, and loads of held contacts without kinetic friction."""
        acting = set().union(*(rate.free_symbols for rate in self.field))
        held = {i for i, own in self.overrides.items() if self.held_inside(i) and own.push}
        return self.resting | {i for i in held if self.signs[i] not in acting}

    @cached_method
    def with_reactions(self, surfaces: frozenset[int]) -> SwitchedField:
        """Return the field with the forces of these surfaces' contacts as their signs.

        A surface on which a body can rest becomes its velocity h', and its sign the reaction, as an acceleration of h;
        the sign of any other surface becomes its load.
        """
        if not surfaces:
            return self
        signs = {i: self.signs[i] for i in sorted(surfaces)}
        off = {s: sp.Integer(self.rests(i)) for i, s in signs.items()}
        pushes = [(s, self.overrides[i].push) for i, s in signs.items()]
        rates = tuple(
            sp.Add(put(rate, off), *(push[k] * s for s, push in pushes if push[k] != 0))
            for k, rate in enumerate(self.field)
        )
        resting = self.resting & surfaces
        velocities = tuple(self.normal_velocity(i) if i in resting else h for i, h in enumerate(self.surfaces))
        return SwitchedField(self.states, self.signs, velocities, rates, self.parameters)

    @property
    def velocities(self) -> SwitchedField:
        """The field with all bodies that can rest as contacts, whose surfaces are velocities."""
        return self.with_reactions(self.resting)

    @cached_method
    def put_on(self, sliding: tuple[int, ...]) -> dict[int, int]:
        """Return the state that is put on each surface of a slide where it ends, for surfaces that determine one.

        A state that its surface holds constant does not leave it. A slide that the source gives stays as it is, and so
        do all slides while a body rests on a stop.
        """
        if any(self.rests(i) for i in sliding):
            return {}
        own = tuple(i for i in sliding if i not in self.overrides or self.held_inside(i))
        moving, solved = {TIME, *self.states}, solved_states(self, independent(self, own))
        return {i: k for i, k in solved.items() if self.surfaces[i].free_symbols & moving != {self.states[k]}}

    def together(self, index: int, sliding: Iterable[int]) -> frozenset[int]:
        """Return the surface and those of ``sliding`` that act on it, or on which it acts, also through each other.

        Surfaces act through the signs in each other's normal velocities and in the loads of held contacts. A surface
        with an ``attracting`` override acts on every surface.
        """
        found, left, more = {index}, set(sliding), {index}
        while more:
            left -= more
            more = left.intersection(chain.from_iterable(self._coupled[i] for i in more))
            found |= more
        return frozenset(found)

    def decided_together(self, guard: Guard, mode: Mode, sliding: Iterable[int]) -> bool:
        """Check whether the mode after a guard of ``mode`` depends on more than its own surface and side.

        No force jumps when an equivalent sign reaches -1 or +1, but a force jumps when static friction ends. A body
        that rests on a surface may leave it with this jump. If the field on the other side keeps the state on the
        surface, the slide goes on too.
        """
        if guard.kind not in ("surface", "release"):
            return False
        if guard.kind == "release" and self._kept_beyond(guard, mode):
            return True
        if self._coupled[guard.index] <= {guard.index} and not self.has_loops:
            return False
        others = self.in_play([guard.index], sliding) - {guard.index}
        return bool(others) and (
            guard.kind == "surface" or self.held_inside(guard.index) or any(map(self.rests, others))
        )

    def _kept_beyond(self, guard: Guard, mode: Mode) -> bool:
        """Check whether a slide's other end is zero at all times: the field there keeps the state on the surface."""
        contact = self.switched.contacts[guard.index] if self.switched is not None else None
        ends = self.equations(mode).guards if self.switched is None else () if contact is None else contact.ends
        others = (g for g in ends if g.kind == "release" and g.index == guard.index and g.to_sign != guard.to_sign)
        return guard.index not in self.overrides and any(self.numeric(g.expression) == 0 for g in others)

    def in_play(self, hit: Iterable[int], sliding: Iterable[int]) -> frozenset[int]:
        """Return the surfaces whose entries are to be decided when some are hit: these, and those that act on them."""
        hit, sliding = set(hit), set(sliding)
        zero = self.closed(hit, sliding)
        return frozenset(j for i in hit | (zero - sliding) for j in self.together(i, zero))

    def closed(self, hit: Collection[int], sliding: Collection[int]) -> frozenset[int]:
        """Return the surfaces that are hit or slide, with those in loops of contacts that are then zero as well.

        A surface that is hit with non-zero speed keeps no contact at rest.
        """
        zero = frozenset((*hit, *sliding))
        still = frozenset(i for i in zero if i in sliding or not self.rests(i))
        return zero | closed(self.velocities, still, self._in_loops) if self.has_loops else zero

    @property
    def has_loops(self) -> bool:
        """Whether surfaces of held contacts depend on each other or on rests."""
        return bool(self._in_loops)

    @cached_property
    def _in_loops(self) -> tuple[int, ...]:
        held = tuple(sorted(i for i in self.overrides if self.held_inside(i) or self.rests(i)))
        found = {i for relation in relations(self.velocities, held) for i in relation}
        return tuple(sorted(i for i in found if self.held_inside(i)))

    @cached_property
    def _coupled(self) -> tuple[frozenset[int], ...]:
        """For each surface, the surfaces that act on it or on which it acts."""
        places = {s: i for i, s in enumerate(self.signs)}
        beside: list[set[int]] = [set() for _ in places]
        unslid = self.with_reactions(self.reacting - self.resting)
        for i in range(len(self.surfaces)):
            loads = [g.expression for g in self.hold_guards(i)] if i in self.overrides else []
            symbols = unslid.normal_velocity(i).free_symbols.union(*(load.free_symbols for load in loads))
            own = i not in self.overrides or self.held_inside(i) or self.rests(i)
            for j in [places[s] for s in symbols & places.keys()] if own else range(len(self.surfaces)):
                beside[i].add(j)
                beside[j].add(i)
        return tuple(map(frozenset, beside))

    def entries_from(self, entry: int, index: int) -> tuple[int, ...]:
        """Return the possible next entries of a surface; a body does not pass through its stop."""
        if self.switched is not None and index in self.switched.crossed:
            return (-1, 1)
        return (0, 1) if entry >= 0 and self.rests(index) else (-1, 0, 1)
