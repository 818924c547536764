"""The compiled mode loop: Taylor steps, events, landings and ordinary mode changes without leaving machine code.

Whatever needs more thought than a sign (several events at once, a tangency, a mode not compiled yet) is
handed back to Python (:mod:`henon_ref.henon.session`) with a code; after the answer the loop goes on.
"""

from __future__ import annotations

from numba import boolean, float64, int64, types

from henon_ref.henon.clock import add_time, remaining, stands
from henon_ref.henon.compile_units import ROWS, unit
from henon_ref.henon.events import at_limit, at_zero, ends_at_zero, fails_at_once, first_event
from henon_ref.henon.passage import through_event
from henon_ref.henon.recording import sample
from henon_ref.henon.registers import (
    BRACKET,
    DIVERGED,
    DOUBTFUL,
    EVENT,
    F_CAP,
    F_LOW,
    F_NEAR,
    F_REACH,
    F_SIGMA,
    F_SIZE,
    F_STATE,
    F_TIME,
    F_TOLERANCE,
    F_UNTIL,
    F_UNTIL_LOW,
    FULL,
    G_KIND,
    G_RISING,
    HORIZON,
    I_BLOCK,
    I_COUNT,
    I_GUARD,
    I_LANDING,
    I_METHOD,
    I_MODE,
    I_ORDER,
    I_SAMPLE,
    I_SIZE,
    I_STALLED,
    I_STEPPED,
    I_STEPS,
    I_WORK,
    NOWHERE,
    ON,
    PAUSE,
    RELEASE,
    REMEMBERED,
    RESOLVE,
    STALLED,
    T_CLOSING,
    T_EXACT,
    T_GUARDS,
    T_WARY,
)
from henon_ref.henon.stepping import CUT, LEAP, glide, grows, move, polish
from henon_ref.henon.trust import steady, swells, trusted
from henon_ref.henon.workspace import work_space
from henon_ref.jit.calls import call_closing
from henon_ref.jit.njit import njit
from henon_ref.jit.primitives import smaller
from henon_ref.jit.views import DOUBLES, GRID, INTEGERS, TABLE, integers_in, rest_of, row_of, rows_in
from henon_ref.roots.double import DEPTH

BUDGET = 50_000
"""Steps between two looks at the clock, in Python."""


_sample = unit(sample, types.void, DOUBLES, INTEGERS, GRID, int64, float64, int64, ROWS)
_polish = unit(
    polish, types.void,
    DOUBLES, INTEGERS, DOUBLES, DOUBLES, TABLE, DOUBLES, GRID, DOUBLES, int64, float64, float64,
)  # fmt: skip
_trusted = unit(
    trusted, float64,
    DOUBLES, INTEGERS, DOUBLES, TABLE, DOUBLES, GRID, GRID, DOUBLES, DOUBLES, int64, float64, boolean, boolean,
)  # fmt: skip


_steady = unit(steady, float64, GRID, int64, int64, float64, float64)


@njit()
def advance(state, tables, numbers, settling, samples):  # type: ignore[no-untyped-def]
    """Run until the horizon, or until Python is needed.

    A round decides what the last one has left open and looks one step ahead. It is one function because compiling one
    to be inlined takes as long again, and a call costs some percent of a run.

    Parameters
    ----------
    state : ndarray, shape (F_STATE + 2 n + I_SIZE + 2 G,)
        The run: as doubles F_..., then x, then what rounding it lost; behind them, as integers I_..., then known zeros
        of each guard, then 1 for those at zero when the loop comes back with RESOLVE. (One array: each that is passed
        from Python costs 45 ns.)
    tables : ndarray of int, shape (M, 1 + G, T_SIZE)
        Machine code, guards, and what follows them, of each mode (T_..., G_...).
    numbers : ndarray, shape (M, 2, K)
        Constants of its expansion, and of its probe.
    settling : tuple or None
        What :func:`henon_ref.henon.settling.decided` needs; None where there is nothing for it to decide (it is
        then not compiled).
    samples : ndarray, shape (k, 1 + n + 1)
        Times at which samples are wanted; states and mode there.

    Returns
    -------
    int
        HORIZON, RESOLVE, FULL, DIVERGED, STALLED, PAUSE, INVALID, ACCUMULATED or UNKNOWN; DOUBTFUL where an event ahead
        cannot be decided in double precision.
    """
    most = tables.shape[1] - 1
    n = (state.size - F_STATE - I_SIZE - 2 * most) // 2
    floats = row_of(state)
    integers = integers_in(rest_of(floats, F_STATE + 2 * n))
    order = integers[I_ORDER]
    band, room, records = work_space(integers[I_WORK], n, most, order)
    x, x_low = rest_of(floats, F_STATE), rest_of(floats, F_STATE + n)
    multiplicity, hits = rest_of(integers, I_SIZE), rest_of(integers, I_SIZE + most)
    rows = n + most + 1
    c, ahead, work = band, rest_of(band, rows), rest_of(band, 2 * rows)
    bounds = rest_of(work, 4 + DEPTH)
    change, lower, point = room, rest_of(room, n), rest_of(room, n + most)
    stop_at = integers[I_STEPS] + BUDGET
    code = ON
    while True:
        if code == EVENT:
            code = through_event(floats, integers, records, tables, numbers, settling, band, room)
        if code != ON:
            return code

        # One look ahead: steps that no guard can end, then one that is looked at.
        mode = integers[I_MODE]
        slot = F_SIZE + (mode if mode < REMEMBERED else REMEMBERED - 1)
        if mode != integers[I_STEPPED] and floats[slot] > 0.0:
            floats[F_SIGMA] = smaller(floats[slot], floats[F_CAP])
        integers[I_STEPPED] = mode
        layout, constants = rows_in(tables, mode), rows_in(numbers, mode)[0]
        guards = layout[0, T_GUARDS]
        if integers[I_COUNT] + 1 > integers[I_BLOCK]:
            return FULL
        if remaining(floats) <= 0.0:
            return HORIZON
        sampled = integers[I_SAMPLE] < samples.shape[0]
        theta = glide(floats, integers, x, x_low, multiplicity, layout, constants, c, change, sampled, stop_at)
        if theta == 0.0:
            return PAUSE
        if theta < 0.0:
            return STALLED if theta > -1.5 else DIVERGED
        sigma = floats[F_SIGMA]
        if layout[0, T_WARY] > 0 and 0.0 < floats[F_CAP] < theta * sigma:  # it may have been cut before a branch point
            theta = floats[F_CAP] / sigma
        natural = theta * sigma
        left = remaining(floats)
        final = natural >= left
        if final:
            theta = left / sigma
        leap = natural > LEAP * sigma
        doubt = layout[0, T_EXACT] == 0 and (leap or swells(c, n + guards, order, theta))
        if doubt or layout[0, T_WARY] > 0:
            believed = _trusted(
                floats, integers, x, layout, constants, c, ahead, change, point, order, theta, leap, doubt
            )
            if believed < theta:
                theta, final = believed, False
                natural = theta * sigma
                if stands(floats, natural) and not grows(c, n, theta):
                    integers[I_STALLED] += CUT
        call_closing(layout[0, T_CLOSING], theta, c, change)
        if fails_at_once(c, n, order, layout, multiplicity, hits, natural / sigma):  # Python looks closer
            integers[I_GUARD] = NOWHERE
            return RESOLVE
        best, hit, doubtful, used = first_event(
            integers, c, n, order, layout, multiplicity, lower, theta, natural / sigma, integers[I_METHOD], work, bounds
        )
        if not doubtful and layout[0, T_EXACT] > 2:
            reach = theta if hit < 0 else best * theta
            shorter = _steady(c, n + guards, layout[0, T_EXACT], reach, floats[F_TOLERANCE])
            if shorter < reach and hit >= 0:  # multiprecision has the digits
                doubtful = True
            elif shorter < reach:
                theta, final = shorter, False
                natural = theta * sigma
                call_closing(layout[0, T_CLOSING], theta, c, change)
        if final and hit < 0:  # the horizon belongs to the run: an event at it counts
            for g in range(guards):
                at_end = ends_at_zero(c[n + g], multiplicity[g], order, theta, layout[1 + g, G_RISING])
                if at_end and not at_limit(c, n, order, layout, g, natural / sigma):
                    best, hit, doubtful = 1.0, g, True
        part = theta if hit < 0 else best * theta
        if sampled:
            _sample(floats, integers, c, order, part, mode, samples)
        integers[I_GUARD], integers[I_LANDING] = hit, BRACKET if doubtful else used
        if doubtful:
            floats[F_NEAR], floats[F_REACH] = part * sigma, theta * sigma
            if layout[0, T_WARY] > 0:
                floats[F_CAP] = 1e3 * theta * sigma
            return DOUBTFUL
        if hit >= 0:
            for g in range(guards):
                at_once = g == hit or at_zero(c[n + g], multiplicity[g], order, part, layout[1 + g, G_RISING])
                hits[g] = 1 if at_once else 0
            call_closing(layout[0, T_CLOSING], part, c, change)
        bounded = move(n, x, x_low, change)
        if not stands(floats, part * sigma):
            integers[I_STALLED] = 0
        add_time(floats, part * sigma)
        integers[I_STEPS] += 1
        floats[F_CAP] = 1e3 * part * sigma if part > 0.0 else sigma
        floats[F_SIGMA] = smaller(natural, floats[F_CAP]) if part > 0.0 else sigma
        floats[slot] = natural
        if not bounded:
            return DIVERGED
        if hit >= 0:
            code = EVENT
            if layout[1 + hit, G_KIND] == RELEASE:
                _polish(floats, integers, x, x_low, layout, constants, ahead, change, n + hit, sigma, theta)
            continue
        for g in range(guards):
            multiplicity[g] = 0
        if final:
            floats[F_TIME], floats[F_LOW] = floats[F_UNTIL], floats[F_UNTIL_LOW]
            return HORIZON
