"""Kinks and jumps as people write them: ``abs``, ``sign``, ``min``, ``max`` and ``piecewise`` by signs of surfaces.

``abs(u)`` is ``u*sgn(u)``, ``max(u, v)`` is u or v by the sign of ``u - v``, and ``piecewise`` chooses by the sign of
what its comparison compares. Each argument becomes a surface ``kink1``, ``kink2``, ... in order of appearance, an
equal one (up to a factor that is a number) once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from henon_ref.errors import ExpressionError
from henon_ref.filippov.exact_numbers import exact_sign
from henon_ref.filippov.switched_field import up_to_a_number


class Sgn(sp.Function):
    """The sign of an expression, until it has a symbol."""

    nargs = 1
    is_real = True


def sgn(argument: sp.Expr) -> sp.Expr:
    """The sign of an expression: a number's own, else -1 or +1 times a :class:`Sgn` of a form without factor."""
    if argument.is_number:
        return sp.sign(argument)
    form, sign = up_to_a_number(argument)
    return sign * Sgn(form)


def chosen(first: sp.Expr, difference: sp.Expr, second: sp.Expr) -> sp.Expr:
    """The first expression where a difference is positive, the second where it is negative."""
    if first == second:
        return first
    sign = sgn(difference)
    if sign.is_number:
        return first if sign >= 0 else second
    return first * (1 + sign) / 2 + second * (1 - sign) / 2


def compared(name: str, arguments: Sequence[sp.Expr]) -> Sequence[sp.Expr]:
    """What a call has a kink or a jump for where it is 0."""
    if name in ("min", "max"):
        return [arguments[0] - arguments[1]]
    return arguments[1::2] if name == "piecewise" else arguments


def call(name: str, arguments: Sequence[sp.Expr], offset: int) -> sp.Expr:
    """``abs``, ``sign``, ``min``, ``max``; and ``piecewise``, each condition given as what is positive where it holds.

    Raises
    ------
    ExpressionError
        Where an argument has a kink of its own.
    """
    differences = compared(name, arguments)
    if any(difference.has(Sgn) for difference in differences):
        message = f"'{name}' of what has a kink of its own is not there yet; name a surface and use its sign"
        raise ExpressionError(message, offset)
    if name == "piecewise":
        value = arguments[-1]
        for k in range(len(arguments) - 3, -1, -2):
            value = chosen(arguments[k], arguments[k + 1], value)
        return value
    (difference,) = differences
    if name in ("min", "max"):
        first, second = arguments if name == "max" else reversed(arguments)
        return chosen(first, difference, second)
    return sgn(difference) * (difference if name == "abs" else 1)


class Kinks:
    """Collects the surfaces of a model's kinks.

    Parameters
    ----------
    parameters : mapping
        Parameter -> exact number: the sign of what holds nothing else is a number.
    """

    def __init__(self, parameters: Mapping[sp.Symbol, sp.Expr]) -> None:
        self.parameters = dict(parameters)
        self.surfaces: dict[sp.Symbol, sp.Expr] = {}
        """Sign -> what it is the sign of, as it was written first."""
        self._signs: dict[sp.Expr, sp.Expr] = {}
        """Form -> its sign: a symbol, minus one, or a number."""

    def resolved(self, expression: sp.Expr, arguments: Sequence[sp.Expr]) -> sp.Expr:
        """An expression with symbols for its signs; ``arguments`` are those of its kinks in order of appearance."""
        for argument in arguments:
            form, way = (argument, 1) if argument.is_number else up_to_a_number(argument)
            if form not in self._signs and expression.has(Sgn(form)):
                self._signs[form] = way * self._sign(argument)
        return expression.xreplace({Sgn(form): sign for form, sign in self._signs.items()})

    def positive_part(self, expression: sp.Expr) -> sp.Expr:
        """max(0, expression)."""
        return self.resolved(chosen(expression, expression, sp.S.Zero), [expression])

    def limited(self, expression: sp.Expr, bound: sp.Expr) -> sp.Expr:
        """The expression where it lies between -bound and bound, else the one of these that it is beyond."""
        above, below = bound + expression, bound - expression
        return self.resolved((sgn(above) * above - sgn(below) * below) / 2, [above, below])

    def used(self, expression: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
        """The surfaces whose signs an expression holds."""
        return {sign: surface for sign, surface in self.surfaces.items() if expression.has(sign)}

    def _sign(self, argument: sp.Expr) -> sp.Expr:
        if argument.free_symbols <= set(self.parameters):
            return sp.Integer(exact_sign(argument.xreplace(self.parameters)))
        sign = sp.Symbol(f"kink{len(self.surfaces) + 1}", real=True)
        self.surfaces[sign] = argument
        return sign
