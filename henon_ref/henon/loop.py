"""The compiled mode loop: Taylor steps, events, landings and ordinary mode changes without leaving machine code.

Whatever needs more thought than a sign (several events at once, a tangency, a rest, a mode not compiled yet) is
handed back to Python (:mod:`henon_ref.henon.run`) with a code; after the answer the loop goes on.
"""

from __future__ import annotations

from typing import Any

from numba import boolean, float64, int64, types

from henon_ref.henon.below_rounding import _fails_beyond_rounding, _root_below_rounding
from henon_ref.henon.compensated_time import add_to_time, below_time_resolution, remaining
from henon_ref.henon.compile_units import NUMBERS, ROW, ROWS, TABLES, compile_unit, link
from henon_ref.henon.event_detection import at_zero, ends_at_zero, first_event, guards_below_zero, load_equals_friction
from henon_ref.henon.mode_selection import SELECTION
from henon_ref.henon.mode_transition import apply_event
from henon_ref.henon.recorder import _record_step, fill_samples
from henon_ref.henon.records import BRACKET, RELEASE, guard_of, mode_of
from henon_ref.henon.state import EVENT, NOWHERE, ON, RUN_RECORD, ReturnCode, run_of, vectors_of
from henon_ref.henon.step import (
    CHECKED_GROWTH,
    CUT_WEIGHT,
    SHARP_CUT,
    SHARP_CUT_WEIGHT,
    SHORTEST_UNIT,
    add_to_state,
    enter_mode,
    event_free_steps,
    refine_release,
    state_grows,
)
from henon_ref.henon.step_validation import cancellation_limit, tail_unconverged, validated_step
from henon_ref.henon.workspace import work_space
from henon_ref.jit.calls import call_closing
from henon_ref.jit.njit import njit
from henon_ref.jit.primitives import larger, smaller
from henon_ref.jit.shared_compiling import Compiled, compile_all
from henon_ref.jit.views import DOUBLES, GRID, INTEGERS, TABLE, rest_of, row_of, rows_in
from henon_ref.roots.double import DEPTH

BUDGET = 50_000
"""Steps between two looks at the clock, in Python."""
TINY_PART = 1e-60
"""An event at a smaller part of the unit is looked at with a shorter one: powers of it would be no doubles."""


_fill_samples = compile_unit(fill_samples, types.void, RUN_RECORD, GRID, int64, float64, int64, ROWS)
_refine_release = compile_unit(
    refine_release, types.void,
    RUN_RECORD, DOUBLES, DOUBLES, TABLE, DOUBLES, GRID, DOUBLES, int64, float64, float64,
)  # fmt: skip
_validated_step = compile_unit(
    validated_step, float64,
    RUN_RECORD, DOUBLES, TABLE, DOUBLES, GRID, GRID, DOUBLES, DOUBLES, int64, float64, boolean, boolean,
)  # fmt: skip


_cancellation_limit = compile_unit(cancellation_limit, float64, GRID, int64, int64, float64, float64)


@njit(nogil=True)
def advance(state, tables, numbers, selection, samples):  # type: ignore[no-untyped-def]
    """Run until the horizon, or until Python is needed.

    A round decides what the last one has left open and looks one step ahead. It is one function because compiling one
    to be inlined takes as long again, and a call costs some percent of a run.

    Parameters
    ----------
    state : ndarray
        The run's block: scalars (:data:`henon_ref.henon.state.RUN`) and the vectors behind them. (One array: each that
        is passed from Python costs 45 ns.)
    tables : ndarray of int, shape (M, 1 + G, RECORD_PLACES)
        Of each mode the record and those of its guards (:func:`henon_ref.henon.records.mode_dtype`).
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
        HORIZON, STOPPED, SELECT_MODE, BLOCK_FULL, STEPS_FULL, DIVERGED, STALLED, BUDGET_SPENT, LEFT_DOMAIN,
        EVENTS_ACCUMULATE or MODE_NOT_COMPILED; UNDECIDED_EVENT where an event ahead cannot be decided in double
        precision.
    """
    most = tables.shape[1] - 1
    block = row_of(state)
    run = run_of(block)
    n, order = run.states, run.order
    last_steps, x, x_low, known_zeros, hits, faint = vectors_of(block, n, most)
    band, room, remembered, records = work_space(block, n, most, order)
    rows = n + most + 1
    c, ahead, work = band, rest_of(band, rows), rest_of(band, 2 * rows)
    bounds = rest_of(work, 4 + DEPTH)
    change, lower, point = room, rest_of(room, n), rest_of(room, n + most)
    stop_at = min(run.steps + BUDGET, run.most_steps)
    code = ON if run.event_pending == 0 else EVENT
    run.event_pending, shrunk = 0, False
    while True:
        if code == EVENT:
            code = apply_event(run, x, known_zeros, hits, records, tables, numbers, selection, band, room)
            if code == ON and run.stopped != 0:
                return ReturnCode.STOPPED.value
        if code != ON:
            return code

        # One look ahead: steps that no guard can end, then one that is looked at.
        mode = run.mode
        layout, constants = rows_in(tables, mode), rows_in(numbers, mode)[0]
        compiled = mode_of(layout)
        guards = compiled.guards
        if mode != run.stepped_mode:
            enter_mode(run, remembered, last_steps)
        if run.transitions + 1 > run.transition_capacity:
            return ReturnCode.BLOCK_FULL.value
        if remaining(run) <= 0.0:
            return ReturnCode.HORIZON.value
        if run.dense != 0 and run.dense_steps >= run.dense_capacity:
            return ReturnCode.STEPS_FULL.value
        sampled = run.next_sample < samples.shape[0]
        theta = event_free_steps(run, x, x_low, known_zeros, layout, constants, c, change, sampled, shrunk, stop_at)
        if theta == 0.0:
            return ReturnCode.BUDGET_SPENT.value
        if theta < -2.5:
            return ReturnCode.STEPS_FULL.value
        if theta < 0.0:
            return ReturnCode.STALLED.value if theta > -1.5 else ReturnCode.DIVERGED.value
        unit = run.unit
        if compiled.slopes > 0 and 0.0 < run.longest_step < theta * unit:  # it may have been cut before a branch point
            theta = run.longest_step / unit
        natural = theta * unit
        left = remaining(run)
        final = natural >= left
        if final:
            theta = left / unit
        grown = natural > CHECKED_GROWTH * unit
        cut = False
        unconverged = compiled.polynomial_degree == 0 and (grown or tail_unconverged(c, n + guards, order, theta))
        if unconverged or compiled.slopes > 0:
            accepted = _validated_step(
                run, x, layout, constants, c, ahead, change, point, order, theta, grown, unconverged
            )
            if accepted < theta:
                cut = compiled.guards_branch > 0 and accepted < SHARP_CUT * theta
                theta, final = accepted, False
                natural = theta * unit
                if below_time_resolution(run, natural) and not state_grows(c, n, theta):
                    run.stalled += CUT_WEIGHT
                elif cut:
                    run.stalled += SHARP_CUT_WEIGHT
        call_closing(compiled.step_end, theta, c, change)
        for g in range(guards):
            faint[g] = 0
        if guards_below_zero(c, n, order, layout, known_zeros, hits, natural / unit) and _fails_beyond_rounding(
            run, x, layout, constants, c, ahead, point, hits, faint, natural / unit
        ):  # Python looks closer
            run.guard = NOWHERE
            return ReturnCode.SELECT_MODE.value
        while True:
            best, hit, undecided, used = first_event(
                run, c, n, order, layout, known_zeros, lower, faint, theta, natural / unit, run.method, work, bounds
            )
            if hit < 0 or not _root_below_rounding(
                run, x, layout, constants, c, ahead, point, hit, best * theta, natural / unit, undecided
            ):
                break
            faint[hit] = 1
        shrunk = hit >= 0 and best * theta < TINY_PART
        if shrunk:
            if unit <= SHORTEST_UNIT:
                return ReturnCode.STALLED.value
            run.unit = larger(unit * larger(2.0 * best * theta, TINY_PART), SHORTEST_UNIT)
            continue
        if not undecided and compiled.polynomial_degree > 2:
            reach = theta if hit < 0 else best * theta
            shorter = _cancellation_limit(c, n + guards, compiled.polynomial_degree, reach, run.tolerance)
            if shorter < reach and hit >= 0:  # multiprecision has the digits
                undecided = True
            elif shorter < reach:
                theta, final = shorter, False
                natural = theta * unit
                call_closing(compiled.step_end, theta, c, change)
        if final and hit < 0:  # the horizon belongs to the run: an event at it counts
            for g in range(guards):
                at_end = ends_at_zero(c[n + g], known_zeros[g], order, theta, guard_of(layout, g).rising_only)
                if at_end and faint[g] == 0 and not load_equals_friction(c, n, order, layout, g, natural / unit):
                    best, hit, undecided = 1.0, g, True
        part = theta if hit < 0 else best * theta
        if sampled:
            _fill_samples(run, c, order, part, mode, samples)
        run.guard, run.landing = hit, BRACKET if undecided else used
        if undecided:
            run.suspect, run.step_length = part * unit, theta * unit
            if compiled.slopes > 0:
                run.longest_step = 1e3 * theta * unit
            return ReturnCode.UNDECIDED_EVENT.value
        if hit >= 0:
            for g in range(guards):
                at_once = g == hit or at_zero(c[n + g], known_zeros[g], order, part, guard_of(layout, g).rising_only)
                hits[g] = 1 if at_once and faint[g] == 0 else 0
            call_closing(compiled.step_end, part, c, change)
        if run.dense != 0 and part > 0.0:
            _record_step(run, c, part * unit, mode)
        bounded = add_to_state(n, x, x_low, change)
        if not (below_time_resolution(run, part * unit) or cut):
            run.stalled = 0
        add_to_time(run, part * unit)
        run.steps += 1
        run.longest_step = 1e3 * part * unit if part > 0.0 else unit
        run.unit = smaller(natural, run.longest_step) if part > 0.0 else unit
        last_steps[run.step_place] = natural
        if not bounded:
            return ReturnCode.DIVERGED.value
        if hit >= 0:
            code = EVENT
            if guard_of(layout, hit).kind == RELEASE:
                _refine_release(run, x, x_low, layout, constants, ahead, change, n + hit, unit, theta)
            continue
        for g in range(guards):
            known_zeros[g] = 0
        if final:
            run.time, run.time_low = run.horizon, run.horizon_low
            return ReturnCode.HORIZON.value


def called(selection: Any) -> tuple[Compiled, ...]:
    """Functions that the loop calls, with the types that it calls them with: the parts that processes share.

    ``selection``: type of that argument. What takes longest comes first.
    """
    return (
        (
            event_free_steps,
            (RUN_RECORD, DOUBLES, DOUBLES, INTEGERS, TABLE, DOUBLES, GRID, DOUBLES, boolean, boolean, int64),
        ),
        (apply_event, (RUN_RECORD, DOUBLES, INTEGERS, INTEGERS, GRID, TABLES, NUMBERS, selection, GRID, DOUBLES)),
        (
            first_event,
            (RUN_RECORD, GRID, int64, int64, TABLE, INTEGERS, DOUBLES, INTEGERS, float64, float64, int64, GRID, GRID),
        ),
        (ends_at_zero, (DOUBLES, int64, int64, float64, int64)),
        (guards_below_zero, (GRID, int64, int64, TABLE, INTEGERS, INTEGERS, float64)),
    )


def load(*, several: bool) -> None:
    """Make the loop callable; ``several``: to decide events of several surfaces, too."""
    link()
    kind = SELECTION if several else types.none
    compile_all([(advance, (ROW, TABLES, NUMBERS, kind, ROWS))], called(kind))
