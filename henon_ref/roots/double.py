"""Roots of a guard's Taylor polynomial on one step: none is stepped over.

A guard is first bounded (:func:`positive_by_bound`); where the bound does not decide, the signs of its Bernstein
coefficients on the step count the roots (:mod:`henon_ref.roots.bernstein`), subdividing until the first falling root
stands alone or the polynomial is zero to rounding (a tangential root). A piece that may hold two roots or none is cut
on both sides of its minimum, which leaves little undecided; another one is halved.
"""

from __future__ import annotations

import math

from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS, fma, larger, smaller

NONE, ROOT, TANGENTIAL, SUBDIVIDE = range(4)
"""Outcome of :func:`first_falling_root`, and of :mod:`henon_ref.roots.bernstein` (SUBDIVIDE: it has to be called)."""
DEPTH = 64
"""Subdivisions kept at once: as many halvings as a double has room for."""
CLEARANCE = 4.0
"""A piece no larger than so many times noise is a touch, one where the polynomial is larger than noise is none."""
KNOWN_ZERO_LEVEL = 1e-9
"""Coefficients before those of known zeros are divided out up to this part of what follows them."""
CUT_PIECES = 32
"""Pieces looked at after which they are only halved."""
NEWTON_STEPS = 6
"""Steps of Newton's method towards the minimum of a piece."""
CUT_LEAST, CUT_MOST = 2.0**-20, 2.0**-3
"""What is cut out around a minimum: at least the one and at most the other of its piece, to either side."""


@inner(forceinline=True)
def powers_of(theta, powers, order):  # type: ignore[no-untyped-def]
    """theta^0 ... theta^order, four at a time; ``powers`` has room for whole fours."""
    square = theta * theta
    fourth = square * square
    a, b, c, d = 1.0, theta, square, theta * square
    for k in range(0, order + 1, 4):
        powers[k], powers[k + 1], powers[k + 2], powers[k + 3] = a, b, c, d
        a, b, c, d = a * fourth, b * fourth, c * fourth, d * fourth


@inner(forceinline=True)
def positive_by_bound(q, powers, degree):  # type: ignore[no-untyped-def]
    """True if q > 0 on the whole step by its negative terms alone (q[k] * powers[k] at the step's end)."""
    odd, even = 0.0, 0.0  # in two sums, which do not wait for each other; so below
    for k in range(1, degree, 2):
        odd += smaller(q[k] * powers[k], 0.0)
        even += smaller(q[k + 1] * powers[k + 1], 0.0)
    if degree % 2 == 1:
        odd += smaller(q[degree] * powers[degree], 0.0)
    return q[0] + (odd + even) > 0.0


@inner(forceinline=True)
def value(q, degree, tau):  # type: ignore[no-untyped-def]
    """q(tau) by Horner's rule."""
    total = q[degree]
    for k in range(degree - 1, -1, -1):
        total = fma(total, tau, q[k])
    return total


@inner()
def deflated(c, zeros, degree, factor, quotient):  # type: ignore[no-untyped-def]
    """The factor of a polynomial's known zeros, and what is left without it; False where these are not next to zero.

    A guard is known to be zero where it has just been left, but the state stands beside that by its rounding. Were the
    first coefficients simply dropped, the other roots would move by as much, and multiple ones by a root of it. The
    factor is t^m + a_(m-1) t^(m-1) + ... + a_0, its coefficients next to nothing.
    """
    size = degree + 1 - zeros
    if size < 2:
        return False
    for i in range(zeros):
        factor[i] = 0.0
        if not abs(c[i]) <= KNOWN_ZERO_LEVEL * abs(c[zeros]):
            return False
    for _ in range(3):
        for k in range(size - 1, -1, -1):
            quotient[k] = c[k + zeros]
            for j in range(max(zeros + k - size + 1, 0), zeros):
                quotient[k] -= factor[j] * quotient[k + zeros - j]
        for i in range(zeros):
            factor[i] = c[i]
            for j in range(i):
                factor[i] -= factor[j] * quotient[i - j] if i - j < size else 0.0
            factor[i] /= quotient[0]
    return True


@inner(forceinline=True)
def _cut(left, right, degree, part):  # type: ignore[no-untyped-def]
    """Bernstein coefficients of both parts of what ``right`` stands for (de Casteljau, in place)."""
    for i in range(degree + 1):
        left[i] = right[0]
        for j in range(degree - i):
            right[j] = fma(part, right[j + 1] - right[j], right[j])


@inner(forceinline=True)
def _around_minimum(a, degree, low, high, noise):  # type: ignore[no-untyped-def]
    """Two places on a piece, one on each side of a minimum, next to it and clear of it where possible; else its middle.

    Newton's method on the slope over its derivative (Schroeder 1870): flat minima, too, are simple roots of that.
    """
    width = high - low
    middle = low + 0.5 * width
    tau, shift = middle, 0.0
    for _ in range(NEWTON_STEPS):
        slope, bend, twist = degree * a[degree], 0.0, 0.0  # twist is half the third derivative
        for k in range(degree - 1, 0, -1):
            twist = fma(twist, tau, bend)
            bend = fma(bend, tau, slope)
            slope = fma(slope, tau, k * a[k])
        if abs(slope) <= noise:
            shift = 0.0
            break
        below = fma(bend, bend, -2.0 * slope * twist)
        if not (bend > 0.0 and below > 0.0):
            return middle, middle
        shift = -slope * bend / below
        tau += shift
        if not low < tau < high:
            return middle, middle
        if abs(shift) <= CUT_LEAST * width:
            break
    distance = larger(8.0 * abs(shift), CUT_LEAST * width)
    if not distance < CUT_MOST * width:
        return middle, middle
    if abs(value(a, degree, tau)) <= noise:
        least = CLEARANCE * noise
        if bend > 0.0:  # where a parabola is midway between noise and a touch: a touch is left between, nothing beside
            near = math.sqrt((noise + least) / bend)
            left, right = value(a, degree, tau - near), value(a, degree, tau + near)
            if near < CUT_MOST * width and smaller(left, right) > noise and larger(left, right) < least:
                return tau - near, tau + near
        while (
            distance < CUT_MOST * width
            and smaller(value(a, degree, tau - distance), value(a, degree, tau + distance)) <= least
        ):
            distance *= 4.0
        distance = smaller(distance, CUT_MOST * width)
    return tau - distance, tau + distance


@inner()
def first_falling_root(a, degree, stack, bounds):  # type: ignore[no-untyped-def]
    """Isolate the first root on (0, 1] through which the polynomial falls.

    Parameters
    ----------
    a : row of degree + 1
        Coefficients in powers of a variable on [0, 1].
    stack : rows, shape (DEPTH + 2, whole fours above degree)
        Its first row holds the Bernstein coefficients on [0, 1]; the others are work space.
    bounds : rows, shape (DEPTH + 2, 2)
        Work space.

    Returns
    -------
    outcome : int
        NONE, ROOT or TANGENTIAL.
    low, high : float
        The interval it lies in (equal where it was hit exactly).
    """
    size = 0.0
    for k in range(degree + 1):
        size += abs(a[k])
    noise = 4.0 * EPS * size
    bounds[0, 0], bounds[0, 1] = 0.0, 1.0
    top, pieces = 1, 0
    before = 0
    while top > 0:
        top -= 1
        pieces += 1
        b = stack[top]
        low, high = bounds[top, 0], bounds[top, 1]
        first, last, clear, changes, largest, lowest = 0, 0, 0, 0, 0.0, 2.0 * size
        for i in range(degree + 1):
            largest = larger(largest, abs(b[i]))
            if 0 < i < degree:  # the ends are looked at where pieces meet
                lowest = smaller(lowest, b[i])
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
            return (ROOT if clear < 0 else TANGENTIAL), low, low
        unclear = first > 0 and lowest <= noise  # rounding may have hidden roots of even number
        if (changes == 0 and not unclear) or (changes == 1 and first < 0):
            before = last if last != 0 else before
            continue
        if changes == 1:
            return ROOT, low, high
        if largest <= CLEARANCE * noise or top + 2 > DEPTH or high - low < 4.0 * EPS:
            return TANGENTIAL, low, high
        left = right = 0.5 * (low + high)
        if first > 0 and pieces < CUT_PIECES:
            left, right = _around_minimum(a, degree, low, high, noise)
        for at in (right, left):
            if low < at < high:
                _cut(stack[top + 1], stack[top], degree, (at - low) / (high - low))
                bounds[top, 0], bounds[top, 1] = at, high
                high = at
                top += 1
        bounds[top, 0], bounds[top, 1] = low, high
        top += 1
    return NONE, 0.0, 0.0


@inner(forceinline=True)
def steepness(q, degree, tau, powers):  # type: ignore[no-untyped-def]
    """How steeply q falls at tau, relative to the size of its terms there: small near a double root.

    ``powers``: room for those of tau.
    """
    powers_of(tau, powers, degree)
    slope, slope_between, size, size_between = 0.0, 0.0, 0.0, 0.0
    for k in range(degree, 0, -2):
        term, between = q[k] * powers[k], q[k - 1] * powers[k - 1]
        slope, slope_between = fma(k, term, slope), fma(k - 1, between, slope_between)
        size, size_between = size + abs(term), size_between + abs(between)
    if degree % 2 == 0:
        size_between += abs(q[0])
    return -(slope + slope_between) / (size + size_between)


@inner(forceinline=True)
def at_end(q, degree):  # type: ignore[no-untyped-def]
    """Value and slope of q at 1."""
    total, total_between, slope, slope_between = 0.0, 0.0, 0.0, 0.0
    for k in range(degree, 0, -2):
        total, total_between = total + q[k], total_between + q[k - 1]
        slope, slope_between = fma(k, q[k], slope), fma(k - 1, q[k - 1], slope_between)
    if degree % 2 == 0:
        total_between += q[0]
    return total + total_between, slope + slope_between
