"""The mode after an event of one guard, by two normal velocities or the hold zone."""

from __future__ import annotations

from numba import float64, int64

from henon_ref.henon.compile_units import compile_unit
from henon_ref.henon.event_detection import zeros_at_release
from henon_ref.henon.jump_transition import call_jump
from henon_ref.henon.mode_selection import select_mode
from henon_ref.henon.recorder import change_mode, events_accumulate, record_transition, set_known_zeros
from henon_ref.henon.records import CROSSING, RELEASE, RELEASED, STICK, SURFACE, VALID, guard_of, mode_of
from henon_ref.henon.state import ON, TANGENT, ReturnCode
from henon_ref.jit.calls import call_expand
from henon_ref.jit.njit import inner
from henon_ref.jit.primitives import smaller
from henon_ref.jit.views import DOUBLES, GRID, TABLE, rest_of, rows_in

HOLD_MARGIN = 1e-9
"""Size of the smallest release guard, relative to all their coefficients, below which Python looks closer."""


@inner()
def inside_hold_zone(t, low, unit, n, x, index, layout, constants, ahead, order):  # type: ignore[no-untyped-def]
    """+1 inside the hold zone of a surface, -1 outside, 0 where that is not clear.

    Parameters
    ----------
    t, low, unit, n, x
        Time, what rounding it lost, a unit of time, states, and the state.
    index : int
        The surface.
    layout : rows of int
        Table of the stick (see :func:`henon_ref.henon.loop.advance`).
    constants : row
        Its constants.
    ahead : rows
        Work space of its expansion.
    """
    call_expand(mode_of(layout).expansion, t, low, unit, x, constants, ahead)
    least, size = 1e300, 0.0
    for g in range(mode_of(layout).guards):
        if guard_of(layout, g).kind == RELEASE and guard_of(layout, g).index == index:
            least = smaller(least, ahead[n + g, 0])
            for k in range(order + 1):
                size += abs(ahead[n + g, k])
    if not abs(least) > HOLD_MARGIN * size:
        return 0
    return 1 if least > 0.0 else -1


_inside_hold_zone = compile_unit(
    inside_hold_zone, int64, float64, float64, float64, int64, DOUBLES, int64, TABLE, DOUBLES, GRID, int64
)


@inner(forceinline=True)
def apply_event(run, x, known_zeros, hits, records, tables, numbers, selection, band, room):  # type: ignore[no-untyped-def]
    """Change the mode at the event the run stands at; ON, or why Python is needed."""
    n, most = run.states, run.guards
    speeds = rest_of(room, 2 * n + most)
    mode, hit, used = run.mode, run.guard, run.landing
    layout = rows_in(tables, mode)
    kind, index = guard_of(layout, hit).kind, guard_of(layout, hit).index
    coincident = False
    for g in range(mode_of(layout).guards):
        coincident = coincident or (hits[g] == 1 and g != hit)
    if kind == VALID:
        return ReturnCode.LEFT_DOMAIN.value
    zeros, what, target = 1, CROSSING, guard_of(layout, hit).mode_across
    if kind == SURFACE:
        if guard_of(layout, hit).jump != 0 and not coincident:
            modes, constants = rows_in(tables, 0), rows_in(numbers, 0)
            return call_jump(
                mode_of(layout).jump, run, x, known_zeros, records, tables.shape[0], modes, constants, band, room
            )
        if coincident or guard_of(layout, hit).coupled != 0:
            if selection is None:
                return ReturnCode.SELECT_MODE.value
            target = select_mode(run.time, run.time_low, x, mode, layout, hits, selection)
            if target < 0 or not change_mode(
                run, x, records, known_zeros, target, layout, rows_in(tables, target), hits, selection[2]
            ):
                return ReturnCode.SELECT_MODE.value
            return ReturnCode.EVENTS_ACCUMULATE.value if events_accumulate(run) else ON
        code, constants = mode_of(layout).normal_velocities, rows_in(numbers, mode)[1]
        call_expand(code, run.time, run.time_low, 1.0, x, constants, speeds)
        run.expansions += 1
        inside, beyond = speeds[n + 2 * hit], speeds[n + 2 * hit + 1]
        if not (inside > 0.0 and abs(beyond) > TANGENT * inside):
            return ReturnCode.SELECT_MODE.value
        stuck = beyond < 0.0
        if guard_of(layout, hit).hold_zone == 1:
            stick = guard_of(layout, hit).mode_stuck
            zone = 0 if stick < 0 else _inside_hold_zone(
                run.time, run.time_low, run.unit, n, x, index, rows_in(tables, stick),
                rows_in(numbers, stick)[0], rest_of(band, n + most + 1), run.order,
            )  # fmt: skip
            if zone == 0 or (stuck and zone < 0):
                return ReturnCode.SELECT_MODE.value
            stuck = zone > 0
        if stuck:
            zeros, what, target = 0, STICK, guard_of(layout, hit).mode_stuck
    else:
        zeros, what = guard_of(layout, hit).zeros_at_release, RELEASED
    if coincident or (kind == RELEASE and guard_of(layout, hit).coupled != 0):
        return ReturnCode.SELECT_MODE.value
    if target < 0:
        run.pending_kind = what
        return ReturnCode.MODE_NOT_COMPILED.value
    after = rows_in(tables, target)
    if zeros == 0 and what == RELEASED:
        code, constants = mode_of(after).normal_velocities, rows_in(numbers, target)[1]
        call_expand(code, run.time, run.time_low, 1.0, x, constants, speeds)
        run.expansions += 1
        zeros = zeros_at_release(after, index, rest_of(speeds, n))
        if zeros == 0:
            return ReturnCode.SELECT_MODE.value
    record_transition(run, x, records, what, index, guard_of(layout, hit).side, mode, target, used)
    run.mode = target
    set_known_zeros(known_zeros, after, index, zeros)
    return ReturnCode.EVENTS_ACCUMULATE.value if events_accumulate(run) else ON
