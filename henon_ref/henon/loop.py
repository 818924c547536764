"""The compiled mode loop: Taylor steps, events, landings and ordinary mode changes without leaving machine code.

Whatever needs more thought than a sign (several events at once, a tangency, a mode not compiled yet) is
handed back to Python (:mod:`henon_ref.henon.run`) with a code; after the answer the loop goes on.
"""

from __future__ import annotations

from typing import Any

from numba import boolean, float64, int64, typeof, types

from henon_ref.henon.compensated_time import add_to_time, below_time_resolution, remaining
from henon_ref.henon.compile_units import NUMBERS, ROW, ROWS, TABLES, compile_unit, link
from henon_ref.henon.event_detection import at_zero, ends_at_zero, first_event, guards_below_zero, load_equals_friction
from henon_ref.henon.mode_transition import apply_event
from henon_ref.henon.recorder import fill_samples
from henon_ref.henon.state import (
    BLOCK_FULL,
    BRACKET,
    BUDGET_SPENT,
    DIVERGED,
    EVENT,
    F_HORIZON,
    F_HORIZON_LOW,
    F_LONGEST_STEP,
    F_SIZE,
    F_STATE,
    F_STEP_LENGTH,
    F_SUSPECT,
    F_TIME,
    F_TIME_LOW,
    F_TOLERANCE,
    F_UNIT,
    G_KIND,
    G_RISING,
    HORIZON,
    I_GUARD,
    I_LANDING,
    I_METHOD,
    I_MODE,
    I_NEXT_SAMPLE,
    I_ORDER,
    I_SIZE,
    I_STALLED,
    I_STEPPED_MODE,
    I_STEPS,
    I_TRANSITION_CAPACITY,
    I_TRANSITIONS,
    I_WORKSPACE,
    NOWHERE,
    ON,
    RELEASE,
    REMEMBERED_STEPS,
    SELECT_MODE,
    STALLED,
    T_GUARDS,
    T_POLYNOMIAL_DEGREE,
    T_SLOPES,
    T_STEP_END,
    UNDECIDED_EVENT,
    work_space,
)
from henon_ref.henon.step import CHECKED_GROWTH, CUT_WEIGHT, add_to_state, event_free_steps, refine_release, state_grows
from henon_ref.henon.step_validation import cancellation_limit, tail_unconverged, validated_step
from henon_ref.jit.calls import call_closing
from henon_ref.jit.njit import njit
from henon_ref.jit.primitives import smaller
from henon_ref.jit.shared_compiling import Compiled, compile_all
from henon_ref.jit.views import DOUBLES, GRID, INTEGERS, TABLE, integers_in, rest_of, row_of, rows_in
from henon_ref.roots.double import DEPTH

BUDGET = 50_000
"""Steps between two looks at the clock, in Python."""


_fill_samples = compile_unit(fill_samples, types.void, DOUBLES, INTEGERS, GRID, int64, float64, int64, ROWS)
_refine_release = compile_unit(
    refine_release, types.void,
    DOUBLES, INTEGERS, DOUBLES, DOUBLES, TABLE, DOUBLES, GRID, DOUBLES, int64, float64, float64,
)  # fmt: skip
_validated_step = compile_unit(
    validated_step, float64,
    DOUBLES, INTEGERS, DOUBLES, TABLE, DOUBLES, GRID, GRID, DOUBLES, DOUBLES, int64, float64, boolean, boolean,
)  # fmt: skip


_cancellation_limit = compile_unit(cancellation_limit, float64, GRID, int64, int64, float64, float64)


@njit()
def advance(state, tables, numbers, selection, samples):  # type: ignore[no-untyped-def]
    """Run until the horizon, or until Python is needed.

    A round decides what the last one has left open and looks one step ahead. It is one function because compiling one
    to be inlined takes as long again, and a call costs some percent of a run.

    Parameters
    ----------
    state : ndarray, shape (F_STATE + 2 n + I_SIZE + 2 G,)
        The run: as doubles F_..., then x, then what rounding it lost; behind them, as integers I_..., then known zeros
        of each guard, then 1 for those at zero when the loop comes back with SELECT_MODE. (One array: each that is
        passed from Python costs 45 ns.)
    tables : ndarray of int, shape (M, 1 + G, T_SIZE)
        Machine code, guards, and what follows them, of each mode (T_..., G_...).
    numbers : ndarray, shape (M, 2, K)
        Constants of its expansion, and of its probe.
    selection : tuple or None
        What :func:`henon_ref.henon.mode_selection.decided` needs; None where there is nothing for it to decide (it is
        then not compiled).
    samples : ndarray, shape (k, 1 + n + 1)
        Times at which samples are wanted; states and mode there.

    Returns
    -------
    int
        HORIZON, SELECT_MODE, BLOCK_FULL, DIVERGED, STALLED, BUDGET_SPENT, LEFT_DOMAIN, EVENTS_ACCUMULATE or
        MODE_NOT_COMPILED; UNDECIDED_EVENT where an event ahead cannot be decided in double precision.
    """
    most = tables.shape[1] - 1
    n = (state.size - F_STATE - I_SIZE - 2 * most) // 2
    floats = row_of(state)
    integers = integers_in(rest_of(floats, F_STATE + 2 * n))
    order = integers[I_ORDER]
    band, room, records = work_space(integers[I_WORKSPACE], n, most, order)
    x, x_low = rest_of(floats, F_STATE), rest_of(floats, F_STATE + n)
    known_zeros, hits = rest_of(integers, I_SIZE), rest_of(integers, I_SIZE + most)
    rows = n + most + 1
    c, ahead, work = band, rest_of(band, rows), rest_of(band, 2 * rows)
    bounds = rest_of(work, 4 + DEPTH)
    change, lower, point = room, rest_of(room, n), rest_of(room, n + most)
    stop_at = integers[I_STEPS] + BUDGET
    code = ON
    while True:
        if code == EVENT:
            code = apply_event(floats, integers, records, tables, numbers, selection, band, room)
        if code != ON:
            return code

        # One look ahead: steps that no guard can end, then one that is looked at.
        mode = integers[I_MODE]
        slot = F_SIZE + (mode if mode < REMEMBERED_STEPS else REMEMBERED_STEPS - 1)
        if mode != integers[I_STEPPED_MODE] and floats[slot] > 0.0:
            floats[F_UNIT] = smaller(floats[slot], floats[F_LONGEST_STEP])
        integers[I_STEPPED_MODE] = mode
        layout, constants = rows_in(tables, mode), rows_in(numbers, mode)[0]
        guards = layout[0, T_GUARDS]
        if integers[I_TRANSITIONS] + 1 > integers[I_TRANSITION_CAPACITY]:
            return BLOCK_FULL
        if remaining(floats) <= 0.0:
            return HORIZON
        sampled = integers[I_NEXT_SAMPLE] < samples.shape[0]
        theta = event_free_steps(
            floats, integers, x, x_low, known_zeros, layout, constants, c, change, sampled, stop_at
        )
        if theta == 0.0:
            return BUDGET_SPENT
        if theta < 0.0:
            return STALLED if theta > -1.5 else DIVERGED
        unit = floats[F_UNIT]
        if (
            layout[0, T_SLOPES] > 0 and 0.0 < floats[F_LONGEST_STEP] < theta * unit
        ):  # it may have been cut before a branch point
            theta = floats[F_LONGEST_STEP] / unit
        natural = theta * unit
        left = remaining(floats)
        final = natural >= left
        if final:
            theta = left / unit
        grown = natural > CHECKED_GROWTH * unit
        unconverged = layout[0, T_POLYNOMIAL_DEGREE] == 0 and (grown or tail_unconverged(c, n + guards, order, theta))
        if unconverged or layout[0, T_SLOPES] > 0:
            accepted = _validated_step(
                floats, integers, x, layout, constants, c, ahead, change, point, order, theta, grown, unconverged
            )
            if accepted < theta:
                theta, final = accepted, False
                natural = theta * unit
                if below_time_resolution(floats, natural) and not state_grows(c, n, theta):
                    integers[I_STALLED] += CUT_WEIGHT
        call_closing(layout[0, T_STEP_END], theta, c, change)
        if guards_below_zero(c, n, order, layout, known_zeros, hits, natural / unit):  # Python looks closer
            integers[I_GUARD] = NOWHERE
            return SELECT_MODE
        best, hit, undecided, used = first_event(
            integers, c, n, order, layout, known_zeros, lower, theta, natural / unit, integers[I_METHOD], work, bounds
        )
        if not undecided and layout[0, T_POLYNOMIAL_DEGREE] > 2:
            reach = theta if hit < 0 else best * theta
            shorter = _cancellation_limit(c, n + guards, layout[0, T_POLYNOMIAL_DEGREE], reach, floats[F_TOLERANCE])
            if shorter < reach and hit >= 0:  # multiprecision has the digits
                undecided = True
            elif shorter < reach:
                theta, final = shorter, False
                natural = theta * unit
                call_closing(layout[0, T_STEP_END], theta, c, change)
        if final and hit < 0:  # the horizon belongs to the run: an event at it counts
            for g in range(guards):
                at_end = ends_at_zero(c[n + g], known_zeros[g], order, theta, layout[1 + g, G_RISING])
                if at_end and not load_equals_friction(c, n, order, layout, g, natural / unit):
                    best, hit, undecided = 1.0, g, True
        part = theta if hit < 0 else best * theta
        if sampled:
            _fill_samples(floats, integers, c, order, part, mode, samples)
        integers[I_GUARD], integers[I_LANDING] = hit, BRACKET if undecided else used
        if undecided:
            floats[F_SUSPECT], floats[F_STEP_LENGTH] = part * unit, theta * unit
            if layout[0, T_SLOPES] > 0:
                floats[F_LONGEST_STEP] = 1e3 * theta * unit
            return UNDECIDED_EVENT
        if hit >= 0:
            for g in range(guards):
                at_once = g == hit or at_zero(c[n + g], known_zeros[g], order, part, layout[1 + g, G_RISING])
                hits[g] = 1 if at_once else 0
            call_closing(layout[0, T_STEP_END], part, c, change)
        bounded = add_to_state(n, x, x_low, change)
        if not below_time_resolution(floats, part * unit):
            integers[I_STALLED] = 0
        add_to_time(floats, part * unit)
        integers[I_STEPS] += 1
        floats[F_LONGEST_STEP] = 1e3 * part * unit if part > 0.0 else unit
        floats[F_UNIT] = smaller(natural, floats[F_LONGEST_STEP]) if part > 0.0 else unit
        floats[slot] = natural
        if not bounded:
            return DIVERGED
        if hit >= 0:
            code = EVENT
            if layout[1 + hit, G_KIND] == RELEASE:
                _refine_release(floats, integers, x, x_low, layout, constants, ahead, change, n + hit, unit, theta)
            continue
        for g in range(guards):
            known_zeros[g] = 0
        if final:
            floats[F_TIME], floats[F_TIME_LOW] = floats[F_HORIZON], floats[F_HORIZON_LOW]
            return HORIZON


def called(selection: Any) -> tuple[Compiled, ...]:
    """Functions that the loop calls, with the types that it calls them with: the parts that processes share.

    ``selection``: type of that argument. What takes longest comes first.
    """
    return (
        (
            event_free_steps,
            (DOUBLES, INTEGERS, DOUBLES, DOUBLES, INTEGERS, TABLE, DOUBLES, GRID, DOUBLES, boolean, int64),
        ),
        (apply_event, (DOUBLES, INTEGERS, GRID, TABLES, NUMBERS, selection, GRID, DOUBLES)),
        (first_event, (INTEGERS, GRID, int64, int64, TABLE, INTEGERS, DOUBLES, float64, float64, int64, GRID, GRID)),
        (ends_at_zero, (DOUBLES, int64, int64, float64, int64)),
        (guards_below_zero, (GRID, int64, int64, TABLE, INTEGERS, INTEGERS, float64)),
    )


def load(selection: tuple[Any, ...] | None) -> None:
    """Make the loop callable; ``selection``: what it will be called with."""
    link()
    kind = typeof(selection)
    compile_all([(advance, (ROW, TABLES, NUMBERS, kind, ROWS))], called(kind))
