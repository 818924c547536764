"""A guard's minimum in quad-double: a touch, or a miss, where the motion is a polynomial in time.

That is all that the closer look in double-double (:mod:`henon_ref.henon.window`) leaves open of a touch, and a
polynomial's expansion is short. What is open then is left to :mod:`henon_ref.henon.closer`, which tells touches by the
same measure.
"""

from __future__ import annotations

import numpy as np
import sympy as sp

from henon_ref.henon import quaddouble as qd
from henon_ref.henon.closer import CURVED, LOST
from henon_ref.henon.compiled import quad_double
from henon_ref.henon.isolation import NOTHING
from henon_ref.henon.program import (
    ADD,
    CLOCK,
    CONSTANT,
    DEGREE,
    DEGREE_A,
    DEGREE_B,
    MUL,
    OP,
    OWN,
    RSUB,
    SCALE,
    SQUARE,
    STATE,
    SUB,
    A,
    B,
    C,
)
from henon_ref.henon.window import MISS, TOUCH, UNSURE
from henon_ref.jit import inner
from henon_ref.taylor.tape import INFINITE

HIGHEST = 15
"""Highest degree of a motion that is looked at here."""
PARTS = 4
"""Doubles of a number."""


_INVERSES = np.array([quad_double(sp.Rational(1, max(k, 1))) for k in range(HIGHEST + 1)])


@inner()
def expand(codes, constants, field, guard, t, t_low, x, x_low, unit, rows):  # type: ignore[no-untyped-def]
    """Coefficients of a motion that is a polynomial, and of what is one along it, in units of ``unit``.

    Parameters as those of :func:`henon_ref.henon.fine.expand_fine`, but that ``constants`` hold four doubles each,
    ``guard`` is the row that is asked for and coefficient k of row i is ``rows[i, 4 k : 4 k + 4]``. Returns the highest
    degree; -1 where the motion or the guard is no polynomial, or something along it needs more than sums and products.
    """
    degree = 0
    for i in range(len(codes)):
        if codes[i, DEGREE] < INFINITE:
            degree = max(degree, codes[i, DEGREE])
            if codes[i, OP] > MUL and codes[i, OP] != SQUARE:
                return -1
        elif codes[i, OP] == STATE or codes[i, OWN] == guard:
            return -1
    if degree > HIGHEST:
        return -1
    for k in range(degree + 1):
        for i in range(len(codes)):
            code = codes[i]
            if code[DEGREE] < INFINITE:
                y = _coefficient(code, k, constants, field, t, t_low, x, x_low, unit, rows)
                put(rows[code[OWN]], k, y)
    return degree


@inner()
def _coefficient(code, k, constants, field, t, t_low, x, x_low, unit, rows):  # type: ignore[no-untyped-def]
    """Coefficient k of what a code makes."""
    op, a, b, c = code[OP], code[A], code[B], code[C]
    if k > code[DEGREE]:
        return 0.0, 0.0, 0.0, 0.0
    if op == STATE:
        own = code[OWN]
        if k == 0:
            return x[own], x_low[own], 0.0, 0.0
        return qd.multiply(qd.scale(number(rows[field[own]], k - 1), unit), number(_INVERSES[k], 0))
    if op == CONSTANT:
        return number(constants[c], 0)
    if op == CLOCK:
        slope = number(constants[b], 0)
        if k == 1:
            return qd.scale(slope, unit)
        return qd.add(qd.multiply(slope, (t, t_low, 0.0, 0.0)), number(constants[c], 0))
    if op in (MUL, SQUARE):
        y = 0.0, 0.0, 0.0, 0.0
        for j in range(max(0, k - code[DEGREE_B]), min(k, code[DEGREE_A]) + 1):
            y = qd.add(y, qd.multiply(number(rows[a], j), number(rows[b], k - j)))
        return y
    y = number(rows[a], k)
    if op == ADD:
        return qd.add(y, number(rows[b], k))
    if op == SUB:
        return qd.add(y, qd.negative(number(rows[b], k)))
    if op == SCALE:
        return qd.multiply(y, number(constants[c], 0))
    if op == RSUB:
        y = qd.negative(y)
    return qd.add(y, number(constants[c], 0)) if k == 0 else y


@inner()
def at_minimum(row, degree, s, s_low):  # type: ignore[no-untyped-def]
    """What a guard does at its minimum next to a place, and where that is: TOUCH, MISS or UNSURE.

    UNSURE where the guard is negative there, or the minimum is none of second order.
    """
    place = s, s_low, 0.0, 0.0
    size = 0.0
    value = slope = half = 0.0, 0.0, 0.0, 0.0  # half the second derivative
    for k in range(degree, -1, -1):
        c = number(row, k)
        size += abs(c[0])
        half = qd.add(qd.multiply(half, place), slope)
        slope = qd.add(qd.multiply(slope, place), value)
        value = qd.add(qd.multiply(value, place), c)
    if not 2.0 * half[0] > CURVED * size:
        return UNSURE, place
    shift = -0.5 * slope[0] / half[0]  # a double's digits do: the place has a double-double's
    depth = value[0] + 0.5 * slope[0] * shift
    place = qd.add(place, (shift, 0.0, 0.0, 0.0))
    if abs(depth) <= NOTHING * size:
        return TOUCH, place
    return MISS if depth > 0.0 else UNSURE, place


@inner()
def along(t, t_low, unit, place):  # type: ignore[no-untyped-def]
    """A time on the step as two doubles."""
    return _pair(qd.add((t, t_low, 0.0, 0.0), qd.scale(place, unit)))


@inner()
def value(row, degree, place):  # type: ignore[no-untyped-def]
    """Value of a polynomial as two doubles."""
    y = 0.0, 0.0, 0.0, 0.0
    for k in range(degree, -1, -1):
        y = qd.add(qd.multiply(y, place), number(row, k))
    return _pair(y)


@inner()
def _pair(y):  # type: ignore[no-untyped-def]
    """A number as two doubles; what is lost to the second, too, would only make it miss round numbers."""
    return y[0], (y[1] if abs(y[1]) > LOST * abs(y[0]) else 0.0)


@inner()
def number(row, k):  # type: ignore[no-untyped-def]
    """Coefficient k."""
    at = PARTS * k
    return row[at], row[at + 1], row[at + 2], row[at + 3]


@inner()
def put(row, k, y):  # type: ignore[no-untyped-def]
    """Set coefficient k."""
    at = PARTS * k
    row[at], row[at + 1], row[at + 2], row[at + 3] = y
