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
def at_minimum(row, degree, s, s_low):  # type: ignore[no-untyped-def]
    """What a guard does at its minimum next to a place, and where that is: TOUCH, MISS or UNSURE.

    UNSURE where the guard is negative there, or the minimum is none of second order.
    """
    place = s, s_low, 0.0, 0.0
    size = 0.0
    value = 0.0, 0.0, 0.0, 0.0
    slope = slope_low = half = 0.0  # half the second derivative
    for k in range(degree, -1, -1):
        c = number(row, k)
        size += abs(c[0])
        half = half * s + slope
        slope, slope_low = dd.multiply(slope, slope_low, s, s_low)
        slope, slope_low = dd.add(slope, slope_low, value[0], value[1])
        value = qd.add(qd.multiply(value, place), c)
    if not 2.0 * half > CURVED * size:
        return UNSURE, place
    shift = -0.5 * slope / half  # a double's digits do: the place has a double-double's
    depth = value[0] + 0.5 * slope * shift
    place = qd.add(place, (shift, 0.0, 0.0, 0.0))
    if abs(depth) <= NOTHING * size:
        return TOUCH, place
    return MISS if depth > 0.0 else UNSURE, place
