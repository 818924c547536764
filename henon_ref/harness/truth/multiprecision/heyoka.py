"""Conversion of SymPy expressions and exact numbers to heyoka, at any precision.

The compared solver has its own conversion, with constants rounded to doubles (``baselines/heyoka_taylor.py``): an error
there cannot also be in the truth.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import reduce
from operator import mul
from typing import Any

import heyoka as hy
import sympy as sp
from flint import arb

from henon_ref.errors import ModelError
from henon_ref.expressions.grammar import ELEMENTARY
from henon_ref.expressions.traversal import Rules, Walk, fold
from henon_ref.harness.truth.reference import decimal_digits, exact_text

Number = Callable[[sp.Expr], Any]


def exact_real(number: sp.Expr, bits: int) -> Any:
    """Convert an exact number to a heyoka number of a precision in bits."""
    return hy.real(exact_text(number, bits), bits)


def to_real(value: arb, bits: int) -> Any:
    """Convert the midpoint of a ball to a heyoka number."""
    return hy.real(value.mid().str(decimal_digits(bits), radius=False), bits)


class RealParameters:
    """Conversion of exact numbers to heyoka's run-time parameters, and of integers to constants.

    The compiled integrator then does not depend on the numbers.
    """

    def __init__(self, bits: int) -> None:
        self._expressions: dict[sp.Expr, Any] = {}
        """Parameter of each number, and of each product or sum of numbers and switches."""
        self._bits = bits
        self._known: dict[tuple[sp.Expr, frozenset[tuple[sp.Symbol, sp.Expr]]], Any] = {}
        """Value of each parameter for the values of its switches."""

    def __len__(self) -> int:
        return len(self._expressions)

    def __call__(self, expression: sp.Expr) -> Any:
        if expression.is_Integer:
            return hy.expression(exact_real(expression, self._bits))
        return self._expressions.setdefault(expression, hy.par[len(self._expressions)])

    def values(self, switches: Mapping[sp.Symbol, sp.Expr]) -> list[Any]:
        """Values of the parameters, in order, as heyoka numbers, for given values of the switches."""
        return [self._value(e, switches) for e in self._expressions]

    def _value(self, expression: sp.Expr, switches: Mapping[sp.Symbol, sp.Expr]) -> Any:
        own = {s: switches[s] for s in expression.free_symbols}
        key = expression, frozenset(own.items())
        if key not in self._known:
            self._known[key] = exact_real(expression.xreplace(own), self._bits)
        return self._known[key]


def to_heyoka(
    expression: sp.Expr, symbols: Mapping[sp.Symbol, Any], constant: Number, switches: Collection[sp.Symbol] = ()
) -> Any:
    """Translate a smooth expression to heyoka; ModelError if heyoka has no Taylor recurrence for a function.

    Its symbols are those of ``symbols`` (symbol -> heyoka expression, ``hy.time`` for time) and ``switches``, which are
    numbers in a run; all other parts are exact numbers. ``constant`` makes a heyoka constant or run-time parameter of
    an exact number or an expression in switches. All switches and numbers of a product become one parameter, because
    heyoka would compute a series for a product of several, and a product of series costs the square of the order.
    """
    telling = frozenset(switches)

    def parts(e: sp.Expr, walk: Walk[Any]) -> list[Any]:
        """Convert the arguments that vary in time, and append all others, combined into one constant."""
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
        if name not in ELEMENTARY:
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
    """Power by products only: the recurrence of a general power divides by the base, which may be zero."""
    if exponent == 1:
        return base
    half = _natural_power(base, exponent // 2)
    square = half * half
    return square * base if exponent % 2 else square
