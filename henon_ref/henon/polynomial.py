"""Roots of a guard's Taylor polynomial on one step: none is stepped over.

A guard is first bounded (:func:`excluded`); where the bound does not decide, the signs of its Bernstein coefficients
on the step count the roots (:mod:`henon_ref.henon.bernstein`), subdividing until the first falling root stands alone
or the polynomial is zero to rounding (a touch).
"""

from __future__ import annotations

from henon_ref.henon.registers import EPS
from henon_ref.jit import inner

NONE, ROOT, TOUCH, LOOK = range(4)
"""Outcome of :func:`first_falling_root`, and of :mod:`henon_ref.henon.bernstein` (LOOK: it has to be called)."""
DEPTH = 64
"""Subdivisions kept at once: as many halvings as a double has room for."""
POLY = {"contract", "nsz"}
"""A product and a sum may be one operation."""


@inner()
def powers_of(theta, powers, order):  # type: ignore[no-untyped-def]
    """theta^0 ... theta^order, four at a time; ``powers`` has room for whole fours."""
    square = theta * theta
    fourth = square * square
    a, b, c, d = 1.0, theta, square, theta * square
    for k in range(0, order + 1, 4):
        powers[k], powers[k + 1], powers[k + 2], powers[k + 3] = a, b, c, d
        a, b, c, d = a * fourth, b * fourth, c * fourth, d * fourth


@inner(fastmath=POLY)
def excluded(q, powers, degree):  # type: ignore[no-untyped-def]
    """True if q > 0 on the whole step by its negative terms alone (q[k] * powers[k] at the step's end)."""
    total = q[0]
    for k in range(1, degree + 1):
        total += min(q[k] * powers[k], 0.0)
    return total > 0.0


@inner(fastmath=POLY)
def value(q, degree, tau):  # type: ignore[no-untyped-def]
    """q(tau) by Horner's rule."""
    total = q[degree]
    for k in range(degree - 1, -1, -1):
        total = total * tau + q[k]
    return total


@inner()
def _halve(left, right, degree):  # type: ignore[no-untyped-def]
    """Bernstein coefficients of both halves of what ``right`` stands for (de Casteljau, in place)."""
    for i in range(degree + 1):
        left[i] = right[0]
        for j in range(degree - i):
            right[j] = 0.5 * (right[j] + right[j + 1])


@inner()
def first_falling_root(a, degree, stack, bounds):  # type: ignore[no-untyped-def]
    """Isolate the first root on (0, 1] through which the polynomial falls.

    Parameters
    ----------
    a : ndarray, shape (degree + 1,)
        Coefficients in powers of a variable on [0, 1].
    stack : ndarray, shape (DEPTH + 2, whole fours above degree)
        Its first row holds the Bernstein coefficients on [0, 1]; the others are work space.
    bounds : ndarray, shape (DEPTH + 2, 2)
        Work space.

    Returns
    -------
    outcome : int
        NONE, ROOT or TOUCH.
    low, high : float
        The interval it lies in (equal where it was hit exactly).
    """
    size = 0.0
    for k in range(degree + 1):
        size += abs(a[k])
    noise = 4.0 * EPS * size
    bounds[0, 0], bounds[0, 1] = 0.0, 1.0
    top = 1
    before = 0
    while top > 0:
        top -= 1
        b = stack[top]
        low, high = bounds[top, 0], bounds[top, 1]
        first, last, clear, changes, largest, lowest = 0, 0, 0, 0, 0.0, 2.0 * size
        for i in range(degree + 1):
            largest = max(largest, abs(b[i]))
            if 0 < i < degree:  # the ends are looked at where pieces meet
                lowest = min(lowest, b[i])
            if clear == 0 and abs(b[i]) > noise:
                clear = 1 if b[i] > 0.0 else -1
            if b[i] != 0.0:
                sign = 1 if b[i] > 0.0 else -1
                if last == 0:
                    first = sign
                elif sign != last:
                    changes += 1
                last = sign
        if before > 0 and first < 0:
            return ROOT, low, low
        if before > 0 and first > 0 and b[0] <= noise:  # zero where the step was halved, positive on both sides
            return (ROOT if clear < 0 else TOUCH), low, low
        unclear = first > 0 and lowest <= noise  # rounding may have hidden roots of even number
        if (changes == 0 and not unclear) or (changes == 1 and first < 0):
            before = last if last != 0 else before
            continue
        if changes == 1:
            return ROOT, low, high
        if largest <= noise or top + 2 > DEPTH or high - low < 4.0 * EPS:
            return TOUCH, low, high
        middle = 0.5 * (low + high)
        _halve(stack[top + 1], stack[top], degree)
        bounds[top, 0], bounds[top, 1] = middle, high
        bounds[top + 1, 0], bounds[top + 1, 1] = low, middle
        top += 2
    return NONE, 0.0, 0.0


@inner(fastmath=POLY)
def steepness(q, degree, tau):  # type: ignore[no-untyped-def]
    """How steeply q falls at tau, relative to the size of its terms there: small near a double root."""
    slope, size, power = 0.0, abs(q[0]), 1.0
    for k in range(1, degree + 1):
        slope += k * q[k] * power
        power *= tau
        size += abs(q[k]) * power
    return -slope * tau / size
