"""Kinks and jumps of written functions (``abs``, ``sign``, ``min``, ``max``, ``piecewise``) as signs of surfaces.

``abs(u)`` becomes ``u*sgn(u)``; ``max(u, v)`` becomes u or v, chosen by the sign of ``u - v``; ``piecewise`` chooses
by the sign of the difference of the two sides of its comparison. Each argument becomes a surface ``kink1``, ``kink2``,
... in order of appearance, unless it equals a surface of the model or an earlier argument up to a factor of constant
sign; it then shares that sign.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import product

import sympy as sp

from henon_ref.errors import ExpressionError
from henon_ref.expressions.algebra import signed_form, up_to_a_number
from henon_ref.expressions.bounds import exact_sign, shown, terms

MAX_INNER = 4
"""Largest number of kinks in the argument of another kink: each doubles the number of branches."""


class Sgn(sp.Function):
    """Sign of an expression, before it has a symbol."""

    nargs = 1
    is_real = True


def sgn(argument: sp.Expr) -> sp.Expr:
    """Return the sign of an expression: a number, or -1 or +1 times a :class:`Sgn` of a form without factor.

    If the expression has kinks, the sign is that of its branches, chosen by the signs of those kinks.
    """
    if argument.is_number:
        return sp.sign(argument)
    inner = _inner(argument)
    if inner is None:
        form, sign = up_to_a_number(argument)
        return sign * Sgn(form)
    return either(inner, *(sgn(argument.xreplace({inner: sp.Integer(side)})) for side in (1, -1)))


def either(sign: sp.Expr, above: sp.Expr, below: sp.Expr) -> sp.Expr:
    """Return an expression that equals ``above`` or ``below`` if a sign is +1 or -1."""
    return above if above == below else above * (1 + sign) / 2 + below * (1 - sign) / 2


def _inner(argument: sp.Expr) -> sp.Expr | None:
    """Return a sign in an expression whose argument contains no other sign; None if there is none."""
    found = [sign for sign in argument.atoms(Sgn) if not sign.args[0].has(Sgn)]
    return min(found, key=sp.default_sort_key) if found else None


def branches(argument: sp.Expr) -> list[sp.Expr]:
    """Return the branches of an expression between its kinks; without kinks, the expression itself."""
    inner = _inner(argument)
    if inner is None:
        return [argument]
    return [part for side in (1, -1) for part in branches(argument.xreplace({inner: sp.Integer(side)}))]


def without_signs(expression: sp.Expr, signs: Collection[sp.Symbol]) -> sp.Expr:
    """Return an equal expression whose kinks contain none of some signs; these choose between kinks instead."""
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
    """Return an expression in which each :class:`Sgn` has a form without factor as its argument."""
    return expression.replace(lambda e: isinstance(e, Sgn), lambda e: sgn(e.args[0]))


def at_signs(argument: sp.Expr, signs: Collection[sp.Symbol]) -> list[sp.Expr]:
    """Return the values of an argument for all choices of the signs that it contains."""
    held = sorted(argument.free_symbols & set(signs), key=lambda s: s.name)
    choices = product((1, -1), repeat=len(held))
    return [argument.xreplace(dict(zip(held, map(sp.Integer, choice), strict=True))) for choice in choices]


def chosen(first: sp.Expr, difference: sp.Expr, second: sp.Expr) -> sp.Expr:
    """Return an expression that equals the first if a difference is positive, the second if it is negative."""
    if first == second:
        return first
    sign = sgn(difference)
    if sign.is_number:
        return first if sign >= 0 else second
    symbol, way = (sign, 1) if isinstance(sign, Sgn) else (-sign, -1)
    if isinstance(symbol, Sgn):  # each is evaluated on its own side only
        first, second = (e.xreplace({symbol: sp.Integer(side)}) for e, side in ((first, way), (second, -way)))
    return sign * first if first == -second else either(sign, first, second)


def compared(name: str, arguments: Sequence[sp.Expr]) -> Sequence[sp.Expr]:
    """Return the expressions at whose zeros a call has a kink or a jump."""
    if name in ("min", "max"):
        return [difference for _, difference in _largest(arguments, name)]
    return arguments[1::2] if name == "piecewise" else arguments


def _largest(arguments: Sequence[sp.Expr], name: str) -> Iterator[tuple[sp.Expr, sp.Expr]]:
    """Yield ``max`` (or ``min``) of the first two, three, ... expressions, each with the difference that decides it."""
    found = arguments[0]
    for other in arguments[1:]:
        difference = found - other
        _check_inner(name, difference)
        first, second = (found, other) if name == "max" else (other, found)
        found = chosen(first, difference, second)
        yield found, difference


def _check_inner(name: str, difference: sp.Expr) -> None:
    """Raise ExpressionError if the argument of a kink contains too many kinks."""
    if len(difference.atoms(Sgn)) > MAX_INNER:
        raise ExpressionError(
            f"the argument of '{name}' has more than {MAX_INNER} kinks; define surfaces and use their signs"
        )


def call(name: str, arguments: Sequence[sp.Expr], offset: int, strict: Sequence[bool] = ()) -> sp.Expr:
    """Return ``abs``, ``sign``, ``min``, ``max`` or ``piecewise`` as an expression in signs.

    A condition of ``piecewise`` is given as an expression that is positive if it holds; ``strict`` gives for each
    condition whether it fails if that expression is 0. Raises ExpressionError if the arguments have too many kinks, or
    if the value on a surface differs from the values on both sides.
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
    """Raise ExpressionError if a ``piecewise`` with one surface has a value on it unlike both sides and their mean."""
    signs = [sgn(condition) for condition in conditions]
    surfaces = set().union(*(sign.atoms(Sgn) for sign in signs))
    if len(surfaces) != 1:
        return
    (surface,) = surfaces
    above, below = (
        _first_value(values, (sign.xreplace({surface: side}) > 0 for sign in signs)).xreplace({surface: side})
        for side in (sp.Integer(1), sp.Integer(-1))
    )
    holds = ((not sign.is_number and not s) or sign == 1 for sign, s in zip(signs, strict, strict=True))
    own = _first_value(values, holds)
    if own.xreplace({surface: sp.S.One}) == above or own.xreplace({surface: sp.S.NegativeOne}) == below:
        return
    here = {surface.args[0]: sp.S.Zero, surface: sp.S.Zero}
    zero = _zero_of(surface.args[0])
    apart = [(own - side).xreplace(here).xreplace(zero) for side in (above, below, (above + below) / 2)]
    # A difference of more terms is not multiplied out, and taken as not zero.
    if all(difference != 0 and (terms(difference) > 1_000 or sp.expand(difference) != 0) for difference in apart):
        value = "a value of its own" if own.has(Sgn) else shown(own)
        raise ExpressionError(
            f"where {shown(surface.args[0])} is 0, this expression is {value}, the value of neither side; on a surface "
            "a field follows from its two sides. For static friction larger than sliding friction give 'static' in a "
            "scene, or 'sliding' with 'entry: inside'"
        )


def _zero_of(argument: sp.Expr) -> dict[sp.Expr, sp.Expr]:
    """Return a symbol in which an expression is linear, with the value at which it is zero; empty if there is none."""
    for symbol in sorted(argument.free_symbols, key=str):
        slope = argument.diff(symbol)
        if slope.is_number and slope != 0:
            return {symbol: sp.expand(symbol - argument / slope)}
    return {}


def _first_value(values: Sequence[sp.Expr], holds: Iterable[object]) -> sp.Expr:
    """Return the value of the first condition that holds, or the last value."""
    return next((value for value, held in zip(values, holds, strict=False) if held), values[-1])


class Kinks:
    """Collection of the surfaces of a model's kinks; signs of expressions in parameters alone become numbers."""

    def __init__(self, parameters: Mapping[sp.Symbol, sp.Expr]) -> None:
        """``parameters``: parameter -> exact value."""
        self.parameters = dict(parameters)
        self.surfaces: dict[sp.Symbol, sp.Expr] = {}
        """Sign -> its argument, as written first."""
        self.declared: dict[sp.Symbol, sp.Expr] = {}
        """Sign of a surface of the model -> the surface."""
        self.conditions: list[sp.Expr] = []
        """Expressions in parameters that were taken as positive, from the parameters' values."""
        self.declared_late = False
        """Whether a kink equals a surface that was declared after it."""
        self._waiting: dict[sp.Symbol, sp.Expr] = {}
        """Declared surfaces whose normal forms have not been computed."""
        self._signs: dict[sp.Expr, sp.Expr] = {}
        """Normal form -> its sign: a symbol, minus a symbol, or a number."""
        self._known: dict[object, sp.Expr] = {}
        """Form of :func:`~henon_ref.expressions.algebra.signed_form` -> its sign, a symbol or minus a symbol."""

    def declare(self, sign: sp.Symbol, surface: sp.Expr) -> None:
        """Declare a surface of the model: a kink that equals it up to a factor shares its sign."""
        self.declared[sign] = self._waiting[sign] = surface
        if self.surfaces:
            self._take_in()

    def _take_in(self) -> None:
        """Compute the forms of the declared surfaces (postponed because models without kinks do not need them)."""
        for sign, surface in self._waiting.items():
            form, way = signed_form(surface, self.parameters)
            own = self._known.setdefault(form, way * sign)
            self.declared_late |= not own.free_symbols.isdisjoint(self.surfaces)
        self._waiting.clear()

    def resolved(self, expression: sp.Expr, arguments: Sequence[sp.Expr]) -> sp.Expr:
        """Return an expression with symbols for its signs; ``arguments`` of its kinks in order of appearance."""
        for argument in (part for whole in arguments for part in branches(whole)):
            form, way = (argument, 1) if argument.is_number else up_to_a_number(argument)
            if form not in self._signs and expression.has(Sgn(form)):
                self._signs[form] = way * self._sign(argument)
        found = ((sign, self._signs.get(sign.args[0])) for sign in expression.atoms(Sgn))
        return expression.xreplace({sign: value for sign, value in found if value is not None})

    def guard(
        self, sign: sp.Symbol, expression: sp.Expr, arguments: Sequence[sp.Expr]
    ) -> tuple[dict[sp.Symbol, sp.Expr], sp.Expr]:
        """Return the surfaces of a guard that may have kinks, and its sign as an expression in their signs.

        Without kinks the surface is the guard itself; with kinks each branch is a surface: ``s``, ``s_2``, ...
        """
        surfaces: dict[sp.Symbol, sp.Expr] = {}
        signs: dict[sp.Expr, sp.Expr] = {}
        parts = branches(expression)
        for part in parts:
            form, way = (part, 1) if part.is_number else up_to_a_number(part)
            if Sgn(form) not in signs and not part.free_symbols <= set(self.parameters):
                own = sp.Symbol(f"{sign.name}_{len(surfaces) + 1}", real=True) if surfaces else sign
                surfaces[own] = part
                signs[Sgn(form)] = way * own
        return surfaces, self.resolved(sgn(expression).xreplace(signs), [*arguments, *parts])

    def used(self, expression: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
        held = expression.free_symbols
        return {sign: surface for sign, surface in self.surfaces.items() if sign in held}

    def _sign(self, argument: sp.Expr) -> sp.Expr:
        if argument.free_symbols <= set(self.parameters):
            value = exact_sign(argument.xreplace(self.parameters))
            self.conditions.append(-argument if value < 0 else argument)
            return sp.Integer(value)
        self._take_in()
        form, way = signed_form(argument, self.parameters)
        if form not in self._known:
            sign = sp.Symbol(f"kink{len(self.surfaces) + 1}", real=True)
            self.surfaces[sign], self._known[form] = argument, way * sign
        return way * self._known[form]
