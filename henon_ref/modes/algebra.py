"""Algebra whose work is known before it is begun.

A call of SymPy cannot be ended safely once it runs, and one on a short text may never end: ``simplify`` of a sum of
quotients of functions tries every identity that it knows. So an expression is measured first, and where it is large
it stays as it is written. What is measured are the polynomials that numerator and denominator would become, in
symbols and in what is no rational function of symbols (``sin(x)``, ``sqrt(x)``, a giant number), which counts as a
symbol and is not looked into.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from math import comb, prod

import sympy as sp

from henon_ref.modes.bounds import exact_sign, put, terms
from henon_ref.modes.switched_field import SwitchedField, up_to_a_number
from henon_ref.taylor.size import size
from henon_ref.taylor.tape import TIME

MAX_TERMS, MAX_MONOMIALS = 50, 2_000
"""Terms that numerator and denominator may have, multiplied out, and products of powers that there are below the
degrees of either, where their greatest common divisor is looked for."""
MAX_FACTORED_TERMS, MAX_FACTORED_MONOMIALS = 8, 128
"""The same where an expression is asked whether it is positive, which is much more work."""
MAX_COEFFICIENT = 64
"""Bits of a number that counts as one: a larger one, whose factors would be looked for, counts as a symbol."""
MAX_EXPANDED = 1_000
"""Terms up to which products of sums are multiplied out."""
MAX_SIZE = 100_000
"""Size that the equations of a mode may have, all together."""
MAX_DERIVED = 400
"""Size up to which a nonlinear expression is differentiated to see whether its derivative is a constant."""
DIGITS, AGREE = 40, sp.Float("1e-25")
"""Digits of the values, and how far apart two of the same may be, of their size."""


def simplified(expression: sp.Expr) -> sp.Expr:
    """The expression in few terms, or as it is written where that is too much work."""
    if not expression.has(sp.Add, sp.Function):  # a product is so already (SymPy loads all its units, 0.2 s, before)
        return expression
    return _rational(expression, sp.simplify, MAX_TERMS, MAX_MONOMIALS)


def cancelled(expression: sp.Expr) -> sp.Expr:
    """The expression as one quotient in lowest terms, or as it is written where that is too much work."""
    return _rational(expression, sp.cancel, MAX_TERMS, MAX_MONOMIALS) if expression.has(sp.Add) else expression


def known_positive(expression: sp.Expr) -> bool:
    """Whether an expression is seen with little work to be positive for all values of its symbols."""
    if expression.is_number:
        return exact_sign(expression) > 0
    extents = measured(expression)
    if extents is None or any(
        part.terms > MAX_FACTORED_TERMS or part.monomials > MAX_FACTORED_MONOMIALS for part in extents
    ):
        return False
    return bool(expression.is_positive)


def signed_form(expression: sp.Expr, still: Collection[sp.Symbol] = ()) -> tuple[object, int]:
    """A form that expressions share which are one another times a factor that always has one sign, and this one's sign.

    ``still``: parameters; what holds no other symbol is a coefficient. Factors that hold others count where they are
    seen to be positive (``exp(x)``).

    Examples
    --------
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
    """An expression without the factors that are seen to be positive or negative, and the sign of these."""
    kept, way = [], 1
    for factor in sp.Mul.make_args(expression):
        if known_positive(-factor):
            way = -way
        elif not known_positive(factor):
            kept.append(factor)
    return sp.Mul(*kept), way


def expanded(expression: sp.Expr) -> sp.Expr:
    """The expression multiplied out at its top, or as it is written where that has too many terms."""
    return sp.expand(expression, deep=False) if _terms(expression) <= MAX_EXPANDED else expression


def coefficients(expression: sp.Expr, symbols: Collection[sp.Symbol]) -> dict[sp.Symbol, sp.Expr] | None:
    """Coefficients of the symbols that stand in an expression; None where it is not linear in all at once by its form.

    Examples
    --------
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
    """Terms of the coefficients, of an expression that holds some of the symbols."""
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


def constant_slope(surface: sp.Expr, state: sp.Symbol, states: Collection[sp.Symbol]) -> sp.Expr | None:
    """Factor of a state in which a surface is linear with a constant (neither t nor a state) factor; None elsewhere."""
    found = coefficients(surface, [state])
    if found is not None:
        slope = found.get(state)
    else:
        slope = sp.diff(surface, state) if size(surface, MAX_DERIVED) <= MAX_DERIVED else None
    return None if slope is None or slope == 0 or slope.free_symbols & {TIME, *states} else slope


def _rational(expression: sp.Expr, rule: Callable[[sp.Expr], sp.Expr], terms: int, monomials: int) -> sp.Expr:
    """What a rule makes of an expression as a rational function; what else there is in it is a symbol to the rule."""
    extents = measured(expression)
    if extents is None or any(part.terms > terms or part.monomials > monomials for part in extents):
        return expression
    others = sorted((g for part in extents for g in part.degrees if not g.is_Symbol), key=sp.default_sort_key)
    names = {g: sp.Dummy(f"g{i}", real=True) for i, g in enumerate(dict.fromkeys(others))}
    written = expression.xreplace(names)
    return rule(written).xreplace({name: g for g, name in names.items()})


class Extent:
    """How large a polynomial may become: its terms, and its degree in each symbol."""

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
    """Extent of numerator and denominator over a common denominator; None where either is large."""
    above, below = Extent(), Extent()
    if expression.is_Rational and max(abs(expression.p), expression.q).bit_length() <= MAX_COEFFICIENT:
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
    """Terms of an expression whose products at the top are multiplied out; counting stops past the limit."""
    if not (expression.is_Mul or expression.is_Pow):
        return 1
    count = 1
    for factor in sp.Mul.make_args(expression):
        base, exponent = (factor.base, factor.exp) if factor.is_Pow and factor.exp.is_Integer else (factor, sp.S.One)
        if base.is_Add:
            n = abs(int(exponent))
            count = min(count * comb(len(base.args) + n - 1, n), MAX_EXPANDED + 1)
    return count


def sample(system: SwitchedField, expressions: Sequence[sp.Expr]) -> list[sp.Expr]:
    """Values of expressions at a point whose coordinates are quotients of primes, the system's parameters put in."""
    symbols = sorted(set().union(*(e.free_symbols for e in expressions)), key=str)
    numbers = {s: sp.Rational(sp.prime(k + 7), sp.prime(k + 17)) for k, s in enumerate(symbols)}
    numbers |= {TIME: sp.Rational(3, 7), **system.parameters}
    return [sp.N(put(e, numbers), DIGITS) for e in expressions]


def leaves_out(
    shared: sp.Expr, own: sp.Expr, signs: Mapping[sp.Symbol, sp.Expr], moving: Collection[sp.Symbol]
) -> bool:
    """Whether a mode's own expression lacks an operation of the shared one that is not linear.

    A branch that a mode does not use is multiplied by zero in what modes share, and zero times the root of a negative
    number, or times what has overflowed, is no number. ``signs``: what ``own`` has for symbols of ``shared``;
    ``moving``: time and states.
    """
    if shared.free_symbols.isdisjoint(signs):
        return False
    kept, values = _operations(own, moving), dict(signs)
    images = ((e, e.xreplace(values)) for e in _operations(shared, moving))
    return any(e not in kept and _core(image, moving) not in kept for e, image in images)


def _operations(expression: sp.Expr, moving: Collection[sp.Symbol]) -> set[sp.Basic]:
    """Its powers and functions of what moves, and products of several things that do, without constant factors."""
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
    """An expression without the factors that are constant."""
    if not expression.is_Mul:
        return expression
    return sp.Mul(*(f for f in expression.args if not f.free_symbols.isdisjoint(moving)))


def has_no_value(expression: sp.Expr, positive: Iterable[sp.Expr]) -> bool:
    """Whether an expression has no real value wherever some others are positive.

    So it is where the argument of a logarithm, or of a power that is not whole, is at most a negative multiple of one
    of them: ``sqrt(-2*x - 1)`` where x is positive.
    """
    arguments = [p.base for p in expression.atoms(sp.Pow) if p.exp.is_integer is not True and p.base.free_symbols]
    arguments += [logarithm.args[0] for logarithm in expression.atoms(sp.log)]
    known = list(positive) if arguments else []
    return any(_below_multiple(argument, other) for argument in arguments for other in known)


def _below_multiple(argument: sp.Expr, positive: sp.Expr) -> bool:
    """Whether an expression is a negative multiple of another one, or is below one by a number."""
    if max(terms(argument, MAX_EXPANDED), terms(positive, MAX_EXPANDED)) > MAX_EXPANDED:
        return False
    known, own = (sp.expand(e).as_coefficients_dict() for e in (positive, argument))
    factor = next((-own[term] / c for term, c in known.items() if term.free_symbols), sp.S.Zero)
    rest = sp.expand(argument + factor * positive)
    return bool(factor.is_positive and rest.is_number and not rest.is_positive)
