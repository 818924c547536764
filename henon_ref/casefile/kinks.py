"""Kinks and jumps as people write them: ``abs``, ``sign``, ``min``, ``max`` and ``piecewise`` by signs of surfaces.

``abs(u)`` is ``u*sgn(u)``, ``max(u, v)`` is u or v by the sign of ``u - v``, and ``piecewise`` chooses by the sign of
what its comparison compares. Each argument becomes a surface ``kink1``, ``kink2``, ... in order of appearance; but one
that is a surface of the model, or another argument, times a factor that always has the same sign has that one's sign.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import product

import sympy as sp

from henon_ref.errors import ExpressionError
from henon_ref.modes.bounds import shown, terms
from henon_ref.modes.switched_field import up_to_a_number

MAX_INNER = 4
"""Kinks that the argument of another one may have: its branches are twice as many with each."""
MAX_TERMS = 1_000
"""Terms, multiplied out, of a difference that is looked at whether it is zero."""


class Sgn(sp.Function):
    """The sign of an expression, until it has a symbol."""

    nargs = 1
    is_real = True


def sgn(argument: sp.Expr) -> sp.Expr:
    """The sign of an expression: a number's own, else -1 or +1 times a :class:`Sgn` of a form without factor.

    Of what has a kink of its own it is the sign of either branch, chosen by the kink's.
    """
    if argument.is_number:
        return sp.sign(argument)
    inner = _inner(argument)
    if inner is None:
        form, sign = up_to_a_number(argument)
        return sign * Sgn(form)
    return either(inner, *(sgn(argument.xreplace({inner: sp.Integer(side)})) for side in (1, -1)))


def either(sign: sp.Expr, above: sp.Expr, below: sp.Expr) -> sp.Expr:
    """One of two expressions by a sign."""
    return above if above == below else above * (1 + sign) / 2 + below * (1 - sign) / 2


def _inner(argument: sp.Expr) -> sp.Expr | None:
    """A sign in an expression that holds no other."""
    found = [sign for sign in argument.atoms(Sgn) if not sign.args[0].has(Sgn)]
    return min(found, key=sp.default_sort_key) if found else None


def branches(argument: sp.Expr) -> list[sp.Expr]:
    """What the sign of an expression is made of: itself, or its branches where it has kinks of its own."""
    inner = _inner(argument)
    if inner is None:
        return [argument]
    return [part for side in (1, -1) for part in branches(argument.xreplace({inner: sp.Integer(side)}))]


def without_signs(expression: sp.Expr, signs: Collection[sp.Symbol]) -> sp.Expr:
    """An expression whose kinks hold none of some signs: these choose among its values at -1 and +1."""
    return sp.Add(*(_chosen_by_signs(term, signs) for term in sp.Add.make_args(expression)))


def _chosen_by_signs(term: sp.Expr, signs: Collection[sp.Symbol]) -> sp.Expr:
    held = {s for kink in term.atoms(Sgn) for s in kink.free_symbols} & set(signs)
    if not held:
        return term
    sign = min(held, key=lambda s: s.name)
    return either(
        sign, *(_chosen_by_signs(_normal(term.xreplace({sign: sp.Integer(side)})), signs) for side in (1, -1))
    )


def _normal(expression: sp.Expr) -> sp.Expr:
    """An expression with each :class:`Sgn` that of a form without factor again."""
    return expression.replace(lambda e: isinstance(e, Sgn), lambda e: sgn(e.args[0]))


def at_signs(argument: sp.Expr, signs: Collection[sp.Symbol]) -> list[sp.Expr]:
    """What an argument is for each choice of the signs that it holds."""
    held = sorted(argument.free_symbols & set(signs), key=lambda s: s.name)
    choices = product((1, -1), repeat=len(held))
    return [argument.xreplace(dict(zip(held, map(sp.Integer, choice), strict=True))) for choice in choices]


def chosen(first: sp.Expr, difference: sp.Expr, second: sp.Expr) -> sp.Expr:
    """The first expression where a difference is positive, the second where it is negative."""
    if first == second:
        return first
    sign = sgn(difference)
    if sign.is_number:
        return first if sign >= 0 else second
    symbol, way = (sign, 1) if isinstance(sign, Sgn) else (-sign, -1)
    if isinstance(symbol, Sgn):  # what one of the two is on the other's side never counts
        first, second = (e.xreplace({symbol: sp.Integer(side)}) for e, side in ((first, way), (second, -way)))
    return sign * first if first == -second else either(sign, first, second)


def compared(name: str, arguments: Sequence[sp.Expr]) -> Sequence[sp.Expr]:
    """What a call has a kink or a jump for where it is 0."""
    if name in ("min", "max"):
        return [difference for _, difference in _largest(arguments, name)]
    return arguments[1::2] if name == "piecewise" else arguments


def _largest(arguments: Sequence[sp.Expr], name: str) -> Iterator[tuple[sp.Expr, sp.Expr]]:
    """``max`` of ever more expressions, or ``min``, and what the one before less the last expression is."""
    found = arguments[0]
    for other in arguments[1:]:
        difference = found - other
        _check_inner(name, difference)
        first, second = (found, other) if name == "max" else (other, found)
        found = chosen(first, difference, second)
        yield found, difference


def _check_inner(name: str, difference: sp.Expr) -> None:
    """Refuse what a kink is of, where it has too many of its own."""
    if len(difference.atoms(Sgn)) > MAX_INNER:
        raise ExpressionError(
            f"'{name}' of what has more than {MAX_INNER} kinks of its own; name surfaces and use their signs"
        )


def call(name: str, arguments: Sequence[sp.Expr], offset: int, strict: Sequence[bool] = ()) -> sp.Expr:
    """``abs``, ``sign``, ``min``, ``max`` and ``piecewise`` as an expression in signs.

    Of ``piecewise`` each condition is given as what is positive where it holds; ``strict`` says of each whether it does
    not hold where that is 0. An ExpressionError tells of arguments with too many kinks of their own, and of a value on
    a surface that is neither side's.
    """
    try:
        if name == "piecewise":
            _check_on_surface(arguments[::2], arguments[1::2], strict)
        return _called(name, arguments)
    except ExpressionError as error:
        raise ExpressionError(error.message, offset) from None


def _called(name: str, arguments: Sequence[sp.Expr]) -> sp.Expr:
    if name in ("min", "max"):
        return list(_largest(arguments, name))[-1][0]
    for difference in compared(name, arguments):
        _check_inner(name, difference)
    if name == "piecewise":
        value = arguments[-1]
        for k in range(len(arguments) - 3, -1, -2):
            value = chosen(arguments[k], arguments[k + 1], value)
        return value
    return sgn(arguments[0]) * (arguments[0] if name == "abs" else 1)


def _check_on_surface(values: Sequence[sp.Expr], conditions: Sequence[sp.Expr], strict: Sequence[bool]) -> None:
    """Refuse a ``piecewise`` of one surface that has a value on it which is neither side's, nor halfway between them.

    The last value is that where no condition holds.
    """
    signs = [sgn(condition) for condition in conditions]
    surfaces = set().union(*(sign.atoms(Sgn) for sign in signs))
    if len(surfaces) != 1:
        return
    (surface,) = surfaces
    above, below = (
        values[_first(sign.xreplace({surface: side}) > 0 for sign in signs)].xreplace({surface: side})
        for side in (sp.Integer(1), sp.Integer(-1))
    )
    own = values[_first((not sign.is_number and not s) or sign == 1 for sign, s in zip(signs, strict, strict=True))]
    if own.xreplace({surface: sp.S.One}) == above or own.xreplace({surface: sp.S.NegativeOne}) == below:
        return
    here = {surface.args[0]: sp.S.Zero, surface: sp.S.Zero}
    apart = [(own - side).xreplace(here) for side in (above, below, (above + below) / 2)]
    if all(difference != 0 and (terms(difference) > MAX_TERMS or sp.expand(difference) != 0) for difference in apart):
        value = "a value of its own" if own.has(Sgn) else shown(own)
        raise ExpressionError(
            f"where {shown(surface.args[0])} is 0 this is {value}, which it is on neither side: a field is what it is "
            "beside a surface. Friction that holds more than it slides with has a 'static' in a scene, or "
            "'sliding' with 'entry: inside'"
        )


def _first(holds: Iterable[object]) -> int:
    """Index of the first condition that holds, or of the value behind the last."""
    count = -1
    for count, held in enumerate(holds):
        if held:
            return count
    return count + 1
