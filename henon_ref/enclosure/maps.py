"""The maps applied at one instant, in a proven order (:mod:`henon_ref.modes.cascade`)."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp
from flint import arb

from henon_ref.enclosure.balls import enclose, sign_of
from henon_ref.enclosure.consistency import EndedError
from henon_ref.enclosure.enclosure import UndecidedError
from henon_ref.enclosure.impacts import speed_after
from henon_ref.enclosure.model import SystemModel
from henon_ref.modes.cascade import MOST, acting_groups
from henon_ref.modes.mode import Mode
from henon_ref.modes.resets import Impact, Jump, impact_of, jump_of
from henon_ref.text import listed


class ProvenMaps:
    """Sequence of the maps applied at an instant.

    Parameters
    ----------
    model : SystemModel
    mode : Mode
        Before the maps.
    index : int
        The surface that has fallen to zero.

    Attributes
    ----------
    due : set of int
        Surfaces whose maps have to be applied.
    sides : list of int
        Signs of the surfaces after the last map; 0 for a surface that the state is on.
    speeds : dict
        Surface -> enclosure of h', for surfaces that the state is on and whose h' a map has changed.
    applied : list of int
        Surfaces whose maps have been applied.
    """

    def __init__(self, model: SystemModel, mode: Mode, index: int) -> None:
        self.model, self.mode = model, mode
        self.due = {index}
        self.sides = [0 if i == index else entry for i, entry in enumerate(mode)]
        self.speeds: dict[int, arb] = {}
        self.applied: list[int] = []
        self._thrown: arb | None = None

    def next(self, box: Sequence[arb]) -> Jump:
        """Select the next jump, given an enclosure of (t, x) before it.

        Raises
        ------
        UndecidedError
            If several jumps may be first and their order may matter.
        EndedError
            If the limit of maps at one instant is reached.
        """
        system = self.model.system
        resets, groups, names = system.resets, acting_groups(system), system.sign_names
        if len(self.applied) >= MOST:
            which = listed([names[i] for i in sorted(set(self.applied))])
            raise EndedError(f"more than {MOST} maps at one instant: resets of {which}", "none")
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
        at = dict(zip(model.symbols, box, strict=True))
        for j, h in enumerate(model.surfaces):
            if j in jump.kept:
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
            if j not in jump.kept or impact is None:
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
        signs = {s: sp.Integer(entry) for s, entry in zip(system.signs, self.mode, strict=True)}
        rate: arb = enclose(system.numeric(impact.speed.xreplace(signs)), at)
        if sign_of(rate) == 0:
            name = system.sign_names[index]
            raise UndecidedError(f"whether the state leaves {name} after the reset cannot be decided", "mode")
        return rate
