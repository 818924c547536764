"""Consistent modes at one point, decided on balls: by strict signs, exact zeros, or not at all."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import sympy as sp
from flint import arb, ctx

from henon_ref.enclosure.balls import enclose, proves_zero, sign_of
from henon_ref.enclosure.contact_proof import is_proven
from henon_ref.enclosure.enclosure import UndecidedError
from henon_ref.enclosure.model import ModeModel, SystemModel, solve_for_states
from henon_ref.errors import ModelError
from henon_ref.expressions.algebra import up_to_a_number
from henon_ref.modes.equations import Guard, Refusal
from henon_ref.modes.held_groups import Broken, Numbers, by_groups, decide_groups, order_of
from henon_ref.modes.mode import Mode, mode_text, replaced

ORDER = 6
"""Highest derivative examined for the sign of a guard."""


@dataclass(frozen=True)
class Entry:
    """A mode to enter, and the exact zeros of its guards there."""

    mode: Mode
    zeros: tuple[int, ...]
    """For every guard, the number of its leading Taylor coefficients that are exactly zero at the entry."""


class EndedError(Exception):
    """The run provably ends here: a property of the problem, not of the precision."""

    def __init__(self, reason: str, ended: Refusal) -> None:
        super().__init__(reason)
        self.reason = reason
        self.ended = ended


@dataclass(frozen=True)
class Identities:
    """Expressions that are exactly zero at a point, solved for states if possible."""

    values: Mapping[sp.Symbol, sp.Expr]
    unsolved: tuple[sp.Expr, ...] = ()
    """Further expressions that are zero but not linear in a state."""

    @classmethod
    def of(cls, zeros: Sequence[sp.Expr], states: Sequence[sp.Symbol]) -> Identities:
        values: dict[sp.Symbol, sp.Expr] = {}
        unsolved: list[sp.Expr] = []
        for zero in zeros:
            solved = solve_for_states([_substituted(zero, values)], states)
            if solved:
                values[states[solved[0].index]] = solved[0].value
            else:
                unsolved.append(_substituted(zero, values))
        return cls(values, tuple(unsolved))

    def vanishes(self, expression: sp.Expr) -> bool:
        """Check whether an expression is proven to be zero at the point."""
        rest = _substituted(expression, self.values)
        return proves_zero(rest) or any(
            proves_zero(rest - z) or proves_zero(rest + z) or _without_factor(rest) == _without_factor(z)
            for z in self.unsolved
        )


def _substituted(expression: sp.Expr, values: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    for _ in range(len(values)):
        expression = expression.xreplace(dict(values))
    return expression


def _without_factor(expression: sp.Expr) -> sp.Expr:
    """Drop a constant factor, by which a reaction and the acceleration that lifts its body differ."""
    return up_to_a_number(sp.expand(expression))[0]


class Judge:
    """Consistency checks of modes at one point."""

    def __init__(
        self,
        model: SystemModel,
        box: Sequence[arb],
        on: tuple[int, ...],
        identities: Identities,
        smooth: int | None = None,
    ) -> None:
        self.model, self.box, self.on, self.identities = model, list(box), on, identities
        self.smooth = smooth
        """Surface that was just released, so that its normal velocity is exactly zero."""

    def fixed(self, mode: Mode, refusal: str, *, attracting: bool = True) -> Entry:
        """Return the entry into a mode that is already known; raise EndedError if the mode's field does not keep it."""
        zeros = self._entry_zeros(mode, self.on if attracting else ())
        if zeros is None:
            raise EndedError(refusal + self._where(), "none")
        return self._attracting(Entry(mode, zeros))

    def unique(self, mode: Mode, active: tuple[int, ...], slipped: Collection[int] = ()) -> Entry:
        """Return the one consistent mode among all choices for the active surfaces.

        ``slipped``: contacts whose loads have just reached their limits.
        """
        names = self.model.system.sign_names
        if by_groups(self.model.system, active):
            return self._grouped(mode, active, slipped)
        found: list[Entry] = []
        for choice in product(*(self.model.system.entries_from(mode[i], i) for i in active)):
            candidate = mode
            for index, value in zip(active, choice, strict=True):
                candidate = replaced(candidate, index, value)
            zeros = self._entry_zeros(candidate, active)
            if zeros is not None:
                found.append(Entry(candidate, zeros))
        if len(found) == 1:
            return self._attracting(found[0])
        if not found:
            raise EndedError("no mode is consistent" + self._where(), "none")
        modes = " or ".join(mode_text(e.mode, names) for e in found)
        raise EndedError(f"the future is not unique{self._where()}: {modes}", "nonunique")

    def _grouped(self, mode: Mode, active: tuple[int, ...], slipped: Collection[int]) -> Entry:
        """Return the entry into the mode that Gauss's principle selects."""
        numbers = Numbers(
            self._values,
            lambda value, size: bool(value < 0),
            self._broken,
            lambda one, other: False,  # balls cannot prove that two modes have the same motion
            self.box[0].str(17, radius=False),
            proof=is_proven,
        )
        if not any(map(self.model.system.held_inside, active)):  # Gauss's principle may not hold for general fields
            raise UndecidedError(f"{len(active)} surfaces in play at once: too many modes to try", "mode")
        try:
            decision = decide_groups(self.model.system, mode, active, slipped, numbers)
        except ModelError as error:
            raise UndecidedError(str(error), "mode") from None
        if decision.status == "nonunique":
            raise EndedError(decision.reason, decision.status)
        if decision.mode is None:  # pivoting without a result does not prove that no mode is consistent
            raise UndecidedError(decision.reason, "mode")
        zeros = [count for count, _ in self._leading_terms(self.model.mode(decision.mode))]
        return self._attracting(Entry(decision.mode, tuple(zeros)))

    def _values(self, expressions: tuple[sp.Expr, ...], signs: Mode) -> list[arb] | None:
        """Evaluate expressions in time, states and signs at the point; None if a value is not finite."""
        system = self.model.system
        entries = {s: sp.Integer(v) for s, v in zip(system.signs, signs, strict=True)}
        at = dict(zip(self.model.symbols, self.box, strict=True))
        values = [enclose(system.numeric(e).xreplace(entries), at) for e in expressions]
        return values if all(v.is_finite() for v in values) else None

    def _broken(self, mode: Mode, active: Collection[int]) -> Broken | None:
        """Guards of grouped contacts that are proven not to hold; None if the mode has no equations."""
        try:
            made = self.model.mode(mode)
        except ModelError:
            return None
        terms = zip(made.guards, self._leading_terms(made), strict=True)
        return [(g, order_of(self.model.system, g, k)) for g, (k, sign) in terms if sign < 0]

    def _leading_terms(self, made: ModeModel) -> list[tuple[int, int]]:
        """For each guard, its number of exact zeros and the sign of the next coefficient; (0, 1) off its surface."""
        series = made.flow.run(ctx.prec, self.box[0], self.box[1:], ORDER, arb(1))
        rows = zip(made.guards, (series[i] for i in made.flow.outputs), strict=True)
        found = []
        for guard, row in rows:
            if guard.ends or guard.index not in self.on:
                found.append((0, 1))
            elif self._by_own_rule(guard):
                found.append((0, 1 if self._attracts(made.mode, guard.index) else -1))
            else:
                found.append(self._leading(made, guard, row))
        return found

    def _by_own_rule(self, guard: Guard) -> bool:
        """Whether the guard ends the sliding of an override that is entered by attraction, not by its hold zone."""
        system = self.model.system
        own = guard.index in system.overrides and not system.held_inside(guard.index)
        return own and not system.rests(guard.index) and guard.kind == "release"

    def _attracting(self, entry: Entry) -> Entry:
        """Return the entry; raise UndecidedError if sliding on an intersection is not proven to attract."""
        at = dict(zip(self.model.symbols, self.box, strict=True))
        for guard in self.model.mode(entry.mode).guards:
            if guard.kind == "attracts" and not enclose(guard.expression, at) > 0:
                names = ", ".join(n for n, s in zip(self.model.system.sign_names, entry.mode, strict=True) if s == 0)
                raise UndecidedError(f"whether sliding on {names} attracts{self._where()} cannot be decided", "mode")
        return entry

    def _where(self) -> str:
        return f" at t = {self.box[0].str(17, radius=False)}"

    def _entry_zeros(self, mode: Mode, active: Sequence[int]) -> tuple[int, ...] | None:
        """Number of exact leading zeros of every guard; None if the mode is proven to be inconsistent."""
        try:
            made = self.model.mode(mode)
        except ModelError:
            return None
        series = made.flow.run(ctx.prec, self.box[0], self.box[1:], ORDER, arb(1))
        zeros: list[int] = []
        for guard, row in zip(made.guards, (series[i] for i in made.flow.outputs), strict=True):
            if guard.ends or guard.index not in self.on:
                zeros.append(0)
                continue
            system = self.model.system
            inside = guard.index in active and (system.held_inside(guard.index) or system.rests(guard.index))
            if inside and guard.kind == "surface" and self._held(mode, guard.index):
                return None  # no slip starts inside the hold zone
            if guard.rising_only and not inside:
                if guard.index in active and not self._attracts(mode, guard.index):
                    return None
                zeros.append(0)
                continue
            count, sign = self._leading(made, guard, row)
            if sign < 0:
                return None
            zeros.append(count)
        return tuple(zeros)

    def _held(self, mode: Mode, index: int) -> bool:
        """Check whether every release guard of an override is positive in the stick just after the point."""
        stick = replaced(mode, index, 0)
        try:
            made = self.model.mode(stick)
        except ModelError as error:  # the stick has no equations next to another sliding surface
            names = self.model.system.sign_names
            raise UndecidedError(
                f"whether {names[index]} is held{self._where()} cannot be decided: {error}", "mode"
            ) from None
        series = made.flow.run(ctx.prec, self.box[0], self.box[1:], ORDER, arb(1))
        rows = zip(made.guards, (series[i] for i in made.flow.outputs), strict=True)
        return all(self._leading(made, g, r)[1] > 0 for g, r in rows if g.kind == "release" and g.index == index)

    def _leading(self, made: ModeModel, guard: Guard, row: Sequence[arb]) -> tuple[int, int]:
        """Number of exactly zero coefficients, and the sign of the first nonzero one."""
        known = 0 if guard.kind == "release" else 2 if guard.index == self.smooth else 1
        expression = guard.expression
        for k in range(ORDER + 1):
            if k >= known:
                sign = sign_of(row[k])
                if sign:
                    return k, sign
                if not row[k].is_finite():
                    break
                if not self.identities.vanishes(expression):
                    break
            expression = made.lie_derivative(expression)
        names = self.model.system.sign_names
        raise UndecidedError(
            f"whether {mode_text(made.mode, names)} is kept{self._where()} hangs on a sign that cannot be told "
            f"(derivative {k} of the guard of {names[guard.index]} is zero to all digits)",
            "mode",
        )

    def _attracts(self, mode: Mode, index: int) -> bool:
        """Check whether both fields point at a surface whose sliding is overridden, or are exactly tangent to it."""
        system = self.model.system
        normal = system.numeric(system.normal_velocity(index))
        values = dict(zip(self.model.symbols, self.box, strict=True))
        for side in (-1, 1):
            signs = {s: sp.Integer(v) for s, v in zip(system.signs, replaced(mode, index, side), strict=True)}
            velocity = normal.xreplace(signs)
            sign = sign_of(enclose(velocity, values))
            if sign == 0 and not self.identities.vanishes(velocity):
                raise UndecidedError(f"the sign of the normal velocity of surface {index} cannot be decided", "mode")
            if sign == side:
                return False
        return True
