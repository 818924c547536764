"""The smooth equations of one mode: its field, and the guards that end it; and what modes have in common.

Modes share tapes (:class:`ModeTape`), and like expressions are derived once (:func:`by_pattern`): those of contacts in
a row differ in the names of their states alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import sympy as sp

from henon_ref.modes.mode import Mode
from henon_ref.precision import one_at_a_time
from henon_ref.taylor.tape import TIME, Tape

KEPT = 1024
"""Patterns, each with what a rule makes of it, that are kept."""
Rule = Callable[..., tuple[sp.Expr, ...] | None]
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


def renamed(expressions: Sequence[sp.Expr]) -> tuple[tuple[sp.Expr, ...], dict[sp.Symbol, sp.Symbol]]:
    """Expressions with names by place, and what the symbols have become.

    Every symbol but the time gets a name by its place among an expression's symbols, in the order of their own names.
    So expressions of one pattern become equal, and since SymPy orders terms by names, whatever is done with them
    commutes with giving the symbols their own names back.

    Examples
    --------
    >>> x, y = sp.symbols("x_7 x_8", real=True)
    >>> renamed([x - TIME * y])[0]
    (-t*z0002 + z0001,)
    """
    symbols = sorted(set().union(*(e.free_symbols for e in expressions)), key=lambda symbol: symbol.name)
    names = {s: s if s == TIME else _name(k, s.name < TIME.name) for k, s in enumerate(symbols)}
    known: dict[sp.Basic, sp.Basic] = dict(names)
    return tuple(_with_names(e, known) for e in expressions), names


def by_pattern(rule: Rule, *expressions: sp.Expr) -> tuple[sp.Expr, ...] | None:
    """What a rule makes of some expressions: it is asked once for all that have one pattern."""
    with one_at_a_time():
        forms, names = renamed(expressions)
        made = _made(rule, forms)
        own: dict[sp.Basic, sp.Basic] = {name: symbol for symbol, name in names.items()}
        return None if made is None else tuple(_with_names(e, own) for e in made)


def _with_names(e: sp.Basic, known: dict[sp.Basic, sp.Basic]) -> sp.Basic:
    """An expression with other names, which keep the order of its terms: nothing is to be evaluated or sorted anew."""
    if e not in known:
        parts = tuple(_with_names(part, known) for part in e.args)
        same = all(part is old for part, old in zip(parts, e.args, strict=True))
        known[e] = e if same else e._from_args(parts) if e.is_Add or e.is_Mul else e.func(*parts, evaluate=False)
    return known[e]


@lru_cache(maxsize=KEPT)
def _made(rule: Rule, forms: tuple[sp.Expr, ...]) -> tuple[sp.Expr, ...] | None:
    return rule(*forms)


@lru_cache(maxsize=KEPT)
def _name(place: int, before_time: bool) -> sp.Symbol:
    """On the same side of the time's name as the symbol's own."""
    return sp.Symbol(f"{'a' if before_time else 'z'}{place:04}", real=True)
