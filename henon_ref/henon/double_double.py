"""Double-double arithmetic with running error bounds, and a machine for programs in it.

A number is three doubles: its nearest double, what that leaves, and a bound of the error of both together. Sums and
products are the accurate ones of Joldes, Muller and Popescu (ACM Trans. Math. Softw. 44, 2017, Algorithms 6 and
12), whose relative errors are a few 2^-106; the bounds take 2^-100 for each.
"""

from __future__ import annotations

import math

import numpy as np

from henon_ref.jit.njit import inner, njit
from henon_ref.jit.primitives import fma

ADD, MULTIPLY, POWER, SQRT = range(4)
"""Operations; POWER has a whole number in place of its second register."""
ROUNDING = 2.0**-100
"""Bound of the relative error of one operation. Sums and products of doubles are exact: their error is 0."""
ACCURATE = 2.0**-80
"""Bound of the relative error that a constant may have: the double is the nearest one, but for a tie."""
UNCLEAR_SIGN = 2
"""Of a number that may be zero."""
LEAST_EXACT = 1e-280
"""A product of doubles above this is two doubles, none of which is too small."""


@inner()
def _sum(a, b):  # type: ignore[no-untyped-def]
    """a + b and what rounding lost of it."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@inner()
def _product(a, b):  # type: ignore[no-untyped-def]
    """a b and what rounding lost of it."""
    total = a * b
    return total, fma(a, b, -total)


@inner()
def _added(a, al, b, bl):  # type: ignore[no-untyped-def]
    high, rest = _sum(a, b)
    low, least = _sum(al, bl)
    high, rest = _sum(high, rest + low)
    return _sum(high, rest + least)


@inner()
def _multiplied(a, al, b, bl):  # type: ignore[no-untyped-def]
    high, rest = _product(a, b)
    return _sum(high, rest + fma(a, bl, al * b))


@inner()
def _divided(a, al, b, bl):  # type: ignore[no-untyped-def]
    first = a / b
    high, low = _multiplied(b, bl, first, 0.0)
    high, low = _added(a, al, -high, -low)
    second = high / b
    more, less = _multiplied(b, bl, second, 0.0)
    third = _added(high, low, -more, -less)[0] / b
    high, low = _sum(first, second)
    return _added(high, low, third, 0.0)


@inner()
def _root(a, al):  # type: ignore[no-untyped-def]
    first = math.sqrt(a)
    if first == 0.0:
        return 0.0, 0.0
    high, low = _product(first, first)
    high, low = _added(a, al, -high, -low)
    return _sum(first, (high + low) / (2.0 * first))


@inner()
def _times(a, al, ae, b, bl, be):  # type: ignore[no-untyped-def]
    """A product with its error."""
    high, low = _multiplied(a, al, b, bl)
    return high, low, abs(a) * be + ae * (abs(b) + be) + ROUNDING * abs(high)


@inner()
def _quotient(a, al, ae, b, bl, be):  # type: ignore[no-untyped-def]
    """A quotient with its error, which is infinite where the divisor may be zero."""
    high, low = _divided(a, al, b, bl)
    least = abs(b) - be
    error = (ae + abs(high) * be) / least if least > 0.0 else np.inf
    return high, low, 1.0001 * error + ROUNDING * abs(high)


@inner()
def _power(a, al, ae, exponent):  # type: ignore[no-untyped-def]
    """A whole power with its error, by repeated squaring."""
    high, low, error = 1.0, 0.0, 0.0
    left = abs(exponent)
    while left > 0:
        if left & 1:
            high, low, error = _times(high, low, error, a, al, ae)
        a, al, ae = _times(a, al, ae, a, al, ae)
        left >>= 1
    if exponent < 0:
        high, low, error = _quotient(1.0, 0.0, 0.0, high, low, error)
    return high, low, error


@njit(nogil=True)
def run_operations(operations, registers):  # type: ignore[no-untyped-def]
    """Run a program at many points.

    Parameters
    ----------
    operations : ndarray of int, shape (k, 4)
        Operation, register of the result, and of the two operands.
    registers : ndarray, shape (points, registers, 3)
        Numbers and their error bounds.
    """
    for point in range(registers.shape[0]):
        r = registers[point]
        for k in range(operations.shape[0]):
            what, to, i, j = operations[k, 0], operations[k, 1], operations[k, 2], operations[k, 3]
            a, al, ae = r[i, 0], r[i, 1], r[i, 2]
            if what == ADD:
                high, low = _added(a, al, r[j, 0], r[j, 1])
                exact = al == 0.0 and r[j, 1] == 0.0
                error = 1.0001 * (ae + r[j, 2]) + (0.0 if exact else ROUNDING * abs(high))
            elif what == MULTIPLY:
                high, low, error = _times(a, al, ae, r[j, 0], r[j, 1], r[j, 2])
                exact = al == 0.0 and r[j, 1] == 0.0 and ae == 0.0 and r[j, 2] == 0.0 and abs(high) > LEAST_EXACT
                error = 0.0 if exact else 1.0001 * error
            elif what == POWER:
                high, low, error = _power(a, al, ae, j)
                error = 1.0001 * error
            else:
                high, low = _root(a, al)
                error = (ae / high if a > ae else np.inf) + ROUNDING * high
            r[to, 0], r[to, 1], r[to, 2] = high, low, error


@njit(nogil=True)
def scatter(registers, sources, highs, lows, out):  # type: ignore[no-untyped-def]
    """Put numbers into rows of constants.

    Parameters
    ----------
    registers : ndarray, shape (points, registers, 3)
    sources, highs, lows : ndarray of int, shape (k,)
        Registers, and places in a row where each number, and what its rounding lost, is put.
    out : ndarray, shape (points, places)

    Returns
    -------
    bool
        Whether each number, so far as it is finite, has most of its digits: terms may have cancelled.
    """
    accurate = True
    for point in range(registers.shape[0]):
        for k in range(sources.size):
            number = registers[point, sources[k]]
            out[point, highs[k]], out[point, lows[k]] = number[0], number[1]
            accurate = accurate and not number[2] > ACCURATE * abs(number[0])
    return accurate


@njit(nogil=True)
def signs_of(registers, sources, signs):  # type: ignore[no-untyped-def]
    """Signs of numbers: 0 of one that is exactly zero, UNCLEAR_SIGN of one that may be zero within its error.

    Parameters
    ----------
    registers : ndarray, shape (points, registers, 3)
    sources : ndarray of int, shape (k,)
        Their registers.
    signs : ndarray of int, shape (points, k)
        Filled with them.
    """
    for point in range(registers.shape[0]):
        for k in range(sources.size):
            value, error = registers[point, sources[k], 0], registers[point, sources[k], 2]
            signs[point, k] = UNCLEAR_SIGN
            if abs(value) > 2.0 * error and abs(value) < np.inf:
                signs[point, k] = 1 if value > 0.0 else -1
            elif value == 0.0 and error == 0.0:
                signs[point, k] = 0
