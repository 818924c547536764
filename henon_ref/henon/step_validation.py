"""Step validation: terms that do not decrease, gaps, branch points, cancellation."""

from __future__ import annotations

import numpy as np

from henon_ref.henon.compensated_time import below_compensated_resolution
from henon_ref.henon.records import guard_of, mode_of
from henon_ref.jit.calls import call_closing, call_expand
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import EPS, larger, smaller

GAP_RATIO = 1e-5
"""Terms this much smaller than those before them are no tail but a gap."""
SHORTER = 0.7
"""What is left of a step at a time where terms grow."""
QUARTER = 0.25
"""And at least of one that is not accepted: as much as would make up for what it is off, its terms falling."""
SLOW = 0.5
"""Terms that fall by less than this over two orders have not converged."""
DECREASING, NOT_DECREASING, ENDS_IN_GAP = range(3)
"""What the last terms of a step do (see :func:`tail_shape`)."""
LEAST = 1.0 / 64.0
"""A step this much shorter than the last one is accepted though guards are not what was predicted."""
SHORTEST = 1e-60
"""One this much shorter, or too short to move the time, though slopes, or guards with branch points, are not (but
numbers): steps end before a kink or a singularity."""
ROUNDING = 1e3 * EPS
"""What rounding may cost a row of a polynomial at least, of its size on a step."""
SPREAD = 8.0
"""By so much of what separates its values at neighbouring points a guard may be off."""
POINTS = 4
"""Where on a step the size of a row is looked for."""


@inner()
def cancellation_limit(c, rows, degree, theta, tolerance):  # type: ignore[no-untyped-def]
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
def tail_unconverged(c, rows, order, theta):  # type: ignore[no-untyped-def]
    """True if the terms of some row do not fall towards the last ones as those of a series do that has converged."""
    if c[rows, 0] * theta <= SHORTER * c[rows, 1]:  # the usual case
        return False
    found = False
    for r in range(rows):
        found = found or tail_shape(c[r], order, theta, EPS) != DECREASING
    return found


@inner()
def tail_shape(row, order, theta, least):  # type: ignore[no-untyped-def]
    """What the last terms of a row do on a step: DECREASING, NOT_DECREASING or ENDS_IN_GAP.

    NOT_DECREASING: the last two are not much smaller than those before them or halfway to them; what comes after may
    be larger still (a singularity on the step, a high power whose turn comes later). ENDS_IN_GAP: they are next to
    nothing all at once; a gap tells nothing of what comes after. Where they are below ``least`` > 0 of the row's size
    they may do what they like.
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
    if GAP_RATIO * before < end < SLOW * smaller(half, before):
        return DECREASING
    scale = least * (abs(row[0]) + theta * (abs(row[1]) + theta * abs(row[2])))
    for _ in range(middle):
        scale /= theta
    if least > 0.0 and larger(end, before) <= scale:
        return DECREASING
    return ENDS_IN_GAP if end <= GAP_RATIO * before else NOT_DECREASING


@inner()
def guard_rounding(run, end, layout, code, constants, ahead, change, point):  # type: ignore[no-untyped-def]
    """What rounding may cost the value of each guard at a point, behind the states in ``change``.

    By values at two neighbours, each state a few units in its last place away, in one direction and in alternating
    ones: what a root's argument next to zero makes of rounding no number of terms foretells. ``ahead`` stays as it is.
    """
    n, guards = run.states, mode_of(layout).guards
    for g in range(guards):
        change[n + g], ahead[n + g, 2] = 0.0, ahead[n + g, 0]
    for neighbour in range(2):
        for i in range(n):
            change[i] = point[i]
            point[i] += (2.0 if neighbour == 0 or i % 2 == 0 else -2.0) * EPS * point[i]
        call_expand(mode_of(layout).slopes, end, run.time_low, run.unit, point, constants, ahead)
        for i in range(n):
            point[i] = change[i]
        for g in range(guards):
            change[n + g] = larger(change[n + g], SPREAD * abs(ahead[n + g, 0] - ahead[n + g, 2]))
    call_expand(code, end, run.time_low, run.unit, point, constants, ahead)
    run.expansions += 3


@inner()
def validated_step(run, x, layout, constants, c, ahead, change, point, order, theta, grown, unconverged):  # type: ignore[no-untyped-def]
    """A step no longer than where the expansion still holds, ``theta`` if that is so.

    Where terms grow the step is shortened until they fall: then it ends within their circle of convergence. Terms
    that only sink below rounding, are zero or end in a gap promise nothing (a high power seen from where it is flat),
    nor do those below rounding on a step much longer than the last one (``grown``). There the expansion is made anew
    on the step and at its end: guards and slopes must be what was predicted, or the step is shortened and asked again.
    A step whose terms fall, or one much shorter than the last, needs no such check of guards (where one is next to zero
    rounding alone may disagree); in slopes and in guards with branch points of their own it does, for behind a branch
    point the terms of a root may fall as well.

    Without ``unconverged`` terms are not looked at: the field or a guard has branch points (``slopes``), behind which
    a square root's series, a polynomial perhaps, goes on as if there were none. Slopes, and such guards, are held
    against it.
    """
    n, guards = run.states, mode_of(layout).guards
    unit = run.unit
    decreasing = True
    for r in range(n + guards if unconverged else 0):
        tail = tail_shape(c[r], order, theta, 0.0 if grown else EPS)
        if tail == NOT_DECREASING:
            while tail_shape(c[r], order, theta, EPS) == NOT_DECREASING:
                theta *= SHORTER
            tail = tail_shape(c[r], order, theta, 0.0)
        decreasing = decreasing and tail == DECREASING
    slopes = mode_of(layout).slopes if decreasing else 0  # the code that makes them alone
    checking = not decreasing or slopes > 0
    while checking:
        agrees, kept, shorter, worst = True, True, theta, 1.0
        for part in (1.0, 0.37):
            if not kept:
                break
            at = part * theta
            call_closing(mode_of(layout).step_end, at, c, change)
            for i in range(n):
                point[i] = x[i] + change[i]
            end = run.time + at * unit
            code = slopes if slopes > 0 else mode_of(layout).expansion
            call_expand(code, end, run.time_low, unit, point, constants, ahead)
            run.expansions += 1
            # The exponentials allow the way back, too.
            agrees = agrees and (slopes > 0 or ahead[n + guards, 3] >= 0.25 * at)
            measured = False
            for r in range(n + guards):
                smooth = r >= n and guard_of(layout, r - n).branches == 0
                if smooth and decreasing:
                    continue
                first = 1 if r < n else 0  # slopes of states, values of guards
                predicted, size, power = 0.0, abs(ahead[r, first]), 1.0
                for k in range(first, order + 1):
                    term = c[r, k] * power * (k if first == 1 else 1)
                    predicted += term
                    size += abs(term)
                    power *= at
                # A slope that moves its state by no more than rounding over the step is none, whatever its digits.
                rounding = 4.0 * EPS * abs(x[r]) / at if first == 1 else 0.0
                off, allowed = abs(predicted - ahead[r, first]), larger(1e-6 * size, rounding)
                if r >= n and not smooth and off > allowed:
                    if not measured:
                        guard_rounding(run, end, layout, code, constants, ahead, change, point)
                        measured = True
                    allowed = larger(allowed, change[r])
                if not off <= allowed:
                    worst = larger(worst, off / allowed) if off < np.inf else np.inf
                    agrees, kept = False, kept and smooth
                    while shorter > LEAST * theta and tail_shape(c[r], order, shorter, 0.0) == NOT_DECREASING:
                        shorter *= SHORTER
        if agrees:
            break
        falls = LEAST * theta < shorter < theta
        if falls and kept:
            return shorter
        theta *= larger(QUARTER, 0.95 * worst ** (-1.0 / order)) if worst < np.inf else SHORTER
        theta = smaller(theta, shorter) if falls else theta
        nowhere = theta <= SHORTEST or (worst < np.inf and below_compensated_resolution(run, theta * unit))
        enough = theta <= LEAST if kept else nowhere
        checking = not enough or tail_unconverged(c, n + guards, order, theta)
    return theta
