"""Traversals of SymPy expressions: conversion to another form, factors of a fraction, size.

The trees have five kinds of nodes: numbers, sums, products, powers and functions. A form (balls, series, expressions of
another library, text) gives one rule per kind; the fold visits every subexpression once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import sympy as sp

T = TypeVar("T")
Walk = Callable[[sp.Expr], T]
Rule = Callable[[sp.Expr, Walk[T]], T]
"""Converts a node, given the node and the function that converts its parts."""


@dataclass(frozen=True)
class Rules(Generic[T]):
    """Rules of one form, one per kind of node."""

    number: Callable[[sp.Expr], T]
    """For a part without symbols; only for an atom if ``into_numbers``."""
    add: Rule[T]
    multiply: Rule[T]
    power: Rule[T]
    function: Rule[T]
    """For every other node with arguments, and for a symbol that is not in ``known``: it raises the form's error."""
    into_numbers: bool = False
    """Whether a number such as ``sqrt(3)/9`` is converted from its parts."""


def fold(expression: sp.Expr, rules: Rules[T], known: dict[Any, T]) -> T:
    """Convert an expression by rules.

    ``known``: results for symbols or larger parts; new results are added, for reuse with the next expression.

    >>> x = sp.Symbol("x")
    >>> rules = Rules(
    ...     number=lambda e: 0,
    ...     add=lambda e, walk: sum(map(walk, e.args)),
    ...     multiply=lambda e, walk: sum(map(walk, e.args)),
    ...     power=lambda e, walk: int(e.exp) * walk(e.base),
    ...     function=lambda e, walk: walk(e.args[0]),
    ... )
    >>> fold(sp.sin(x) * x**3 + 2, rules, {x: 1})  # number of occurrences of x
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
    """Factors of numerator and denominator as written: factors with a negative rational exponent are below."""
    above, below = [], []
    for factor in sp.Mul.make_args(e):
        if factor.is_Pow and factor.exp.is_Rational and factor.exp.is_negative and factor.base != sp.E:
            below.append(sp.Pow(factor.base, -factor.exp))
        else:
            above.append(factor)
    return above, below


def product(factors: Sequence[sp.Expr]) -> sp.Expr:
    """Product; a single factor is returned as it is, without SymPy's work for a new product."""
    return factors[0] if len(factors) == 1 else sp.Mul(*factors)


def size(expression: sp.Expr | Iterable[sp.Expr], limit: int) -> int:
    """Number of operations, symbols and numbers of one or several expressions, each occurrence counted.

    At most limit + 1.
    """
    waiting: list[sp.Basic] = [expression] if isinstance(expression, sp.Basic) else [*expression]
    count = 0
    while waiting and count <= limit:
        part = waiting.pop()
        count += 1
        waiting += part.args
    return count


def is_longer(expression: sp.Expr | Iterable[sp.Expr], limit: int) -> bool:
    """Check whether the :func:`size` of one or several expressions exceeds a limit."""
    return size(expression, limit) > limit
