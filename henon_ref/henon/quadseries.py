"""Taylor coefficients of a solution in quad-double, about 60 digits: one interpreter, compiled once for all models.

Where the motion is a polynomial in time by its form the expansion ends with its degree, else where its terms count for
nothing. Of the functions there are the sine, the cosine and the exponential.
"""

from __future__ import annotations

import math

from henon_ref.henon import doubledouble as dd
from henon_ref.henon import quaddouble as qd
from henon_ref.henon.program import (
    ADD,
    CLOCK,
    CONSTANT,
    COS,
    DEGREE,
    DEGREE_A,
    DEGREE_B,
    DIV,
    EXP,
    FIRST,
    MUL,
    NEEDED,
    OP,
    OWN,
    RECIP,
    RSUB,
    SCALE,
    SIN,
    SLOPE,
    SQRT,
    SQUARE,
    STATE,
    SUB,
    A,
    B,
    C,
)
from henon_ref.henon.quadfunctions import exponential, inverse, sine_cosine
from henon_ref.jit import inner
from henon_ref.taylor.tape import INFINITE

ORDER = 96
"""Highest order of an expansion."""
PARTS = 4
"""Doubles of a number."""
WIDTH = PARTS * (ORDER + 1)
"""Doubles of a row."""
NEGLIGIBLE = 1e-63
"""Size of a coefficient, relative to its series, that no longer counts."""
SMALL = 1e-31
"""Size of a coefficient, or of a term of it, relative to its series, of which a double-double's digits do."""
TINY = 1e-47
"""And of a term of which a double's do."""
QUIET = 4
"""So many orders in a row without one that counts end an expansion."""


@inner()
def expand(codes, constants, field, output, row, t, t_low, x, x_low, unit, unit_low, least, rows, sizes):  # type: ignore[no-untyped-def]
    """Coefficients of a motion, and of one function along it, in units of ``unit + unit_low``.

    Parameters as those of :func:`henon_ref.henon.fine.expand_fine`, but that ``constants`` hold four doubles each,
    ``output`` is the place of the function among the outputs and ``row`` its row, and coefficient k of row i is
    ``rows[i, 4 k : 4 k + 4]``; zero as long as no coefficient of that order has been made. Returns the highest order;
    -1 where that is not enough, or a function is not here.
    """
    bit, degree, finite = 1 << min(output, 62), 0, True
    for i in range(len(codes)):
        if codes[i, NEEDED] & bit != 0:
            op = codes[i, OP]
            if op > RECIP and op not in (SIN, COS, EXP):
                return -1
            finite = finite and codes[i, DEGREE] < INFINITE
            degree = max(degree, codes[i, DEGREE])
    if finite and degree > ORDER:
        return -1
    quiet, small = 0, False
    whole = unit, unit_low, 0.0, 0.0
    sizes[:] = 0.0
    for k in range((degree if finite else ORDER) + 1):
        part = _short_product(inverse(k), whole) if small else qd.multiply(inverse(k), whole)
        quiet += 1
        small = k > 0
        for i in range(len(codes)):
            if codes[i, NEEDED] & bit != 0 and k <= codes[i, DEGREE]:  # coefficients behind are zero as they are
                own = codes[i, OWN]
                y = _coefficient(codes[i], k, constants, field, t, t_low, x, x_low, part, rows, sizes[own])
                put(rows[own], k, y)
                sizes[own] += abs(y[0])
                if not sizes[own] < math.inf:
                    return -1
                small = small and abs(y[0]) <= SMALL * sizes[own]
                if (codes[i, OP] == STATE or own == row) and abs(y[0]) > NEGLIGIBLE * sizes[own]:
                    quiet = 0
        if not finite and quiet >= QUIET and k >= least:
            return k
    return degree if finite else -1


@inner(inline="always")
def _coefficient(code, k, constants, field, t, t_low, x, x_low, part, rows, size):  # type: ignore[no-untyped-def]
    """Coefficient k of what a code makes; ``part`` is the unit over k, ``size`` that of the coefficients before."""
    op, own, a, b, c = code[OP], code[OWN], code[A], code[B], code[C]
    if op == STATE:
        if k == 0:
            return x[own], x_low[own], 0.0, 0.0
        slope = number(rows[field[own]], k - 1)
        if abs(slope[0] * part[0]) <= SMALL * size:
            return _short_product(slope, part)
        return qd.multiply(slope, part)
    if op == CONSTANT:
        return number(constants[c], 0)
    if op == CLOCK:
        slope = number(constants[b], 0)
        if k == 1:
            return qd.multiply(slope, part)
        return qd.add(qd.multiply(slope, (t, t_low, 0.0, 0.0)), number(constants[c], 0))
    if op >= SIN:
        return _integral(op, k, rows[a], rows[b])
    if op in (MUL, SQUARE):
        return _dot(rows[a], rows[b], max(code[FIRST], k - code[DEGREE_B]), min(k, code[DEGREE_A]), k, size)
    if op in (DIV, RECIP, SQRT):
        return _quotient(op, k, rows[own], rows[a], rows[b], number(constants[c], 0), size)
    y = number(rows[a], k)
    if op == ADD:
        return qd.add(y, number(rows[b], k))
    if op == SUB:
        return qd.add(y, qd.negative(number(rows[b], k)))
    if op == SCALE:
        factor = number(constants[c], 0)
        if abs(factor[0]) == 1.0 and factor[1] == 0.0:  # a sign
            return y[0] * factor[0], y[1] * factor[0], y[2] * factor[0], y[3] * factor[0]
        return qd.multiply(y, factor) if factor[1] != 0.0 else qd.scale(y, factor[0])
    if op == SLOPE:
        return qd.scale(y, float(k))
    if op == RSUB:
        y = qd.negative(y)
    return qd.add(y, number(constants[c], 0)) if k == 0 else y


@inner()
def _short_product(a, b):  # type: ignore[no-untyped-def]
    """a b to a double-double's digits."""
    high, low = dd.multiply(a[0], a[1], b[0], b[1])
    return high, low, 0.0, 0.0


@inner()
def _dot(a, b, first, last, k, size):  # type: ignore[no-untyped-def]
    """Sum of a[j] b[k - j] over first <= j <= last, each with the digits that count in a series of some size."""
    y = 0.0, 0.0, 0.0, 0.0
    s, rest = 0.0, 0.0
    for j in range(first, last + 1):
        i = k - j
        term = a[PARTS * j] * b[PARTS * i]
        if abs(term) > SMALL * size:
            y = qd.accumulated_product(y, number(a, j), number(b, i))
        elif abs(term) > TINY * size:
            high, low = dd.multiply(a[PARTS * j], a[PARTS * j + 1], b[PARTS * i], b[PARTS * i + 1])
            s, lost = dd.two_sum(s, high)
            rest += lost + low
        else:
            rest += term
    return qd.add(y, (s, rest, 0.0, 0.0))


@inner()
def _quotient(op, k, own, a, b, constant, size):  # type: ignore[no-untyped-def]
    """Coefficient k of a / b, of a constant over b, or of the root of a, which is a over itself."""
    if op == SQRT and k == 0:
        return qd.square_root(number(a, 0))
    y = number(a, k)
    if op == RECIP:
        y = constant if k == 0 else (0.0, 0.0, 0.0, 0.0)
    if op == SQRT:
        y = qd.scale(qd.add(y, qd.negative(_dot(own, own, 1, k - 1, k, size * own[0]))), 0.5)
        return qd.divide(y, number(own, 0))
    return qd.divide(qd.add(y, qd.negative(_dot(own, b, 0, k - 1, k, size * abs(b[0])))), number(b, 0))


@inner()
def _integral(op, k, a, slope):  # type: ignore[no-untyped-def]
    """Coefficient k of a function of a; ``slope`` is that of its slope, a cosine's with the other sign, times k."""
    if k == 0:
        if op == EXP:
            return exponential(number(a, 0))
        s, c = sine_cosine(number(a, 0))
        return s if op == SIN else c
    y = qd.multiply(number(slope, k), inverse(k))
    return qd.negative(y) if op == COS else y


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
