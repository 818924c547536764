"""One walk over the tree of an expression, for every form that expressions are turned into.

SymPy's tree has five kinds of nodes that matter: numbers, sums, products, powers and functions of one argument. A form
(balls, series, another library's expressions, text) says what each becomes; the walk visits every part once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import sympy as sp

T = TypeVar("T")
Walk = Callable[[sp.Expr], T]
Rule = Callable[[sp.Expr, Walk[T]], T]
"""What a node becomes: it is given the node, and what turns a part of it."""


@dataclass(frozen=True)
class Rules(Generic[T]):
    """What the nodes of an expression become."""

    number: Callable[[sp.Expr], T]
    """Of a part without symbols; of an atom alone where ``into_numbers``."""
    add: Rule[T]
    multiply: Rule[T]
    power: Rule[T]
    function: Rule[T]
    """Of everything else that has arguments, and of a symbol that is not known: it raises what is to be said then."""
    into_numbers: bool = False
    """Whether a number such as ``sqrt(3)/9`` is made of its parts."""


def fold(expression: sp.Expr, rules: Rules[T], known: dict[Any, T]) -> T:
    """What an expression becomes by some rules.

    Parameters
    ----------
    expression : Expr
    rules : Rules
    known : dict
        What symbols, or larger parts, become; whatever is found is added, for the next expression.

    Examples
    --------
    >>> x = sp.Symbol("x")
    >>> rules = Rules(
    ...     number=lambda e: 0,
    ...     add=lambda e, walk: sum(map(walk, e.args)),
    ...     multiply=lambda e, walk: sum(map(walk, e.args)),
    ...     power=lambda e, walk: int(e.exp) * walk(e.base),
    ...     function=lambda e, walk: walk(e.args[0]),
    ... )
    >>> fold(sp.sin(x) * x**3 + 2, rules, {x: 1})  # how often x stands in it
    4
    """

    def walk(e: sp.Expr) -> T:
        if e not in known:
            known[e] = made(e)
        return known[e]

    def made(e: sp.Expr) -> T:
        if e.is_number and (e.is_Atom or not rules.into_numbers):
            return rules.number(e)
        if e.is_Add:
            return rules.add(e, walk)
        if e.is_Mul:
            return rules.multiply(e, walk)
        if e.is_Pow:
            return rules.power(e, walk)
        return rules.function(e, walk)

    return walk(expression)


def fraction(e: sp.Expr) -> tuple[list[sp.Expr], list[sp.Expr]]:
    """Factors above and below the line, by sight: whole and other rational powers that are negative go below."""
    above, below = [], []
    for factor in sp.Mul.make_args(e):
        if factor.is_Pow and factor.exp.is_Rational and factor.exp.is_negative and factor.base != sp.E:
            below.append(sp.Pow(factor.base, -factor.exp))
        else:
            above.append(factor)
    return above, below
