"""SymPy expressions as Python callables, for numerical libraries.

Every number in an expression is exact; :func:`rounded` folds each constant part once, with one rounding. Scalar
callables (``math``, one float per argument) are the fastest plain Python for a few states.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from sympy.printing.pycode import PythonCodePrinter

from henon_ref.errors import ModelError
from henon_ref.taylor.tape import TIME

Scalar = Callable[..., tuple[float, ...]]
"""``f(t, *x)`` -> one float per expression."""

ARITHMETIC = (ZeroDivisionError, ValueError, OverflowError)
"""Exceptions of ``math`` and python-flint for an expression without a finite value."""


def rounded(expression: sp.Expr) -> sp.Expr:
    """Return the expression with every constant part folded to one double.

    Integers that a double represents exactly stay (exponents, unit factors); exponents stay exact. ModelError if a
    constant is not a finite number (a mode that does not exist for these parameters).

    >>> x = sp.Symbol("x", real=True)
    >>> rounded(sp.sqrt(3) / 9 * x)
    0.19245008972987526*x
    """
    if expression.is_number:
        return expression if expression.is_Float else _constant(expression)
    if expression.is_Pow:
        exponent = expression.exp if expression.exp.is_Rational else rounded(expression.exp)
        return sp.Pow(rounded(expression.base), exponent)
    if expression.is_Mul or expression.is_Add:
        numbers = [a for a in expression.args if a.is_number]
        others = [rounded(a) for a in expression.args if not a.is_number]
        constant = expression.func(*numbers)
        return expression.func(_constant(constant), *others)
    return expression.func(*(rounded(a) for a in expression.args)) if expression.args else expression


def with_rounded_constants(expressions: Iterable[sp.Expr]) -> tuple[sp.Expr, ...]:
    """Return expressions with :func:`rounded` constants; constant expressions become doubles."""
    return tuple(_float(e) if e.is_number else rounded(e) for e in expressions)


def _constant(number: sp.Expr) -> sp.Expr:
    return number if number.is_Integer and abs(number) <= 2**53 else _float(number)  # up to 2**53 all are doubles


def _float(number: sp.Expr) -> sp.Float:
    value = number.evalf(40)
    if not value.is_comparable or not math.isfinite(float(value)):
        raise ModelError(f"the constant {number} is not a finite number")
    # 17 decimal digits identify a double; sp.Float(float) keeps its 53 bits.
    return sp.Float(float(value), 17)


class ScalarPrinter(PythonCodePrinter):
    """Printer with ``math`` names; a non-integer power of a negative base raises an exception."""

    def __init__(self) -> None:
        super().__init__({"fully_qualified_modules": False, "inline": True, "allow_unknown_functions": True})

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:  # noqa: N802  (SymPy's name)
        if expr.exp.is_Integer or abs(expr.exp) == sp.Rational(1, 2):
            return str(super()._print_Pow(expr, rational=rational))
        return f"pow({self._print(expr.base)}, {self._print(expr.exp)})"

    def _print_Float(self, expr: sp.Float) -> str:  # noqa: N802  (SymPy's name)
        return repr(float(expr))


def scalar(
    states: Sequence[sp.Symbol],
    expressions: Iterable[sp.Expr],
    functions: Mapping[str, Callable[[float], float]] | None = None,
) -> Scalar:
    """Return ``f(t, *states)`` of expressions in time and states by ``math``, with common subexpressions shared.

    ``functions``: name -> callable for a function that ``math`` does not have.
    """
    return _lambdified(tuple(states), with_rounded_constants(expressions), tuple((functions or {}).items()))


@lru_cache(maxsize=4096)
def _lambdified(
    states: tuple[sp.Symbol, ...],
    exprs: tuple[sp.Expr, ...],
    functions: tuple[tuple[str, Callable[[float], float]], ...],
) -> Scalar:
    """Compile expressions; cached, since modes share many of their functions."""
    return sp.lambdify(
        [TIME, *states],
        exprs,
        modules=[{"pow": math.pow, **dict(functions)}, "math"],
        printer=ScalarPrinter(),
        cse=True,
        dummify=True,
    )


def vector(states: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., NDArray[np.float64]]:
    """Return ``f(t, x)`` of time and the array of states -> one value per expression, shape (m,).

    All values are NaN if one expression has no value (a division by zero, a root of a negative number).
    """
    function, nowhere = scalar(states, expressions), (math.nan,) * len(expressions)

    def values(t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        try:
            return np.array(function(t, *x.tolist()))
        except ARITHMETIC:
            return np.array(nowhere)

    return values


def interpreted(symbols: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[[float, Any], Any]:
    """Return ``f(t, x)`` of time and an array -> one value per expression; raises an exception if one has no value."""
    function = scalar(symbols, expressions)
    return lambda t, x: function(t, *x.tolist())


class Jacobian:
    """df/dx by SymPy; only entries that are not identically zero are evaluated.

    ``switches``: further symbols of the field, whose values :meth:`at` sets; ``function`` makes ``f(t, x)`` of symbols
    and expressions, as :func:`interpreted` does.
    """

    def __init__(
        self,
        states: Sequence[sp.Symbol],
        field: Sequence[sp.Expr],
        switches: Sequence[sp.Symbol] = (),
        function: Callable[..., Callable[[float, Any], Any]] = interpreted,
    ) -> None:
        entries = [
            (i, k, slope)
            for i, f in enumerate(field)
            for k, x in enumerate(states)
            if f.has(x) and (slope := sp.diff(f, x)) != 0
        ]
        self.shape = (len(field), len(states))
        self._rows = np.array([i for i, _, _ in entries], dtype=np.intp)
        self._columns = np.array([k for _, k, _ in entries], dtype=np.intp)
        self._point = np.empty(len(states) + len(switches))
        slopes = [slope for _, _, slope in entries]
        self._values = function((*states, *switches), slopes) if entries else lambda t, x: ()

    def at(self, switches: Sequence[float]) -> Jacobian:
        """Return a copy with these values of the switches."""
        found = copy(self)
        found._point = self._point.copy()
        found._point[self.shape[1] :] = switches
        return found

    def fill(self, t: float, x: NDArray[np.float64], out: NDArray[np.float64]) -> None:
        """Write df/dx at (t, x), shape (n, n), into ``out`` (NaN without a value)."""
        out[:] = 0.0
        point = x
        if len(self._point) > self.shape[1]:
            point = self._point
            point[: self.shape[1]] = x
        try:
            out[self._rows, self._columns] = self._values(t, point)
        except ARITHMETIC:
            out[self._rows, self._columns] = math.nan

    def __call__(self, t: float, x: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.empty(self.shape)
        self.fill(t, x, out)
        return out
