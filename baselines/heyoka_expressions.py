"""SymPy expressions as heyoka's.

heyoka's own ``from_sympy`` refuses rationals whose denominator is no power of two (and sign, Abs, Piecewise,
of which a mode has none). Here every constant part is one double, as for all other libraries.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp

from henon_ref.errors import UnsupportedError
from henon_ref.modes.callables import rounded
from henon_ref.taylor.fold import Rules, Walk, fold, fraction
from henon_ref.taylor.rules import FUNCTIONS
from henon_ref.taylor.tape import TIME


def to_heyoka(expression: sp.Expr, variables: Mapping[sp.Symbol, Any]) -> Any:
    """One expression in heyoka's form.

    Parameters
    ----------
    expression : Expr
        In time and the states, parameters put in.
    variables : mapping
        State -> heyoka variable.

    Raises
    ------
    UnsupportedError
        For a function that heyoka does not have.
    """
    import heyoka as hy

    def number(value: sp.Expr) -> Any:
        return hy.expression(float(value))

    def product(e: sp.Expr, walk: Walk[Any]) -> Any:
        above, below = fraction(e)
        numerator = hy.prod(list(map(walk, above))) if above else number(sp.Integer(1))
        return numerator / hy.prod(list(map(walk, below))) if below else numerator

    def power(e: sp.Expr, walk: Walk[Any]) -> Any:
        if e.base == sp.E:
            return hy.exp(walk(e.exp))
        if e.exp.is_Rational and e.exp.is_negative:
            return number(sp.Integer(1)) / walk(sp.Pow(e.base, -e.exp))
        base = walk(e.base)
        if e.exp.is_Integer:
            return whole_power(base, int(e.exp))
        if e.exp == sp.Rational(1, 2):
            return hy.sqrt(base)
        return base ** (float(e.exp) if e.exp.is_number else walk(e.exp))

    def whole_power(base: Any, n: int) -> Any:
        # heyoka expands x**3 by a recurrence that divides by x: at x = 0 it is NaN, events on it are lost, and
        # near 0 its steps are short. Products and squares have neither trouble.
        if n == 1:
            return base
        return whole_power(base, n - 1) * base if n % 2 else whole_power(base, n // 2) ** 2.0

    def function(e: sp.Expr, walk: Walk[Any]) -> Any:
        name = e.func.__name__
        if name not in FUNCTIONS:
            raise UnsupportedError(f"heyoka has no {name}")
        return getattr(hy, name)(walk(e.args[0]))

    rules = Rules(number, lambda e, walk: hy.sum(list(map(walk, e.args))), product, power, function)
    return fold(rounded(expression), rules, {TIME: hy.time, **variables})
