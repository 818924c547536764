"""Kinks and jumps as people write them: ``abs``, ``sign``, ``min``, ``max`` and ``piecewise`` by signs of surfaces.

``abs(u)`` is ``u*sgn(u)``, ``max(u, v)`` is u or v by the sign of ``u - v``, and ``piecewise`` chooses by the sign of
what its comparison compares. Each argument becomes a surface ``kink1``, ``kink2``, ... in order of appearance; but one
that is a surface of the model, or another argument, times a factor that always has the same sign has that one's sign.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import product

import sympy as sp

from henon_ref.errors import ExpressionError
from henon_ref.modes.algebra import signed_form
from henon_ref.modes.bounds import exact_sign, shown, terms
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
    above, below = (sgn(argument.xreplace({inner: sp.Integer(side)})) for side in (1, -1))
    return above if above == below else above * (1 + inner) / 2 + below * (1 - inner) / 2


def _inner(argument: sp.Expr) -> sp.Expr | None:
    """A sign in an expression that holds no other."""
    found = [sign for sign in argument.atoms(Sgn) if not sign.args[0].has(Sgn)]
    return min(found, key=sp.default_sort_key) if found else None


def _branches(argument: sp.Expr) -> list[sp.Expr]:
    """What the sign of an expression is made of: itself, or its branches where it has kinks of its own."""
    inner = _inner(argument)
    if inner is None:
        return [argument]
    return [part for side in (1, -1) for part in _branches(argument.xreplace({inner: sp.Integer(side)}))]


def without_signs(expression: sp.Expr, signs: Collection[sp.Symbol]) -> sp.Expr:
    """An expression whose kinks hold none of some signs: these choose among its values at -1 and +1."""
    return sp.Add(*(_chosen_by_signs(term, signs) for term in sp.Add.make_args(expression)))


def _chosen_by_signs(term: sp.Expr, signs: Collection[sp.Symbol]) -> sp.Expr:
    held = {s for kink in term.atoms(Sgn) for s in kink.free_symbols} & set(signs)
    if not held:
        return term
    sign = min(held, key=lambda s: s.name)
    above, below = (_chosen_by_signs(_normal(term.xreplace({sign: sp.Integer(side)})), signs) for side in (1, -1))
    return above if above == below else above * (1 + sign) / 2 + below * (1 - sign) / 2


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
    if first == -second:
        return sign * first
    return first if first == second else first * (1 + sign) / 2 + second * (1 - sign) / 2


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


def call(name: str, arguments: Sequence[sp.Expr], offset: int) -> sp.Expr:
    """``abs``, ``sign``, ``min``, ``max``; and ``piecewise``, each condition given as what is positive where it holds.

    Raises
    ------
    ExpressionError
        Where an argument has too many kinks of its own.
    """
    try:
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


def check_on_surface(
    values: Sequence[sp.Expr], conditions: Sequence[sp.Expr], strict: Sequence[bool], offset: int
) -> None:
    """Refuse a ``piecewise`` of one surface that has a value on it which is neither side's, nor halfway between them.

    Parameters
    ----------
    values, conditions : sequences of Expr
        The last value is that where no condition holds; each condition is what is positive where it holds.
    strict : sequence of bool
        Whether a condition does not hold where it is 0.
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
            "'sliding' with 'entry: inside'",
            offset,
        )


def _first(holds: Iterable[object]) -> int:
    """Index of the first condition that holds, or of the value behind the last."""
    count = -1
    for count, held in enumerate(holds):
        if held:
            return count
    return count + 1


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
        self.declared: dict[sp.Symbol, sp.Expr] = {}
        """The same of the model's own surfaces."""
        self.conditions: list[sp.Expr] = []
        """What has been taken as positive for the values of the parameters."""
        self.declared_late = False
        """Whether a kink has turned out to be a surface that was declared behind it."""
        self._waiting: dict[sp.Symbol, sp.Expr] = {}
        """Those whose forms are not known yet."""
        self._signs: dict[sp.Expr, sp.Expr] = {}
        """Form -> its sign: a symbol, minus one, or a number."""
        self._known: dict[object, sp.Expr] = {}
        """Form of :func:`henon_ref.modes.algebra.signed_form` -> its sign, a symbol or minus one."""

    def declare(self, sign: sp.Symbol, surface: sp.Expr) -> None:
        """Take in a surface of the model: what is one up to a factor has its sign."""
        self.declared[sign] = self._waiting[sign] = surface
        if self.surfaces:
            self._take_in()

    def _take_in(self) -> None:
        """Forms of the surfaces that have been declared; where there are no kinks nobody asks for them."""
        for sign, surface in self._waiting.items():
            form, way = signed_form(surface, self.parameters)
            own = self._known.setdefault(form, way * sign)
            self.declared_late |= not own.free_symbols.isdisjoint(self.surfaces)
        self._waiting.clear()

    def resolved(self, expression: sp.Expr, arguments: Sequence[sp.Expr]) -> sp.Expr:
        """An expression with symbols for its signs; ``arguments`` are those of its kinks in order of appearance."""
        for argument in (part for whole in arguments for part in _branches(whole)):
            form, way = (argument, 1) if argument.is_number else up_to_a_number(argument)
            if form not in self._signs and expression.has(Sgn(form)):
                self._signs[form] = way * self._sign(argument)
        found = ((sign, self._signs.get(sign.args[0])) for sign in expression.atoms(Sgn))
        return expression.xreplace({sign: value for sign, value in found if value is not None})

    def guard(
        self, sign: sp.Symbol, expression: sp.Expr, arguments: Sequence[sp.Expr]
    ) -> tuple[dict[sp.Symbol, sp.Expr], sp.Expr]:
        """Surfaces of an expression that may have kinks, and its sign by theirs.

        Without kinks that is the sign itself; with them each branch is a surface: ``s``, ``s_2``, ...
        """
        surfaces: dict[sp.Symbol, sp.Expr] = {}
        signs: dict[sp.Expr, sp.Expr] = {}
        parts = _branches(expression)
        for part in parts:
            form, way = (part, 1) if part.is_number else up_to_a_number(part)
            if Sgn(form) not in signs and not part.free_symbols <= set(self.parameters):
                own = sp.Symbol(f"{sign.name}_{len(surfaces) + 1}", real=True) if surfaces else sign
                surfaces[own] = part
                signs[Sgn(form)] = way * own
        return surfaces, self.resolved(sgn(expression).xreplace(signs), [*arguments, *parts])

    def positive_part(self, expression: sp.Expr, arguments: Sequence[sp.Expr] = ()) -> sp.Expr:
        """max(0, expression), which may have kinks itself, of ``arguments``."""
        return self.resolved(chosen(expression, expression, sp.S.Zero), [*arguments, expression])

    def limited(self, expression: sp.Expr, bound: sp.Expr) -> sp.Expr:
        """The expression where it lies between -bound and bound, else the one of these that it is beyond."""
        above, below = bound + expression, bound - expression
        return self.resolved((sgn(above) * above - sgn(below) * below) / 2, [above, below])

    def used(self, expression: sp.Expr) -> dict[sp.Symbol, sp.Expr]:
        """The kinks whose signs an expression holds."""
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
