"""Sine, cosine and exponential in quad-double: a reduced argument's Taylor series, then doubled again and again."""

from __future__ import annotations

import math

import numpy as np
import sympy as sp

from henon_ref.henon import quaddouble as qd
from henon_ref.henon.compiled import quad_double
from henon_ref.jit import inner

INVERSES = np.array([quad_double(sp.Rational(1, max(k, 1))) for k in range(100)])
"""1 / k, each in four doubles."""
_LOG_2 = tuple(quad_double(sp.log(2)))
_QUARTER = tuple(quad_double(sp.pi / 2))
_HALVED = 9
"""An exponential's argument is halved so often, a sine's three times less."""
LARGEST, FARTHEST = 600.0, 1e6
"""Arguments of an exponential and of a sine that are larger are refused: the result is not a number."""


@inner()
def exponential(a):  # type: ignore[no-untyped-def]
    """exp(a)."""
    if not abs(a[0]) < LARGEST:
        return math.nan, 0.0, 0.0, 0.0
    whole = math.floor(a[0] / _LOG_2[0] + 0.5)
    r = qd.add(a, qd.scale(_LOG_2, -whole))
    r = _shifted(r, -_HALVED)
    s = term = r  # exp(r) - 1
    for k in range(2, 18):
        term = qd.multiply(qd.multiply(term, r), inverse(k))
        s = qd.add(s, term)
    for _ in range(_HALVED):
        s = qd.add(_shifted(s, 1), qd.multiply(s, s))
    return _shifted(qd.add(s, (1.0, 0.0, 0.0, 0.0)), int(whole))


@inner()
def sine_cosine(a):  # type: ignore[no-untyped-def]
    """sin(a) and cos(a)."""
    nothing = math.nan, 0.0, 0.0, 0.0
    if not abs(a[0]) < FARTHEST:
        return nothing, nothing
    turns = math.floor(a[0] / _QUARTER[0] + 0.5)
    r = _shifted(qd.add(a, qd.scale(_QUARTER, -turns)), 3 - _HALVED)
    square = qd.negative(qd.multiply(r, r))
    s = term = r
    c = part = _shifted(square, -1)  # cos(r) - 1
    for k in range(1, 15):
        term = qd.multiply(qd.multiply(qd.multiply(term, square), inverse(2 * k)), inverse(2 * k + 1))
        part = qd.multiply(qd.multiply(qd.multiply(part, square), inverse(2 * k + 1)), inverse(2 * k + 2))
        s, c = qd.add(s, term), qd.add(c, part)
    for _ in range(_HALVED - 3):
        s = _shifted(qd.add(s, qd.multiply(s, c)), 1)
        c = _shifted(qd.multiply(c, qd.add(c, (2.0, 0.0, 0.0, 0.0))), 1)
    c = qd.add(c, (1.0, 0.0, 0.0, 0.0))
    quarter = int(turns) % 4
    if quarter % 2 == 1:
        s, c = c, qd.negative(s)
    if quarter >= 2:
        s, c = qd.negative(s), qd.negative(c)
    return s, c


@inner()
def inverse(k):  # type: ignore[no-untyped-def]
    """1 / k."""
    return INVERSES[k, 0], INVERSES[k, 1], INVERSES[k, 2], INVERSES[k, 3]


@inner()
def _shifted(a, power):  # type: ignore[no-untyped-def]
    """a 2^power."""
    factor = math.ldexp(1.0, power)
    return a[0] * factor, a[1] * factor, a[2] * factor, a[3] * factor
