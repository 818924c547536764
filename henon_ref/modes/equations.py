"""The smooth equations of one mode: its field, and the guards that end it; and tapes that modes have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import sympy as sp

from henon_ref.modes.mode import Mode
from henon_ref.taylor.tape import TIME, Tape

GuardKind = Literal["surface", "release", "valid", "attracts"]
Refusal = Literal["nonunique", "none", "invalid"]
"""Why no mode follows: several could, none can be told, the model ends."""


@dataclass(frozen=True)
class Guard:
    """A function that is positive inside a mode; the mode ends where it falls through zero."""

    kind: GuardKind
    """``surface``: h_i reached in slip; ``release``: the sliding on surface i ends; ``valid``: the model ends;
    ``attracts``: sliding on an intersection is no longer sure to attract."""
    index: int
    """Index of the surface, or of the ``valid`` expression; ``attracts``: of the first surface slid on."""
    to_sign: int
    """``surface``: the side beyond; ``release``: the side released into; else 0."""
    expression: sp.Expr
    """In time, states, parameters (and, in shared equations, the signs of the surfaces in slip)."""
    rising_only: bool = False
    """A guard that may be negative at the start of the mode and is then armed once it has turned positive."""
    ends: Refusal | None = None
    """Why a run ends where it falls; None where it goes on in another mode."""
    cut: tuple[tuple[int, int], ...] = ()
    """Surfaces of a cut through a loop of contacts, the one at ``index`` first, and the sides they are released into;
    empty where a contact lets go by itself."""


@dataclass(frozen=True)
class ModeEquations:
    """The smooth equations of one mode."""

    field: tuple[sp.Expr, ...]
    """x' in this mode, in time, states and parameters."""
    guards: tuple[Guard, ...]
    """What ends the mode: surfaces in slip first, then releases, ``attracts``, ``valid``; by index within each."""
    equivalent_signs: Mapping[int, sp.Expr]
    """Sliding surface -> its equivalent sign in [-1, 1] (empty where a ``sliding`` override is in force)."""

    @property
    def of_signs(self) -> tuple[sp.Expr, ...]:
        """What may hold other signs than that of its own surface: the field, and guards but for surfaces."""
        return (*self.field, *(guard.expression for guard in self.guards if guard.kind != "surface"))


@dataclass(frozen=True, eq=False)
class ModeTape:
    """A tape that several modes share, which the symbols of each surface's entry make that of one mode."""

    tape: Tape
    entries: tuple[tuple[Mapping[sp.Symbol, sp.Expr], ...], ...]
    """For every surface what its entry -1, 0 or +1 (in this order) puts for its symbols."""

    @cached_property
    def owners(self) -> tuple[tuple[int, ...], ...]:
        """Surfaces whose symbols stand in each constant."""
        owner = {symbol: i for i, entries in enumerate(self.entries) for symbol in entries[0]}
        found = ({owner[s] for s in c.free_symbols if s in owner} for c in self.tape.constants)
        return tuple(tuple(sorted(surfaces)) for surfaces in found)

    def constant(self, at: int, mode: Mode) -> sp.Expr:
        """A constant in a mode, in parameters."""
        values: dict[sp.Symbol, sp.Expr] = {}
        for i in self.owners[at]:
            values |= self.entries[i][mode[i] + 1]
        return self.tape.constants[at].xreplace(values)


def along(expression: sp.Expr, states: tuple[sp.Symbol, ...], rhs: tuple[sp.Expr, ...]) -> sp.Expr:
    """Time derivative of an expression along a field."""
    moving = expression.free_symbols
    slopes = (derivative(expression, x) * f for x, f in zip(states, rhs, strict=True) if x in moving)
    return derivative(expression, TIME) + sp.Add(*slopes)


@lru_cache(maxsize=1024)
def gradient(expression: sp.Expr, states: tuple[sp.Symbol, ...]) -> tuple[sp.Expr, ...]:
    """Its derivative in each of some states."""
    return tuple(derivative(expression, x) for x in states)


def derivative(expression: sp.Expr, x: sp.Symbol) -> sp.Expr:
    """The derivative that ``sp.diff`` makes, in the same form.

    What an expression holds again and again is differentiated once: SymPy looks through each part of it, at every
    level, for its symbols.
    """
    known: dict[sp.Basic, sp.Expr] = {x: sp.S.One}

    def of(e: sp.Basic) -> sp.Expr:
        if e not in known:
            known[e] = made(e, [of(a) for a in e.args])
        return known[e]

    def made(e: sp.Basic, slopes: list[sp.Expr]) -> sp.Expr:
        if not any(slopes):
            return sp.S.Zero
        if e.is_Add:
            return sp.Add(*slopes)
        if e.is_Mul:
            return sp.Add(*(sp.Mul(*e.args[:i], s, *e.args[i + 1 :]) for i, s in enumerate(slopes) if s))
        if e.is_Pow and e.base != sp.E:
            return e * (slopes[1] * sp.log(e.base) + slopes[0] * e.exp / e.base)
        if e.is_Function and len(e.args) == 1:
            return e.fdiff(1) * slopes[0]
        return sp.diff(e, x)

    return of(expression)
