"""A guard's minimum in quad-double: a touch, or a miss.

Of a touch of second order the closer look in double-double (:mod:`henon_ref.henon.window`) leaves that alone open.
What is open then is left to :mod:`henon_ref.henon.closer`, which tells touches by the same measure.
"""

from __future__ import annotations

from henon_ref.henon import doubledouble as dd
from henon_ref.henon import quaddouble as qd
from henon_ref.henon.closer import CURVED
from henon_ref.henon.isolation import NOTHING
from henon_ref.henon.quadseries import number
from henon_ref.henon.window import MISS, TOUCH, UNSURE
from henon_ref.jit import inner


@inner()
def at_minimum(row, degree, size, s):  # type: ignore[no-untyped-def]
    """What a guard does at its minimum next to 1, and how far behind 1 that is: TOUCH, MISS or UNSURE.

    UNSURE where the guard is negative there, or the minimum is none of second order. ``row`` are its
    coefficients, four doubles each, in units of the place, which is at ``s`` on a step on which ``size`` is its size.
    """
    total = 0.0, 0.0, 0.0, 0.0
    slope = slope_low = half = 0.0  # half the second derivative
    for k in range(degree, -1, -1):
        c = number(row, k)
        total = qd.accumulated(total, c)
        part, rest = dd.two_product(c[0], k)
        slope, lost = dd.two_sum(slope, part)
        slope_low += lost + (rest + c[1] * k)
        half += part * (0.5 * (k - 1))
    if not 2.0 * half > CURVED * size * s * s:
        return UNSURE, 0.0
    slope += slope_low
    shift = -0.5 * slope / half  # a double's digits do: the place has a double-double's
    depth = qd.rounded(total) + 0.5 * slope * shift
    if abs(depth) <= NOTHING * size:
        return TOUCH, shift
    return MISS if depth > 0.0 else UNSURE, shift
