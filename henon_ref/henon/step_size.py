"""Step size from the last two terms of the expansion (Jorba and Zou 2005), and where coefficients are not finite."""

from __future__ import annotations

import numpy as np
from numba import float64, int64

from henon_ref.henon.compile_units import compile_unit
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import bits, fma, from_bits, larger, smaller
from henon_ref.jit.views import GRID, INTEGERS

UNLIMITED = 1e30
"""A step, in the unit, that no coefficient limits."""


@inner(forceinline=True)
def _root(above, below, power):  # type: ignore[no-untyped-def]
    """(above / below) ** power to about one part in 100: a step size needs no more. Both positive.

    The exponent and the leading bits of a double are a piecewise linear logarithm to base 2.
    """
    exponent = (bits(above) - bits(below)) * (2.220446049250313e-16 * power)
    shifted = exponent + 6755399441055744.0  # 1.5 * 2^52: rounds to a whole number, which the low bits then hold
    part = exponent - (shifted - 6755399441055744.0)
    return from_bits((bits(shifted) + 1023) << 52) * (1.0 + part * (0.6931471805599453 + 0.24022650695910072 * part))


@inner(forceinline=True)
def _error_norms(c, rows, order, theta):  # type: ignore[no-untyped-def]
    """Largest relative size of the last two coefficients over states and guards on a step of theta units."""
    last, before = 0.0, 0.0
    for r in range(rows):
        row = c[r]
        scale = fma(theta, fma(theta, abs(row[2]), abs(row[1])), abs(row[0])) + 1e-300
        last = larger(last, abs(row[order]) / scale)
        before = larger(before, abs(row[order - 1]) / scale)
    return last, before


@inner()
def infinite(c, rows, degree):  # type: ignore[no-untyped-def]
    """True if a coefficient up to a degree above 0 is infinite (or no number): the unit is too long, or all is so.

    Where it is one of order 2 at most the unit is at least 1e100 times as long as what these coefficients allow, for
    states are bounded (BLOWN_UP).
    """
    found = False
    for r in range(rows if degree > 0 else 0):
        for k in range(degree + 1):
            found = found or not abs(c[r, k]) < np.inf
    return found


@inner(forceinline=True)
def step_size(c, rows, order, tolerance):  # type: ignore[no-untyped-def]
    """Step in the unit at which the last two terms fall below the tolerance (Jorba and Zou 2005, Sec. 3).

    0 where a coefficient is not finite.
    """
    last, before = c[rows, 0], c[rows, 1]
    if not c[rows, 2] < np.inf:
        return 0.0
    theta = 1.0
    longest = smaller(c[rows, 3], UNLIMITED)
    power, other = 1.0 / order, 1.0 / (order - 1)
    for _ in range(4):
        new = UNLIMITED
        if last > 0.0:
            new = smaller(new, _root(tolerance, last, power))
        if before > 0.0:
            new = smaller(new, _root(tolerance, before, other))
        if new >= 0.5 * theta:
            return smaller(new, longest)
        theta = new
        last, before = _error_norms(c, rows, order, theta)
    return smaller(theta, longest)


@inner()
def flat_step_size(c, n, guards, known_zeros, order, tolerance):  # type: ignore[no-untyped-def]
    """The same where guards have more than two known zeros: what follows those tells the size of such a guard."""
    rows = n + guards
    shortest = smaller(c[rows, 3], UNLIMITED)
    for r in range(rows):
        row, first = c[r], known_zeros[r - n] if r >= n else 0
        theta = 1.0
        for _ in range(4):
            size = abs(row[first]) + theta * (abs(row[first + 1]) + theta * abs(row[first + 2]))
            size = size * theta**first + 1e-300
            new = UNLIMITED
            for k in (order - 1, order):
                if row[k] != 0.0:
                    new = smaller(new, (tolerance * size / abs(row[k])) ** (1.0 / k))
            enough = new >= 0.5 * theta
            theta = new
            if enough:
                break
        shortest = smaller(shortest, theta)
    return shortest


_flat_step_size = compile_unit(flat_step_size, float64, GRID, int64, int64, INTEGERS, int64, float64)
