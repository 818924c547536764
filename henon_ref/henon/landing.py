"""Landings: putting the step's end on a guard's root that stands alone on the step."""

from __future__ import annotations

import math

from henon_ref.henon.records import BRACKET, NEWTON
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS, fma, larger, smaller
from henon_ref.roots.double import at_end, value

CUBIC_STEEPNESS = 3.0
"""How many times less steep than the chord an end may be for an inverse cubic: it is monotone then."""


@inner()
def land(q, degree, low, high, method):  # type: ignore[no-untyped-def]
    """Put the step's end on the root of q that [low, high], within [0, 1], brackets, q falling.

    ``HENON``: the independent variable is swapped from t to h (Hénon 1982; Eq. (14) of the paper) and one
    Taylor step of order 4 in h, of length -h, is taken from a point near the surface: dt/dh = 1/h', whose
    Taylor series is the reversion of h's. That point is the root of an inverse cubic where the guard falls evenly
    over the whole step, and the chord's otherwise. The step is repeated once where the first was long.
    Where the swapped series does not converge (near a graze) the falling root of the guard's parabola leads closer.
    ``NEWTON``: the same with order 1, repeated (``BRENT``: see :func:`brent`). Where neither gets there, bisection
    decides, and the landing says ``BRACKET``.

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
    below, evaluations = q[0], 0
    if low > 0.0:
        below, evaluations = value(q, degree, low), 1
    above, slope = at_end(q, degree)
    if high < 1.0:
        above, evaluations = value(q, degree, high), evaluations + 1
    left, right = low, high
    tau = 0.5 * (low + high)
    if below > 0.0 and above < -0.01 * below:  # else another root next to ``high`` may have left nothing but rounding
        part, fall = below / (below - above), above - below
        tau = fma(high - low, part, low)
        if low == 0.0 and high == 1.0 and CUBIC_STEEPNESS * q[1] < fall and CUBIC_STEEPNESS * slope < fall:
            tau = _interpolated(part, fall / q[1], fall / slope)
    order_one, before = method == NEWTON, 1.0
    for _ in range(12):
        g0, g1, g2, g3, g4 = _around(q, degree, tau, order_one)
        evaluations += 1
        if g0 > 0.0:
            left = tau
        else:
            right = tau
        bend = fma(g1, g1, -4.0 * g0 * g2)
        if g1 >= 0.0 and (order_one or not (g2 < 0.0 and bend > 0.0)):  # not yet, or no longer, on the way down
            tau = 0.5 * (left + right)
            continue
        u = -g0 / g1 if g1 < 0.0 else 1.0
        delta, error = u, 1.0
        if not order_one:
            if g1 < 0.0:
                delta, error = _reverted(u, 1.0 / g1, g2, g3, g4)
            if error == 1.0:  # the swapped series does not converge from here: come closer first
                if bend > 0.0:  # by the parabola's falling root, which is near where two roots are
                    root = math.sqrt(bend)
                    delta = 2.0 * g0 / (root - g1) if g1 <= 0.0 else -0.5 * (g1 + root) / g2
                if not low < tau + delta < high:
                    delta = 0.5 * (left + right) - tau
        new = tau + delta
        if not left <= new <= right:
            new = smaller(larger(new, left), right)
            if new in (left, right) and abs(delta) > 8.0 * EPS * right:
                new = 0.5 * (left + right)
                tau = new
                continue
        moved = abs(new - tau)
        tau = new
        if moved <= 2.0 * EPS * new or error * moved <= 0.25 * EPS * new:
            return tau, method, evaluations
        if error < 1.0 and moved >= 0.5 * before:  # no nearer: what is left of the guard is rounding
            return tau, method, evaluations
        before = moved if error < 1.0 else 1.0
    tau, more = _bisect(q, degree, left, right)
    return tau, BRACKET, evaluations + more


@inner(forceinline=True)
def _interpolated(part, first, last):  # type: ignore[no-untyped-def]
    """Root by the cubic in h that has the guard's values and slopes at both ends of [0, 1] (Hermite's interpolation).

    ``part`` of its fall lies before the root; ``first``, ``last``: slopes of the inverse, in units of the chord's.
    """
    rest = 1.0 - part
    return part * fma(part, fma(2.0, rest, 1.0), rest * fma(rest, first, -part * last))


@inner(forceinline=True)
def _around(q, degree, tau, order_one):  # type: ignore[no-untyped-def]
    """Taylor coefficients 0 to 4 of q around tau; 0 and 1 only where no more are wanted."""
    g0, g1, g2, g3, g4 = q[degree], 0.0, 0.0, 0.0, 0.0
    for k in range(degree - 1, -1, -1):
        if not order_one:
            g4 = fma(g4, tau, g3)
            g3 = fma(g3, tau, g2)
            g2 = fma(g2, tau, g1)
        g1 = fma(g1, tau, g0)
        g0 = fma(g0, tau, q[k])
    return g0, g1, g2, g3, g4


@inner(forceinline=True)
def _reverted(u, inverse, g2, g3, g4):  # type: ignore[no-untyped-def]
    """Step to the zero by the reversed series in h, of order 4, and its relative error; 1 where it is no good.

    ``u`` is the step of order 1, ``inverse`` 1 / h'. The terms fall off like powers of one number; the error
    is about the fourth.
    """
    b2, b3, b4 = g2 * inverse, g3 * inverse, g4 * inverse
    second, third, fourth = abs(b2 * u), abs(b3 * u * u), abs(b4 * u * u * u)
    if second > 0.125 or third > 0.015 or fourth > 0.002:
        return u, 1.0
    # 1 - b2 u + (2 b2^2 - b3) u^2 + (5 b2 b3 - b4 - 5 b2^3) u^3
    three, four = fma(2.0 * b2, b2, -b3), fma(5.0 * b2, fma(-b2, b2, b3), -b4)
    step = u * fma(u, fma(u, fma(u, four, three), -b2), 1.0)
    return step, second**4 + third**2 + fourth * larger(second, third)


@inner(forceinline=True)
def _bisect(q, degree, left, right):  # type: ignore[no-untyped-def]
    evaluations = 0
    while right - left > 2.0 * EPS * right and evaluations < 200:
        middle = 0.5 * (left + right)
        if middle <= left or middle >= right:
            break
        evaluations += 1
        if value(q, degree, middle) > 0.0:
            left = middle
        else:
            right = middle
    return 0.5 * (left + right), evaluations


@inner()
def brent(q, degree, low, high):  # type: ignore[no-untyped-def]
    """Bracketing alone, by Brent's method (*Algorithms for Minimization without Derivatives*, 1973, Ch. 4).

    Returns the root, or -1 where the interval's ends do not bracket one, and evaluations of the polynomial.
    """
    if low == high:
        return low, 0
    a, b, fa, fb, evaluations = low, high, q[0], value(q, degree, high), 0
    if low > 0.0:
        fa, evaluations = value(q, degree, low), 1
    if high < 1.0:
        evaluations += 1
    if not fa > 0.0 > fb:
        return -1.0, 0
    c, fc = a, fa
    d = e = b - a
    while evaluations < 200:
        if abs(fc) < abs(fb):
            a, b, c = b, c, b
            fa, fb, fc = fb, fc, fb
        tolerance = EPS * abs(b)
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
            if 2.0 * p < smaller(3.0 * half * r - abs(tolerance * r), abs(e * r)):
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
