"""Contacts that do not act on each other, and the equations of all their modes at once.

With m surfaces there are 3^m modes. Where every surface is x_k = r(t), each in a state of its own, and its sign
acts on that state's rate alone (blocks on a belt, each with its own dry friction), sliding on one of them
replaces one rate by dr/dt and leaves the others as they are. So one set of equations serves all modes, with
numbers that switch: a rate is ``slip f + slide r'``, and a surface's two guards are ``slip s h - slide N(+1)``
and ``slip + slide N(-1)``, N being dh/dt on the surface (Filippov's conditions, 1988, Sec. 2.10).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from henon_ref.filippov.equations import Guard
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.system import FilippovSystem
from henon_ref.taylor.tape import TIME


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
class SwitchedEquations:
    """Equations of every mode, in time, states, parameters and switches."""

    system: FilippovSystem
    switches: tuple[ModeIndicators, ...]
    """One a surface."""
    field: tuple[sp.Expr, ...]
    outputs: tuple[sp.Expr, ...]
    """Two guards a surface, then the ``valid`` expressions; positive inside a mode."""

    @cached_property
    def owner(self) -> Mapping[sp.Symbol, int]:
        """Switch -> its surface."""
        return {symbol: i for i, own in enumerate(self.switches) for symbol in (own.sign, own.slip, own.slide)}

    def guards(self, mode: Mode) -> tuple[Guard, ...]:
        """What each output stands for in a mode; a surface in slip has no second guard, its output stays at 1."""
        found = []
        for i, entry in enumerate(mode):
            first, second = self.outputs[2 * i : 2 * i + 2]
            if entry:
                found.append(Guard("surface", i, -entry, first))
            else:
                found.append(Guard("release", i, 1, first))
            found.append(Guard("release", i, -1, second))
        valid = self.outputs[2 * len(mode) :]
        return (*found, *(Guard("valid", i, 0, e, ends="invalid") for i, e in enumerate(valid)))

    def places(self, mode: Mode) -> tuple[int, ...]:
        """Where each of :meth:`guards` stands among those of the mode's own equations; -1 where it does not."""
        slips, slides = 0, 0
        found = []
        count = sum(map(abs, mode))
        for entry in mode:
            found += [slips, -1] if entry else [count + 2 * slides, count + 2 * slides + 1]
            slips, slides = slips + abs(entry), slides + 1 - abs(entry)
        return (*found, *(count + 2 * slides + k for k in range(len(self.outputs) - 2 * len(mode))))


def switched_equations(system: FilippovSystem) -> SwitchedEquations | None:
    """One set of equations for all modes; None where the surfaces act on each other or on several rates."""
    if system.overrides:
        return None
    rows: list[int] = []
    for h, sign in zip(system.surfaces, system.signs, strict=True):
        row = _own_state(h, system)
        acted_on = [k for k, f in enumerate(system.field) if f.has(sign)]
        if row is None or acted_on != [row] or row in rows:
            return None
        rows.append(row)
    if any(len(system.field[k].free_symbols & set(system.signs)) != 1 for k in rows):
        return None
    switches = tuple(
        ModeIndicators(s, sp.Symbol(f"slip_{i}", real=True), sp.Symbol(f"slide_{i}", real=True))
        for i, s in enumerate(system.signs)
    )
    field, outputs = list(system.field), []
    for h, k, own in zip(system.surfaces, rows, switches, strict=True):
        x = system.states[k]
        slope = sp.diff(h, x)
        there = sp.expand(x - h / slope)
        speed = sp.diff(there, TIME)
        field[k] = own.slip * field[k] + own.slide * speed
        normal = sp.expand(slope * (system.field[k].xreplace({x: there}) - speed), deep=False)
        outputs.append(own.slip * own.sign * h - own.slide * normal.xreplace({own.sign: sp.Integer(1)}))
        outputs.append(own.slip + own.slide * normal.xreplace({own.sign: sp.Integer(-1)}))
    return SwitchedEquations(system, switches, tuple(field), (*outputs, *system.valid))


def _own_state(surface: sp.Expr, system: FilippovSystem) -> int | None:
    """The one state of a surface that is linear in it with a constant factor."""
    own = [k for k, x in enumerate(system.states) if surface.has(x)]
    if len(own) != 1 or sp.diff(surface, system.states[own[0]]).free_symbols & {TIME, *system.states}:
        return None
    return own[0]
