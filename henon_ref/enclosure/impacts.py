"""Impacts of a set of states, and the limit of those that accumulate, enclosed.

Let h'' be in [-a2, -a1] (a1 > 0) and the ratio of the speeds after and before an impact in [r1, r2] as long as a body
bounces, and q = sqrt(a2/a1). A flight that begins with the speed v lasts from 2 v / a2 to 2 v / a1 (h'' is largest and
least all the time), and ends, as the body falls as far as it rises, with a speed from v / q to v q. So all flights
from one with the speed v on last together from ``2 v / (a2 (1 - r1/q))`` to ``2 v / (a1 (1 - r2 q))``, if r2 q < 1.
The bounds hold on a box that the states do not leave within that time, which is checked as in Picard's iteration.
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
"""So many times as far as they would go by the bounds at hand may the states go: the next guess of the box."""
TRIES = 12
"""Guesses of the box."""


@dataclass(frozen=True)
class Rest:
    """A body that has come to rest on a surface."""

    mode: Mode
    box: tuple[arb, ...]
    """Enclosure of (t, x) where it does."""


def speed_after(model: SystemModel, index: int, arrived: Sequence[arb]) -> arb | None:
    """Enclosure of h' after an impact on a surface, exactly 0 where it is proven to be; None where it is no body's.

    Parameters
    ----------
    model : SystemModel
    index : int
        The surface.
    arrived : sequence of arb
        Enclosure of (t, x) before it.

    Raises
    ------
    UndecidedError
        Where it cannot be told whether the body leaves.
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
        raise UndecidedError(f"whether the body leaves {name} after an impact cannot be told", "mode")
    return speed


def rest_after(model: SystemModel, index: int, mode: Mode, speed: arb, box: Sequence[arb]) -> Rest:
    """The limit of impacts on a surface, and the rest there.

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
        Enclosure of (t, x) then.

    Raises
    ------
    UndecidedError
        Where the limit is not proven.
    """
    return _Limit(model, index, mode, speed, box).rest()


class _Limit:
    """The limit of impacts on one surface."""

    def __init__(self, model: SystemModel, index: int, mode: Mode, speed: arb, box: Sequence[arb]) -> None:
        self.model, self.index, self.mode, self.speed, self.begin = model, index, mode, speed, list(box)
        impact = impact_of(model.system, index)
        assert impact is not None  # it has thrown the body back
        self.impact: Impact = impact
        made = model.mode(mode)
        self.field, self.guards = made.field, made.guards
        stuck = replaced(mode, index, 0)
        self.stuck, self.held = stuck, model.mode(stuck).field
        own = next(g for g in made.guards if g.kind == "surface" and g.index == index)
        self.bend = made.lie_derivative(made.lie_derivative(own.expression))

    def rest(self) -> Rest:
        """Where the body comes to rest."""
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
        """A box that the states do not leave, and the bounds that hold on it."""
        box = list(self.begin)
        for _ in range(TRIES):
            time, change = self._bounds(box)
            inside = self._reached(box, time.upper(), change)
            if all(wide.contains(own) for wide, own in zip(box, inside, strict=True)):
                return box, time, change
            box = self._reached(box, ROOM * time.upper(), ROOM * change)
        raise self._open("the states may go further than thought meanwhile")

    def _bounds(self, box: Sequence[arb]) -> tuple[arb, arb]:
        """How long all flights last together, and the sum of the changes of h' by impacts, while a box is not left."""
        at = self._at(box)
        pull = -enclose(self.bend, at)
        ratio = -enclose(self.model.system.numeric(self.impact.ratio), at)
        least, most = arb(pull.lower()), arb(pull.upper())
        low, high = max(arb(ratio.lower()), arb(0)), arb(ratio.upper())
        if not least > 0:
            raise self._open("whether the body is pressed on cannot be told")
        spread = (most / least).sqrt()
        if not high * spread < 1:
            raise self._open("impacts may lose no speed")
        longest = 2 * self.speed / (least * (1 - high * spread))
        time = (2 * self.speed / (most * (1 - low / spread))).union(longest)
        return time, ((1 + high) * spread * self.speed / (1 - high * spread)).upper()

    def _reached(self, box: Sequence[arb], time: arb, change: arb) -> list[arb]:
        """Where time and states may be within a time, while a box is not left."""
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
