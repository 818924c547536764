"""Taylor steps: how long they are, and taking them."""

from __future__ import annotations

import numpy as np
from numba import float64, int64

from henon_ref.henon.clock import add_time, lost, remaining, stands
from henon_ref.henon.compile_units import unit
from henon_ref.henon.registers import (
    F_LOW,
    F_SIGMA,
    F_TIME,
    F_TOLERANCE,
    F_UNTIL,
    I_ORDER,
    I_RHS,
    I_STALLED,
    I_STATES,
    I_STEPS,
    T_CLOSING,
    T_EXPANSION,
    T_GUARDS,
    T_WARY,
)
from henon_ref.henon.trust import swells
from henon_ref.jit.calls import call_closing, call_expand
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS, bits, fma, from_bits, larger, smaller
from henon_ref.jit.views import GRID, INTEGERS

HUGE = 1e100
"""A state beyond this has blown up (no smaller bound is safe whatever the units)."""
LEAP = 4.0
"""A step this many times longer than the last is checked at its end before it is believed."""
FAR = 1e30
"""A step, in units of sigma, that no coefficient limits."""
ABYSS = 1e-100
"""How much shorter sigma becomes where even coefficients of low order are infinite."""
STALL = 1000
"""Steps in a row too short to move a double's time before the run counts as stalled."""
LOST = 100
"""So many of them is one that does not even move what rounding has lost of the time, nor makes a state grow."""
CUT = 200
"""And so many one that had to be cut short before a singularity, nor makes a state grow."""


@inner(forceinline=True)
def _root(above, below, power):  # type: ignore[no-untyped-def]
    """(above / below) ** power to about one part in 100: a step size needs no more. Both positive.

    The exponent and the leading bits of a double are a piecewise linear logarithm to base 2.
    """
    exponent = (bits(above) - bits(below)) * (2.220446049250313e-16 * power)
    shifted = exponent + 6755399441055744.0  # 1.5 * 2^52: rounds to a whole number, which the low bits then hold
    part = exponent - (shifted - 6755399441055744.0)
    return from_bits((bits(shifted) + 1023) << 52) * (1.0 + part * (0.6931471805599453 + 0.24022650695910072 * part))


@inner(forceinline=True)
def _error_norms(c, rows, order, theta):  # type: ignore[no-untyped-def]
    """Largest relative size of the last two coefficients over states and guards on a step of theta sigma."""
    last, before = 0.0, 0.0
    for r in range(rows):
        row = c[r]
        scale = fma(theta, fma(theta, abs(row[2]), abs(row[1])), abs(row[0])) + 1e-300
        last = larger(last, abs(row[order]) / scale)
        before = larger(before, abs(row[order - 1]) / scale)
    return last, before


@inner()
def _endless(c, rows):  # type: ignore[no-untyped-def]
    """True if a coefficient is infinite (or no number) that is of order 2 at most: sigma is too long by far, or all is.

    States being below HUGE, sigma is 1 / ABYSS times as long at least as what these coefficients could be finite at.
    """
    found = False
    for r in range(rows):
        found = found or not (abs(c[r, 0]) + abs(c[r, 1]) + abs(c[r, 2]) < np.inf)
    return found


@inner(forceinline=True)
def step_size(c, rows, order, tolerance):  # type: ignore[no-untyped-def]
    """Step in units of sigma at which the last two terms fall below the tolerance (Jorba and Zou 2005, Sec. 3).

    0 where a coefficient is not finite.
    """
    last, before = c[rows, 0], c[rows, 1]
    if not c[rows, 2] < np.inf:
        return 0.0
    theta = 1.0
    longest = smaller(c[rows, 3], FAR)
    power, other = 1.0 / order, 1.0 / (order - 1)
    for _ in range(4):
        new = FAR
        if last > 0.0:
            new = smaller(new, _root(tolerance, last, power))
        if before > 0.0:
            new = smaller(new, _root(tolerance, before, other))
        if new >= 0.5 * theta:
            return smaller(new, longest)
        theta = new
        last, before = _error_norms(c, rows, order, theta)
    return smaller(theta, longest)


@inner()
def flat_step_size(c, n, guards, multiplicity, order, tolerance):  # type: ignore[no-untyped-def]
    """The same where guards have more than two known zeros: what follows those tells the size of such a guard."""
    rows = n + guards
    shortest = smaller(c[rows, 3], FAR)
    for r in range(rows):
        row, first = c[r], multiplicity[r - n] if r >= n else 0
        theta = 1.0
        for _ in range(4):
            size = abs(row[first]) + theta * (abs(row[first + 1]) + theta * abs(row[first + 2]))
            size = size * theta**first + 1e-300
            new = FAR
            for k in (order - 1, order):
                if row[k] != 0.0:
                    new = smaller(new, (tolerance * size / abs(row[k])) ** (1.0 / k))
            enough = new >= 0.5 * theta
            theta = new
            if enough:
                break
        shortest = smaller(shortest, theta)
    return shortest


_flat_step_size = unit(flat_step_size, float64, GRID, int64, int64, INTEGERS, int64, float64)


@inner()
def grows(c, n, theta):  # type: ignore[no-untyped-def]
    """True if some state grows by a hundredth at least on a step of theta sigma, as one does that blows up."""
    found = False
    for i in range(n):
        found = found or (abs(c[i, 1]) * theta > 0.01 * abs(c[i, 0]) and (c[i, 1] > 0.0) == (c[i, 0] > 0.0))
    return found


@inner(forceinline=True)
def move(n, x, x_low, change):  # type: ignore[no-untyped-def]
    """x += change as a compensated sum; False where the state has blown up."""
    bounded = True
    for i in range(n):
        step = change[i] + x_low[i]
        total = x[i] + step
        part = total - x[i]
        x_low[i] = (x[i] - (total - part)) + (step - part)
        x[i] = total
        bounded = bounded and abs(total) < HUGE
    return bounded


@inner(forceinline=True)
def glide(floats, integers, x, x_low, multiplicity, layout, constants, c, change, alone, stop_at):  # type: ignore[no-untyped-def]
    """Take steps on which no guard can reach zero; come back with the coefficients of one that needs a look.

    ``alone``: look at the very first one, as where a guard stands at zero or a branch point may come. Returns the step
    proposed in units of sigma; 0 where the budget of steps is used up, -1 where the step size fell to zero, -2 where
    the state blew up.
    """
    n, guards = integers[I_STATES], layout[0, T_GUARDS]
    expansion, closing = layout[0, T_EXPANSION], layout[0, T_CLOSING]
    shrunk, zeros = False, 0
    for g in range(guards):
        if multiplicity[g] > zeros:
            zeros = multiplicity[g]
    alone = alone or zeros > 0 or layout[0, T_WARY] > 0
    while True:
        if integers[I_STEPS] >= stop_at:
            return 0.0
        left = remaining(floats)
        sigma = floats[F_SIGMA]
        call_expand(expansion, floats[F_TIME], floats[F_LOW], sigma, x, constants, c)
        integers[I_RHS] += 1
        theta = step_size(c, n + guards, integers[I_ORDER], floats[F_TOLERANCE])
        if zeros > 2 and theta > 0.0:
            theta = _flat_step_size(c, n, guards, multiplicity, integers[I_ORDER], floats[F_TOLERANCE])
        if theta < 1e-6 or (theta > 1e6 and sigma < left and not shrunk):
            # sigma is far from the step: bring it there and expand again before anything is read off. Where it is
            # much too long even the step is not to be believed: it shrinks by degrees, and does not grow again here.
            least = ABYSS if theta == 0.0 and _endless(c, n + guards) else 1e-4
            new = larger(sigma * larger(theta, least), 1e-290) if theta < 1.0 else smaller(sigma * theta, left)
            if sigma <= 1e-280 and new <= sigma:
                return -1.0
            if new < 0.5 * sigma or new > 2.0 * sigma:
                shrunk = shrunk or new < sigma
                floats[F_SIGMA] = new
                continue
        if shrunk:
            theta = smaller(theta, 1e6)
            shrunk = False
        step = theta * sigma
        if stands(floats, step):
            integers[I_STALLED] += LOST if lost(floats, step) and not grows(c, n, theta) else 1
        if integers[I_STALLED] > STALL:
            return -1.0
        if alone or step >= left or theta > LEAP or swells(c, n + guards, integers[I_ORDER], theta):
            return theta
        call_closing(closing, theta, c, change)
        for g in range(guards):
            if not change[n + g] > 0.0:
                return theta
        if not move(n, x, x_low, change):
            return -2.0
        if not stands(floats, step):
            integers[I_STALLED] = 0
        add_time(floats, step)
        integers[I_STEPS] += 1
        floats[F_SIGMA] = smaller(step, 1e3 * sigma)


@inner()
def polish(floats, integers, x, x_low, layout, constants, ahead, change, row, sigma, theta):  # type: ignore[no-untyped-def]
    """Put the end of a slide on its guard to the last digit, whatever the tolerance of the step that led there.

    A tangent point is where the field's normal velocity vanishes: left a little beside it, the field would
    point back at the surface, and the slide would begin anew. Newton's steps on the expansion at the landing.
    """
    for _ in range(3):
        call_expand(layout[0, T_EXPANSION], floats[F_TIME], floats[F_LOW], sigma, x, constants, ahead)
        integers[I_RHS] += 1
        off, slope = ahead[row, 0], ahead[row, 1]
        size = abs(off) + abs(slope) * theta
        if abs(off) <= 2.0 * EPS * size or not slope < 0.0:
            return
        shift = -off / slope
        if abs(shift) > 0.1 * theta or floats[F_TIME] + shift * sigma > floats[F_UNTIL]:
            return
        call_closing(layout[0, T_CLOSING], shift, ahead, change)
        move(integers[I_STATES], x, x_low, change)
        add_time(floats, shift * sigma)
