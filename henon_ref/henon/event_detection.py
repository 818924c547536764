"""Guards on a step: which one falls first, which are at zero, and with how many zeros a surface is left."""

from __future__ import annotations

import numpy as np
from numba import boolean, float64, int64, types

from henon_ref.henon.compile_units import compile_unit
from henon_ref.henon.landing import brent, land
from henon_ref.henon.records import BRACKET, BRENT, RELEASE, SURFACE, guard_of, mode_of
from henon_ref.henon.state import TANGENT
from henon_ref.jit.calls import call_bernstein
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS
from henon_ref.jit.views import DOUBLES, GRID, rest_of
from henon_ref.roots.double import (
    NONE,
    SUBDIVIDE,
    TANGENTIAL,
    deflated,
    first_falling_root,
    positive_by_bound,
    powers_of,
    steepness,
    value,
)

UNDECIDED_STEEPNESS = 1e-5
"""Relative steepness of a guard at its root below which the root is located in multiprecision."""
NEAR = 1e3
"""So many local errors, of its size on a step, off zero a guard may only seem to touch it, or not to."""
NEWTON_STEPS, PLACES = 6, 16
"""Of the minimum of a guard on a step: Newton's steps, and places to begin with."""
EQUAL = 1e-13
"""Part of the friction by which a force may be off that counts as equal to it."""
_isolate = compile_unit(first_falling_root, types.Tuple((int64, float64, float64)), DOUBLES, int64, GRID, GRID)
_deflated = compile_unit(deflated, boolean, DOUBLES, int64, int64, DOUBLES, DOUBLES)
_land = compile_unit(land, types.Tuple((float64, int64, int64)), DOUBLES, int64, float64, float64, int64)
_brent = compile_unit(brent, types.Tuple((float64, int64)), DOUBLES, int64, float64, float64)


@inner(forceinline=True)
def first_event(run, c, n, order, layout, known_zeros, lower, faint, theta, natural, method, work, bounds):  # type: ignore[no-untyped-def]
    """Earliest event on (0, theta]: (fraction of the step or 2, guard or -1, doubtful, landing used).

    ``faint``: not 0 for guards that are passed over; ``natural``: theta of the step that nothing has cut short.
    """
    powers, scaled, stack = work[0], work[1], rest_of(work, 2)
    best, hit, undecided, used = 2.0, -1, False, 0
    begin = 2.0  # of a touch somewhere on a piece of the step
    level = 0.0  # within which multiprecision is asked, that has the digits
    if run.more_digits != 0 and run.remembered == 1:
        level = NEAR * run.tolerance
    powers[0] = 0.0
    for g in range(mode_of(layout).guards):
        zeros = known_zeros[g]
        if faint[g] != 0 or (zeros == 0 and lower[g] > 0.0):
            continue
        if powers[0] == 0.0:
            powers_of(theta, powers, order)
        q = rest_of(c[n + g], zeros)
        degree = order - zeros
        if zeros > 0:
            if q[0] > 0.0 and positive_by_bound(q, powers, degree):
                continue
            if _deflated(c[n + g], zeros, order, stack[1], stack[2]):  # rows that are free until cuts
                q = stack[2]
        outcome, low, high = call_bernstein(mode_of(layout).bernstein, q, powers, degree, scaled, stack[0]), 0.0, 1.0
        if outcome == SUBDIVIDE:
            outcome, low, high = _isolate(scaled, order, stack, bounds)
            if outcome == NONE and level > 0.0:
                low = high = _near_touch(scaled, degree, level)
                outcome = TANGENTIAL if low > 0.0 else NONE
        if outcome == NONE or load_equals_friction(c, n, order, layout, g, natural):
            continue
        if outcome == TANGENTIAL:
            tau, landing, evaluations = 0.5 * (low + high), BRACKET, 0
        else:
            tau, landing, evaluations = -1.0, BRENT, 0
            if method == BRENT:
                tau, evaluations = _brent(scaled, degree, low, high)
            if tau < 0.0:
                tau, landing, evaluations = _land(scaled, degree, low, high, method)
        run.guard_evaluations += evaluations
        first = low if outcome == TANGENTIAL else tau
        if first < begin:
            flat = outcome == TANGENTIAL
            if not flat:
                steep = steepness(scaled, degree, tau, stack[0])
                flat = steep < UNDECIDED_STEEPNESS or steep * steep < level
            begin, best, hit, undecided, used = first, tau, g, flat, landing
    return best, hit, undecided, used


@inner()
def near_touch(a, degree, level):  # type: ignore[no-untyped-def]
    """Where on (0, 1) a polynomial that stays above zero has a minimum within ``level`` of its size; else -1."""
    size, tau, least = 0.0, -1.0, np.inf
    for k in range(degree + 1):
        size += abs(a[k])
    for place in range(1, PLACES):
        height = value(a, degree, place / PLACES)
        if height < least:
            least, tau = height, place / PLACES
    first, bend = tau, 0.0
    for _ in range(NEWTON_STEPS):
        slope, bend = 0.0, 0.0
        for k in range(degree, 0, -1):
            bend = bend * tau + slope
            slope = slope * tau + k * a[k]
        if not bend > 0.0:
            return -1.0
        tau -= slope / bend
        if not abs(tau - first) < 2.0 / PLACES:
            return -1.0
    return tau if 0.0 < tau < 1.0 and value(a, degree, tau) <= level * size else -1.0


_near_touch = compile_unit(near_touch, float64, DOUBLES, int64, float64)


@inner()
def below_zero(row, order, surface):  # type: ignore[no-untyped-def]
    """Of a guard below zero where a step begins: zeros with which its surface is left (0: it is not), whether it fails.

    ``surface``: it may be one that is left. A mode's side of a surface was decided when it was left, and no root came
    since: a value below zero is rounding's (another event followed at once), and if it rises, with a speed or
    tangentially, there is nothing to decide. What is zero and stays so does not fall through zero.
    """
    size = 0.0
    for k in range(1, order + 1):
        size += abs(row[k])
    if surface and row[1] > TANGENT * size:
        return 1, False
    if surface and abs(row[1]) <= TANGENT * size and row[2] > 0.5 * size:
        return 2, False
    return 0, abs(row[0]) + size != 0.0


_below_zero = compile_unit(below_zero, types.Tuple((int64, boolean)), DOUBLES, int64, boolean)


@inner()
def load_equals_friction(c, n, order, layout, guard, natural):  # type: ignore[no-untyped-def]
    """True if a guard is a slide's end at which the force equals the friction all over a step: the slide holds.

    Against what all ends of that slide come to, which is the friction's size; on a step that nothing has cut short, for
    on a short one any end that is next to zero stays there.
    """
    if guard_of(layout, guard).kind != RELEASE:
        return False
    friction = 0.0
    for g in range(mode_of(layout).guards):
        if guard_of(layout, g).kind == RELEASE and guard_of(layout, g).index == guard_of(layout, guard).index:
            friction += c[n + g, 0]
    own, power = 0.0, 1.0
    for k in range(order + 1):
        own += abs(c[n + guard, k]) * power
        if not own <= EQUAL * friction:
            return False
        power *= natural
    return True


@inner(forceinline=True)
def guards_below_zero(c, n, order, layout, known_zeros, hits, natural):  # type: ignore[no-untyped-def]
    """True if a guard is below zero where the step begins, and is not being left; ``hits``: which ones."""
    found = False
    for g in range(mode_of(layout).guards):
        row = c[n + g]
        hits[g] = 0
        if row[known_zeros[g]] <= 0.0 and guard_of(layout, g).rising_only == 0:
            surface = known_zeros[g] == 0 and guard_of(layout, g).kind == SURFACE
            zeros, fails = _below_zero(row, order, surface)
            fails = fails and not load_equals_friction(c, n, order, layout, g, natural)
            known_zeros[g] += zeros
            hits[g] = 1 if fails else 0
            found = found or fails
    return found


@inner()
def ends_at_zero(row, zeros, order, theta, rising_only):  # type: ignore[no-untyped-def]
    """True if a guard falls to zero at the end of a step, as far as rounding can tell."""
    if row[zeros] <= 0.0 or not at_zero(row, zeros, order, theta, rising_only):
        return False
    slope, power = 0.0, 1.0
    for k in range(1, order + 1):
        slope += k * row[k] * power
        power *= theta
    return slope < 0.0


@inner(forceinline=True)
def at_zero(row, zeros, order, tau, rising_only):  # type: ignore[no-untyped-def]
    """True if a guard is at zero at the event of another one, as far as rounding can tell."""
    q = rest_of(row, zeros)
    degree = order - zeros
    if rising_only and q[0] < 0.0:
        return False
    size, power = 0.0, 1.0
    for k in range(degree + 1):
        size += abs(q[k]) * power
        power *= tau
    return size > 0.0 and value(q, degree, tau) <= 32.0 * EPS * size


@inner()
def zeros_at_release(layout, surface, speeds):  # type: ignore[no-untyped-def]
    """1 if the surface is left with a speed, 2 if tangentially, 0 if the new mode's field points back at it."""
    for g in range(mode_of(layout).guards):
        if guard_of(layout, g).kind == SURFACE and guard_of(layout, g).index == surface:
            towards, beyond = speeds[2 * g], speeds[2 * g + 1]
            if abs(towards) <= TANGENT * (abs(towards) + abs(beyond)):
                return 2
            return 1 if towards < 0.0 else 0
    return 0
