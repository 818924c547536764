"""SymPy expressions and exact numbers to heyoka's, of any precision."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
    first : int
        Parameters that stand before them.
    """

    def __init__(self, bits: int, first: int) -> None:
        self.values: list[Any] = []
        """Heyoka numbers, in order."""
        self._bits, self._first = bits, first
        self._constant = real_constants(bits)

    def __call__(self, number: sp.Expr) -> Any:
        if number.is_Integer:
            return self._constant(number)
        self.values.append(exact_real(number, self._bits))
        return hy.par[self._first + len(self.values) - 1]


def to_heyoka(expression: sp.Expr, symbols: Mapping[sp.Symbol, Any], constant: Number) -> Any:
    """Translate a smooth expression.

    Parameters
    ----------
    expression : Expr
        Its symbols are those of ``symbols``; everything else in it is an exact number.
    symbols : mapping
        Symbol -> heyoka expression (``hy.time`` for time, ``hy.par[i]`` for what is set at run time).
    constant : callable
        Exact number -> heyoka constant, or run-time parameter.

    Raises
    ------
    ModelError
        For a function that heyoka does not integrate.
    """

    def parts(e: sp.Expr, walk: Walk[Any]) -> list[Any]:
        """Those that move, then the product or sum of all numbers among them, as one."""
        numbers, moving = ([a for a in e.args if a.is_number is still] for still in (True, False))
        return list(map(walk, [*moving, e.func(*numbers)] if numbers else moving))

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
