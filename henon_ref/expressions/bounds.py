"""Exact numbers, and checks before SymPy computes: work is bounded, and values are real, finite and smooth."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from math import comb

import sympy as sp

from henon_ref.errors import ExpressionError, ModelError
from henon_ref.expressions.grammar import ELEMENTARY
from henon_ref.text import shortened

MAX_BITS = 4_096
"""Largest number of bits of numerator or denominator of an exact number."""
MAX_POWER = 64
"""Largest absolute integer exponent of a base that is not a number."""
MAX_ROOT = 1_000_000
"""Largest denominator of a rational exponent."""
MAX_RATE = 10**8
"""Largest absolute number that multiplies a symbol in an exponent, since SymPy may use it as a degree."""
MAX_ANGLE = 10**15
"""Largest absolute number of which sin, cos and tan are taken."""
MAX_TERMS = 20_000
"""Largest number of terms of an expression with powers and products expanded."""
MAX_SIZE = 500
"""Largest number of operations and numbers in a number, with parameters substituted."""
MAX_LEVELS = 16
"""Largest nesting of operations in a number that is not rational: SymPy's work may double with each level."""
LARGEST = sp.Float("1.7976931348623157e308", 20)
"""Largest absolute value of a number: the largest double."""
NOT_FINITE = (sp.zoo, sp.nan, sp.oo, -sp.oo)
_DIGITS = 25
"""Decimal digits with which a number is compared with a bound: more than a double's 17."""


def power(base: sp.Expr, exponent: sp.Expr, offset: int) -> sp.Expr:
    """Return base**exponent after checking that SymPy will not compute a giant number."""
    check_power(base, exponent, offset)
    return checked(sp.Pow(base, exponent), offset)


def check_power(base: sp.Expr, exponent: sp.Expr, offset: int) -> None:
    """Refuse a power that is not finite, not real, or has too many digits."""
    if base.is_number:
        if base.is_zero and not exponent.is_positive:
            raise ExpressionError("division by zero" if exponent.is_negative else "a power of zero", offset)
        if base.is_negative and not exponent.is_integer:
            root = "'sqrt' of" if exponent in (sp.S.Half, -sp.S.Half) else f"the power {shown(exponent)} of"
            raise ExpressionError(f"{root} {shown(base)} is not a real number", offset)
    if exponent.is_Rational:
        size = abs(exponent)
        if exponent.q > MAX_ROOT:
            raise ExpressionError(f"the denominator of the exponent is too large; at most {MAX_ROOT}", offset)
        if not base.is_number and size > MAX_POWER:
            raise ExpressionError(f"the exponent {shown(exponent)} is too large; at most {MAX_POWER}", offset)
        if base not in (0, 1, -1) and size * _bits(base) > MAX_BITS:
            raise ExpressionError(
                f"a power of {shown(base)} with exponent {shown(exponent)} is too large; "
                f"exact numbers may have {MAX_BITS} bits",
                offset,
            )
        return
    if exponent.is_number and abs(exponent.evalf(_DIGITS)) > MAX_BITS:
        raise ExpressionError(f"the exponent {shown(exponent)} is too large; at most {MAX_BITS}", offset)
    _check_rates(exponent, offset)
    whole = exponent.as_coeff_Add()[0]
    if whole != 0:
        # In a product SymPy splits b**(x + 10**9) into b**x and b**(10**9).
        check_power(base, whole, offset)


def _check_rates(exponent: sp.Expr, offset: int) -> None:
    for term in sp.Add.make_args(exponent):
        rate = term.as_coeff_Mul()[0]
        if not term.is_number and abs(rate) > MAX_RATE:
            raise ExpressionError(f"the factor {shown(rate)} in an exponent is too large; at most {MAX_RATE}", offset)


def check_domain(name: str, argument: sp.Expr, offset: int) -> None:
    """Refuse numbers at which a function is not defined, or that SymPy cannot reduce."""
    if name in ("sin", "cos", "tan") and abs(argument.evalf(_DIGITS)) > MAX_ANGLE:
        raise ExpressionError(f"'{name}' of {shown(argument)}: at most {MAX_ANGLE:.0e} is allowed", offset)
    if name == "log" and argument.is_negative:
        raise ExpressionError(f"'log' of {shown(argument)} is not a real number", offset)
    if name in ("asin", "acos"):
        beyond = abs(argument if argument.is_Rational else argument.evalf(120)) - 1
        if beyond > 0:
            raise ExpressionError(f"'{name}' of {shown(argument)} is not a real number", offset)
        if not argument.is_Rational and beyond > -sp.Float("1e-100", 120):
            raise ExpressionError(f"'{name}' of {shown(argument)}, which cannot be distinguished from 1 or -1", offset)


def check_exponential(argument: sp.Expr, offset: int) -> None:
    """Check the powers that SymPy makes of an exponential: exp(c*log(b)) becomes b**c."""
    for term in sp.Add.make_args(argument):
        factors = sp.Mul.make_args(term)
        for factor in factors:
            if factor.func == sp.log:
                check_power(factor.args[0], sp.Mul(*(f for f in factors if f != factor)), offset)


def checked(value: sp.Expr, offset: int) -> sp.Expr:
    """Return the value of one operation if it is within the bounds."""
    if value.is_number:
        check_constant(value, offset)
        return value
    if value.has(*NOT_FINITE):
        raise ExpressionError("division by zero, or another value that is not finite", offset)
    if value.has(sp.I):
        raise ExpressionError("the value is not real", offset)
    for factor in sp.Mul.make_args(value):
        if factor.is_Pow and factor.exp.is_Rational and abs(factor.exp) > MAX_POWER:
            raise ExpressionError(f"the exponent {shown(factor.exp)} is too large; at most {MAX_POWER}", offset)
    if max(_bits(value.as_coeff_Mul()[0]), _bits(value.as_coeff_Add()[0])) > MAX_BITS:
        raise ExpressionError(f"exact numbers may have {MAX_BITS} bits", offset)
    return value


def check_constant(value: sp.Expr, offset: int) -> None:
    """Refuse a number that is not real, not finite, or too large, and a sum that cannot be distinguished from zero.

    If 100 digits of such a sum are zero, SymPy would search for its minimal polynomial, possibly without end.
    """
    _check_extent(value, offset)
    if value.has(*NOT_FINITE):
        raise ExpressionError("division by zero, or another value that is not finite", offset)
    if value.is_Rational:
        if _bits(value) > MAX_BITS:
            raise ExpressionError(f"exact numbers may have {MAX_BITS} bits", offset)
        number = value
    else:
        number = value.evalf(_DIGITS)
        if not number.is_Float and not number.is_Rational:
            raise ExpressionError(f"the value {shown(value)} is not a real number", offset)
        if value.is_Add and number.is_Float and number._prec == 1:
            raise ExpressionError(f"{shown(value)} cannot be distinguished from zero; write 0", offset)
    if abs(number) > LARGEST:
        raise ExpressionError("the value is larger than the largest double, 1.8e308", offset)


def _check_extent(value: sp.Expr, offset: int) -> None:
    waiting, count = [(value, 0)], 0
    while waiting:
        part, level = waiting.pop()
        count += 1
        if count > MAX_SIZE:
            raise ExpressionError(f"a number made of more than {MAX_SIZE} numbers and operations", offset)
        if level > MAX_LEVELS:
            text = f"operations nest deeper than {MAX_LEVELS} in this number, with all parameters in it written out"
            raise ExpressionError(text, offset)
        waiting += [(inner, level + 1) for inner in part.args]


def check_smooth(value: sp.Expr) -> None:
    """Refuse functions with a kink, which SymPy may have made from a root."""
    for function in value.atoms(sp.Function):
        if isinstance(function, sp.Abs):
            raise ExpressionError(
                f"{shown(function)} (the root of a square) has a kink; name a surface h and use its sign s: s*h", 0
            )
        if function.func.__name__ not in (*ELEMENTARY, "Sgn"):
            raise ExpressionError(f"{shown(function)} is not allowed in a field", 0)


def with_known_functions(value: sp.Expr) -> sp.Expr:
    """Replace cot, which SymPy makes of tan(x + pi/2) and which no later step supports."""
    return value.replace(sp.cot, lambda a: sp.cos(a) / sp.sin(a)) if value.has(sp.cot) else value


def _bits(value: sp.Expr) -> int:
    return max((max(abs(n.p).bit_length(), n.q.bit_length()) for n in value.atoms(sp.Rational)), default=1)


def terms(value: sp.Expr, limit: int = MAX_TERMS) -> int:
    """Return an upper bound of the number of terms after expansion; counting stops past the limit."""
    if value.is_Add:
        return min(sum(terms(a, limit) for a in value.args), limit + 1)
    if value.is_Mul:
        total = 1
        for a in value.args:
            total = min(total * terms(a, limit), limit + 1)
        return total
    if value.is_Pow and value.exp.is_Integer:
        n = abs(int(value.exp))
        return min(comb(terms(value.base, limit) + n - 1, n), limit + 1)
    return 1


def put(expression: sp.Expr, values: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Substitute values for symbols after checking that SymPy will not compute a giant number.

    ModelError if the values make a power that is not finite, not real, or has too many digits.
    """
    symbols = set(values)
    if not any(p.exp.free_symbols & symbols for p in expression.atoms(sp.Pow)):
        return expression.xreplace(dict(values))
    known: dict[sp.Basic, sp.Expr] = dict(values)

    def walk(e: sp.Expr) -> sp.Expr:
        if e not in known:
            known[e] = e if not e.free_symbols & symbols else made(e, [walk(a) for a in e.args])
        return known[e]

    def made(e: sp.Expr, arguments: list[sp.Expr]) -> sp.Expr:
        if e.is_Pow:
            check_power(arguments[0], arguments[1], 0)
        elif e.func == sp.exp:
            check_exponential(arguments[0], 0)
        return e.func(*arguments)

    try:
        return walk(expression)
    except ExpressionError as error:
        raise ModelError(f"in {shown(expression)}: {error.message}") from None


def shown(value: sp.Expr) -> str:
    """Return an expression as text for a message, shortened."""
    if value.is_Rational and _bits(value) > 200:
        return f"a number of {_bits(value)} bits"
    return shortened(str(value)).strip("'")


def exact_sign(number: sp.Expr) -> int:
    """Return the sign of an exact number; of an irrational number by its digits, 0 if 60 digits are zero.

    +1 for a number without a real value, as at a kink of an unused branch (all other cases are refused before).
    """
    if number.is_Rational:
        return int(sp.sign(number))
    digits = sp.N(number, 60, maxn=400, chop=False)
    if digits.has(sp.nan, sp.zoo) or abs(sp.im(digits)) > sp.Float("1e-55", 60):
        return 1
    value = sp.re(digits)
    if abs(value) < sp.Float("1e-55", 60):
        return 0
    return 1 if value > 0 else -1


@lru_cache(maxsize=4096)
def double_double(number: sp.Expr) -> tuple[float, float]:
    """Return an exact number as the nearest double and the remainder, rounded to a double.

    ModelError if it is not a finite real number.
    """
    if number.is_Rational and (found := quotient(int(number.p), int(number.q))) is not None:
        return found
    rest = sp.N(number, 50)
    if not rest.is_number or not rest.is_real or not rest.is_finite:
        raise ModelError(f"not a finite real number: {number}")
    high = float(rest)
    return high, float(rest - sp.Float(high, 50))


def quotient(numerator: int, denominator: int) -> tuple[float, float] | None:
    """Return a quotient of integers as the nearest double and the nearest double to the rest; None if it overflows."""
    try:
        high = numerator / denominator
        p, q = high.as_integer_ratio()
        return high, (numerator * q - p * denominator) / (denominator * q)
    except OverflowError:
        return None
