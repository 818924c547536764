"""A polynomial in quad-double about a place on the step."""

from __future__ import annotations

from henon_ref.henon import doubledouble as dd
from henon_ref.henon import quaddouble as qd
from henon_ref.henon.quadseries import PARTS, number
from henon_ref.jit import inner

LOST = 1e-58
"""What may be lost of the size of a polynomial's value and slope about a place."""
_ONE_DOUBLE, _TWO_DOUBLES = 1e-44, 1e-28


@inner()
def about(row, degree, zeros, size, s, s_low):  # type: ignore[no-untyped-def]
    """Value and slope at a place of a polynomial over s^zeros, each rounded at its end only.

    ``size`` is that of the polynomial. Its known zeros need not be divided out of it: they are far from the place.
    """
    top = degree
    y = slope = 0.0
    while top >= 0 and abs(row[PARTS * top]) <= _ONE_DOUBLE * size:
        y, slope = y * s + row[PARTS * top], slope * s + y
        top -= 1
    rest = lost = 0.0
    while top >= 0 and abs(row[PARTS * top]) <= _TWO_DOUBLES * size:
        slope, lost = dd.compensated(slope, lost, s, s_low, y, rest)
        y, rest = dd.compensated(y, rest, s, s_low, row[PARTS * top], row[PARTS * top + 1])
        top -= 1
    value, first = _ordered(y, rest), _ordered(slope, lost)
    for k in range(top, -1, -1):
        first = qd.add(_times(first, s, s_low), value)
        value = qd.add(_times(value, s, s_low), number(row, k))
    apart = s**zeros
    return value[0] / apart, (first[0] - zeros / s * value[0]) / apart


@inner()
def _times(y, s, s_low):  # type: ignore[no-untyped-def]
    product = qd.scale(y, s)
    return product if s_low == 0.0 else qd.add(product, qd.scale(y, s_low))


@inner()
def _ordered(y, rest):  # type: ignore[no-untyped-def]
    high, low = dd.two_sum(y, rest)
    return high, low, 0.0, 0.0
