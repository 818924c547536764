"""SymPy expressions and exact numbers to heyoka's, of any precision."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import reduce
from operator import mul
from typing import Any

import heyoka as hy
import sympy as sp
from flint import arb

from henon_ref.errors import ModelError
from henon_ref.harness.truth.multiprecision.numbers import decimal_digits, exact_text
from henon_ref.taylor.fold import Rules, Walk, fold
from henon_ref.taylor.rules import FUNCTIONS

Number = Callable[[sp.Expr], Any]


def exact_real(number: sp.Expr, bits: int) -> Any:
    """An exact number as a heyoka number of so many bits."""
    return hy.real(exact_text(number, bits), bits)


def to_real(value: arb, bits: int) -> Any:
    """The midpoint of a ball as a heyoka number."""
    return hy.real(value.mid().str(decimal_digits(bits), radius=False), bits)


def real_constants(bits: int) -> Number:
    """Exact numbers as heyoka constants of so many bits."""
    return lambda number: hy.expression(exact_real(number, bits))


class RealParameters:
    """Exact numbers as heyoka's run-time parameters, whole ones as constants: what is compiled does not depend on them.

    Parameters
    ----------
    bits : int
        Precision.
    """

    def __init__(self, bits: int) -> None:
        self._expressions: dict[sp.Expr, Any] = {}
        """Numbers, and products and sums of numbers and switches, each with its parameter."""
        self._bits = bits
        self._constant = real_constants(bits)
        self._known: dict[sp.Expr, Any] = {}

    def __len__(self) -> int:
        return len(self._expressions)

    def __call__(self, expression: sp.Expr) -> Any:
        if expression.is_Integer:
            return self._constant(expression)
        return self._expressions.setdefault(expression, hy.par[len(self._expressions)])

    def values(self, switches: Mapping[sp.Symbol, sp.Expr]) -> list[Any]:
        """Heyoka numbers, in order, where the switches have these values."""
        numbers = [e.xreplace(switches) for e in self._expressions]
        for number in numbers:
            if number not in self._known:
                self._known[number] = exact_real(number, self._bits)
        return [self._known[number] for number in numbers]


def to_heyoka(
    expression: sp.Expr, symbols: Mapping[sp.Symbol, Any], constant: Number, switches: Collection[sp.Symbol] = ()
) -> Any:
    """Translate a smooth expression.

    Parameters
    ----------
    expression : Expr
        Its symbols are those of ``symbols`` and ``switches``; everything else in it is an exact number.
    symbols : mapping
        Symbol -> heyoka expression (``hy.time`` for time).
    constant : callable
        Exact number, or expression in switches -> heyoka constant, or run-time parameter.
    switches : collection of Symbol
        Symbols that are numbers in a run. A factor of them is one parameter: of a product of several heyoka would
        make a series of its own, and a product of series costs as many operations as the square of the order.

    Raises
    ------
    ModelError
        For a function that heyoka does not integrate.
    """

    telling = frozenset(switches)

    def parts(e: sp.Expr, walk: Walk[Any]) -> list[Any]:
        """Those that move, then the product or sum of all numbers and switches among them, as one."""
        still = [a for a in e.args if a.free_symbols <= telling]
        moving = [walk(a) for a in e.args if not a.free_symbols <= telling]
        return [*moving, constant(e.func(*still))] if still else moving

    def power(e: sp.Expr, walk: Walk[Any]) -> Any:
        base, exponent = e.base, e.exp
        if not exponent.is_number:
            return hy.exp(walk(exponent) * hy.log(walk(base)))
        if exponent.could_extract_minus_sign():
            return constant(sp.Integer(1)) / walk(sp.Pow(base, -exponent))
        if exponent.is_Integer:
            return _natural_power(walk(base), int(exponent))
        if (2 * exponent).is_Integer:
            return _natural_power(hy.sqrt(walk(base)), int(2 * exponent))
        return walk(base) ** constant(exponent)

    def function(e: sp.Expr, walk: Walk[Any]) -> Any:
        if e in telling:
            return constant(e)
        name = e.func.__name__
        if name not in FUNCTIONS:
            raise ModelError(f"heyoka has no Taylor recurrence for {e}: a field is smooth in t and x")
        return getattr(hy, name)(walk(e.args[0]))

    rules = Rules(
        number=constant,
        add=lambda e, walk: hy.sum(parts(e, walk)),
        multiply=lambda e, walk: reduce(mul, parts(e, walk)),
        power=power,
        function=function,
    )
    return fold(expression, rules, dict(symbols))


def _natural_power(base: Any, exponent: int) -> Any:
    """Products only: the recurrence of a general power divides by the base, which may be zero."""
    if exponent == 1:
        return base
    half = _natural_power(base, exponent // 2)
    square = half * half
    return square * base if exponent % 2 else square
