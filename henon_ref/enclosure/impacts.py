"""Impacts of a set of states, and enclosures of the limit of accumulating impacts.

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

from henon_ref.enclosure.balls import enclose, proves_zero
from henon_ref.enclosure.enclosure import UNIT_BALL, UndecidedError
from henon_ref.enclosure.model import SystemModel, solve_for_states
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.resets import Impact, impact_of

ROOM = 4
"""Factor from the displacements that the present bounds allow to the next guess of the box."""
TRIES = 12
"""Largest number of guesses of the box."""


@dataclass(frozen=True)
class Rest:
    """A body at rest on a surface."""

    mode: Mode
    box: tuple[arb, ...]
    """Enclosure of (t, x) at the beginning of the rest."""


def speed_after(model: SystemModel, index: int, arrived: Sequence[arb]) -> arb | None:
    """Enclose h' after an impact; exactly 0 if proven, None if the reset of the surface is not an impact of a body.

    Parameters
    ----------
    model : SystemModel
    index : int
        The surface.
    arrived : sequence of arb
        Enclosure of (t, x) before the impact.

    Raises
    ------
    UndecidedError
        If the enclosure contains 0, so that the body may or may not leave the surface.
    """
    system, impact = model.system, impact_of(model.system, index)
    if impact is None or impact.refusal:
        return None
    ratio = system.numeric(impact.ratio)
    if proves_zero(ratio):
        return arb(0)
    at = dict(zip(model.symbols, arrived, strict=True))
    speed: arb = enclose(ratio, at) * enclose(system.numeric(impact.speed), at)
    if speed.contains(0):
        name = system.sign_names[index]
        raise UndecidedError(f"whether the body leaves {name} after an impact cannot be decided", "mode")
    return speed


def rest_after(model: SystemModel, index: int, mode: Mode, speed: arb, box: Sequence[arb]) -> Rest:
    """Enclose the limit of accumulating impacts on a surface, where the body comes to rest.

    Parameters
    ----------
    model : SystemModel
    index : int
        The surface.
    mode : Mode
        Between the impacts.
    speed : arb
        h' after the last impact.
    box : sequence of arb
        Enclosure of (t, x) after the last impact.

    Raises
    ------
    UndecidedError
        If the limit is not proven.
    """
    return _Limit(model, index, mode, speed, box).rest()


class _Limit:
    """Enclosure of the limit of accumulating impacts on one surface."""

    def __init__(self, model: SystemModel, index: int, mode: Mode, speed: arb, box: Sequence[arb]) -> None:
        self.model, self.index, self.mode, self.speed, self.begin = model, index, mode, speed, list(box)
        impact = impact_of(model.system, index)
        assert impact is not None  # the surface has just reset a body's speed
        self.impact: Impact = impact
        made = model.mode(mode)
        self.field, self.guards = made.field, made.guards
        stuck = replaced(mode, index, 0)
        self.stuck, self.held = stuck, model.mode(stuck).field
        own = next(g for g in made.guards if g.kind == "surface" and g.index == index)
        self.bend = made.lie_derivative(made.lie_derivative(own.expression))

    def rest(self) -> Rest:
        begin = self.begin
        box, time, change = self._kept()
        for guard in self.guards:
            if not (guard.kind == "surface" and guard.index == self.index):
                self._check(guard, box)
        at = self._at(box)
        fields, pushes = self._values(self.held, at), self._values(self.impact.push, at)
        end = [
            x + time * rate - self.speed * push.mid() + 2 * change * push.rad() * UNIT_BALL
            for x, rate, push in zip(begin[1:], fields, pushes, strict=True)
        ]
        settled = [begin[0] + time, *end]
        zeros = [self.model.surfaces[self.index], self.model.system.numeric(self.impact.speed)]
        for solved in solve_for_states(zeros, self.model.system.states):
            settled[solved.index + 1] = enclose(solved.value, self._at(settled))
        return Rest(self.stuck, tuple(settled))

    def _kept(self) -> tuple[list[arb], arb, arb]:
        """Find a box that the states do not leave, with the bounds (time, change of h') on it."""
        box = list(self.begin)
        for _ in range(TRIES):
            time, change = self._bounds(box)
            inside = self._reached(box, time.upper(), change)
            if all(wide.contains(own) for wide, own in zip(box, inside, strict=True)):
                return box, time, change
            box = self._reached(box, ROOM * time.upper(), ROOM * change)
        raise self._open("no box is found that the states do not leave")

    def _bounds(self, box: Sequence[arb]) -> tuple[arb, arb]:
        """Total time of all flights, and total change of h' by impacts, as long as the states are in a box."""
        at = self._at(box)
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
        at = self._at(box)
        fields, pushes = self._values(self.field, at), self._values(self.impact.push, at)
        return [self.begin[0] + time * UNIT_BALL] + [
            x + (time * abs(rate) + change * abs(push)).upper() * UNIT_BALL
            for x, rate, push in zip(self.begin[1:], fields, pushes, strict=True)
        ]

    def _check(self, guard: Guard, box: Sequence[arb]) -> None:
        if enclose(guard.expression, self._at(box)).contains(0):
            raise self._open("another event is as close")

    def _at(self, box: Sequence[arb]) -> dict[sp.Symbol, arb]:
        return dict(zip(self.model.symbols, box, strict=True))

    def _values(self, expressions: Sequence[sp.Expr], at: dict[sp.Symbol, arb]) -> list[arb]:
        return [enclose(self.model.system.numeric(e), at) for e in expressions]

    def _open(self, reason: str) -> UndecidedError:
        at, name = self.begin[0].str(12, radius=False), self.model.system.sign_names[self.index]
        return UndecidedError(f"the limit of impacts on {name} after t = {at} is not proven: {reason}", "mode")
