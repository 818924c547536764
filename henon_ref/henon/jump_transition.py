"""The jump of the state at one surface that resets it, and the mode after it, where double precision decides them.

What :mod:`henon_ref.filippov.after_jump` says of a jump, for the common case: one surface alone is at zero, and after
the jump no surface holds the state. The map is evaluated at the state with what rounding has lost of it, to the
rounding of its own terms, as a step is. Then the mode after it is expanded there: every guard must be clearly above
zero, and a surface that the map keeps must be left with a speed, with flights to come that last longer than what counts
as rest.
All else is left to Python, before anything is changed.

Compiled for systems that have resets alone, and called by its address.
"""

from __future__ import annotations

from numba import int64

from henon_ref.henon.compile_units import NUMBERS, TABLES, compile_on_demand
from henon_ref.henon.recorder import events_accumulate, record_transition, set_known_zeros
from henon_ref.henon.records import CROSSING, RELEASED, RESET, SURFACE, guard_of, mode_of
from henon_ref.henon.state import ON, RUN_RECORD, TANGENT, ReturnCode
from henon_ref.henon.step import BLOWN_UP
from henon_ref.jit.calls import call_expand
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import larger
from henon_ref.jit.views import DOUBLES, GRID, INTEGERS, rest_of, rows_in

CLEAR = 1e-9
"""Part of the sum of its terms' sizes on a step from which on a guard is clearly above zero."""
LASTING = 1.0 + 1e-6
"""So many times the longest rest all later flights must last together, for it to be clear that they go on."""


@inner()
def _map_state(run, x, layout, constants, room):  # type: ignore[no-untyped-def]
    """Put the state after the jump, what is lost of it, and new values of surfaces into ``room``; False if not finite.

    Of a surface whose function the map keeps the value is put as 0.
    """
    n, low = run.states, rest_of(room, run.states)
    for i in range(2 * n):
        room[i] = x[i]
    for j in range(mode_of(layout).surfaces):
        room[2 * n + j] = 0.0
    call_expand(guard_of(layout, run.guard).jump, run.time, run.time_low, 1.0, x, constants, room)
    bounded = True
    for i in range(n):
        total = room[i] + low[i]
        part = total - room[i]
        low[i] = (room[i] - (total - part)) + (low[i] - part)
        room[i] = total
        bounded = bounded and abs(total) < BLOWN_UP
    for j in range(mode_of(layout).surfaces):
        bounded = bounded and abs(room[2 * n + j]) < BLOWN_UP
    return bounded


@inner()
def _entry(number, surface):  # type: ignore[no-untyped-def]
    """Entry of a surface in the mode of a number (:func:`henon_ref.filippov.modes.mode_number`)."""
    for _ in range(surface):
        number //= 3
    return number % 3 - 1


@inner()
def _number_after(layout, values):  # type: ignore[no-untyped-def]
    """Number of the mode on the sides where a jump has put the state; -1 where it slides on.

    ``values``: of the surfaces after it, 0 where the side is the same.
    """
    number, power = mode_of(layout).number, 1
    for j in range(mode_of(layout).surfaces):
        before = _entry(mode_of(layout).number, j)
        if values[j] != 0.0:
            number += ((1 if values[j] > 0.0 else -1) - before) * power
        elif before == 0:
            return -1
        power *= 3
    return number


@inner()
def _row_of(number, tables):  # type: ignore[no-untyped-def]
    """Row of the mode of a number; -1 where that is not compiled."""
    for row in range(tables.shape[0]):
        if mode_of(rows_in(tables, row)).number == number:
            return row
    return -1


@inner()
def _goes_on(run, x, index, kept, speed, layout, constants, ahead):  # type: ignore[no-untyped-def]
    """Whether a mode clearly goes on from a state after a jump.

    ``kept``: whether the surface ``index`` was left where it was; ``speed``: with which it was reached.
    """
    n, unit = run.states, run.unit
    call_expand(mode_of(layout).expansion, run.time, run.time_low, unit, x, constants, ahead)
    for g in range(mode_of(layout).guards):
        row = ahead[n + g]
        if kept and guard_of(layout, g).kind == SURFACE and guard_of(layout, g).index == index:
            # All later flights last 2 v / (a (1 - r)): see :mod:`henon_ref.filippov.resting`.
            rise, reached = row[1], speed * unit
            ending = larger(-row[2], 0.0) * larger(1.0 - rise / reached, 0.0)
            rest = LASTING * run.rest_part * (run.horizon - run.begin)
            if not (rise > TANGENT * reached and unit * rise > rest * ending):
                return False
        else:
            size = 0.0
            for k in range(run.order + 1):
                size += abs(row[k])
            if not row[0] > CLEAR * size:
                return False
    return True


@inner()
def jump_transition(run, x, known_zeros, records, tables, numbers, band, room):  # type: ignore[no-untyped-def]
    """Let the state jump at the event of one guard that the run stands at; ON, or why Python is needed.

    Parameters
    ----------
    run : record
    x : row
        State, what rounding has lost of it, and the state before the last jump.
    known_zeros, records, tables, numbers, band, room
        See :func:`henon_ref.henon.loop.advance` and :func:`henon_ref.henon.workspace.work_space`.
    """
    n, most, mode = run.states, run.guards, run.mode
    layout, own = rows_in(tables, mode), rows_in(numbers, mode)
    index, values, speeds = guard_of(layout, run.guard).index, rest_of(room, 2 * n), rest_of(room, 2 * n + most)
    call_expand(mode_of(layout).normal_velocities, run.time, run.time_low, 1.0, x, own[1], speeds)
    speed = speeds[n + 2 * run.guard]
    if not (_map_state(run, x, layout, own[2], room) and speed > 0.0):
        return ReturnCode.SELECT_MODE.value
    before, number = mode_of(layout).number, _number_after(layout, values)
    if number < 0:
        return ReturnCode.SELECT_MODE.value
    target = mode if number == before else _row_of(number, tables)
    if target < 0:
        run.pending_kind, run.pending_mode, run.event_pending = RESET, number, 1
        return ReturnCode.MODE_NOT_COMPILED.value
    after, kept = rows_in(tables, target), values[index] == 0.0
    if not _goes_on(run, room, index, kept, speed, after, rows_in(numbers, target)[0], rest_of(band, n + most + 1)):
        return ReturnCode.SELECT_MODE.value
    changes = 0
    for j in range(mode_of(layout).surfaces):
        changes += 1 if j == index or _entry(before, j) != _entry(number, j) else 0
    # Of a block that is empty there is memory for all, however few transitions it is to hold.
    if run.transitions > 0 and run.transitions + changes > run.transition_capacity:
        run.event_pending = 1
        return ReturnCode.BLOCK_FULL.value
    run.expansions += (
        2  # normal velocities, and the mode after it; not before all is sure, for the event may be put off
    )
    for i in range(n):
        x[2 * n + i] = x[i]
    for i in range(2 * n):
        x[i] = room[i]
    for j in range(mode_of(layout).surfaces):
        entry = _entry(before, j)
        if j == index or entry != _entry(number, j):
            kind = RESET if j == index else RELEASED if entry == 0 else CROSSING
            record_transition(run, x, records, kind, j, entry, mode, target, run.landing)
    run.mode = target
    set_known_zeros(known_zeros, after, index, 1 if kept else 0)
    return ReturnCode.EVENTS_ACCUMULATE.value if events_accumulate(run) else ON


compiled_jump, call_jump = compile_on_demand(
    jump_transition, int64, RUN_RECORD, DOUBLES, INTEGERS, GRID, TABLES, NUMBERS, GRID, DOUBLES
)
"""What compiles it and returns its address; what calls it, in compiled code."""
