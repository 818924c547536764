"""The mode after an event, decided in ball arithmetic: the one mode whose own field keeps it.

The rule is that of :mod:`henon_ref.filippov.switching`; the arithmetic is not. A point carries radii (what the
precision leaves open), and a derivative is positive, negative or *zero to the precision*, where its ball holds
zero: a tie within that radius counts as exact.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import sympy as sp
from flint import arb

from henon_ref.errors import ModelError
from henon_ref.filippov.decision import Decision, ended, explained, without_indeterminate
from henon_ref.filippov.equations import Guard
from henon_ref.filippov.exact_numbers import exact_sign
from henon_ref.filippov.held_groups import (
    IDENTICALLY_ZERO,
    Broken,
    Numbers,
    by_groups,
    decide_groups,
    order_of,
    slipped_by,
)
from henon_ref.filippov.modes import Mode, mode_text, replaced
from henon_ref.filippov.resting import unless_into_surface
from henon_ref.filippov.staying import staying_mode
from henon_ref.filippov.system import FilippovSystem
from henon_ref.harness.truth.multiprecision import series
from henon_ref.taylor.tape import TIME

FIRST_ORDERS = (1, 3)
"""Orders of the guards' series that are tried before the highest: in nearly all events the first one tells."""
LeadingTerm = tuple[int, int] | None
"""(index, sign) of a guard's first Taylor coefficient that is not zero; None: none found."""


@dataclass(frozen=True)
class Point:
    """Time and state, with the radii to which they are known."""

    time: arb
    state: tuple[arb, ...]


class ModeSelection:
    """Decides modes of one system at one precision.

    Parameters
    ----------
    system : FilippovSystem
    bits : int
        Precision of the exact numbers in its equations.
    """

    def __init__(self, system: FilippovSystem, bits: int) -> None:
        self.system = system
        self.bits = bits
        self._normals = [system.numeric(system.normal_velocity(i)) for i in range(len(system.surfaces))]

    def initial_mode(self, start: sp.Expr, initial: Sequence[sp.Expr], given: Mapping[int, int]) -> Decision:
        """Mode at the start; which surfaces it lies on is decided from exact numbers."""
        system = self.system
        sides = self.sides(start, initial, system.surfaces)
        for i, sign in given.items():
            if sides[i] not in (0, sign):
                return Decision("invalid", None, f"the start is not on the surface of {system.signs[i]}")
        for expression, sign in zip(system.valid, self.sides(start, initial, system.valid), strict=True):
            if sign < 0:
                return Decision("invalid", None, f"the model does not hold at the start: {expression} < 0")
        mode = tuple(given.get(i, sign) for i, sign in enumerate(sides))
        active = tuple(i for i, sign in enumerate(sides) if sign == 0 and i not in given)
        if not active:
            return Decision("unique", mode)
        point = Point(self._exact(start), tuple(self._exact(v) for v in initial))
        return self._outside(point, self._decide(point, mode, active), active)

    def sides(self, start: sp.Expr, initial: Sequence[sp.Expr], expressions: Sequence[sp.Expr]) -> list[int]:
        """Signs of expressions at an exact start."""
        at = {TIME: start, **dict(zip(self.system.states, initial, strict=True))}
        return [exact_sign(self.system.numeric(e).subs(at, simultaneous=True)) for e in expressions]

    def after_event(self, point: Point, mode: Mode, hits: Sequence[Guard], *, touched: bool = False) -> Decision:
        """Mode after the guards ``hits`` of ``mode`` fell to zero at a point, or ``touched`` it and turned."""
        refused = ended(self.system, mode, hits, _short(point))
        if refused is not None:
            return refused
        sliding = [i for i, s in enumerate(mode) if s == 0]
        alone = len(hits) == 1 and hits[0].kind == "release" and not touched
        if alone and not self.system.decided_together(hits[0], sliding):
            # The equivalent sign reaches +-1 continuously, so nothing else changes (an override says where to).
            return Decision("unique", replaced(mode, hits[0].index, hits[0].to_sign))
        active = self.system.in_play([g.index for g in hits], sliding)
        slipped = frozenset[int]() if touched else slipped_by(self.system, hits)
        return self._decide(point, mode, tuple(sorted(active)), slipped)

    def mode_by_signs(self, point: Point, sides: Sequence[int], valid: Sequence[int]) -> Decision:
        """The mode at a point where the surfaces, and the ``valid`` expressions, have these signs; 0: it is on one."""
        for expression, sign in zip(self.system.valid, valid, strict=True):
            if sign <= 0:
                reason = f"the model does not hold after the reset at t = {_short(point)}: {expression} <= 0"
                return Decision("invalid", None, reason)
        on = tuple(i for i, side in enumerate(sides) if side == 0)
        return (
            self._outside(point, self._decide(point, tuple(sides), on), on) if on else Decision("unique", tuple(sides))
        )

    def _outside(self, point: Point, decision: Decision, on: Sequence[int]) -> Decision:
        """A decision, unless the state moves into a surface that resets it."""
        return unless_into_surface(decision, self.system, on, partial(self._sign_at, point), _short(point))

    def _sign_at(self, point: Point, expression: sp.Expr) -> int:
        """Sign of an expression in time and states at a point."""
        return series.sign(self.values_of((expression,), point)[0])

    def leading_terms(self, point: Point, mode: Mode, active: frozenset[int]) -> list[LeadingTerm] | None:
        """What each guard of a mode does first, just after a point; None where its field is not finite.

        Parameters
        ----------
        active : frozenset of int
            Surfaces that the point is on, whatever rounding says.
        """
        guards = self.system.equations(mode).guards
        first = [1 if g.kind == "surface" and g.index in active else 0 for g in guards]
        found: list[LeadingTerm] = []
        for order in (*FIRST_ORDERS, series.ORDER):
            try:
                expansions = self._expansions(point, mode, order)
            except (ZeroDivisionError, ValueError):  # python-flint's words for a series that does not exist
                return None
            if not all(c[0].is_finite() and c[1].is_finite() for c in expansions):
                return None
            found = [series.leading(c, k) for c, k in zip(expansions, first, strict=True)]
            if None not in found:
                break
        return found

    def guard_series(self, point: Point, mode: Mode) -> list[list[arb]]:
        """Taylor coefficients in time of a mode's guards; ZeroDivisionError or ValueError where there are none."""
        return self._expansions(point, mode)

    def values_of(self, expressions: Sequence[sp.Expr], point: Point) -> list[arb]:
        """Expressions in time and states at a point."""
        frozen, outputs = [sp.Integer(0)] * len(point.state), [self.system.numeric(e) for e in expressions]
        states = self.system.states
        return [c[0] for c in series.along(frozen, outputs, states, point.time, point.state, bits=self.bits, order=0)]

    def values(self, point: Point, mode: Mode) -> list[arb]:
        """Values of a mode's guards at the middle of a point (balls drop digits below their radius)."""
        middle = Point(point.time.mid(), tuple(v.mid() for v in point.state))
        return [c[0] for c in self._expansions(middle, mode, order=0)]

    def _exact(self, number: sp.Expr) -> arb:
        return series.exact_ball(number, self.bits)

    def _expansions(self, point: Point, mode: Mode, order: int = series.ORDER) -> list[list[arb]]:
        system, equations = self.system, self.system.equations(mode)
        field = [system.numeric(f) for f in equations.field]
        outputs = [system.numeric(g.expression) for g in equations.guards]
        return series.along(field, outputs, system.states, point.time, point.state, bits=self.bits, order=order)

    def _decide(
        self, point: Point, mode: Mode, active: tuple[int, ...], slipped: frozenset[int] = frozenset()
    ) -> Decision:
        decision = self._decided(point, mode, active, slipped)
        if decision.status == "none" and not by_groups(self.system, active):
            staying, same = partial(self._staying, point, active=active), partial(self._same_motion, point)
            decision = staying_mode(self.system, mode, active, staying, same, f"at t = {_short(point)}") or decision
        return decision if decision.mode is not None else explained(decision, self.system, mode, active)

    def _decided(self, point: Point, mode: Mode, active: tuple[int, ...], slipped: frozenset[int]) -> Decision:
        if by_groups(self.system, active):
            return self._decided_in_groups(point, mode, active, slipped)
        found = []
        for choice in product(*(self.system.entries_from(mode[i], i) for i in active)):
            candidate = mode
            for index, value in zip(active, choice, strict=True):
                candidate = replaced(candidate, index, value)
            if self._violations(point, candidate, active) == ():
                found.append(candidate)
        if len(found) > 1:
            found = without_indeterminate(found, active, lambda mode, i: self._indeterminate(point, mode, i))
        if len(found) == 1:
            return Decision("unique", found[0])
        if not found:
            return Decision("none", None, f"no mode is consistent at t = {_short(point)}")
        modes = " or ".join(mode_text(m, self.system.sign_names) for m in found)
        return Decision("nonunique", None, f"the future is not unique at t = {_short(point)}: {modes}")

    def _decided_in_groups(
        self, point: Point, mode: Mode, active: tuple[int, ...], slipped: frozenset[int]
    ) -> Decision:
        numbers = Numbers(
            partial(self._finite_values, point),
            lambda value, size: bool(value < 0),
            partial(self._broken, point),
            partial(self._same_motion, point),
            _short(point),
        )
        try:
            return decide_groups(self.system, mode, active, slipped, numbers)
        except ModelError as error:
            return Decision("none", None, str(error))

    def _finite_values(self, point: Point, expressions: tuple[sp.Expr, ...], signs: Mode) -> list[arb] | None:
        """Expressions in time, states and signs at a point; None where they are not finite."""
        entries = {s: sp.Integer(v) for s, v in zip(self.system.signs, signs, strict=True)}
        values = self._at(point, [self.system.numeric(e).xreplace(entries) for e in expressions])
        return values if all(value.is_finite() for value in values) else None

    def _broken(self, point: Point, mode: Mode, active: Collection[int]) -> Broken | None:
        """Guards of contacts in groups that do not hold just after a point; None where the mode has no equations."""
        system = self.system
        try:
            terms = self.leading_terms(point, mode, frozenset(active))
        except ModelError:
            return None
        if terms is None:
            return None
        broken = []
        for guard, term in zip(system.equations(mode).guards, terms, strict=True):
            i = guard.index
            if guard.ends or i not in active:
                continue
            if guard.kind == "release" and i in system.overrides and not (system.held_inside(i) or system.rests(i)):
                if not self._attracts(point, mode, i) and (term is None or term[1] <= 0):
                    broken.append((guard, 0))
            elif (term is None and guard.kind == "surface") or (term is not None and term[1] < 0):
                broken.append((guard, IDENTICALLY_ZERO if term is None else order_of(system, guard, term[0])))
        return broken

    def _at(self, point: Point, expressions: Sequence[sp.Expr]) -> list[arb]:
        """Values of expressions in time and states at a point."""
        frozen, states = [sp.Integer(0)] * len(self.system.states), self.system.states
        found = series.along(frozen, expressions, states, point.time, point.state, bits=self.bits, order=0)
        return [c[0] for c in found]

    def _indeterminate(self, point: Point, mode: Mode, index: int) -> bool:
        """Whether no end of a slide on a surface is anything but zero, so far as its derivatives tell."""
        terms = self.leading_terms(point, mode, frozenset((index,)))
        guards = self.system.equations(mode).guards
        assert terms is not None
        ends = [h for g, h in zip(guards, terms, strict=True) if g.kind == "release" and g.index == index]
        return index not in self.system.overrides and all(term is None for term in ends)

    def _violations(self, point: Point, mode: Mode, active: Sequence[int]) -> tuple[Guard, ...] | None:
        """Guards of the mode that do not hold just after the point; None where the mode has no equations."""
        try:
            terms = self.leading_terms(point, mode, frozenset(active))
        except ModelError:
            return None
        if terms is None:
            return None
        own = {i for i in active if mode[i] == 0 and i in self.system.overrides}
        off = {i for i in active if mode[i] != 0 and self.system.rests(i)}
        # No slip starts where a body rests.
        if any(self._sticks(point, mode, i) for i in off) or not all(self._sticks(point, mode, i) for i in own):
            return None
        broken = []
        for guard, term in zip(self.system.equations(mode).guards, terms, strict=True):
            if guard.ends or guard.index not in active or guard.index in own:
                continue
            # A surface that is never left is no slip; an equivalent sign that stays at its limit still holds.
            holds = guard.kind == "release" if term is None else term[1] > 0
            if not holds:
                broken.append(guard)
        return tuple(broken)

    def _staying(self, point: Point, mode: Mode, active: Sequence[int]) -> frozenset[int] | None:
        """Surfaces that a slip does not leave, where nothing else keeps the mode out; else None."""
        broken = self._violations(point, mode, active)
        if broken is None:
            return None
        terms = self.leading_terms(point, mode, frozenset(active))
        assert terms is not None
        guards = self.system.equations(mode).guards
        left = {g for g, term in zip(guards, terms, strict=True) if g.kind != "surface" or term is not None}
        return None if left & set(broken) else frozenset(guard.index for guard in broken)

    def _same_motion(self, point: Point, first: Mode, second: Mode) -> bool:
        """Whether two modes have the same motion from a point, so far as its derivatives tell."""
        states = self.system.states
        motions = (
            series.along(field, states, states, point.time, point.state, bits=self.bits)
            for field in ([self.system.numeric(f) for f in self.system.equations(m).field] for m in (first, second))
        )
        return all(a.overlaps(b) for one, other in zip(*motions, strict=True) for a, b in zip(one, other, strict=True))

    def _sticks(self, point: Point, mode: Mode, index: int) -> bool:
        """Whether a surface whose sliding is overridden is slid on from a point."""
        return self._rests(point, mode, index) if self.system.rests(index) else self._attracts(point, mode, index)

    def _rests(self, point: Point, mode: Mode, index: int) -> bool:
        """Whether a body on a surface stays there: off it, h would neither rise at once nor fall with a speed."""
        free = replaced(mode, index, 1)
        terms = self.leading_terms(point, free, frozenset((index,)))
        own = zip(self.system.equations(free).guards, terms or (), strict=False)
        term = next((term for g, term in own if g.kind == "surface" and g.index == index), (1, -1))
        return term is None or (term[0] > 1 and term[1] < 0)

    def _attracts(self, point: Point, mode: Mode, index: int) -> bool:
        """Whether both fields point at a surface, or along it."""
        system = self.system
        below, above = (
            self._normals[index].xreplace({s: sp.Integer(v) for s, v in zip(system.signs, side, strict=True)})
            for side in (replaced(mode, index, -1), replaced(mode, index, 1))
        )
        speeds = self._at(point, [below, above])
        return series.sign(speeds[0]) >= 0 and series.sign(speeds[1]) <= 0


def _short(point: Point) -> str:
    return point.time.str(17, radius=False)
