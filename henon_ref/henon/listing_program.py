"""The program in the paper's appendix as it is printed, mistakes and all, in our own words.

Olejnik and Awrejcewicz (2013), Listing 1, which made Fig. 8. What it does, step by step and mistake by
mistake, stands at the lines that do it; :mod:`henon_ref.henon.listing_variants` has each mistake as a switch.

The one that matters most: in Python ``xn = x`` names the same list twice. Whatever the listing writes to
the new state it has also written to the old one, so each Runge-Kutta stage starts where the one before
ended, and a step of length h moves the slip state by ``(1/2 + 1/2 + 1 + 1) h = 3 h``, while time, forcing
and stick move by h. That is why its limit for h -> 0 has the slip field ``3 f``.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from henon_ref.jit.njit import njit

_compile = njit(allocates=True)

SINE, COSINE_1, COSINE_2 = math.sin(math.pi / 18), math.cos(math.pi / 9), math.cos(2 * math.pi / 9)
WIDTH = 2 * math.sqrt(3) / 3
EDGES = np.array([WIDTH * v for v in (COSINE_1, COSINE_2, SINE, -SINE, -COSINE_2, -COSINE_1)])
"""Tangent points z of Eq. (24), highest first: the stick zones are [1, 0], [3, 2] and [5, 4]."""


@_compile
def base_position(A, w, t):  # type: ignore[no-untyped-def]
    """Displacement of the far end of the spring."""
    return A * math.sin(w * t)


@_compile
def acceleration(position, velocity, base, side_constant, inverse_mass, k1, k2, mu0):  # type: ignore[no-untyped-def]
    """x2' of Eq. (18); ``side_constant`` is vp + 1 below the belt's speed and vp - 1 above it."""
    z = position - base
    return inverse_mass * (-k1 * z + k2 * z**3 + mu0 / (side_constant - velocity))


@_compile
def zone(position, edges, base):  # type: ignore[no-untyped-def]
    """Index of the upper edge of the stick zone that holds the position, -1 outside.

    A defect that never bites here: the caller takes ``edges[-1]`` as an edge, and in Python that exists.
    """
    for upper in range(4, -1, -2):
        if position <= edges[upper] + base:
            return upper if position >= edges[upper + 1] + base else -1
    return -1


@_compile
def slip_step(x, base, h, side_constant, inverse_mass, k1, k2, mu0):  # type: ignore[no-untyped-def]
    """The Runge-Kutta step in time, on the one list that is both old and new state.

    Defects: every stage moves the state itself (3 h in all); the forcing ``base`` is that of the start of
    the step at all four stages (order 1 in h); time is left to the caller.
    """
    v1 = x[2]
    a1 = acceleration(x[1], x[2], base, side_constant, inverse_mass, k1, k2, mu0)
    x[1] = x[1] + h / 2 * v1
    x[2] = x[2] + h / 2 * a1
    v2 = x[2]
    a2 = acceleration(x[1], x[2], base, side_constant, inverse_mass, k1, k2, mu0)
    x[1] = x[1] + h / 2 * v2
    x[2] = x[2] + h / 2 * a2
    v3 = x[2]
    a3 = acceleration(x[1], x[2], base, side_constant, inverse_mass, k1, k2, mu0)
    x[1] = x[1] + h * v3
    x[2] = x[2] + h * a3
    v4 = x[2]
    a4 = acceleration(x[1], x[2], base, side_constant, inverse_mass, k1, k2, mu0)
    x[1] = x[1] + h / 6 * (v1 + 2 * (v2 + v3) + v4)
    x[2] = x[2] + h / 6 * (a1 + 2 * (a2 + a3) + a4)


@_compile
def landing_step(x, base, length, side_constant, inverse_mass, k1, k2, mu0):  # type: ignore[no-untyped-def]
    """The swapped step of Eq. (14), velocity being the independent variable; again on the one list.

    Defects: as in :func:`slip_step`, and 0.166666 stands for 1/6. Time does start from the old one, for it
    has not been moved yet.
    """
    half, sixth = length * 0.5, length * 0.166666
    t1 = 1 / acceleration(x[1], x[2], base, side_constant, inverse_mass, k1, k2, mu0)
    p1 = x[2] * t1
    x[1] = x[1] + half * p1
    x[2] = x[2] + half
    t2 = 1 / acceleration(x[1], x[2], base, side_constant, inverse_mass, k1, k2, mu0)
    p2 = x[2] * t2
    x[1] = x[1] + half * p2
    t3 = 1 / acceleration(x[1], x[2], base, side_constant, inverse_mass, k1, k2, mu0)
    p3 = x[2] * t3
    x[1] = x[1] + length * p3
    x[2] = x[2] + length
    t4 = 1 / acceleration(x[1], x[2], base, side_constant, inverse_mass, k1, k2, mu0)
    p4 = x[2] * t4
    x[1] = x[1] + sixth * (p1 + 2 * (p2 + p3) + p4)
    x[0] = x[0] + sixth * (t1 + 2 * (t2 + t3) + t4)


@_compile
def run_listing(x, edges, h, steps, m, k1, k2, mu0, vp, A, w, changes, path):  # type: ignore[no-untyped-def]
    """The main loop: ``steps + 1`` passes (its counter, never advanced in print, is here).

    ``x`` is (time, position, velocity); ``changes`` takes a row (step, time, position, velocity, mode) a
    change of mode; ``path`` a row (time, position, velocity) a step if it has room. Returns the number of
    changes, the last mode, and the numbers of slip and landing steps.
    """
    sticking, side = False, 0
    if x[2] == vp:
        # A defect without effect here: the third stick zone is not looked at.
        for upper in (0, 2):
            if edges[upper + 1] <= x[1] <= edges[upper]:
                sticking = True
    elif x[2] < vp:
        side = -1
    else:
        side = 1
    base = base_position(A, w, x[0])
    inverse_mass = 1 / m
    upper = zone(x[1], edges, base)
    count = slips = landings = 0
    for step in range(steps + 1):
        mode = 0 if sticking else side
        if sticking:
            x[1] = x[1] + h * x[2]
            x[0] = x[0] + h
            base = base_position(A, w, x[0])
            # Defect: only the upper tangent point is tested; z also falls out of the zone at its lower end.
            if not x[1] < edges[upper] + base:
                sticking = False
                # Defect: the way back to the tangent point is new minus old position, which are one number:
                # it is 0, and time stays where the step of length h has put it.
                x[1] = edges[upper] + base
                # Defect: with the spring's sign as printed the middle zone (2) is left downwards and the
                # others upwards; here it is the other way round. The next step undoes it.
                side = -1 if upper != 2 else 1
        else:
            side_constant = vp + 1 if side == -1 else vp - 1
            slips += 1
            slip_step(x, base, h, side_constant, inverse_mass, k1, k2, mu0)
            if (x[2] >= vp) if side == -1 else (x[2] <= vp):
                # The old velocity is lost with the aliasing, so this is the way back from beyond, which is
                # right from below. Defect: from above it has the wrong sign.
                length = vp - x[2] if side == -1 else x[2] - vp
                landings += 1
                landing_step(x, base, length, side_constant, inverse_mass, k1, k2, mu0)
                x[2] = vp
                base = base_position(A, w, x[0])
                spring = -k1 * (x[1] - base) + k2 * (x[1] - base) ** 3
                if spring**2 - mu0**2 <= 0:
                    upper = zone(x[1], edges, base)
                    sticking = True
                else:
                    side = -side
            else:
                x[0] = x[0] + h
                base = base_position(A, w, x[0])
        now = 0 if sticking else side
        if now != mode and count < changes.shape[0]:
            changes[count, 0] = step
            changes[count, 1:4] = x
            changes[count, 4] = now
            count += 1
        if step < path.shape[0]:
            path[step] = x
    return count, 0 if sticking else side, slips, landings


def effective_changes(rows: NDArray[np.float64], start: int) -> NDArray[np.float64]:
    """Changes of mode with the releases to a side that was never entered put right.

    Such a release is undone by the very next step, which lands again and turns to the other side: one
    release, at its own time, to that side.

    Parameters
    ----------
    rows : ndarray, shape (k, 5)
        Step, time, position, velocity and mode after each change.
    start : int
        Mode before the first.

    Returns
    -------
    ndarray, shape (at most k, 5)
    """
    modes = rows[:, 4]
    released = np.concatenate(([start], modes[:-1])) == 0
    undone = np.flatnonzero(released[:-1] & (np.diff(rows[:, 0]) == 1) & (modes[1:] != 0))
    kept = rows.copy()
    kept[undone, 4] = modes[undone + 1]
    return np.delete(kept, undone + 1, axis=0)
