"""Like expressions, derived once: those of contacts in a row differ in the names of their states alone.

Every symbol but the time gets a name by its place among an expression's symbols, in the order of their own names. So
expressions of one pattern become equal, and since SymPy orders terms by names, whatever is done with them commutes
with giving the symbols their own names back.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import sympy as sp

from henon_ref.precision import one_at_a_time
from henon_ref.taylor.tape import TIME

KEPT = 1024
"""Patterns, each with what a rule makes of it, that are kept."""

Rule = Callable[..., tuple[sp.Expr, ...] | None]


def renamed(expressions: Sequence[sp.Expr]) -> tuple[tuple[sp.Expr, ...], dict[sp.Symbol, sp.Symbol]]:
    """Expressions with names by place, and what the symbols have become.

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
