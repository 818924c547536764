"""Maps applied to a set of states at one instant, in a proven order, and the limit of accumulating impacts.

The order of the maps is that of :mod:`henon_ref.modes.cascade`.

While a body bounces, let h'' be in [-a2, -a1] (a1 > 0), let [r1, r2] contain the ratios of the speeds after and before
an impact, and let q = sqrt(a2/a1). A flight with initial speed v lasts from 2 v / a2 to 2 v / a1 (h'' constant at its
bounds) and ends with a speed from v / q to v q, since the body falls as far as it rises. By the geometric series, all
flights from one with speed v on last from ``2 v / (a2 (1 - r1/q))`` to ``2 v / (a1 (1 - r2 q))`` together, if
r2 q < 1. The bounds hold on a box that the states do not leave in that time; an a priori enclosure proves it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp
from flint import arb

from henon_ref.enclosure.balls import enclose, proves_zero, sign_of
from henon_ref.enclosure.consistency import EndedError
from henon_ref.enclosure.enclosure import UNIT_BALL, UndecidedError
from henon_ref.enclosure.model import SystemModel, solve_for_states
from henon_ref.modes.cascade import MAX_MAPS, acting_groups
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.resets import Impact, Jump, impact_of, jump_of, kept_zero
from henon_ref.text import listed


@dataclass(frozen=True)
class Rest:
    """A body at rest on a surface."""

    mode: Mode
    box: tuple[arb, ...]
    """Enclosure of (t, x) at the beginning of the rest."""


def speed_after(model: SystemModel, index: int, arrived: Sequence[arb]) -> arb | None:
    """Enclose h' of a surface after an impact at ``arrived``, an enclosure of (t, x) before it.

    Exactly 0 if proven, None if the reset of the surface is not an impact of a body; UndecidedError if the enclosure
    contains 0, so that the body may or may not leave the surface.
    """
    system, impact = model.system, impact_of(model.system, index)
    if impact is None or impact.refusal:
        return None
    ratio = system.numeric(impact.ratio)
    if proves_zero(ratio):
        return arb(0)
    at = model.at(arrived)
    speed: arb = enclose(ratio, at) * enclose(system.numeric(impact.speed), at)
    if speed.contains(0):
        name = system.sign_names[index]
        raise UndecidedError(f"whether the body leaves {name} after an impact cannot be decided", "mode")
    return speed


class ProvenMaps:
    """Sequence of the maps applied at the instant at which a surface falls to zero in a mode."""

    def __init__(self, model: SystemModel, mode: Mode, index: int) -> None:
        self.model, self.mode = model, mode
        self.due = {index}
        """Surfaces whose maps have to be applied."""
        self.sides = [0 if i == index else entry for i, entry in enumerate(mode)]
        """Signs of the surfaces after the last map; 0 for a surface that the state is on."""
        self.speeds: dict[int, arb] = {}
        """Enclosures of h' of the surfaces that the state is on and whose h' a map has changed."""
        self.applied: list[int] = []
        """Surfaces whose maps have been applied."""
        self._thrown: arb | None = None

    def next(self, box: Sequence[arb]) -> Jump:
        """Select the next jump, given an enclosure of (t, x) before it.

        UndecidedError if several jumps may be first and their order may matter; EndedError if the limit of maps at one
        instant is reached.
        """
        system = self.model.system
        resets, groups, names = system.resets, acting_groups(system), system.sign_names
        if len(self.applied) >= MAX_MAPS:
            which = listed([names[i] for i in sorted(set(self.applied))])
            reason = f"more than {MAX_MAPS} maps at one instant: resets of {which}"
            if all((impact := impact_of(system, i)) and not impact.refusal for i in self.applied):
                raise UndecidedError(reason, "mode")  # impacts of bodies may have a limit
            raise EndedError(reason, "none")
        lowest = min(resets[i].priority for i in self.due)
        first, *others = sorted(i for i in self.due if resets[i].priority == lowest)
        if tied := [i for i in others if groups[i] == groups[first]]:
            which = listed([names[i] for i in (first, *tied)])
            raise UndecidedError(f"several resets are due at one instant, and their order may matter: {which}", "mode")
        self.due.remove(first)
        self.applied.append(first)
        self._thrown = speed_after(self.model, first, box) if self.sides[first] == 0 else None
        return jump_of(system, first)

    def after(self, jump: Jump, box: Sequence[arb]) -> None:
        """Update sides, speeds and due maps after a jump, given an enclosure of (t, x) after it."""
        model, system, index = self.model, self.model.system, self.applied[-1]
        at = model.at(box)
        for j, h in enumerate(model.surfaces):
            known = jump.side(j, self.sides[j])
            if known is not None:
                self.sides[j] = known
                continue
            side = sign_of(enclose(h, at))
            if side == 0:
                raise UndecidedError(f"the side of {system.sign_names[j]} after the reset cannot be decided", "mode")
            if j in system.resets and self.sides[j] > 0 > side:
                self.due.add(j)
            self.sides[j] = side
            self.speeds.pop(j, None)
        moved = {system.states[k] for k in jump.moved}
        for j in sorted(system.resets):
            impact = impact_of(system, j)
            if impact is None or not (j in jump.kept or (j == index and jump.stays)):
                continue
            if j == index and self.sides[j] == 0:
                self.speeds[j] = self._rate(j, impact, at) if self._thrown is None else self._thrown
            if j == index or not impact.speed.free_symbols & moved:
                continue
            if self.sides[j] == 0 and (self.mode[j] != 0 or system.rests(j)):
                self._turn(j, impact, at)
            elif self.sides[j] > 0 and enclose(model.surfaces[j], at).contains(0):
                raise UndecidedError(f"whether the reset touches {system.sign_names[j]} cannot be decided", "mode")

    def _turn(self, index: int, impact: Impact, at: dict[sp.Symbol, arb]) -> None:
        """Record h' of a surface that the state is on, as changed by the map of another surface."""
        rate = self._rate(index, impact, at)
        sign = sign_of(rate)
        falling = index in self.speeds and self.speeds[index] < 0
        if sign < 0 and not (falling and index in self.applied):
            self.due.add(index)
        elif sign > 0 and not impact.refusal:
            self.due.discard(index)
        self.speeds[index] = rate

    def _rate(self, index: int, impact: Impact, at: dict[sp.Symbol, arb]) -> arb:
        """Enclose h' of a surface; its sign must be strict."""
        system = self.model.system
        signs = system.entries(self.mode)
        rate: arb = enclose(system.numeric(impact.speed.xreplace(signs)), at)
        if sign_of(rate) == 0:
            name = system.sign_names[index]
            raise UndecidedError(f"whether the state leaves {name} after the reset cannot be decided", "mode")
        return rate


class Accumulation:
    """Accumulating impacts on a surface: the mode between them, h' and an enclosure of (t, x) after the last one."""

    def __init__(self, model: SystemModel, index: int, mode: Mode, speed: arb, box: Sequence[arb]) -> None:
        self.model, self.index, self.mode, self.speed, self.begin = model, index, mode, speed, list(box)
        impact = impact_of(model.system, index)
        assert impact is not None  # the surface has just reset a body's speed
        self.impact = impact
        made = model.mode(mode)
        self.field, self.guards = made.field, made.guards
        self.stuck = replaced(mode, index, 0)
        own = next(g for g in made.guards if g.kind == "surface" and g.index == index)
        self.bend = made.lie_derivative(made.lie_derivative(own.expression))

    def rest(self) -> Rest:
        """Enclose the limit, where the body comes to rest; raise UndecidedError if it is not proven."""
        begin = self.begin
        box, time, change = self._kept()
        for guard in self.guards:
            own = guard.kind == "surface" and guard.index == self.index
            if not own and enclose(guard.expression, self.model.at(box)).contains(0):
                raise self._open("another event is as close")
        at = self.model.at(box)
        fields, pushes = self._values(self.model.mode(self.stuck).field, at), self._values(self.impact.push, at)
        end = [
            x + time * rate - self.speed * push.mid() + 2 * change * push.rad() * UNIT_BALL
            for x, rate, push in zip(begin[1:], fields, pushes, strict=True)
        ]
        settled = [begin[0] + time, *end]
        zeros = [self.model.system.numeric(zero) for zero in kept_zero(self.model.system, self.index)]
        for index, value, _ in solve_for_states(zeros, self.model.system.states):
            settled[index + 1] = enclose(value, self.model.at(settled))
        return Rest(self.stuck, tuple(settled))

    def _kept(self) -> tuple[list[arb], arb, arb]:
        """Find a box that the states do not leave, with the bounds (time, change of h') on it."""
        box = list(self.begin)
        for _ in range(12):
            time, change = self._bounds(box)
            inside = self._reached(box, time.upper(), change)
            if all(wide.contains(own) for wide, own in zip(box, inside, strict=True)):
                return box, time, change
            box = self._reached(box, 4 * time.upper(), 4 * change)
        raise self._open("no box is found that the states do not leave")

    def _bounds(self, box: Sequence[arb]) -> tuple[arb, arb]:
        """Total time of all flights, and total change of h' by impacts, as long as the states are in a box."""
        at = self.model.at(box)
        pull = -enclose(self.bend, at)
        ratio = -enclose(self.model.system.numeric(self.impact.ratio), at)
        least, most = arb(pull.lower()), arb(pull.upper())
        low, high = max(arb(ratio.lower()), arb(0)), arb(ratio.upper())
        if not least > 0:
            raise self._open("it cannot be decided whether the body is pressed onto the surface")
        spread = (most / least).sqrt()
        if not high * spread < 1:
            raise self._open("impacts may lose no speed")
        longest = 2 * self.speed / (least * (1 - high * spread))
        time = (2 * self.speed / (most * (1 - low / spread))).union(longest)
        return time, ((1 + high) * spread * self.speed / (1 - high * spread)).upper()

    def _reached(self, box: Sequence[arb], time: arb, change: arb) -> list[arb]:
        """Enclose time and states reached within a time, as long as the states are in a box."""
        at = self.model.at(box)
        fields, pushes = self._values(self.field, at), self._values(self.impact.push, at)
        return [self.begin[0] + time * UNIT_BALL] + [
            x + (time * abs(rate) + change * abs(push)).upper() * UNIT_BALL
            for x, rate, push in zip(self.begin[1:], fields, pushes, strict=True)
        ]

    def _values(self, expressions: Sequence[sp.Expr], at: dict[sp.Symbol, arb]) -> list[arb]:
        return [enclose(self.model.system.numeric(e), at) for e in expressions]

    def _open(self, reason: str) -> UndecidedError:
        at, name = self.begin[0].str(12, radius=False), self.model.system.sign_names[self.index]
        return UndecidedError(f"the limit of impacts on {name} after t = {at} is not proven: {reason}", "mode")
