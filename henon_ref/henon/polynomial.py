"""Roots of a guard's Taylor polynomial on one step: none is stepped over.

A guard is first bounded (:func:`excluded`); where the bound does not decide, its Bernstein coefficients on
the step count the roots (Descartes' rule of signs; Mourrain and Pavone, *J. Symbolic Comput.* 44, 2009),
subdividing until the first falling root stands alone or the polynomial is zero to rounding (a touch).
Then one of three landings puts the step's end on the surface.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from henon_ref.henon.registers import BRACKET, BRENT, NEWTON
from henon_ref.jit import inner

NONE, ROOT, TOUCH = 0, 1, 2
"""Outcome of :func:`first_falling_root`."""
DEPTH = 64
"""Subdivisions kept at once: as many halvings as a double has room for."""
_EPS = 2.220446049250313e-16
_POLY = {"contract", "nsz"}


def bernstein_table(order: int) -> NDArray[np.float64]:
    """Weights w[d, k, i] = binom(i, k) / binom(d, k), from powers to Bernstein coefficients of degree d <= order."""
    from math import comb

    table = np.zeros((order + 1, order + 1, order + 1))
    for d in range(order + 1):
        for i in range(d + 1):
            for k in range(i + 1):
                table[d, k, i] = comb(i, k) / comb(d, k)
    return table


@inner(fastmath=_POLY)
def excluded(q, powers, degree):  # type: ignore[no-untyped-def]
    """True if q > 0 on the whole step by its negative terms alone (q[k] * powers[k] at the step's end)."""
    total = q[0]
    for k in range(1, degree + 1):
        total += min(q[k] * powers[k], 0.0)
    return total > 0.0


@inner(fastmath=_POLY)
def value(q, degree, tau):  # type: ignore[no-untyped-def]
    """q(tau) by Horner's rule."""
    total = q[degree]
    for k in range(degree - 1, -1, -1):
        total = total * tau + q[k]
    return total


@inner()
def first_falling_root(a, degree, table, stack, bounds):  # type: ignore[no-untyped-def]
    """Isolate the first root on (0, 1] through which the polynomial falls.

    Parameters
    ----------
    a : ndarray, shape (degree + 1,)
        Coefficients in powers of a variable on [0, 1].
    table : ndarray
        :func:`bernstein_table`.
    stack : ndarray, shape (DEPTH + 2, >= degree + 1)
    bounds : ndarray, shape (DEPTH + 2, 2)
        Work space.

    Returns
    -------
    outcome : int
        NONE, ROOT or TOUCH.
    low, high : float
        The interval it lies in (equal where it was hit exactly).
    """
    weights = table[degree]
    size = 0.0
    for k in range(degree + 1):
        size += abs(a[k])
    noise = 4.0 * _EPS * size
    b = stack[0]
    for i in range(degree + 1):
        b[i] = a[0]
    for k in range(1, degree + 1):  # a column at a time, so that the sums go side by side in vectors
        column, own = weights[k], a[k]
        for i in range(degree + 1):
            b[i] += column[i] * own
    bounds[0, 0], bounds[0, 1] = 0.0, 1.0
    top = 1
    before = 0
    while top > 0:
        top -= 1
        b = stack[top]
        low, high = bounds[top, 0], bounds[top, 1]
        first, last, clear, changes, largest = 0, 0, 0, 0, 0.0
        for i in range(degree + 1):
            largest = max(largest, abs(b[i]))
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
        if changes == 0 or (changes == 1 and first < 0):
            before = last if last != 0 else before
            continue
        if changes == 1:
            return ROOT, low, high
        if largest <= noise or top + 2 > DEPTH or high - low < 4.0 * _EPS:
            return TOUCH, low, high
        middle = 0.5 * (low + high)
        right = stack[top]
        left = stack[top + 1]
        for i in range(degree + 1):  # de Casteljau in place: what stays behind is the right half, in order
            left[i] = right[0]
            for j in range(degree - i):
                right[j] = 0.5 * (right[j] + right[j + 1])
        bounds[top, 0], bounds[top, 1] = middle, high
        bounds[top + 1, 0], bounds[top + 1, 1] = low, middle
        top += 2
    return NONE, 0.0, 0.0


@inner(fastmath=_POLY)
def steepness(q, degree, tau):  # type: ignore[no-untyped-def]
    """How steeply q falls at tau, relative to the size of its terms there: small near a double root."""
    slope, size, power = 0.0, abs(q[0]), 1.0
    for k in range(1, degree + 1):
        slope += k * q[k] * power
        power *= tau
        size += abs(q[k]) * power
    return -slope * tau / size


@inner(fastmath=_POLY)
def land(q, degree, low, high, method):  # type: ignore[no-untyped-def]
    """Put the step's end on the root of q that [low, high], within [0, 1], brackets, q falling.

    ``HENON``: the independent variable is swapped from t to h (Hénon 1982; Eq. (14) of the paper) and one
    Taylor step of order 4 in h, of length -h, is taken from a point near the surface: dt/dh = 1/h', whose
    Taylor series is the reversion of h's. It is repeated once where the first step was long.
    ``NEWTON``: the same with order 1, repeated. ``BRENT``: bracketing alone. Where h' is too small for
    the swap (grazing), bisection decides, and the landing says ``BRACKET``.

    Returns
    -------
    tau : float
    used : int
        The landing that was used.
    evaluations : int
        Evaluations of the polynomial (with its derivatives counted as one).
    """
    if low == high:
        return low, method, 0
    # A root at ``high`` itself, if there is one, is not the one bracketed: q is negative just before it.
    below, above, evaluations = q[0], 0.0, 0
    if low > 0.0:
        below, evaluations = value(q, degree, low), 1
    for k in range(degree + 1):
        above += q[k]
    if high < 1.0:
        above, evaluations = value(q, degree, high), evaluations + 1
    if method == BRENT and below > 0.0 > above:
        tau, more = _brent(q, degree, low, high, below, above)
        return tau, BRENT, evaluations + more
    left, right = low, high
    # The chord's root, but where another root next to ``high`` may have left nothing but rounding there.
    chord = below > 0.0 and above < -0.01 * below
    tau = low + (high - low) * below / (below - above) if chord else 0.5 * (low + high)
    order_one = method == NEWTON
    for _ in range(12):
        g0, g1, g2, g3, g4 = q[degree], 0.0, 0.0, 0.0, 0.0
        for k in range(degree - 1, -1, -1):
            if not order_one:
                g4 = g4 * tau + g3
                g3 = g3 * tau + g2
                g2 = g2 * tau + g1
            g1 = g1 * tau + g0
            g0 = g0 * tau + q[k]
        evaluations += 1
        if g0 > 0.0:
            left = tau
        else:
            right = tau
        if g1 >= 0.0:  # not yet, or no longer, on the way down
            tau = 0.5 * (left + right)
            continue
        u = -g0 / g1
        delta = u
        ratio = 0.0
        if not order_one:
            b2, b3, b4 = g2 / g1, g3 / g1, g4 / g1
            ratio = abs(b2 * u) + np.sqrt(abs(b3 * u * u)) + np.sqrt(np.sqrt(abs(b4 * u * u * u * u)))
            if ratio > 0.25:  # the swapped series does not converge from here: come closer first
                delta = u if low < tau + u < high else 0.5 * (left + right) - tau
            else:
                delta = u * (1.0 + u * (-b2 + u * ((2.0 * b2 * b2 - b3) + u * (5.0 * b2 * b3 - b4 - 5.0 * b2**3))))
        new = tau + delta
        if not left <= new <= right:
            new = min(max(new, left), right)
            if new in (left, right) and abs(delta) > 8.0 * _EPS * right:
                new = 0.5 * (left + right)
                tau = new
                continue
        moved = abs(new - tau)
        tau = new
        if moved <= 2.0 * _EPS * new or (not order_one and ratio**4 * moved <= 0.25 * _EPS * new):
            return tau, method, evaluations
    tau, more = _bisect(q, degree, left, right)
    return tau, BRACKET, evaluations + more


@inner(fastmath=_POLY)
def _bisect(q, degree, left, right):  # type: ignore[no-untyped-def]
    evaluations = 0
    while right - left > 2.0 * _EPS * right and evaluations < 200:
        middle = 0.5 * (left + right)
        if middle <= left or middle >= right:
            break
        evaluations += 1
        if value(q, degree, middle) > 0.0:
            left = middle
        else:
            right = middle
    return 0.5 * (left + right), evaluations


@inner(fastmath=_POLY)
def _brent(q, degree, low, high, below, above):  # type: ignore[no-untyped-def]
    """Brent's method (*Algorithms for Minimization without Derivatives*, 1973, Ch. 4)."""
    a, b, fa, fb = low, high, below, above
    c, fc = a, fa
    d = e = b - a
    evaluations = 0
    while evaluations < 200:
        if abs(fc) < abs(fb):
            a, b, c = b, c, b
            fa, fb, fc = fb, fc, fb
        tolerance = _EPS * abs(b)
        half = 0.5 * (c - b)
        if abs(half) <= tolerance or fb == 0.0:
            break
        if abs(e) >= tolerance and abs(fa) > abs(fb):
            s = fb / fa
            if a == c:
                p, r = 2.0 * half * s, 1.0 - s
            else:
                u, v = fa / fc, fb / fc
                p = s * (2.0 * half * u * (u - v) - (b - a) * (v - 1.0))
                r = (u - 1.0) * (v - 1.0) * (s - 1.0)
            if p > 0.0:
                r = -r
            p = abs(p)
            if 2.0 * p < min(3.0 * half * r - abs(tolerance * r), abs(e * r)):
                e, d = d, p / r
            else:
                d = e = half
        else:
            d = e = half
        a, fa = b, fb
        b += d if abs(d) > tolerance else (tolerance if half > 0.0 else -tolerance)
        fb = value(q, degree, b)
        evaluations += 1
        if (fb > 0.0) == (fc > 0.0):
            c, fc = a, fa
            d = e = b - a
    return b, evaluations
