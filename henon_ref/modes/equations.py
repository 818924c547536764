"""Smooth equations of one mode: its field, and the guards that end it; equations shared by modes.

Modes share tapes (:class:`ModeTape`), and similar expressions are derived once (:func:`by_pattern`): those of contacts
in a row differ only in the names of their states.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import sympy as sp

from henon_ref.method_cache import cached_method
from henon_ref.modes.mode import Mode
from henon_ref.precision import one_at_a_time
from henon_ref.taylor.tape import TIME, Tape

Rule = Callable[..., tuple[sp.Expr, ...] | None]
GuardKind = Literal["surface", "release", "valid", "attracts"]
Refusal = Literal["nonunique", "none", "invalid"]
"""Reason why no mode follows: several are consistent, none can be decided, or the model is no longer valid."""


@dataclass(frozen=True)
class Guard:
    """Function that is positive inside a mode; the mode ends when it falls through zero."""

    kind: GuardKind
    """``surface``: h_i reached in slip; ``release``: sliding on surface i ends; ``valid``: the model is no longer
    valid; ``attracts``: sliding on an intersection may no longer attract."""
    index: int
    """Index of the surface or of the ``valid`` expression; ``attracts``: of the first sliding surface."""
    to_sign: int
    """``surface``: the side beyond; ``release``: the side of the slip after it; else 0."""
    expression: sp.Expr
    """In time, states, parameters (and, in shared equations, the signs of surfaces in slip)."""
    rising_only: bool = False
    """Whether the guard may be negative at the start of the mode and is armed once it has become positive."""
    held: bool = False
    """Whether it is the distance of a load from the limit of static friction."""
    ends: Refusal | None = None
    """Reason why the run ends when the guard falls; None if the run continues in another mode."""
    cut: tuple[tuple[int, int], ...] = ()
    """Surfaces of a cut of a loop of contacts, ``index`` first, with their sides after it; empty for one contact."""


@dataclass(frozen=True)
class ModeEquations:
    """The smooth equations of one mode."""

    field: tuple[sp.Expr, ...]
    """x' in this mode, in time, states and parameters."""
    guards: tuple[Guard, ...]
    """Guards that end the mode: surfaces in slip, releases, ``attracts``, ``valid``; by index within each."""
    equivalent_signs: Mapping[int, sp.Expr]
    """Sliding surface -> its equivalent sign in [-1, 1] (empty with a ``sliding`` override)."""

    @property
    def of_signs(self) -> tuple[sp.Expr, ...]:
        """Expressions that may contain signs of other surfaces: the field, and all guards except surfaces."""
        return (*self.field, *(guard.expression for guard in self.guards if guard.kind != "surface"))


@dataclass(frozen=True, eq=False)
class ModeTape:
    """Tape that several modes share; substituting the symbols of each surface's entry gives the tape of one mode."""

    tape: Tape
    entries: tuple[tuple[Mapping[sp.Symbol, sp.Expr], ...], ...]
    """For every surface, the values of its symbols for the entries -1, 0 and +1, in this order."""

    @cached_property
    def owners(self) -> tuple[tuple[int, ...], ...]:
        """Surfaces whose symbols are in each constant."""
        owner = {symbol: i for i, entries in enumerate(self.entries) for symbol in entries[0]}
        found = ({owner[s] for s in c.free_symbols if s in owner} for c in self.tape.constants)
        return tuple(tuple(sorted(surfaces)) for surfaces in found)

    def constant(self, at: int, mode: Mode) -> sp.Expr:
        """Return a constant in a mode, in parameters."""
        return self._constant(at, tuple([mode[i] for i in self.owners[at]]))

    @cached_method
    def _constant(self, at: int, own: Mode) -> sp.Expr:
        values: dict[sp.Symbol, sp.Expr] = {}
        for i, entry in zip(self.owners[at], own, strict=True):
            values |= self.entries[i][entry + 1]
        return self.tape.constants[at].xreplace(values)


def along(expression: sp.Expr, states: tuple[sp.Symbol, ...], rhs: tuple[sp.Expr, ...]) -> sp.Expr:
    """Return the time derivative of an expression along a field."""
    moving = expression.free_symbols
    slopes = (derivative(expression, x) * f for x, f in zip(states, rhs, strict=True) if x in moving)
    return derivative(expression, TIME) + sp.Add(*slopes)


@lru_cache(maxsize=1024)
def gradient(expression: sp.Expr, states: tuple[sp.Symbol, ...]) -> tuple[sp.Expr, ...]:
    return tuple(derivative(expression, x) for x in states)


def derivative(expression: sp.Expr, x: sp.Symbol) -> sp.Expr:
    """Return the derivative in the form of ``sp.diff``.

    Repeated subexpressions are differentiated once; ``sp.diff`` searches every part for its symbols at each level.
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
    """Return expressions with symbols renamed by position, and the new name of each symbol.

    Every symbol except time gets a name by its position among the sorted symbols of the expressions. Expressions of one
    pattern then become equal. Since SymPy orders terms by names, renaming back commutes with every operation on them.

    >>> x, y = sp.symbols("x_7 x_8", real=True)
    >>> renamed([x - TIME * y])[0]
    (-t*z0002 + z0001,)
    """
    symbols = sorted(set().union(*(e.free_symbols for e in expressions)), key=lambda symbol: symbol.name)
    names = {s: s if s == TIME else _name(k, s.name < TIME.name) for k, s in enumerate(symbols)}
    known: dict[sp.Basic, sp.Basic] = dict(names)
    return tuple(_with_names(e, known) for e in expressions), names


def by_pattern(rule: Rule, *expressions: sp.Expr) -> tuple[sp.Expr, ...] | None:
    """Apply a rule to expressions; expressions of one pattern share one call of the rule."""
    with one_at_a_time():
        forms, names = renamed(expressions)
        made = _made(rule, forms)
        own: dict[sp.Basic, sp.Basic] = {name: symbol for symbol, name in names.items()}
        return None if made is None else tuple(_with_names(e, own) for e in made)


def _with_names(e: sp.Basic, known: dict[sp.Basic, sp.Basic]) -> sp.Basic:
    """Rename symbols with the order of terms unchanged, so that no part is evaluated or sorted again."""
    if e not in known:
        parts = tuple(_with_names(part, known) for part in e.args)
        same = all(part is old for part, old in zip(parts, e.args, strict=True))
        known[e] = e if same else e._from_args(parts) if e.is_Add or e.is_Mul else e.func(*parts, evaluate=False)
    return known[e]


@lru_cache(maxsize=1024)
def _made(rule: Rule, forms: tuple[sp.Expr, ...]) -> tuple[sp.Expr, ...] | None:
    return rule(*forms)


@lru_cache(maxsize=1024)
def _name(place: int, before_time: bool) -> sp.Symbol:
    """Name that sorts on the same side of the time's name as the symbol's own name."""
    return sp.Symbol(f"{'a' if before_time else 'z'}{place:04}", real=True)
