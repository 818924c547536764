"""Whether a step is to be believed: what its last terms do, and what the field says where it leads."""

from __future__ import annotations

import numpy as np

from henon_ref.henon.clock import lost
from henon_ref.henon.registers import F_LOW, F_SIGMA, F_TIME, I_RHS, I_STATES, T_CLOSING, T_EXPANSION, T_GUARDS, T_WARY
from henon_ref.jit.calls import call_closing, call_expand
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS, larger, smaller

GAP = 1e-5
"""Terms this much smaller than those before them are no tail but a gap."""
SHORTER = 0.7
"""What is left of a step at a time where terms grow."""
QUARTER = 0.25
"""And at least of one that is not to be believed: as much as would make up for what it is off, its terms falling."""
SLOW = 0.5
"""Terms that fall by less than this over two orders have not converged."""
FALLS, GROWS, HOLLOW = range(3)
"""What the last terms of a step do (see :func:`_tail`)."""
LEAST = 1.0 / 64.0
"""A step this much shorter than the last one is believed though guards are not what was foretold."""
SHORTEST = 1e-60
"""One this much shorter, or too short to move the time, though slopes are not (but numbers): steps end before a kink
or a singularity, and the run with them."""
ROUNDING = 1e3 * EPS
"""What rounding may cost a row of a polynomial at least, of its size on a step."""
POINTS = 4
"""Where on a step the size of a row is looked for."""


@inner()
def steady(c, rows, degree, theta, tolerance):  # type: ignore[no-untyped-def]
    """A step no longer than where terms of a polynomial cancel by more digits than there are to spare.

    No coefficient limits a step where a motion is a polynomial by its form.
    """
    spare = larger(tolerance, ROUNDING) / EPS
    for r in range(rows):
        row = c[r]
        while True:
            terms, size = 0.0, 0.0
            for k in range(degree, -1, -1):
                terms = terms * theta + abs(row[k])
            for point in range(1, POINTS + 1):
                at, value = theta * point / POINTS, 0.0
                for k in range(degree, -1, -1):
                    value = value * at + row[k]
                size = larger(size, abs(value))
            if not terms > spare * size:
                break
            theta *= 0.5
    return theta


@inner(forceinline=True)
def swells(c, rows, order, theta):  # type: ignore[no-untyped-def]
    """True if the terms of some row do not fall towards the last ones as those of a series do that has converged."""
    if c[rows, 0] * theta <= SHORTER * c[rows, 1]:  # the usual case
        return False
    found = False
    for r in range(rows):
        found = found or _tail(c[r], order, theta, EPS) != FALLS
    return found


@inner()
def _tail(row, order, theta, least):  # type: ignore[no-untyped-def]
    """What the last terms of a row do on a step: FALLS, GROWS or HOLLOW.

    GROWS: the last two are not much smaller than those before them or halfway to them; what comes after may be larger
    still (a singularity on the step, a high power whose turn comes later). HOLLOW: they are next to nothing all at
    once; a gap tells nothing of what comes after. Where they are below ``least`` > 0 of the row's size they may do
    what they like.
    """
    middle, last = order // 2 - 1, order - 3
    square = theta * theta
    cube = square * theta
    shift = 1.0
    for _ in range(last - middle):  # a call of the C library costs as much as the rest
        shift *= theta
    half = larger(
        larger(abs(row[middle]), abs(row[middle + 1]) * theta),
        larger(abs(row[middle + 2]) * square, abs(row[middle + 3]) * cube),
    )
    before = shift * larger(abs(row[last]), abs(row[last + 1]) * theta)
    end = shift * larger(abs(row[last + 2]) * square, abs(row[last + 3]) * cube)
    if GAP * before < end < SLOW * smaller(half, before):
        return FALLS
    scale = least * (abs(row[0]) + theta * (abs(row[1]) + theta * abs(row[2])))
    for _ in range(middle):
        scale /= theta
    if least > 0.0 and larger(end, before) <= scale:
        return FALLS
    return HOLLOW if end <= GAP * before else GROWS


@inner()
def trusted(floats, integers, x, layout, constants, c, ahead, change, point, order, theta, leap, doubt):  # type: ignore[no-untyped-def]
    """A step no longer than where the expansion still tells what lies there, ``theta`` if that is so.

    Where terms grow the step is shortened until they fall: then it ends within their circle of convergence. Terms
    that only sink below rounding, are zero or end in a gap promise nothing (a high power seen from where it is flat),
    nor do those below rounding on a step much longer than the last one (``leap``). There the expansion is made anew
    on the step and at its end: guards and slopes must be what was foretold, or the step is shortened and asked again.
    A step whose terms fall, or one much shorter than the last, needs no such trust in guards (where one is next to zero
    rounding alone may disagree); in slopes it does, for behind a branch point the terms of a root may fall as well.

    Without ``doubt`` terms are not looked at: the field has branch points (T_WARY), behind which a square root's
    series, a polynomial perhaps, goes on as if there were none. Slopes alone are held against it.
    """
    n, guards = integers[I_STATES], layout[0, T_GUARDS]
    sigma = floats[F_SIGMA]
    all_told = True
    for r in range(n + guards if doubt else 0):
        tail = _tail(c[r], order, theta, 0.0 if leap else EPS)
        if tail == GROWS:
            while _tail(c[r], order, theta, EPS) == GROWS:
                theta *= SHORTER
            tail = _tail(c[r], order, theta, 0.0)
        all_told = all_told and tail == FALLS
    compared = n if all_told else n + guards
    slopes = layout[0, T_WARY] if all_told else 0  # the code that makes them alone
    ask = not all_told or slopes > 0
    while ask:
        agreed, kept, shorter, worst = True, True, theta, 1.0
        for part in (1.0, 0.37):
            if not kept:
                break
            at = part * theta
            call_closing(layout[0, T_CLOSING], at, c, change)
            for i in range(n):
                point[i] = x[i] + change[i]
            end = floats[F_TIME] + at * sigma
            code = slopes if slopes > 0 else layout[0, T_EXPANSION]
            call_expand(code, end, floats[F_LOW], sigma, point, constants, ahead)
            integers[I_RHS] += 1
            # The exponentials allow the way back, too.
            agreed = agreed and (slopes > 0 or ahead[n + guards, 3] >= 0.25 * at)
            for r in range(compared):
                first = 1 if r < n else 0  # slopes of states, values of guards
                foretold, size, power = 0.0, abs(ahead[r, first]), 1.0
                for k in range(first, order + 1):
                    term = c[r, k] * power * (k if first == 1 else 1)
                    foretold += term
                    size += abs(term)
                    power *= at
                # A slope that moves its state by no more than rounding over the step is none, whatever its digits.
                dust = 4.0 * EPS * abs(x[r]) / at if first == 1 else 0.0
                off, allowed = abs(foretold - ahead[r, first]), larger(1e-6 * size, dust)
                if not off <= allowed:
                    worst = larger(worst, off / allowed) if off < np.inf else np.inf
                    agreed, kept = False, kept and first == 0
                    while shorter > LEAST * theta and _tail(c[r], order, shorter, 0.0) == GROWS:
                        shorter *= SHORTER
        if agreed:
            break
        falls = LEAST * theta < shorter < theta
        if falls and kept:
            return shorter
        theta *= larger(QUARTER, 0.95 * worst ** (-1.0 / order)) if worst < np.inf else SHORTER
        theta = smaller(theta, shorter) if falls else theta
        nowhere = theta <= SHORTEST or (worst < np.inf and lost(floats, theta * sigma))
        enough = theta <= LEAST if kept else nowhere
        ask = not enough or swells(c, n + guards, order, theta)
    return theta
