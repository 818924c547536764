"""Guards on a step: which one falls first, which are at zero, and with how many zeros a surface is left."""

from __future__ import annotations

from henon_ref.henon.calls import call_bernstein
from henon_ref.henon.landing import land
from henon_ref.henon.polynomial import (
    LOOK,
    NONE,
    TOUCH,
    excluded,
    factored,
    first_falling_root,
    powers_of,
    steepness,
    value,
)
from henon_ref.henon.registers import (
    BRACKET,
    EPS,
    G_INDEX,
    G_KIND,
    G_RISING,
    I_EVENTS,
    SURFACE,
    T_BERNSTEIN,
    T_GUARDS,
    TANGENT,
)
from henon_ref.jit import inner

FLAT = 1e-5
"""Relative steepness of a guard at its root below which the root is left to a closer look in multiprecision."""


@inner(forceinline=True)
def first_event(integers, c, n, order, layout, multiplicity, lower, theta, method, work, bounds):  # type: ignore[no-untyped-def]
    """Earliest event on (0, theta]: (fraction of the step or 2, guard or -1, doubtful, landing used)."""
    powers, scaled, stack = work[0], work[1], work[2:]
    best, hit, doubtful, used = 2.0, -1, False, 0
    powers[0] = 0.0
    for g in range(layout[0, T_GUARDS]):
        zeros = multiplicity[g]
        if zeros == 0 and lower[g] > 0.0:
            continue
        if powers[0] == 0.0:
            powers_of(theta, powers, order)
        q = c[n + g, zeros:]
        degree = order - zeros
        if zeros > 0:
            if q[0] > 0.0 and excluded(q, powers, degree):
                continue
            if factored(c[n + g], zeros, order, stack[1], stack[2]):  # rows that are free until pieces are cut
                q = stack[2]
        outcome, low, high = call_bernstein(layout[0, T_BERNSTEIN], q, powers, degree, scaled, stack[0]), 0.0, 1.0
        if outcome == LOOK:
            outcome, low, high = first_falling_root(scaled, order, stack, bounds)
        if outcome == NONE:
            continue
        if outcome == TOUCH:
            tau, landing, evaluations = 0.5 * (low + high), BRACKET, 0
        else:
            tau, landing, evaluations = land(scaled, degree, low, high, method)
        integers[I_EVENTS] += evaluations
        if tau < best:
            flat = outcome == TOUCH or steepness(scaled, degree, tau, stack[0]) < FLAT
            best, hit, doubtful, used = tau, g, flat, landing
    return best, hit, doubtful, used


@inner(forceinline=True)
def fails_at_once(c, n, order, layout, multiplicity, hits):  # type: ignore[no-untyped-def]
    """True if a guard is below zero where the step begins, and is not being left; ``hits``: which ones."""
    found = False
    for g in range(layout[0, T_GUARDS]):
        row = c[n + g]
        low = row[multiplicity[g]] <= 0.0 and layout[1 + g, G_RISING] == 0
        if low and multiplicity[g] == 0 and layout[1 + g, G_KIND] == SURFACE:
            multiplicity[g] = _zeros_when_leaving(row, order)
            low = multiplicity[g] == 0
        hits[g] = 1 if low and not _silent(row, order) else 0
        found = found or hits[g] == 1
    return found


@inner()
def ends_at_zero(row, zeros, order, theta):  # type: ignore[no-untyped-def]
    """True if a guard falls to zero at the end of a step, as far as rounding can tell."""
    if row[zeros] <= 0.0 or not at_zero(row, zeros, order, theta, 0):
        return False
    slope, power = 0.0, 1.0
    for k in range(1, order + 1):
        slope += k * row[k] * power
        power *= theta
    return slope < 0.0


@inner()
def _silent(row, order):  # type: ignore[no-untyped-def]
    """True for a guard that is zero and stays so: nothing falls through zero there."""
    size = 0.0
    for k in range(order + 1):
        size += abs(row[k])
    return size == 0.0


@inner(forceinline=True)
def at_zero(row, zeros, order, tau, rising_only):  # type: ignore[no-untyped-def]
    """True if a guard is at zero at the event of another one, as far as rounding can tell."""
    q = row[zeros:]
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
    for g in range(layout[0, T_GUARDS]):
        if layout[1 + g, G_KIND] == SURFACE and layout[1 + g, G_INDEX] == surface:
            towards, beyond = speeds[2 * g], speeds[2 * g + 1]
            if abs(towards) <= TANGENT * (abs(towards) + abs(beyond)):
                return 2
            return 1 if towards < 0.0 else 0
    return 0


@inner()
def _zeros_when_leaving(row, order):  # type: ignore[no-untyped-def]
    """1 or 2 for a surface on the wrong side that is being left with a speed or tangentially, 0 for any other.

    A mode's side of a surface was decided when it was left, and no root came since: a value below zero is
    rounding's (another event followed at once), and if it rises there is nothing to decide.
    """
    size = 0.0
    for k in range(1, order + 1):
        size += abs(row[k])
    if row[1] > TANGENT * size:
        return 1
    return 2 if abs(row[1]) <= TANGENT * size and row[2] > 0.5 * size else 0
