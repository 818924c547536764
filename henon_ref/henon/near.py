"""A closer look in double-double, in compiled code, at an event that double precision leaves in doubt.

The mode is expanded again (:mod:`henon_ref.henon.fine`), and the doubtful guard's polynomial looked at
(:mod:`henon_ref.henon.window`). What is not clear then is looked at in quad-double (:mod:`henon_ref.henon.nearer`).
"""

from __future__ import annotations

from numba import float64, int64

from henon_ref.henon import doubledouble as dd
from henon_ref.henon.apart import COUNTS, LAYOUT, ROW, ROWS, apart, missing
from henon_ref.henon.arrival import arrive, settle_touch
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
    G_ACTS,
    G_HOLD,
    G_KIND,
    G_RISING,
    I_BLOCK,
    I_COUNT,
    I_GUARD,
    I_GUARDS,
    I_MISSING,
    I_ORDER,
    I_SIZE,
    I_STATES,
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
    SURFACE,
    T_GUARDS,
    T_LOOK,
    TANGENT,
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
from henon_ref.jit import inner

ORDER = 64
"""Highest order of the expansion; it ends before where its terms have become negligible."""
AHEAD, PART = 1.1, 0.5
"""Where so many times as far as the doubtful event lies within this part of the step, that is what is expanded."""
CERTAIN = 1e3 * NOISE
"""What a speed has to exceed of its size for its sign to be certain."""
TOGETHER = 1e-12
"""Touches no farther from each other than this part of the step are at the same time."""
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
    last = _expand_fine(
        integers, integers, codes, constants, field, outputs, floats[F_TIME], floats[F_LOW], x, x_low, unit, 0.0, ORDER,
        integers[I_ORDER], high, low, sizes,
    )  # fmt: skip
    if last < 0 or not _settled(high, outputs, n, last, sizes):
        return UNSURE
    step = look, field, outputs, places, high, low, last, unit, part
    outcome, s, s_low, order, clear = _told(floats, integers, step, guard, floats[F_NEAR] / unit, work)
    if integers[I_MISSING] > 0:
        return UNSURE
    if outcome == OPEN:
        floats[F_NEAR], floats[F_NEAR_LOW] = dd.multiply(s, s_low, unit, 0.0)
        floats[F_CLEAR] = min(clear * unit, floats[F_NEAR])
    if outcome in (UNSURE, OPEN):
        return outcome
    if outcome == PASSED and not _others_clear(high, outputs, integers, layout, places, last, s, work):
        return UNSURE
    if outcome in (TOUCH, MISS):
        integers[I_SIZE + integers[I_GUARDS] + guard] = order if outcome == TOUCH else -2
        if not _others_touch(floats, integers, layout, step, s, work):
            for g in range(layout[0, T_GUARDS]):
                integers[I_SIZE + integers[I_GUARDS] + g] = 0
            return UNSURE
    tau, tau_low = dd.multiply(s, s_low, unit, 0.0)
    floats[F_TIME], floats[F_LOW] = dd.kept(*dd.add(floats[F_TIME], floats[F_LOW], tau, tau_low))
    for i in range(n):
        x[i], x_low[i] = dd.kept(*_value(high[i, : last + 1], low[i, : last + 1], sizes[i], s, s_low))
    if outcome in (TOUCH, MISS):
        return settle_touch(floats, integers, layout)
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
def _told(floats, integers, step, guard, start, work):  # type: ignore[no-untyped-def]
    """What a guard does up to a doubtful point of the step, which is expanded.

    Returns
    -------
    outcome : int
        It counts for nothing where a function turns out to be missing.
    place, low : float
        Where, in units of the expansion.
    order : int
        Above 2 at a flat root.
    clear : float
        With OPEN, up to where there is no doubt.
    """
    look, field, outputs, places, high, low, last, unit, part = step
    zeros, row = integers[I_SIZE + guard], outputs[places[guard]]
    if zeros > 0:
        if missing(integers, A_FACTORED):
            return UNSURE, 0.0, 0.0, 2, 0.0
        _divide_out(integers, high[row, : last + 1], low[row, : last + 1], zeros, work)
    q, q_low = high[row, zeros : last + 1], low[row, zeros : last + 1]
    size = 0.0  # on the whole step
    for k in range(q.size - 1, -1, -1):
        size = size / part + abs(q[k])
    outcome, s, s_low, clear = call_decide(integers, integers, q, q_low, q[:0], zeros, size, start, 0.0, work)
    if outcome not in (UNSURE, OPEN):
        return outcome, s, s_low, 2, clear
    sure = outcome == OPEN and clear == s
    if outcome == UNSURE:
        s, s_low = start, 0.0
    told, at, at_low, order = look_nearer(
        floats, integers, look, field, places[guard], row, unit, part, (q, q_low, zeros, size), s, s_low, sure, work
    )
    return (told, at, at_low, order, clear) if told != UNSURE else (outcome, s, s_low, order, clear)


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
def _others_touch(floats, integers, layout, step, s, work):  # type: ignore[no-untyped-def]
    """Write down the orders of the other guards' minima at zero at the place of one; False where that is left open.

    One that falls through zero there is left to the next step, which begins at it; so is a surface whose touch has a
    time of its own. Where there is no room to tell of all touches that is left open, too.
    """
    _, _, outputs, places, high, _, last, _, _ = step
    most, guard, told = integers[I_GUARDS], integers[I_GUARD], 0
    for g in range(layout[0, T_GUARDS]):
        if g != guard and places[g] >= 0:
            series, zeros = high[outputs[places[g]], : last + 1], integers[I_SIZE + g]
            if at_zero(series, zeros, last, s, layout[1 + g, G_RISING]):
                outcome, at, _, order, _ = _told(floats, integers, step, g, s, work)
                if integers[I_MISSING] > 0 or outcome in (UNSURE, OPEN):
                    return False
                own_time = layout[1 + g, G_KIND] == SURFACE and at > s + TOGETHER
                if outcome in (TOUCH, MISS) and not own_time:
                    integers[I_SIZE + most + g] = order if outcome == TOUCH else -2
        told += 1 if integers[I_SIZE + most + g] > 0 and layout[1 + g, G_KIND] == SURFACE else 0
    return integers[I_COUNT] + told <= integers[I_BLOCK]


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
