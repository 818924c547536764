"""SymPy expressions as text that C, Octave, Python, Julia, JavaScript and awk can evaluate.

Doubles, names, ``+ - * /``, parentheses, ``pow(a, b)``, and sin cos tan asin acos atan sinh cosh tanh exp log sqrt.
Numbers always have a point or an exponent, so that ``1.0/2.0`` is a half everywhere; Greek letters are spelled out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import sympy as sp
from sympy.printing.str import StrPrinter

from henon_ref.errors import UnsupportedError
from henon_ref.modes.callables import rounded
from henon_ref.taylor.rules import FUNCTIONS
from henon_ref.text import spelled

MULTIPLIED = 4
"""Powers of a name up to this one are written as products."""
_NAME = re.compile(r"(?<![\w.])[^\W\d_]\w*")


class _Printer(StrPrinter):
    """One double a number; powers as products, quotients, ``sqrt`` and ``pow``."""

    def _print_Symbol(self, expr: sp.Expr) -> str:  # noqa: N802
        return spelled(expr.name)

    def _print_Float(self, expr: sp.Expr) -> str:  # noqa: N802  (SymPy's names here and below)
        return repr(float(expr))

    def _print_Integer(self, expr: sp.Expr) -> str:  # noqa: N802
        return repr(float(expr))

    def _print_Rational(self, expr: sp.Expr) -> str:  # noqa: N802
        return repr(float(expr))

    _print_Zero = _print_Integer  # noqa: N815  (StrPrinter has one of its own)

    def _print_Mul(self, expr: sp.Expr) -> str:  # noqa: N802
        above: list[sp.Expr] = []
        below: list[sp.Expr] = []
        for factor in expr.as_ordered_factors():
            inverse = factor.is_Pow and factor.exp.is_number and factor.exp.is_negative
            (below if inverse else above).append(1 / factor if inverse else factor)
        sign = "-" if above and above[0] == -1 else ""
        above = above[1:] if sign else above
        product = "*".join(map(self._factor, above)) or "1.0"
        return sign + product + "".join(f"/{self._factor(factor)}" for factor in below)

    def _factor(self, expr: sp.Expr) -> str:
        text: str = self._print(expr)
        product = expr.is_Pow and expr.exp.is_Integer and "*" in text and "pow(" not in text
        return f"({text})" if expr.is_Add or expr.is_Mul or text.startswith("-") or "/" in text or product else text

    def _print_Pow(self, expr: sp.Expr, rational: bool = False) -> str:  # noqa: N802
        base, exponent = expr.base, expr.exp
        if exponent.is_number and exponent.is_negative:
            return f"1.0/{self._factor(1 / expr)}"
        if exponent == sp.Rational(1, 2):
            return f"sqrt({self._print(base)})"
        if base.is_Symbol and exponent.is_Integer and exponent <= MULTIPLIED:
            return "*".join([self._print(base)] * int(exponent))
        return f"pow({self._print(base)}, {self._print(exponent)})"

    def _print_Function(self, expr: sp.Expr) -> str:  # noqa: N802
        name = expr.func.__name__
        if name not in (*FUNCTIONS, "sqrt", "pow"):
            raise UnsupportedError(f"the protocol has no function {name}")
        return f"{name}({', '.join(map(self._print, expr.args))})"

    _print_exp = _print_Function


def infix(expression: sp.Expr) -> str:
    """The text of an expression.

    Raises
    ------
    UnsupportedError
        Where a function is not among those of the protocol.

    Examples
    --------
    >>> x, v, m = sp.symbols("x v m", real=True)
    >>> infix(-x / m + sp.Rational(1, 3) * sp.cos(v) ** 2 - sp.sqrt(2) * x**3)
    '-1.4142135623730951*(x*x*x) + 0.3333333333333333*pow(cos(v), 2.0) - x/m'
    """
    text: str = _Printer().doprint(rounded(expression))
    return text


def renamed(text: str, names: Mapping[str, str]) -> str:
    """The text with names replaced; functions are no names.

    Examples
    --------
    >>> renamed("1e5*e5 + sin(x)", {"e5": "p[0]", "x": "x[0]"})
    '1e5*p[0] + sin(x[0])'
    """
    return _NAME.sub(lambda found: names.get(found[0], found[0]), text)
