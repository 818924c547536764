"""A closer look in double-double, in compiled code, at an event that double precision leaves in doubt.

The mode is expanded again (:mod:`henon_ref.henon.fine`), and the doubtful guard's polynomial looked at
(:mod:`henon_ref.henon.window`). What is not clear then is looked at in quad-double (:mod:`henon_ref.henon.nearer`).
"""

from __future__ import annotations

from numba import float64, int64

from henon_ref.henon import doubledouble as dd
from henon_ref.henon.apart import COUNTS, LAYOUT, ROW, ROWS, apart, missing
from henon_ref.henon.clock import remaining
from henon_ref.henon.events import at_zero, call_factored
from henon_ref.henon.fine import expand_fine
from henon_ref.henon.nearer import look_nearer
from henon_ref.henon.primitives import array_of, doubles_at, integers_at
from henon_ref.henon.program import COLUMNS
from henon_ref.henon.quadseries import PARTS
from henon_ref.henon.registers import (
    A_CLEAR,
    A_DECIDE,
    A_FACTORED,
    A_FINE,
    EPS,
    F_BEYOND,
    F_CLEAR,
    F_LOW,
    F_NEAR,
    F_NEAR_LOW,
    F_REACH,
    F_STATE,
    F_TIME,
    F_UNTIL,
    F_UNTIL_LOW,
    G_ACTS,
    G_HOLD,
    G_KIND,
    G_RISING,
    I_ARRIVED,
    I_GUARD,
    I_GUARDS,
    I_MISSING,
    I_ORDER,
    I_SIZE,
    I_STATES,
    I_STEPS,
    L_CODES,
    L_CONSTANTS,
    L_HIGH,
    L_LOW,
    L_NUMBERS,
    L_OPERATIONS,
    L_PLACED,
    L_PLACES,
    L_ROWS,
    L_SIZE,
    L_SIZES,
    L_WORK,
    LANDED,
    SURFACE,
    T_GUARDS,
    T_LOOK,
    TANGENT,
    TOLD,
    VALID,
)
from henon_ref.henon.views import INTEGERS, rest_of, row_of
from henon_ref.henon.window import (
    ACROSS,
    BEYOND,
    HALVINGS,
    MISS,
    NOISE,
    OPEN,
    PASSED,
    ROOT,
    STEEP,
    TOUCH,
    UNSURE,
    call_clear,
    call_decide,
)
from henon_ref.jit import inner, njit

ORDER = 64
"""Highest order of the expansion; it ends before where its terms have become negligible."""
AHEAD, PART = 1.1, 0.5
"""Where so many times as far as the doubtful event lies within this part of the step, that is what is expanded."""
CERTAIN = 1e3 * NOISE
"""What a speed has to exceed of its size for its sign to be certain."""
_expand_fine = apart(
    A_FINE, expand_fine, int64,
    INTEGERS, LAYOUT, ROWS, COUNTS, COUNTS, float64, float64, ROW, ROW, float64, float64, int64, int64, ROWS, ROWS, ROW,
)  # fmt: skip


@inner()
def look_near(floats, integers, layout):  # type: ignore[no-untyped-def]
    """Decide a doubtful event and go there.

    Parameters
    ----------
    floats, integers : row
        The run (see :mod:`henon_ref.henon.registers`), next to a doubtful event.
    layout : rows of int
        The mode's table. What its T_LOOK leads to (L_...): a :class:`henon_ref.henon.program.Program` whose outputs
        are G guards, then the speeds towards the surface of each and away from it beyond; guards + n + 3 G places:
        where the guards of the table stand among the G (-1 for those that have no place there), rows of the field
        and of the outputs; work space of :func:`henon_ref.henon.fine.expand_fine` and of
        :func:`henon_ref.henon.quadseries.expand`, and of this function, shape (4 + HALVINGS, ORDER + 1).

    Returns
    -------
    int
        UNSURE or OPEN, and the run has not moved (with OPEN the doubtful point is the minimum, and up to F_CLEAR there
        is no doubt); or where it is now, with ACROSS at a root beyond whose surface the field is known. It counts for
        nothing where a function turns out to be missing.
    """
    if missing(integers, A_FINE) or missing(integers, A_DECIDE) or missing(integers, A_CLEAR):
        return UNSURE
    look = integers_at(layout[0, T_LOOK], 1, L_SIZE)[0]
    count = look[L_ROWS]
    codes = integers_at(look[L_CODES], look[L_OPERATIONS], COLUMNS)
    constants = doubles_at(look[L_CONSTANTS], look[L_NUMBERS], PARTS)
    rows = integers_at(look[L_PLACES], 1, look[L_PLACED])[0]
    high, low = doubles_at(look[L_HIGH], count, ORDER + 1), doubles_at(look[L_LOW], count, ORDER + 1)
    sizes = doubles_at(look[L_SIZES], 2, count)[0]
    work = doubles_at(look[L_WORK], 4 + HALVINGS, ORDER + 1)
    n = integers[I_STATES]
    x, x_low = array_of(rest_of(floats, F_STATE), n), array_of(rest_of(floats, F_STATE + n), n)
    known = layout[0, T_GUARDS]
    first = known + n
    behind = first + (rows.size - first) // 3
    places, field, outputs, sides = rows[:known], rows[known:first], rows[first:behind], rows[behind:]
    part = PART if AHEAD * floats[F_NEAR] <= PART * floats[F_REACH] else 1.0
    unit = part * floats[F_REACH] * (1.0 + BEYOND)
    guard = integers[I_GUARD]
    zeros = integers[I_SIZE + guard]
    last = _expand_fine(
        integers, integers, codes, constants, field, outputs, floats[F_TIME], floats[F_LOW], x, x_low, unit, 0.0, ORDER,
        integers[I_ORDER], high, low, sizes,
    )  # fmt: skip
    if last < 0 or not _settled(high, outputs, n, last, sizes):
        return UNSURE
    row = outputs[places[guard]]
    if zeros > 0:
        if missing(integers, A_FACTORED):
            return UNSURE
        _divide_out(integers, high[row, : last + 1], low[row, : last + 1], zeros, work)
    q, q_low = high[row, zeros : last + 1], low[row, zeros : last + 1]
    size = 0.0  # on the whole step
    for k in range(q.size - 1, -1, -1):
        size = size / part + abs(q[k])
    start = floats[F_NEAR] / unit
    outcome, s, s_low, clear = call_decide(integers, integers, q, q_low, q[:0], zeros, size, start, 0.0, work)
    if outcome == OPEN:
        floats[F_NEAR], floats[F_NEAR_LOW] = dd.multiply(s, s_low, unit, 0.0)
        floats[F_CLEAR] = min(clear * unit, floats[F_NEAR])
    order = 2
    if outcome in (UNSURE, OPEN):
        sure = outcome == OPEN and clear == s
        if outcome == UNSURE:
            s, s_low = start, 0.0
        told, s, s_low, order = look_nearer(
            floats, integers, look, field, places[guard], row, unit, part, (q, q_low, zeros, size), s, s_low, sure, work
        )
        if integers[I_MISSING] > 0:
            return UNSURE
        if told != UNSURE:
            outcome = told
    if outcome in (UNSURE, OPEN):
        return outcome
    if outcome == PASSED and not _others_clear(high, outputs, integers, layout, places, last, s, work):
        return UNSURE
    tau, tau_low = dd.multiply(s, s_low, unit, 0.0)
    floats[F_TIME], floats[F_LOW] = dd.kept(*dd.add(floats[F_TIME], floats[F_LOW], tau, tau_low))
    for i in range(n):
        x[i], x_low[i] = dd.kept(*_value(high[i, : last + 1], low[i, : last + 1], sizes[i], s, s_low))
    if outcome == TOUCH:
        outcome = settle_touch(floats, integers, layout)
        if integers[I_SIZE + guard] > 0:
            integers[I_SIZE + guard] = order
        return outcome
    if outcome in (ROOT, STEEP):
        own = layout[1 + guard]
        if _others_hit(high, outputs, integers, layout, places, last, s):
            outcome = ROOT
        elif outcome == ROOT and order == 2 and own[G_KIND] == SURFACE and own[G_HOLD] == 0 and own[G_ACTS] == 0:
            floats[F_BEYOND] = _beyond(high, low, sizes, sides[2 * places[guard] :], last, s, s_low)
            outcome = ROOT if floats[F_BEYOND] == 0.0 else ACROSS
    arrive(floats, integers, outcome)
    return outcome


@inner()
def _divide_out(integers, c, c_low, zeros, work):  # type: ignore[no-untyped-def]
    """Divide a polynomial by the factor of its known zeros, leaving the quotient from place ``zeros`` on."""
    size, factor = c.size - zeros, work[0]
    if not call_factored(integers, row_of(c), zeros, c.size - 1, row_of(factor), row_of(work[1])):
        return
    for k in range(size - 1, -1, -1):
        for j in range(max(zeros + k - size + 1, 0), zeros):
            at = k + 2 * zeros - j
            part, part_low = dd.multiply(c[at], c_low[at], -factor[j], 0.0)
            c[k + zeros], c_low[k + zeros] = dd.add(c[k + zeros], c_low[k + zeros], part, part_low)


@njit()
def arrive(floats, integers, outcome):  # type: ignore[no-untyped-def]
    """Leave the step behind, the run being where the closer look has led it."""
    guard, most = integers[I_GUARD], integers[I_GUARDS]
    integers[I_STEPS] += 1
    for g in range(most):
        integers[I_SIZE + g] = 0
    if remaining(floats) < -2e-17 * abs(floats[F_UNTIL]):  # behind the horizon, by more than a sum's rounding
        floats[F_TIME], floats[F_LOW] = floats[F_UNTIL], floats[F_UNTIL_LOW]
    elif outcome == MISS:
        integers[I_SIZE + guard] = 2
    elif outcome != PASSED:
        integers[I_SIZE + most + guard] = 1
        integers[I_ARRIVED] = TOLD if outcome == ACROSS else LANDED if outcome == STEEP else 0


@njit()
def settle_touch(floats, integers, layout):  # type: ignore[no-untyped-def]
    """Leave the step behind where a guard touches zero; TOUCH if its surface is left again, to be told of.

    A hold zone holds what only touches its surface, and a model ends where it only just does: that is a ROOT.
    """
    guard = integers[I_GUARD]
    own = layout[1 + guard]
    surface = own[G_KIND] == SURFACE
    outcome = ROOT if own[G_KIND] == VALID or (surface and own[G_HOLD] == 1) else MISS
    arrive(floats, integers, outcome)
    if outcome == ROOT:
        return ROOT
    return TOUCH if surface and integers[I_SIZE + guard] > 0 else MISS


@inner()
def _settled(high, outputs, n, last, sizes):  # type: ignore[no-untyped-def]
    """True if what the expansions leave out does not count."""
    for i in range(n + outputs.size):
        row = i if i < n else outputs[i - n]
        for k in range(max(last - 3, 0), last + 1):
            if abs(high[row, k]) > 0.01 * NOISE * sizes[row]:
                return False
    return True


@inner()
def _others_hit(high, outputs, integers, layout, places, last, s):  # type: ignore[no-untyped-def]
    """Mark the other guards that are at zero at a place on the step; True if there are any."""
    most, found = integers[I_GUARDS], False
    for g in range(layout[0, T_GUARDS]):
        if g != integers[I_GUARD] and places[g] >= 0:
            series = high[outputs[places[g]], : last + 1]
            if at_zero(series, integers[I_SIZE + g], last, s, layout[1 + g, G_RISING]):
                integers[I_SIZE + most + g] = 1
                found = True
    return found


@inner()
def _others_clear(high, outputs, integers, layout, places, last, s, work):  # type: ignore[no-untyped-def]
    """True if the other guards have no event before a place on the step."""
    for g in range(layout[0, T_GUARDS]):
        if g != integers[I_GUARD] and places[g] >= 0:
            series, own = high[outputs[places[g]], integers[I_SIZE + g] : last + 1], work[1, : last + 1]
            sign = -1.0 if layout[1 + g, G_RISING] == 1 and series[0] < 0.0 else 1.0  # one that has to rise first
            size = 0.0
            for k in range(series.size):
                own[k] = sign * series[k]
                size += abs(series[k])
            if size > 0.0 and not call_clear(integers, own[: series.size], s, size, work[2:]):
                return False
    return True


@inner()
def _beyond(high, low, sizes, rows, last, s, s_low):  # type: ignore[no-untyped-def]
    """Speed away from a surface beyond it, in units of that towards it; 0 where they cannot be told for certain."""
    towards = 0.0
    for i in range(2):
        row = rows[i]
        for k in range(max(last - 3, 0), last + 1):
            if abs(high[row, k]) > 0.01 * NOISE * sizes[row]:
                return 0.0
        speed, _ = _value(high[row, : last + 1], low[row, : last + 1], sizes[row], s, s_low)
        if not abs(speed) > CERTAIN * sizes[row]:
            return 0.0
        if i == 0:
            towards = speed
    return speed / towards if towards > 0.0 and abs(speed) > TANGENT * towards else 0.0


@inner()
def _value(a, a_low, size, s, s_low):  # type: ignore[no-untyped-def]
    """Horner's rule; ``size`` is the sum of the sizes of the coefficients."""
    y, lost = 0.0, 0.0
    top = a.size - 1
    while top >= 0 and abs(a[top]) <= EPS * size:  # of these a double's digits do
        y = y * s + a[top]
        top -= 1
    for k in range(top, -1, -1):
        y, lost = dd.compensated(y, lost, s, s_low, a[k], a_low[k])
    return dd.two_sum(y, lost)
