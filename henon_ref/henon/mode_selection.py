"""What follows an event where several surfaces meet or slide, decided in machine code where it is clear.

The rule is that of :mod:`henon_ref.filippov.switching`: of all candidate modes the one whose own field keeps it.
At one point the normal velocities are affine in the signs of the surfaces in play, N = a + B s; so a few
numbers settle it: for each candidate the equivalent signs of its sliding surfaces solve B s = -a, and what is
left must point the right way. Where no surface's velocity has another one's sign in it, each surface is decided
alone, by its velocities below and above. Whatever is not clear (a number within ``CLEAR_MARGIN`` of where it would
decide otherwise, none or several modes that fit, signs that multiply each other) is left to Python.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import boolean, float64, int64, types
from numpy.typing import NDArray

from henon_ref.henon.records import SURFACE, guard_of, mode_of
from henon_ref.jit.calls import call_expand
from henon_ref.jit.njit import inner

CLEAR_MARGIN = 1e-6
"""Relative distance from a tie from which on a decision is clear in double precision."""
SELECTION = types.Tuple(
    (
        int64,
        float64[::1],
        int64[:, ::1],
        int64[::1],
        boolean,
        float64[::1],
        float64[:, ::1],
        float64[:, ::1],
        int64[:, ::1],
    )
)
"""Type of the argument ``selection`` of :func:`select_mode`."""
MOST = 4
"""Surfaces in play that act on each other; with more the candidates are searched, not tried (Python does)."""


def selection_space(states: int, surfaces: int) -> tuple[NDArray[Any], ...]:
    """Room for states and signs, normal velocities at two choices of signs, the linear systems, surfaces in play."""
    return (
        np.zeros(states + surfaces),
        np.zeros((2, states + 2 * surfaces)),
        np.zeros((4 + 2 * MOST + 2**MOST, MOST + 1)),
        np.zeros((2, surfaces), dtype=np.int64),
    )


@inner()
def select_mode(t, low, x, mode, layout, hits, selection):  # type: ignore[no-untyped-def]
    """Row of the mode that follows; -1 where that is not clear or the mode not compiled.

    Parameters
    ----------
    t, low, x
        Time, what rounding it lost, and the state.
    mode : int
        Row of the mode that ends.
    layout : rows of int
        Its guards (see :func:`henon_ref.henon.loop.advance`).
    hits : row of int
        Its guards at zero.
    selection : tuple
        Address of the normal velocities' machine code and its constants; the signs of every row and the row of
        every combination of signs; whether no normal velocity has the sign of another surface in it; work space
        of :func:`selection_space`.
    """
    address, constants, signs, rows, decoupled, point, values, numbers, places = selection
    surfaces = signs.shape[1]
    n = point.size - surfaces
    active, index = places[0], places[1]
    count = 0
    for i in range(surfaces):
        involved = signs[mode, i] == 0
        for g in range(mode_of(layout).guards):
            if hits[g] == 1 and guard_of(layout, g).kind != SURFACE:
                return -1
            involved = involved or (hits[g] == 1 and guard_of(layout, g).index == i)
        if involved:
            active[count] = i
            count += 1
    for i in range(n):
        point[i] = x[i]
    for i in range(surfaces):
        point[n + i] = signs[mode, i]
    if decoupled:
        found = _each(address, constants, t, low, point, values, n, active, count, signs[mode])
    elif count > MOST:
        return -1
    else:
        a, size, lean, s = numbers[0], numbers[1], numbers[2], numbers[3]
        b, m, corners = numbers[4 : 4 + MOST], numbers[4 + MOST : 4 + 2 * MOST], numbers[4 + 2 * MOST :]
        if not _affine(address, constants, t, low, point, values[0], n, active, count, a, b, size, lean, corners):
            return -1
        found = _only(a, b, size, lean, count, s, m, index)
    if found < 0:
        return -1
    row, power = 0, 1
    for i in range(surfaces):
        entry = signs[mode, i]
        for k in range(count):
            if active[k] == i:
                entry = _choice(found, k)
        row += (entry + 1) * power
        power *= 3
    return rows[row]


@inner()
def _choice(candidate, k):  # type: ignore[no-untyped-def]
    """Sign of the k-th surface in play in a candidate (a number of base 3)."""
    for _ in range(k):
        candidate //= 3
    return candidate % 3 - 1


@inner()
def _each(address, constants, t, low, point, values, n, active, count, before):  # type: ignore[no-untyped-def]
    """The candidate of surfaces that do not act on each other, from their velocities on both sides; -1: unclear."""
    first = point.size
    for side in range(2):
        point[n:] = 2.0 * side - 1.0
        call_expand(address, t, low, 1.0, point, constants, values[side])
    found, power = 0, 1
    for k in range(count):
        below, above = values[0, first + active[k]], values[1, first + active[k]]
        margin = CLEAR_MARGIN * max(abs(below), abs(above))
        if below > margin and above < -margin:
            entry = 0
        elif before[active[k]] == 0:  # it was not hit and slides on, if it is far from its own release
            return -1
        elif min(below, above) > margin:
            entry = 1
        elif max(below, above) < -margin:
            entry = -1
        else:
            return -1
        found += (entry + 1) * power
        power *= 3
    return found


@inner()
def _affine(address, constants, t, low, point, values, n, active, count, a, b, size, lean, found):  # type: ignore[no-untyped-def]
    """Normal velocities a + B s of the surfaces in play, from all corners; False where they are not affine.

    ``size`` is the most |a + B s| can be; ``lean`` the sign it has whatever the signs in [-1, 1] are, 0 if none.
    """
    corners = 2**count
    first = point.size
    for corner in range(corners):
        for k in range(count):
            point[n + active[k]] = 1.0 if corner >> k & 1 else -1.0
        call_expand(address, t, low, 1.0, point, constants, values)
        for k in range(count):
            found[corner, k] = values[first + active[k]]
    for k in range(count):
        a[k] = 0.0
        b[k, :] = 0.0
        for corner in range(corners):
            a[k] += found[corner, k] / corners
            for j in range(count):
                b[k, j] += (found[corner, k] if corner >> j & 1 else -found[corner, k]) / corners
        size[k] = abs(a[k])
        for j in range(count):
            size[k] += abs(b[k, j])
        lean[k] = np.sign(a[k]) if 2.0 * abs(a[k]) - size[k] > CLEAR_MARGIN * size[k] else 0.0
        for corner in range(corners):
            rest = found[corner, k] - a[k]
            for j in range(count):
                rest -= b[k, j] if corner >> j & 1 else -b[k, j]
            if not abs(rest) <= 1e-3 * CLEAR_MARGIN * size[k]:  # not affine, or no number
                return False
    return True


@inner()
def _only(a, b, size, lean, count, s, m, index):  # type: ignore[no-untyped-def]
    """The one candidate that is clearly consistent; -1 where there is none, several, or an unclear one."""
    best = -1
    for candidate in range(3**count):
        holds = _consistent(a, b, size, lean, count, candidate, s, m, index)
        if holds == 0:
            return -1
        if holds > 0:
            if best >= 0:
                return -1
            best = candidate
    return best


@inner()
def _consistent(a, b, size, lean, count, candidate, s, m, index):  # type: ignore[no-untyped-def]
    """1 if a candidate's own field keeps it, -1 if not, 0 if that is not clear."""
    for k in range(count):
        if lean[k] != 0.0 and lean[k] != _choice(candidate, k):
            return -1
    unclear = not _solved(a, b, count, candidate, s, m, index)
    for k in range(count):
        side = _choice(candidate, k)
        speed, coupling = a[k], 0.0
        for j in range(count):
            speed += b[k, j] * s[j]
            coupling += abs(b[k, j]) if j != k else 0.0
        if side != 0:
            clear = side * speed / size[k] if size[k] > 0.0 else 0.0
            if unclear:
                clear = 0.0  # the equivalent signs are not known
        elif -b[k, k] > CLEAR_MARGIN * size[k]:
            clear = 0.0 if unclear else 1.0 - abs(s[k])
        elif coupling == 0.0 and size[k] > 0.0:  # it does not attract: one of the fields points away
            clear = min(-(a[k] + b[k, k]), a[k] - b[k, k]) / size[k]
        else:
            clear = 0.0
        if clear < -CLEAR_MARGIN:
            return -1
        unclear = unclear or not clear > CLEAR_MARGIN
    return 0 if unclear else 1


@inner()
def _solved(a, b, count, candidate, s, m, index):  # type: ignore[no-untyped-def]
    """Signs of a candidate, those of its sliding surfaces from B s = -a; False where they are not settled."""
    sliding = 0
    for k in range(count):
        s[k] = _choice(candidate, k)
        if s[k] == 0.0:
            index[sliding] = k
            sliding += 1
    for r in range(sliding):
        k = index[r]
        m[r, sliding] = -a[k]
        for j in range(count):
            m[r, sliding] -= b[k, j] * s[j]
        for q in range(sliding):
            m[r, q] = b[k, index[q]]
    for r in range(sliding):
        pivot = r
        for q in range(r + 1, sliding):
            if abs(m[q, r]) > abs(m[pivot, r]):
                pivot = q
        largest = 0.0
        for q in range(sliding + 1):
            m[r, q], m[pivot, q] = m[pivot, q], m[r, q]
            largest = max(largest, abs(m[r, q]))
        if abs(m[r, r]) <= CLEAR_MARGIN * largest:
            return False
        for q in range(sliding):
            factor = m[q, r] / m[r, r]
            if q != r:
                for p in range(sliding + 1):
                    m[q, p] -= factor * m[r, p]
    for r in range(sliding):
        s[index[r]] = m[r, sliding] / m[r, r]
    return True
