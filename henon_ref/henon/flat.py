"""Flat roots of polynomial motions in quad-double: touches of order four and more, crossings of odd order.

Next to a root of order m nothing is told from zero in 1/m of the digits. Its place is a simple root of derivative
m - 1. The polynomial is recentred there, and the root is told where its first term outweighs all behind it up to where
double precision is clear of zero. What is open then is left to :mod:`henon_ref.henon.closer`.
"""

from __future__ import annotations

from henon_ref.henon import doubledouble as dd
from henon_ref.henon import quaddouble as qd
from henon_ref.henon.isolation import NOTHING
from henon_ref.henon.quadseries import number, put
from henon_ref.henon.window import NOISE, ROOT, TOUCH, UNSURE, call_clear
from henon_ref.jit import inner

HIGHEST = 15
"""Highest degree of a polynomial that is looked at here."""
ROUNDS = 20
"""Steps of Newton's method after which the root is not found."""
LEVEL = 1e-61
"""Slopes below this of the size cannot be told from zero."""
PLACED = 1e-28
"""A step shorter than this of the whole step tells the order of the root."""
REFINED = 4
"""Steps towards the root, once its order is known, at most."""
EXACT = 1e-32
"""After one shorter than this of the whole step the root is known to all digits."""
HALVINGS = 40
"""The first term is looked at from the whole step down to as many halvings."""


@inner()
def at_flat_root(integers, row, degree, start, q, work):  # type: ignore[no-untyped-def]
    """What a guard does at a flat root next to a place, before which it has none.

    Parameters
    ----------
    integers : row of int
        Of the run: where functions that stand apart are.
    row : ndarray
        The guard, as :func:`henon_ref.henon.quadseries.expand` makes it.
    degree : int
    start : float
        Next to the root, on (0, 1).
    q : ndarray
        The guard without the zeros it is known to have where the step begins, in double precision.
    work : ndarray, shape (4 or more, whole fours above four times the degree)
        Work space.

    Returns
    -------
    outcome : int
        TOUCH (order even), ROOT (odd, the guard falls), or UNSURE.
    place : tuple of four floats
    order : int
    """
    local = work[0]
    size = 0.0
    for k in range(degree + 1):
        size += abs(number(row, k)[0])
    place = start, 0.0, 0.0, 0.0
    _recentred(row, degree, place, local)
    order = _lifting(local, degree, NOISE * size)  # as double-double tells it, which has led here
    if order > 2:
        place = _refined(row, degree, place, order, local)
    if order < 3 or _lifting(local, degree, NOTHING * size) != order:
        place, found = _stationary(row, degree, start, size)
        if not found:
            return UNSURE, place, 0
        _recentred(row, degree, place, local)
        order = _lifting(local, degree, NOTHING * size)
        if order < 2:
            return UNSURE, place, 0
        place = _refined(row, degree, place, order, local)
    leading, s = number(local, order)[0], place[0]
    falls = order % 2 == 1
    if (leading > 0.0) == falls or not 0.0 < s < 1.0 or _lifting(local, degree, NOTHING * size) != order:
        return UNSURE, place, 0
    if not abs(number(local, 0)[0]) <= NOTHING * size:
        return UNSURE, place, 0
    near = _outweighed(local, degree, order, s)
    if near == 0.0 or (near < s and not call_clear(integers, q, s - near, size, work[2:])):
        return UNSURE, place, 0
    return (ROOT if falls else TOUCH), place, order


@inner()
def _stationary(row, degree, start, size):  # type: ignore[no-untyped-def]
    """Where the slope vanishes next to a place, and whether that is found.

    Newton's method on the slope over its derivative, of which a flat root, too, is a simple root (Schroeder 1870).
    """
    place = start, 0.0, 0.0, 0.0
    for _ in range(ROUNDS):
        slope = bend = twist = 0.0, 0.0, 0.0, 0.0  # twist is half the third derivative
        for k in range(degree, 0, -1):
            twist = qd.add(qd.multiply(twist, place), bend)
            bend = qd.add(qd.multiply(bend, place), slope)
            slope = qd.add(qd.multiply(slope, place), qd.scale(number(row, k), float(k)))
        if abs(slope[0]) <= LEVEL * size:
            return place, True
        below = bend[0] * bend[0] - 2.0 * slope[0] * twist[0]
        if not below > 0.0:
            return place, False
        shift = -slope[0] * bend[0] / below
        place = qd.add(place, (shift, 0.0, 0.0, 0.0))
        if not 0.0 < place[0] < 1.0:
            return place, False
        if abs(shift) <= PLACED:
            return place, True
    return place, False


@inner()
def _refined(row, degree, place, order, local):  # type: ignore[no-untyped-def]
    """The root of derivative order - 1 next to a place, about which a polynomial is recentred already, and then is."""
    for _ in range(REFINED):
        above, below = number(local, order - 1), number(local, order)
        shift, shift_low = dd.divide(-above[0], -above[1], order * below[0], order * below[1])
        place = qd.add(place, (shift, shift_low, 0.0, 0.0))
        if abs(shift) <= EXACT:
            break
        _recentred(row, degree, place, local)
    return place


@inner()
def _recentred(row, degree, place, local):  # type: ignore[no-untyped-def]
    """Coefficients about a place, by Horner's rule again and again."""
    for k in range(degree + 1):
        put(local, k, number(row, k))
    for i in range(degree):
        for k in range(degree - 1, i - 1, -1):
            put(local, k, qd.add(number(local, k), qd.multiply(place, number(local, k + 1))))


@inner()
def _lifting(local, degree, level):  # type: ignore[no-untyped-def]
    """Order of the term that first lifts a polynomial by so much."""
    order, nearest = 0, 2.0
    for k in range(1, degree + 1):
        c = abs(number(local, k)[0])
        if c > 0.0 and (level / c) ** (1.0 / k) < nearest:
            order, nearest = k, (level / c) ** (1.0 / k)
    return order


@inner()
def _outweighed(local, degree, order, widest):  # type: ignore[no-untyped-def]
    """How far to the left a term outweighs all behind it twice; 0 if next to nowhere."""
    leading, near = abs(number(local, order)[0]), widest
    for _ in range(HALVINGS):
        total = 0.0
        for k in range(degree, order, -1):
            total = (total + abs(number(local, k)[0])) * near
        if 2.0 * total <= leading:
            return near
        near *= 0.5
    return 0.0
