"""One compiled call that does the runs of many points: no Python between them, nor the interpreter lock.

A point that double precision cannot decide, that needs a mode which is not compiled, or whose run ends before its
horizon is set aside by its number: Python finishes it (:mod:`henon_ref.henon.points`).
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numba import int64, types

from henon_ref.henon.compile_units import NUMBERS, ROW, ROWS, TABLES, add_symbol, call_symbol
from henon_ref.henon.loop import advance, load
from henon_ref.henon.mode_selection import SELECTION
from henon_ref.henon.recorder import set_known_zeros
from henon_ref.henon.records import RELEASED, STICK, TRANSITION_PLACES, record_view, transition_of
from henon_ref.henon.state import STATE_PLACE, ReturnCode, run_of, vectors_of
from henon_ref.henon.surface_start import mode_on_surface
from henon_ref.henon.workspace import work_space
from henon_ref.jit.njit import inner, njit
from henon_ref.jit.shared_compiling import compile_all
from henon_ref.jit.views import integers_in, rest_of, row_of, rows_in, rows_of

NO_SAMPLES = np.zeros((0, 2))
PROGRESS = np.dtype(
    [
        ("after", "f8"),  # s: transitions before this time are not kept
        ("point", "i8"),  # that is at work, or comes next
        ("running", "i8"),  # whether its run has begun
        ("kept", "i8"), ("kept_before", "i8"),  # transitions in the buffer, and those of the points before this one
        ("open_sticks", "i8"),  # whether sticks that are open at ``after`` are kept, with their begin
        ("kinds", "i8"), ("surfaces", "i8"),  # those of transitions that are kept, a bit each
        ("steps", "i8"),  # after which the call comes back, so that Python can look at interrupts
        ("stop_aside", "i8"),  # whether it comes back where a point is set aside
    ],
    align=True,
)  # fmt: skip
"""Where the call stands, and what it is to keep."""
END = np.dtype(
    [
        ("time", "f8"), ("time_low", "f8"),  # s
        ("code", "i8"),  # of return, or SET_ASIDE
        ("mode", "i8"),  # its row
        ("steps", "i8"), ("expansions", "i8"), ("guard_evaluations", "i8"), ("transitions", "i8"),
    ],
    align=True,
)  # fmt: skip
"""How the run of a point ended."""
END_PLACES = END.itemsize // 8
DONE, BUFFER_FULL, PAUSE, ASIDE = range(4)
"""Why the call comes back: all points are done; there may be no room for the next transitions; Python may look at
interrupts; a point was set aside, perhaps for a mode that can be compiled before the next one."""
SET_ASIDE = -1
"""In place of a return code: Python has to do this point."""
progress_of, end_of = record_view(PROGRESS), record_view(END)
_advance_one = call_symbol("henon_ref.advance", int64, ROW, TABLES, NUMBERS, types.none, ROWS)
_advance_several = call_symbol("henon_ref.advance_several", int64, ROW, TABLES, NUMBERS, SELECTION, ROWS)


@inner()
def keep_transitions(progress, records, count, states, kept, pending):  # type: ignore[no-untyped-def]
    """Append transitions that are wanted to the buffer.

    Parameters
    ----------
    progress : record
        :data:`PROGRESS`.
    records : rows, shape (count, TRANSITION_PLACES + n)
        Transitions of the present point.
    kept : rows, shape (capacity, 1 + TRANSITION_PLACES + n)
        The buffer: number of the point, then the transition. There is room for ``count`` more, and one a surface.
    pending : rows, shape (surfaces, 1 + TRANSITION_PLACES + n)
        Per surface the stick that is open, its first number not 0; those before ``after`` only.
    """
    width = TRANSITION_PLACES + states
    for k in range(count):
        made = transition_of(records, k)
        if not (progress.kinds >> made.kind & 1 and progress.surfaces >> made.surface & 1):
            continue
        if made.time < progress.after:
            if progress.open_sticks != 0 and made.kind in (STICK, RELEASED):
                waiting = pending[made.surface]
                waiting[0] = 1.0 if made.kind == STICK else 0.0
                for i in range(width):
                    waiting[1 + i] = records[k, i]
            continue
        if made.kind == RELEASED and pending[made.surface][0] != 0.0:
            _append(progress, rest_of(pending[made.surface], 1), width, kept)
            pending[made.surface][0] = 0.0
        _append(progress, records[k], width, kept)


@inner()
def _append(progress, row, width, kept):  # type: ignore[no-untyped-def]
    new = kept[progress.kept]
    integers_in(new)[0] = progress.point
    for i in range(width):
        new[1 + i] = row[i]
    progress.kept += 1


@inner()
def _begin(state, template, times, initial, point, row, surface, tables, numbers):  # type: ignore[no-untyped-def]
    """Put a point's start into the run's block; False where its mode is not clear."""
    for i in range(template.size):
        state[i] = template[i]
    run = run_of(row_of(state))
    run.time, run.time_low, run.begin, run.mode = times[point, 0], times[point, 1], times[point, 0], row
    run.horizon, run.horizon_low = times[point, 2], times[point, 3]
    run.unit = max((run.horizon - run.time) + (run.horizon_low - run.time_low), 1e-280)
    for i in range(initial.shape[1]):
        state[STATE_PLACE + i] = initial[point, i]
    if surface >= 0:
        n, most = run.states, run.guards
        x, known_zeros = vectors_of(row_of(state), n, most)[1], vectors_of(row_of(state), n, most)[3]
        speeds = work_space(row_of(state), n, most, run.order)[1]
        run.mode, zeros = mode_on_surface(tables, numbers, row, surface, run.time, x, n, speeds)
        if run.mode < 0:
            return False
        set_known_zeros(known_zeros, rows_in(tables, run.mode), surface, zeros)
    return True


@inner()
def _finish(run, state, code, ends, states, point):  # type: ignore[no-untyped-def]
    """Write down how a point's run ended."""
    end = end_of(row_of(ends[point]))
    end.time, end.time_low, end.code, end.mode = run.time, run.time_low, code, run.mode
    end.steps, end.expansions, end.guard_evaluations = run.steps, run.expansions, run.guard_evaluations
    for i in range(states.shape[1]):
        states[point, i] = state[STATE_PLACE + i]


@inner()
def _take_in(at, run, block, code, buffer, waiting, ends, states):  # type: ignore[no-untyped-def]
    """Take in what a point's run has come to; True where it goes on."""
    spent = code == ReturnCode.BUDGET_SPENT.value
    going_on = code == ReturnCode.BLOCK_FULL.value or (spent and run.steps < run.most_steps)
    end = end_of(row_of(ends[at.point]))
    if not (going_on or spent or code == ReturnCode.HORIZON.value or code == ReturnCode.STOPPED.value):
        at.kept, end.code = at.kept_before, SET_ASIDE
        return False
    end.transitions += run.transitions
    records = work_space(row_of(block), run.states, run.guards, run.order)[3]
    keep_transitions(at, records, run.transitions, run.states, buffer, waiting)
    run.transitions = 0
    if not going_on:
        _finish(run, block, code, ends, states, at.point)
    return going_on


@inner()
def _advance_point(block, tables, numbers, normals, selection, samples):  # type: ignore[no-untyped-def]
    """Call the loop, with a point's constants of the normal velocities where it selects modes by them."""
    if selection is None:
        return _advance_one(block, tables, numbers, None, samples)
    address, _, signs, rows, decoupled, room, values, systems, places = selection
    chosen = address, normals, signs, rows, decoupled, room, values, systems, places
    return _advance_several(block, tables, numbers, chosen, samples)


@njit(nogil=True)
def run_points(  # type: ignore[no-untyped-def]
    progress, block, template, times, initial, rows, surfaces, tables, numbers, normals, selection, samples, kept,
    pending, ends, states,
):  # fmt: skip
    """Do the runs of points until all are done, or Python is needed.

    Parameters
    ----------
    progress : ndarray, shape (1 record,) as doubles
        :data:`PROGRESS`.
    block : ndarray
        A workspace's block, which must be the same until all points are done.
    template : ndarray
        State of a start (:attr:`henon_ref.henon.start.Start.state`).
    times : ndarray, shape (points, 4)
        Initial time and horizon [s], each with what rounding lost of it.
    initial : ndarray, shape (points, 2 n)
        State at the start, and what rounding lost of it.
    rows : ndarray of int, shape (points,)
        Row of the mode at the start; -1: the point is set aside.
    surfaces : ndarray of int, shape (points,)
        Surface on which the point starts, -1 where it is on none; ``rows`` then has the mode below it.
    tables : ndarray of int
        See :func:`henon_ref.henon.loop.advance`.
    numbers, normals : ndarray, shapes (points or 1, M, 2, K) and (points or 1, k)
        Constants of the compiled modes, and of the normal velocities: for each point, or the same for all.
    selection : tuple or None
        See :func:`henon_ref.henon.loop.advance`; its constants are taken from ``normals``.
    samples : ndarray, shape (0, 2)
        None are taken.
    kept, pending : ndarray
        See :func:`keep_transitions`.
    ends, states : ndarray, shapes (points, END_PLACES) and (points, n)
        Filled with :data:`END`, and the states there.

    Returns
    -------
    int
        DONE, BUFFER_FULL, PAUSE or ASIDE.
    """
    at = progress_of(row_of(progress))
    run = run_of(row_of(block))
    buffer, waiting = rows_of(row_of(kept), kept.shape[1]), rows_of(row_of(pending), pending.shape[1])
    spent = 0
    while at.point < rows.size:
        point = at.point
        constants = point if numbers.shape[0] > 1 else 0
        if at.running == 0:
            if rows[point] < 0 or not _begin(
                block, template, times, initial, point, rows[point], surfaces[point], tables, numbers[constants]
            ):
                end_of(row_of(ends[point])).code = SET_ASIDE
                at.point += 1
                continue
            for i in range(pending.shape[0]):
                pending[i, 0] = 0.0
            end_of(row_of(ends[point])).transitions = 0
            at.running, at.kept_before = 1, at.kept
        if at.kept + run.transition_capacity + pending.shape[0] > kept.shape[0]:
            return BUFFER_FULL
        before = run.steps
        code = _advance_point(block, tables, numbers[constants], normals[constants], selection, samples)
        spent += run.steps - before
        going_on = _take_in(at, run, block, code, buffer, waiting, ends, states)
        if not going_on:
            at.running = 0
            at.point += 1
            if at.stop_aside != 0 and end_of(row_of(ends[point])).code == SET_ASIDE:
                return ASIDE
        if spent > at.steps:
            return PAUSE
    return DONE


@njit(nogil=True)
def keep_rows(progress, transitions, kept, pending):  # type: ignore[no-untyped-def]
    """:func:`keep_transitions` for a run in Python; ``transitions`` of shape (count, TRANSITION_PLACES + n)."""
    count, width = transitions.shape
    records, buffer = rows_of(row_of(transitions), width), rows_of(row_of(kept), kept.shape[1])
    waiting = rows_of(row_of(pending), pending.shape[1])
    keep_transitions(progress_of(row_of(progress)), records, count, width - TRANSITION_PLACES, buffer, waiting)


@cache
def load_points(*, several: bool) -> None:
    """Make the call ready; ``several``: for systems whose events of several surfaces the compiled loop decides."""
    load(several=several)
    symbol, kind = ("henon_ref.advance_several", SELECTION) if several else ("henon_ref.advance", types.none)
    add_symbol(symbol, advance, (ROW, TABLES, NUMBERS, kind, ROWS))
    compile_all([(run_points, point_types(several=several)), (keep_rows, (ROW, ROWS, ROWS, ROWS))])


def point_types(*, several: bool) -> tuple[Any, ...]:
    """Types of the arguments of :func:`run_points`."""
    flat, grid = ROW, ROWS
    constants = types.Array(types.float64, 4, "C")
    selection = SELECTION if several else types.none
    whole = types.Array(types.int64, 1, "C")
    return (
        flat,
        flat,
        flat,
        grid,
        grid,
        whole,
        whole,
        TABLES,
        constants,
        grid,
        selection,
        grid,
        grid,
        grid,
        grid,
        grid,
    )
