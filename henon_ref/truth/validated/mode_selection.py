"""The mode after an event or at the start, decided on balls: strict signs, exact zeros, or no decision.

The rule is that of :mod:`henon_ref.filippov.switching`: the one mode whose own field keeps it. Here a sign
counts only where a ball excludes zero; a zero counts only where it is proven by algebra (the start is given
in exact numbers; after an event the surface is exactly zero) or by structure (the field is continuous across
a Filippov release, so the surface's normal velocity is exactly zero there).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import sympy as sp
from flint import arb, ctx

from henon_ref.errors import ModelError
from henon_ref.filippov.decision import ended
from henon_ref.filippov.equations import Guard, Refusal
from henon_ref.filippov.modes import Mode, mode_text, replaced
from henon_ref.filippov.problem import Problem
from henon_ref.filippov.resets import Jump
from henon_ref.filippov.resting import impact_of
from henon_ref.truth.balls import enclose, proves_zero
from henon_ref.truth.validated.enclosure import UndecidedError
from henon_ref.truth.validated.model import ModeModel, SystemModel, solve_for_states

ORDER = 6
"""Derivatives looked at for the sign of a guard."""
EXHAUSTIVE = 4
"""With more surfaces in play than this the candidate modes are too many to be tried."""


@dataclass(frozen=True)
class Entry:
    """A mode that is entered, and what is known of its guards."""

    mode: Mode
    zeros: tuple[int, ...]
    """For every guard, how many of its leading Taylor coefficients are exactly zero at the entry."""


class EndedError(Exception):
    """The run is proven to go no further: a fact about the problem, not about the precision."""

    def __init__(self, reason: str, ended: Refusal) -> None:
        super().__init__(reason)
        self.reason = reason
        self.ended = ended


@dataclass(frozen=True)
class Identities:
    """What is exactly zero at a point, and so what a state is in terms of the rest."""

    values: Mapping[sp.Symbol, sp.Expr]
    unsolved: tuple[sp.Expr, ...] = ()
    """Expressions that are zero too, but not linear in a state."""

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
        """Whether an expression is proven to be zero at the point."""
        rest = _substituted(expression, self.values)
        return proves_zero(rest) or any(proves_zero(rest - z) or proves_zero(rest + z) for z in self.unsolved)


def _substituted(expression: sp.Expr, values: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    for _ in range(len(values)):
        expression = expression.xreplace(dict(values))
    return expression


def initial_entry(model: SystemModel, problem: Problem) -> tuple[Entry, tuple[int, ...]]:
    """The mode at the start, and the surfaces the start lies on.

    Raises
    ------
    UndecidedError
        Where a sign cannot be proven.
    EndedError
        Where the start is proven to have no unique future, none at all, or lies outside the model.
    """
    system = problem.system
    numbers = [system.numeric(e) for e in (problem.start, *problem.initial)]
    at = Identities(dict(zip(model.symbols, numbers, strict=True)))
    box = [enclose(e) for e in numbers]
    for expression in system.valid:
        if enclose(system.numeric(expression), dict(zip(model.symbols, box, strict=True))) < 0:
            raise EndedError(f"the model does not hold at the start: {expression} < 0", "invalid")
    mode: list[int] = []
    on: list[int] = []
    for i, h in enumerate(model.surfaces):
        sign = _sign(enclose(h, dict(zip(model.symbols, box, strict=True))))
        if sign == 0:
            if not at.vanishes(h):
                raise UndecidedError(f"the start's side of {system.sign_names[i]} cannot be told", "start")
            on.append(i)
            sign = problem.initial_mode.get(i, 0)
        elif problem.initial_mode.get(i, sign) != sign:
            raise EndedError(
                f"the start is off the surface of {system.sign_names[i]}: its mode is {sign:+d}", "invalid"
            )
        mode.append(sign)
    open_ones = tuple(i for i in on if i not in problem.initial_mode)
    for i in open_ones:
        impact = impact_of(system, i) if system.rests(i) else None
        speed = sp.Integer(0) if impact is None else system.numeric(impact.speed)
        if at.vanishes(speed):
            continue
        mode[i] = _sign(enclose(speed, dict(zip(model.symbols, box, strict=True))))
        if mode[i] == 0:
            raise UndecidedError(f"whether the start leaves {system.sign_names[i]} cannot be told", "start")
        if mode[i] < 0:
            name = system.sign_names[i]
            raise EndedError(f"the start is on {name}, which resets the state, and moves into it", "invalid")
    open_ones = tuple(i for i in open_ones if mode[i] == 0)
    judge = _Judge(model, box, tuple(on), at)
    if open_ones:
        return judge.unique(tuple(mode), open_ones), tuple(on)
    refusal = "the mode given for the start is not kept by its own field"
    return judge.fixed(tuple(mode), refusal, attracting=False), tuple(on)


def entry_after(model: SystemModel, box: Sequence[arb], mode: Mode, hit: Guard) -> tuple[Entry, tuple[int, ...]]:
    """The mode after one guard fell through zero, and the surfaces the state is then exactly on.

    Parameters
    ----------
    model : SystemModel
    box : sequence of arb
        Enclosure of (t, x) at the event.
    mode : Mode
        Before it.
    hit : Guard
        With exact numbers for the parameters.
    """
    system = model.system
    refused = ended(system, mode, [hit], box[0].str(17, radius=False))
    if refused is not None:
        if hit.ends is None or hit.ends == "none":  # not told is not proven
            raise UndecidedError(refused.reason, "mode")
        raise EndedError(refused.reason, hit.ends)
    on = tuple(sorted({i for i, s in enumerate(mode) if s == 0} | {hit.index}))
    if hit.kind == "surface":
        moving = [hit.index] if mode[hit.index] else []
        judge = _Judge(model, box, on, _identities(model, [i for i in on if i not in moving], moving))
        if system.rests(hit.index):  # from the side where nothing can rest
            return judge.fixed(replaced(mode, hit.index, hit.to_sign), "the surface is not left"), on
        return judge.unique(mode, tuple(sorted(system.together(hit.index, on)))), on
    released = replaced(mode, hit.index, hit.to_sign)
    identities = _identities(model, on, (), hit.expression)
    smooth = None if hit.index in system.overrides else hit.index
    judge = _Judge(model, box, on, identities, smooth)
    return judge.fixed(released, f"the release into {mode_text(released, system.sign_names)} leads back at once"), on


def entry_after_jump(model: SystemModel, box: Sequence[arb], mode: Mode, jump: Jump, speed: arb | None) -> Entry:
    """The mode after a jump of the state.

    Parameters
    ----------
    model : SystemModel
    box : sequence of arb
        Enclosure of (t, x) after it.
    mode : Mode
        Before it.
    jump : Jump
        Of one surface.
    speed : arb, optional
        With which the surface is left; exactly 0 where it is not, None where the jump is no impact.
    """
    system, at = model.system, dict(zip(model.symbols, box, strict=True))
    for expression in system.valid:
        value = enclose(system.numeric(expression), at)
        if value < 0:
            raise EndedError(f"the model does not hold after the reset: {expression} < 0", "invalid")
        if not value > 0:
            raise UndecidedError(f"whether the model holds after the reset cannot be told: {expression}", "mode")
    signs = [_sign(enclose(h, at)) for h in model.surfaces]
    for i, sign in enumerate(signs):
        if sign == 0 and i not in jump.kept:
            raise UndecidedError(f"the side of {system.sign_names[i]} after the reset cannot be told", "mode")
    (index,) = jump.surfaces
    sides = jump.sides(mode, jump.surfaces, signs)
    on = tuple(i for i, side in enumerate(sides) if side == 0)
    identities = _identities(model, [i for i in on if i != index or speed == 0], [i for i in on if i == index])
    if speed is not None:
        sides[index] = _sign(speed)
    return _Judge(model, box, on, identities).unique(tuple(sides), tuple(i for i in on if sides[i] == 0))


def entry_at_rest(model: SystemModel, box: Sequence[arb], mode: Mode) -> Entry:
    """The mode in which a body has come to rest."""
    on = tuple(i for i, s in enumerate(mode) if s == 0)
    return _Judge(model, box, on, _identities(model, on)).fixed(mode, "the body does not stay at rest")


def _identities(model: SystemModel, on: Sequence[int], moving: Sequence[int] = (), *more: sp.Expr) -> Identities:
    """What is zero on surfaces, of those that a body rests on the speed, too; ``moving``: without the speed."""
    system = model.system
    zeros = [model.surfaces[i] for i in (*on, *moving)]
    rests = [impact_of(system, i) for i in on if system.rests(i)]
    zeros += [system.numeric(impact.speed) for impact in rests if impact is not None]
    return Identities.of([*zeros, *more], system.states)


class _Judge:
    """Tells which modes are consistent at one point."""

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
        """A surface whose normal velocity is exactly zero after a release from it."""

    def fixed(self, mode: Mode, refusal: str, *, attracting: bool = True) -> Entry:
        """The entry into a mode that is settled already; its field must keep it."""
        zeros = self._entry_zeros(mode, self.on if attracting else ())
        if zeros is None:
            raise EndedError(refusal + self._where(), "none")
        return self._attracting(Entry(mode, zeros))

    def unique(self, mode: Mode, active: tuple[int, ...]) -> Entry:
        """The one consistent mode among all choices for the active surfaces."""
        names = self.model.system.sign_names
        if len(active) > EXHAUSTIVE:
            raise UndecidedError(f"{len(active)} surfaces in play at once: too many modes to try", "mode")
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

    def _attracting(self, entry: Entry) -> Entry:
        """An entry, where it is sure that sliding on an intersection attracts."""
        at = dict(zip(self.model.symbols, self.box, strict=True))
        for guard in self.model.mode(entry.mode).guards:
            if guard.kind == "attracts" and not enclose(guard.expression, at) > 0:
                names = ", ".join(n for n, s in zip(self.model.system.sign_names, entry.mode, strict=True) if s == 0)
                raise UndecidedError(f"whether sliding on {names} attracts{self._where()} is not told", "mode")
        return entry

    def _where(self) -> str:
        return f" at t = {self.box[0].str(17, radius=False)}"

    def _entry_zeros(self, mode: Mode, active: Sequence[int]) -> tuple[int, ...] | None:
        """Exact leading zeros of every guard where the mode is consistent, None where it is proven not to be."""
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
        """Whether every release guard of an override is positive just after the point, in the stick."""
        stick = replaced(mode, index, 0)
        try:
            made = self.model.mode(stick)
        except ModelError as error:  # beside another sliding surface
            names = self.model.system.sign_names
            raise UndecidedError(
                f"whether {names[index]} is held{self._where()} cannot be told: {error}", "mode"
            ) from None
        series = made.flow.run(ctx.prec, self.box[0], self.box[1:], ORDER, arb(1))
        rows = zip(made.guards, (series[i] for i in made.flow.outputs), strict=True)
        return all(self._leading(made, g, r)[1] > 0 for g, r in rows if g.kind == "release" and g.index == index)

    def _leading(self, made: ModeModel, guard: Guard, row: Sequence[arb]) -> tuple[int, int]:
        """(number of exactly zero coefficients, sign of the first that is not)."""
        known = 0 if guard.kind == "release" else 2 if guard.index == self.smooth else 1
        expression = guard.expression
        for k in range(ORDER + 1):
            if k >= known:
                sign = _sign(row[k])
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
        """Whether both fields point at a surface whose sliding is overridden (or run along it, exactly)."""
        system = self.model.system
        normal = system.numeric(system.normal_velocity(index))
        values = dict(zip(self.model.symbols, self.box, strict=True))
        for side in (-1, 1):
            signs = {s: sp.Integer(v) for s, v in zip(system.signs, replaced(mode, index, side), strict=True)}
            velocity = normal.xreplace(signs)
            sign = _sign(enclose(velocity, values))
            if sign == 0 and not self.identities.vanishes(velocity):
                raise UndecidedError(f"the sign of the normal velocity of surface {index} cannot be told", "mode")
            if sign == side:
                return False
        return True


def _sign(ball: arb) -> int:
    if ball > 0:
        return 1
    return -1 if ball < 0 else 0
