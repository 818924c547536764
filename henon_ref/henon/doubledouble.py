"""Double-double arithmetic: a number as the unevaluated sum of two doubles, about 32 digits, in compiled code.

Sums and products without loss are Dekker's (*Numer. Math.* 18, 1971), the product by a fused multiply-add; the
operations and the way to the elementary functions are those of the QD library (Hida, Li and Bailey, *Proc. 15th
IEEE Symp. on Computer Arithmetic*, 2001). A pair travels as two floats and comes back as a tuple (high, low). What
has no finite value is nan or infinite. None of this may be compiled with fastmath.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from henon_ref.jit import inner

FARTHEST = 1e6
"""Sines of larger arguments are nan: pi/2 is kept to three doubles."""
_HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
_LOG_2 = (0.6931471805599453, 2.3190468138462996e-17, 5.707708438416212e-34)
_BEYOND = 800.0
"""Exponentials of arguments larger than this are infinite or zero in doubles."""
_HALVINGS = 5
"""Of the argument of the exponential's series, which is then at most 0.011."""


def _inverse_factorials(count: int) -> list[tuple[float, float]]:
    exact = [Fraction(1, math.factorial(k)) for k in range(count)]
    return [(float(c), float(c - Fraction(float(c)))) for c in exact]


_INVERSE_FACTORIALS = np.array(_inverse_factorials(32))


@intrinsic
def fma(typing, a, b, c):  # type: ignore[no-untyped-def]
    """a b + c, rounded once."""
    signature = types.float64(types.float64, types.float64, types.float64)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        kind = ir.FunctionType(ir.DoubleType(), [ir.DoubleType()] * 3)
        return builder.call(builder.module.declare_intrinsic("llvm.fma", [ir.DoubleType()], kind), args)

    return signature, codegen


LOST = 2.0**-106
"""A second double below this of the first is none."""


@inner()
def quick_two_sum(a, b):  # type: ignore[no-untyped-def]
    """a + b and what rounding loses of it, for \\|a\\| >= \\|b\\|."""
    s = a + b
    return s, b - (s - a)


@inner()
def two_sum(a, b):  # type: ignore[no-untyped-def]
    """a + b and what rounding loses of it."""
    s = a + b
    part = s - a
    return s, (a - (s - part)) + (b - part)


@inner()
def two_product(a, b):  # type: ignore[no-untyped-def]
    """a b and what rounding loses of it."""
    p = a * b
    return p, fma(a, b, -p)


@inner()
def add(a, a_low, b, b_low):  # type: ignore[no-untyped-def]
    """a + b, accurate relative to the sum even where a and b cancel."""
    s, rest = two_sum(a, b)
    low, lowest = two_sum(a_low, b_low)
    s, rest = quick_two_sum(s, rest + low)
    return quick_two_sum(s, rest + lowest)


@inner()
def multiply(a, a_low, b, b_low):  # type: ignore[no-untyped-def]
    """a b."""
    p, rest = two_product(a, b)
    return quick_two_sum(p, rest + (a * b_low + a_low * b))


@inner(forceinline=True)
def compensated(y, lost, s, s_low, a, a_low):  # type: ignore[no-untyped-def]
    """y s + a, and what is lost of it: a step of Horner's rule whose sum of both is nearly as good as a pair's.

    Graillat, Langlois and Louvet, *Compensated Horner scheme* (2005). What waits for each other are a double's
    operations: a fifth of the time.
    """
    p, rest = two_product(y, s)
    total, left = two_sum(p, a)
    return total, fma(lost, s, y * s_low + rest + (left + a_low))


@inner()
def kept(high, low):  # type: ignore[no-untyped-def]
    """A number in two doubles; what is lost to the second, too, would only make it miss round numbers."""
    return high, (low if abs(low) > LOST * abs(high) else 0.0)


@inner()
def divide(a, a_low, b, b_low):  # type: ignore[no-untyped-def]
    """a / b: the double quotient, and what its remainder, which has no rounding in its leading part, adds to it."""
    q = a / b
    p, p_low = two_product(q, b)
    return quick_two_sum(q, ((a - p) - p_low + (a_low - q * b_low)) / b)


@inner()
def square_root(a, a_low):  # type: ignore[no-untyped-def]
    """The square root, by one step of Newton's method from the double one (Karp's)."""
    if a == 0.0:
        return 0.0, 0.0
    root = math.sqrt(a)
    p, p_low = two_product(root, root)
    rest, _ = add(a, a_low, -p, -p_low)
    return quick_two_sum(root, 0.5 * rest / root)


@inner()
def _series(z, z_low, first, step, middle, last):  # type: ignore[no-untyped-def]
    """Sum of z^i / (first + i step)! up to last!; what is behind middle! needs one double only."""
    s, s_low = 0.0, 0.0
    for k in range(last, middle, -step):
        s = s * z + _INVERSE_FACTORIALS[k, 0]
    for k in range(middle, first - 1, -step):
        s, s_low = multiply(s, s_low, z, z_low)
        s, s_low = add(s, s_low, _INVERSE_FACTORIALS[k, 0], _INVERSE_FACTORIALS[k, 1])
    return s, s_low


@inner()
def _less_multiple(a, a_low, n, unit):  # type: ignore[no-untyped-def]
    """a - n unit for a whole number n and a unit of three doubles."""
    for part in unit:
        p, p_low = two_product(-n, part)
        a, a_low = add(a, a_low, p, p_low)
    return a, a_low


@inner()
def _turned(a, a_low, quarters):  # type: ignore[no-untyped-def]
    """sin(a + quarters pi/2)."""
    if not abs(a) <= FARTHEST:
        return math.nan, math.nan
    n = np.rint(a / _HALF_PI[0])
    r, r_low = _less_multiple(a, a_low, n, _HALF_PI)
    z, z_low = multiply(r, r_low, -r, -r_low)
    quadrant = int(n + quarters) & 3
    first = 1 - (quadrant & 1)
    s, s_low = _series(z, z_low, first, 2, first + 16, first + 28)
    if first == 1:
        s, s_low = multiply(s, s_low, r, r_low)
    return (-s, -s_low) if quadrant & 2 else (s, s_low)


@inner()
def sine(a, a_low):  # type: ignore[no-untyped-def]
    """sin(a), relatively accurate about zero."""
    return _turned(a, a_low, 0.0)


@inner()
def cosine(a, a_low):  # type: ignore[no-untyped-def]
    """cos(a)."""
    return _turned(a, a_low, 1.0)


@inner()
def tangent(a, a_low):  # type: ignore[no-untyped-def]
    """tan(a)."""
    s, s_low = sine(a, a_low)
    c, c_low = cosine(a, a_low)
    return divide(s, s_low, c, c_low)


@inner()
def _grown(a, a_low):  # type: ignore[no-untyped-def]
    """(e, low part, n) with exp(a) = (1 + e) 2^n: the series of a small part, doubled up."""
    if abs(a) > _BEYOND:
        a, a_low = math.copysign(_BEYOND, a), 0.0
    n = np.rint(a / _LOG_2[0])
    r, r_low = _less_multiple(a, a_low, n, _LOG_2)
    scale = 0.5**_HALVINGS
    r, r_low = r * scale, r_low * scale
    e, e_low = _series(r, r_low, 1, 1, 7, 13)
    e, e_low = multiply(e, e_low, r, r_low)
    for _ in range(_HALVINGS):
        p, p_low = add(2.0, 0.0, e, e_low)
        e, e_low = multiply(e, e_low, p, p_low)
    return e, e_low, int(n)


@inner()
def _scaled(e, e_low, n):  # type: ignore[no-untyped-def]
    """(1 + e) 2^n, where 2^n may be too large or too small for a double."""
    e, e_low = add(1.0, 0.0, e, e_low)
    first, second = math.ldexp(1.0, n // 2), math.ldexp(1.0, n - n // 2)
    return e * first * second, e_low * first * second


@inner()
def exponential(a, a_low):  # type: ignore[no-untyped-def]
    """exp(a)."""
    e, e_low, n = _grown(a, a_low)
    return _scaled(e, e_low, n)


@inner()
def exponential_less_one(a, a_low):  # type: ignore[no-untyped-def]
    """exp(a) - 1, relatively accurate about zero."""
    e, e_low, n = _grown(a, a_low)
    if n == 0:
        return e, e_low
    e, e_low = _scaled(e, e_low, n)
    return add(e, e_low, -1.0, 0.0)


@inner()
def logarithm(a, a_low):  # type: ignore[no-untyped-def]
    """log(a), relatively accurate about one: a correction of second order to the double one of a 2^-n."""
    part, n = math.frexp(a)
    n -= part < 0.7
    a, a_low = math.ldexp(a, -n), math.ldexp(a_low, -n)
    y = math.log(a)
    e, e_low = exponential_less_one(-y, 0.0)
    p, p_low = multiply(a, a_low, e, e_low)
    w, w_low = add(a, a_low, -1.0, 0.0)
    w, w_low = add(w, w_low, p, p_low)
    y, y_low = add(y, 0.0, w, w_low - 0.5 * w * w)
    return _less_multiple(y, y_low, -float(n), _LOG_2)


@inner()
def hyperbolic_sine(a, a_low):  # type: ignore[no-untyped-def]
    """sinh(a), relatively accurate about zero."""
    sign = math.copysign(0.5, a)
    e, e_low = exponential_less_one(abs(a), 2.0 * sign * a_low)
    p, p_low = add(1.0, 0.0, e, e_low)
    p, p_low = divide(e, e_low, p, p_low)
    e, e_low = add(e, e_low, p, p_low)
    return sign * e, sign * e_low


@inner()
def hyperbolic_cosine(a, a_low):  # type: ignore[no-untyped-def]
    """cosh(a)."""
    e, e_low = exponential(abs(a), math.copysign(1.0, a) * a_low)
    p, p_low = divide(1.0, 0.0, e, e_low)
    e, e_low = add(e, e_low, p, p_low)
    return 0.5 * e, 0.5 * e_low


@inner()
def hyperbolic_tangent(a, a_low):  # type: ignore[no-untyped-def]
    """tanh(a), relatively accurate about zero."""
    sign = math.copysign(1.0, a)
    e, e_low = exponential_less_one(-2.0 * abs(a), -2.0 * sign * a_low)
    p, p_low = add(2.0, 0.0, e, e_low)
    e, e_low = divide(e, e_low, p, p_low)
    return -sign * e, -sign * e_low


@inner()
def arc_tangent(a, a_low):  # type: ignore[no-untyped-def]
    """atan(a): y of the double one is corrected by (a cos y - sin y) / (cos y + a sin y)."""
    y = math.atan(a)
    s, s_low = sine(y, 0.0)
    c, c_low = cosine(y, 0.0)
    p, p_low = multiply(a, a_low, c, c_low)
    p, p_low = add(p, p_low, -s, -s_low)
    return add(y, 0.0, p / (c + a * s), 0.0)


@inner()
def arc_sine(a, a_low):  # type: ignore[no-untyped-def]
    """asin(a) for \\|a\\| < 1."""
    p, p_low = add(1.0, 0.0, a, a_low)
    q, q_low = add(1.0, 0.0, -a, -a_low)
    p, p_low = multiply(p, p_low, q, q_low)
    p, p_low = square_root(p, p_low)
    p, p_low = divide(a, a_low, p, p_low)
    return arc_tangent(p, p_low)


@inner()
def arc_cosine(a, a_low):  # type: ignore[no-untyped-def]
    """acos(a) for \\|a\\| < 1: twice the angle whose tangent is sqrt((1 - a) / (1 + a))."""
    p, p_low = add(1.0, 0.0, a, a_low)
    q, q_low = add(1.0, 0.0, -a, -a_low)
    p, p_low = divide(q, q_low, p, p_low)
    p, p_low = square_root(p, p_low)
    p, p_low = arc_tangent(p, p_low)
    return 2.0 * p, 2.0 * p_low


@inner()
def power(a, a_low, c, c_low):  # type: ignore[no-untyped-def]
    """a^c for a > 0."""
    y, y_low = logarithm(a, a_low)
    y, y_low = multiply(y, y_low, c, c_low)
    return exponential(y, y_low)
