"""SymPy operations with work bounded in advance.

A SymPy call cannot be stopped safely, and a call on a short text may never return: ``simplify`` of a sum of quotients
of functions tries every identity it has. So an expression is measured first and left as written if it is large. The
measure is the size of the polynomials that numerator and denominator would become. A subexpression that is not a
rational function of symbols (``sin(x)``, ``sqrt(x)``, a giant number) counts as one symbol.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping
from math import comb, prod

import sympy as sp

from henon_ref.expressions.bounds import exact_sign, terms

MAX_TERMS, MAX_MONOMIALS = 50, 2_000
"""Largest number of expanded terms of numerator and denominator, and largest number of monomials up to their degrees,
for which their greatest common divisor is computed."""
MAX_EXPANDED = 1_000
"""Largest number of terms up to which products of sums are expanded."""
MAX_SIZE = 100_000
"""Largest total size of the equations of a mode."""
MAX_DERIVED = 400
"""Largest size of a nonlinear expression that is differentiated to test whether its derivative is constant."""


def simplified(expression: sp.Expr) -> sp.Expr:
    """Return the simplified expression, or the expression as written if that is too much work."""
    if not expression.has(sp.Add, sp.Function):  # a product is simple; SymPy would first load its units, 0.2 s
        return expression
    return _rational(expression, sp.simplify)


def cancelled(expression: sp.Expr) -> sp.Expr:
    """Return the expression as one quotient in lowest terms, or as written if that is too much work."""
    return _rational(expression, sp.cancel) if expression.has(sp.Add) else expression


def known_positive(expression: sp.Expr) -> bool:
    """Check with little work whether an expression is positive for all values of its symbols."""
    if expression.is_number:
        return exact_sign(expression) > 0
    extents = measured(expression)  # to be smaller than for simplification: the test is much more work
    small = extents is not None and all(part.terms <= 8 and part.monomials <= 128 for part in extents)
    return small and bool(expression.is_positive)


def up_to_a_number(expression: sp.Expr) -> tuple[sp.Expr, int]:
    """Return the expression without its numerical factor, and the sign of this factor; nothing is expanded."""
    number, rest = expression.as_independent(*expression.free_symbols, as_Add=False)
    _, form = rest.as_content_primitive()
    turned = form.could_extract_minus_sign()
    return (-form if turned else form), (1 if number.is_positive else -1) * (-1 if turned else 1)


def signed_form(expression: sp.Expr, still: Collection[sp.Symbol] = ()) -> tuple[object, int]:
    """Return a form shared by expressions that differ by a factor of constant sign, and the sign of this factor.

    ``still``: parameters; a term's factors in these symbols alone are its coefficient. Factors in other symbols count
    if they are seen to be positive (``exp(x)``).

    >>> v, b, m = sp.symbols("v b m", real=True)
    >>> form, sign = signed_form(v - b, {b, m})
    >>> [signed_form(e, {b, m}) == (form, sign) for e in (2 * v - 2 * b, sp.exp(v) * (v - b), m * (v - b))]
    [True, True, False]
    >>> signed_form(b - v, {b, m}) == (form, -sign)
    True
    """
    rest, way = _without_positive_factors(expression)
    short = terms(rest, MAX_TERMS) <= MAX_TERMS
    whole = sp.expand(rest) if short else rest
    if not short or whole == 0:
        form, sign = up_to_a_number(rest)
        return form, way * sign
    parts: dict[sp.Expr, sp.Expr] = {}
    for term in sp.Add.make_args(whole):
        coefficient, held = term.as_independent(*(term.free_symbols - set(still)), as_Add=False)
        parts[held] = parts.get(held, sp.S.Zero) + coefficient
    leading = parts[min(parts, key=sp.default_sort_key)]
    uncertain, other = _without_positive_factors(leading)
    form, sign = up_to_a_number(uncertain)
    return (form, frozenset((held, simplified(part / leading)) for held, part in parts.items())), way * other * sign


def _without_positive_factors(expression: sp.Expr) -> tuple[sp.Expr, int]:
    kept, way = [], 1
    for factor in sp.Mul.make_args(expression):
        if known_positive(-factor):
            way = -way
        elif not known_positive(factor):
            kept.append(factor)
    return sp.Mul(*kept), way


def expanded(expression: sp.Expr) -> sp.Expr:
    """Return the expression expanded at its top level, or as written if it would have too many terms."""
    return sp.expand(expression, deep=False) if _terms(expression) <= MAX_EXPANDED else expression


def coefficients(expression: sp.Expr, symbols: Collection[sp.Symbol]) -> dict[sp.Symbol, sp.Expr] | None:
    """Return the coefficients of the symbols in an expression; None if it is not written as linear in all of them.

    >>> x, y, s, u = sp.symbols("x y s u")
    >>> coefficients(x - 2*s*(y + 1) + u, [s, u]) == {s: -2*(y + 1), u: 1}
    True
    >>> coefficients(s*u, [s, u]), coefficients(sp.sin(s), [s])
    (None, None)
    """
    wanted = set(symbols)
    found = _coefficients(expression, wanted) if expression.free_symbols & wanted else {}
    return None if found is None else {s: sp.Add(*terms) for s, terms in found.items()}


def _coefficients(expression: sp.Expr, wanted: set[sp.Symbol]) -> dict[sp.Symbol, list[sp.Expr]] | None:
    if expression in wanted:
        return {expression: [sp.S.One]}
    if not (expression.is_Add or expression.is_Mul):
        return None
    found: dict[sp.Symbol, list[sp.Expr]] = {}
    moving = [argument for argument in expression.args if argument.free_symbols & wanted]
    if expression.is_Mul and len(moving) > 1:
        return None
    for argument in moving:
        inner = _coefficients(argument, wanted)
        if inner is None:
            return None
        for symbol, own in inner.items():
            if expression.is_Mul:
                others = [a for a in expression.args if a is not argument]
                own = [sp.Mul(*others, sp.Add(*own))]
            found.setdefault(symbol, []).extend(own)
    return found


def _rational(expression: sp.Expr, rule: Callable[[sp.Expr], sp.Expr]) -> sp.Expr:
    """Apply a rule to an expression as a rational function; other subexpressions are symbols to the rule."""
    extents = measured(expression)
    if extents is None:
        return expression
    others = sorted((g for part in extents for g in part.degrees if not g.is_Symbol), key=sp.default_sort_key)
    names = {g: sp.Dummy(f"g{i}", real=True) for i, g in enumerate(dict.fromkeys(others))}
    written = expression.xreplace(names)
    return rule(written).xreplace({name: g for g, name in names.items()})


class Extent:
    """Upper bound of the size of a polynomial: its terms, and its degree in each symbol."""

    def __init__(self, terms: int = 1, degrees: Counter[sp.Expr] | None = None) -> None:
        self.terms = min(terms, MAX_TERMS + 1)
        self.degrees: Counter[sp.Expr] = degrees if degrees is not None else Counter()

    def __mul__(self, other: Extent) -> Extent:
        return Extent(self.terms * other.terms, self.degrees + other.degrees)

    def __add__(self, other: Extent) -> Extent:
        return Extent(self.terms + other.terms, self.degrees | other.degrees)

    def power(self, n: int) -> Extent:
        return Extent(comb(self.terms + n - 1, n), Counter({g: n * d for g, d in self.degrees.items()}))

    @property
    def monomials(self) -> int:
        return prod(d + 1 for d in self.degrees.values())

    @property
    def small(self) -> bool:
        return self.terms <= MAX_TERMS and self.monomials <= MAX_MONOMIALS


def measured(expression: sp.Expr) -> tuple[Extent, Extent] | None:
    """Return the extents of numerator and denominator over a common denominator; None if either is large."""
    above, below = Extent(), Extent()
    # A larger number, which SymPy might factor, counts as a symbol.
    if expression.is_Rational and max(abs(expression.p), expression.q).bit_length() <= 64:
        return above, below
    if expression.is_Add or expression.is_Mul:
        for i, argument in enumerate(expression.args):
            part = measured(argument)
            if part is None:
                return None
            if expression.is_Mul:
                above, below = above * part[0], below * part[1]
            else:
                above = above * part[1] + part[0] * below if i else part[0]
                below = below * part[1]
            if not (above.small and below.small):
                return None
        return above, below
    if expression.is_Pow and expression.exp.is_Integer:
        part = measured(expression.base)
        if part is None:
            return None
        n = int(expression.exp)
        above, below = part[0].power(abs(n)), part[1].power(abs(n))
        if not (above.small and below.small):
            return None
        return (above, below) if n > 0 else (below, above)
    return Extent(1, Counter({expression: 1})), below


def _terms(expression: sp.Expr) -> int:
    """Count the terms of an expression expanded at its top level; counting stops past the limit."""
    if not (expression.is_Mul or expression.is_Pow):
        return 1
    count = 1
    for factor in sp.Mul.make_args(expression):
        base, exponent = (factor.base, factor.exp) if factor.is_Pow and factor.exp.is_Integer else (factor, sp.S.One)
        if base.is_Add:
            n = abs(int(exponent))
            count = min(count * comb(len(base.args) + n - 1, n), MAX_EXPANDED + 1)
    return count


def leaves_out(
    shared: sp.Expr, own: sp.Expr, signs: Mapping[sp.Symbol, sp.Expr], moving: Collection[sp.Symbol]
) -> bool:
    """Check whether a mode's own expression lacks a nonlinear operation of the shared expression.

    Shared expressions multiply an unused branch by zero, but zero times the root of a negative number, or times an
    overflow, is NaN. ``signs``: value in ``own`` of each symbol of ``shared``; ``moving``: time and states.
    """
    if shared.free_symbols.isdisjoint(signs):
        return False
    kept, values = _operations(own, moving), dict(signs)
    images = ((e, e.xreplace(values)) for e in _operations(shared, moving))
    return any(e not in kept and _core(image, moving) not in kept for e, image in images)


def _operations(expression: sp.Expr, moving: Collection[sp.Symbol]) -> set[sp.Basic]:
    """Return the powers and functions of moving symbols, and products of several of these, without constant factors."""
    found: set[sp.Basic] = set()
    known: dict[sp.Basic, bool] = dict.fromkeys(moving, True)

    def moves(e: sp.Basic) -> bool:
        if e not in known:
            own = [a for a in e.args if moves(a)]
            known[e] = bool(own)
            if own and (e.is_Pow or e.is_Function):
                found.add(e)
            elif len(own) > 1 and e.is_Mul:
                found.add(e if len(own) == len(e.args) else sp.Mul(*own))
        return known[e]

    moves(expression)
    return found


def _core(expression: sp.Expr, moving: Collection[sp.Symbol]) -> sp.Expr:
    if not expression.is_Mul:
        return expression
    return sp.Mul(*(f for f in expression.args if not f.free_symbols.isdisjoint(moving)))


def has_no_value(expression: sp.Expr, positive: Iterable[sp.Expr]) -> bool:
    """Check whether an expression has no real value if all expressions in ``positive`` are positive.

    This is the case if the argument of a logarithm or non-integer power is at most a negative multiple of a positive
    expression: ``sqrt(-2*x - 1)`` for positive x.
    """
    arguments = [p.base for p in expression.atoms(sp.Pow) if p.exp.is_integer is not True and p.base.free_symbols]
    arguments += [logarithm.args[0] for logarithm in expression.atoms(sp.log)]
    known = list(positive) if arguments else []
    return any(_below_multiple(argument, other) for argument in arguments for other in known)


def _below_multiple(argument: sp.Expr, positive: sp.Expr) -> bool:
    """Check whether an expression is a negative multiple of a positive one, minus a non-negative number."""
    if max(terms(argument, MAX_EXPANDED), terms(positive, MAX_EXPANDED)) > MAX_EXPANDED:
        return False
    known, own = (sp.expand(e).as_coefficients_dict() for e in (positive, argument))
    factor = next((-own[term] / c for term, c in known.items() if term.free_symbols), sp.S.Zero)
    rest = sp.expand(argument + factor * positive)
    return bool(factor.is_positive and rest.is_number and not rest.is_positive)
