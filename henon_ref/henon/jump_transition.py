"""The jump of the state at one surface that resets it, and the mode after it, where double precision decides them.

What :mod:`henon_ref.filippov.after_jump` says of a jump, for the common case: one surface alone is at zero, no other
one is slid on after the jump, and the map carries none through zero whose reset would be due. The map is evaluated at
the state with what rounding has lost of it, to the rounding of its own terms, as a step is. Then the mode after it is
expanded there: every guard must be clearly above zero, and a surface that the map keeps must be left with a speed, with
flights to come that last longer than what counts as rest. Or it goes on falling, or the impact takes all of the speed,
and the body is clearly pressed on: then the mode below, or at rest, is expanded, too.

All else is left to Python, before anything is changed.

Compiled for systems that have resets alone, and called by its address.
"""

from __future__ import annotations

from numba import int64

from henon_ref.henon.compile_units import compile_on_demand
from henon_ref.henon.recorder import events_accumulate, record_transition, set_known_zeros
from henon_ref.henon.records import CROSSING, RELEASED, RESET, RESETTING, STICK, SURFACE, guard_of, mode_of
from henon_ref.henon.state import ON, RUN_RECORD, TANGENT, ReturnCode
from henon_ref.henon.step import BLOWN_UP
from henon_ref.jit.calls import call_expand
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import larger
from henon_ref.jit.views import DOUBLES, GRID, INTEGERS, TABLE, rest_of

CLEAR = 1e-9
"""Part of the sum of its terms' sizes on a step from which on a guard is clearly above zero."""
LASTING = 1.0 + 1e-6
"""So many times the longest rest all later flights must last together, for it to be clear that they go on."""
UNCLEAR, RESTS, LEFT, FALLS = -1, 0, 1, 2
"""What becomes of a surface whose function the map keeps; Python has to decide where that is not clear."""


@inner()
def _map_state(run, x, layout, constants, room):  # type: ignore[no-untyped-def]
    """Put the state after the jump, what is lost of it, and new values of surfaces into ``room``; False if not finite.

    Of a surface whose function the map keeps the value is put as 0. Behind them stands the part of the speed that is
    left.
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
def _lower(number, surface, entries):  # type: ignore[no-untyped-def]
    """Number of the mode whose entry of a surface is so much lower."""
    power = 1
    for _ in range(surface):
        power *= 3
    return number - entries * power


@inner()
def _carries_another(layout, index, values):  # type: ignore[no-untyped-def]
    """Whether a map carries another surface below zero that resets the state there."""
    for g in range(mode_of(layout).guards):
        other = guard_of(layout, g).index
        resets = guard_of(layout, g).kind == SURFACE and guard_of(layout, g).coupled == RESETTING
        if resets and other != index and values[other] < 0.0:
            return True
    return False


@inner()
def _layout(run, tables, row):  # type: ignore[no-untyped-def]
    """A mode's table."""
    return rest_of(tables, row * (1 + run.guards))


@inner()
def _numbers(numbers, row):  # type: ignore[no-untyped-def]
    """Its constants: of the expansion, of normal velocities, and of maps of resets."""
    return rest_of(numbers, 3 * row)


@inner()
def _row_of(run, number, count, tables):  # type: ignore[no-untyped-def]
    """Row of the mode of a number; -1 where that is not compiled."""
    for row in range(count):
        if mode_of(_layout(run, tables, row)).number == number:
            return row
    return -1


@inner()
def _after_impact(run, row, speed, ratio, turned):  # type: ignore[no-untyped-def]
    """What clearly becomes of a surface after an impact: it is LEFT, the body RESTS there, or it FALLS through.

    ``row``: coefficients of its function after the impact; ``speed``: with which it was reached, and of which the
    impact leaves ``ratio``; ``turned``: whether another surface changes its side.
    """
    size = 0.0
    for k in range(2, run.order + 1):
        size += abs(row[k])
    if ratio == 0.0:
        return RESTS if row[2] < -CLEAR * size else UNCLEAR
    # All later flights last 2 v / (a (1 - r)): see :mod:`henon_ref.filippov.resting`. Where friction has turned round
    # the way up alone lasts v / a.
    rise, reached = row[1], speed * run.unit
    if rise < -TANGENT * reached:
        return FALLS if ratio > 0.0 else UNCLEAR
    ending = larger(-row[2], 0.0) * (2.0 if turned else larger(1.0 - rise / reached, 0.0))
    rest = LASTING * run.rest_part * (run.horizon - run.begin)
    return LEFT if rise > TANGENT * reached and run.unit * rise > rest * ending else UNCLEAR


@inner()
def _holds(run, x, layout, constants, ahead, surface):  # type: ignore[no-untyped-def]
    """Expand a mode at a state; whether all its guards, but for a ``surface``'s, are clearly above zero there."""
    n = run.states
    call_expand(mode_of(layout).expansion, run.time, run.time_low, run.unit, x, constants, ahead)
    for g in range(mode_of(layout).guards):
        size = 0.0
        for k in range(run.order + 1):
            size += abs(ahead[n + g, k])
        own = guard_of(layout, g).kind == SURFACE and guard_of(layout, g).index == surface
        if not own and not ahead[n + g, 0] > CLEAR * size:
            return False
    return True


@inner()
def _guard_on(layout, surface):  # type: ignore[no-untyped-def]
    """The guard of a surface that a mode does not slide on."""
    g = 0
    while guard_of(layout, g).kind != SURFACE or guard_of(layout, g).index != surface:
        g += 1
    return g


@inner()
def _not_compiled(run, number):  # type: ignore[no-untyped-def]
    """Have Python compile the mode of a number; the loop then goes through the event anew."""
    run.pending_kind, run.pending_mode, run.event_pending = RESET, number, 1
    return ReturnCode.MODE_NOT_COMPILED.value


@inner()
def jump_transition(run, x, known_zeros, records, count, tables, numbers, band, room):  # type: ignore[no-untyped-def]
    """Let the state jump at the event of one guard that the run stands at; ON, or why Python is needed.

    Parameters
    ----------
    run : record
    x : row
        State, what rounding has lost of it, and the state before the last jump.
    known_zeros, records, band, room
        See :func:`henon_ref.henon.state.vectors_of` and :func:`henon_ref.henon.workspace.work_space`.
    count : int
        Compiled modes.
    tables, numbers : rows
        Theirs, one after the other (:func:`henon_ref.henon.loop.advance`): arrays would be many more words of a call.
    """
    n, most, mode = run.states, run.guards, run.mode
    layout, own, ahead = _layout(run, tables, mode), _numbers(numbers, mode), rest_of(band, n + most + 1)
    index, surfaces = guard_of(layout, run.guard).index, mode_of(layout).surfaces
    values, speeds = rest_of(room, 2 * n), rest_of(room, 2 * n + most)
    call_expand(mode_of(layout).normal_velocities, run.time, run.time_low, 1.0, x, own[1], speeds)
    speed = speeds[n + 2 * run.guard]
    if not (_map_state(run, x, layout, own[2], room) and speed > 0.0):
        return ReturnCode.SELECT_MODE.value
    before, number, kept = mode_of(layout).number, _number_after(layout, values), values[index] == 0.0
    if number < 0 or _carries_another(layout, index, values):
        return ReturnCode.SELECT_MODE.value
    target = _row_of(run, number, count, tables)
    if target < 0:
        return _not_compiled(run, number)
    after, end, changes, expanded = _layout(run, tables, target), target, 0, 2
    for j in range(surfaces):
        changes += 1 if j == index or _entry(before, j) != _entry(number, j) else 0
    if not _holds(run, room, after, _numbers(numbers, target)[0], ahead, index if kept else -1):
        return ReturnCode.SELECT_MODE.value
    if kept:
        left = _after_impact(run, ahead[n + _guard_on(after, index)], speed, values[surfaces], changes > 1)
        if left == UNCLEAR:
            return ReturnCode.SELECT_MODE.value
        if left != LEFT:
            lower = _lower(number, index, 2 if left == FALLS else 1)
            end = _row_of(run, lower, count, tables)
            if end < 0:
                return _not_compiled(run, lower)
            after, falls, expanded = _layout(run, tables, end), left == FALLS, 3
            if not _holds(run, room, after, _numbers(numbers, end)[0], ahead, index if falls else -1):
                return ReturnCode.SELECT_MODE.value
            if falls:
                if not ahead[n + _guard_on(after, index), 1] > TANGENT * speed * run.unit:
                    return ReturnCode.SELECT_MODE.value
                number, target = lower, end
    changes += 1 if end != target else 0
    # Of a block that is empty there is memory for all, however few transitions it is to hold.
    if run.transitions > 0 and run.transitions + changes > run.transition_capacity:
        run.event_pending = 1
        return ReturnCode.BLOCK_FULL.value
    # Normal velocities, and modes; not counted before all is sure, for the event may be put off.
    run.expansions += expanded
    for i in range(n):
        x[2 * n + i] = x[i]
    for i in range(2 * n):
        x[i] = room[i]
    for j in range(surfaces):
        entry = _entry(before, j)
        if j == index or entry != _entry(number, j):
            kind = RESET if j == index else RELEASED if entry == 0 else CROSSING
            record_transition(run, x, records, kind, j, entry, mode, target, run.landing)
    accumulate = events_accumulate(run)
    if end != target:
        record_transition(run, x, records, STICK, index, 1, target, end, run.landing)
        accumulate = events_accumulate(run)
    run.mode, run.more_digits = end, 0
    set_known_zeros(known_zeros, _layout(run, tables, end), index, 1 if kept and end == target else 0)
    return ReturnCode.EVENTS_ACCUMULATE.value if accumulate else ON


compiled_jump, call_jump = compile_on_demand(
    jump_transition, int64, RUN_RECORD, DOUBLES, INTEGERS, GRID, int64, TABLE, GRID, GRID, DOUBLES
)
"""What compiles it and returns its address; what calls it, in compiled code."""
