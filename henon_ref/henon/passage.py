"""An event that the run stands at: the mode that follows it, where a sign or two decide that."""

from __future__ import annotations

from numba import float64, int64

from henon_ref.henon.compile_units import unit
from henon_ref.henon.events import zeros_at_release
from henon_ref.henon.holding import held
from henon_ref.henon.recording import crowded, record, settle, start
from henon_ref.henon.registers import (
    ACCUMULATED,
    CROSS,
    F_LOW,
    F_SIGMA,
    F_STATE,
    F_TIME,
    FREE,
    G_ACTS,
    G_AFTER,
    G_HOLD,
    G_INDEX,
    G_KIND,
    G_STUCK,
    I_GUARD,
    I_GUARDS,
    I_LANDING,
    I_MODE,
    I_ORDER,
    I_RHS,
    I_SIZE,
    I_STATES,
    I_WHAT,
    INVALID,
    ON,
    RESOLVE,
    STICK,
    SURFACE,
    T_GUARDS,
    T_PROBE,
    TANGENT,
    UNKNOWN,
    VALID,
)
from henon_ref.henon.settling import decided
from henon_ref.jit.calls import call_expand
from henon_ref.jit.njit import inner
from henon_ref.jit.views import DOUBLES, GRID, TABLE, rest_of, rows_in

_held = unit(held, int64, float64, float64, float64, int64, DOUBLES, int64, TABLE, DOUBLES, GRID, int64)


@inner(forceinline=True)
def through_event(floats, integers, records, tables, numbers, settling, band, room):  # type: ignore[no-untyped-def]
    """Change the mode at the event the run stands at; ON, or why Python is needed."""
    n, most = integers[I_STATES], integers[I_GUARDS]
    x, speeds = rest_of(floats, F_STATE), rest_of(room, 2 * n + most)
    multiplicity, hits = rest_of(integers, I_SIZE), rest_of(integers, I_SIZE + most)
    mode, hit, used = integers[I_MODE], integers[I_GUARD], integers[I_LANDING]
    layout = rows_in(tables, mode)
    kind, index = layout[1 + hit, G_KIND], layout[1 + hit, G_INDEX]
    together = False
    for g in range(layout[0, T_GUARDS]):
        together = together or (hits[g] == 1 and g != hit)
    if kind == VALID:
        return INVALID
    zeros, what, target = 1, CROSS, layout[1 + hit, G_AFTER]
    if kind == SURFACE:
        if together or layout[1 + hit, G_ACTS] == 1:
            if settling is None:
                return RESOLVE
            target = decided(floats[F_TIME], floats[F_LOW], x, mode, layout, hits, settling)
            if target < 0 or not settle(
                floats, integers, x, records, multiplicity, target, layout, rows_in(tables, target), hits, settling[2]
            ):
                return RESOLVE
            return ACCUMULATED if crowded(floats, integers) else ON
        call_expand(layout[0, T_PROBE], floats[F_TIME], floats[F_LOW], 1.0, x, rows_in(numbers, mode)[1], speeds)
        integers[I_RHS] += 1
        inside, beyond = speeds[n + 2 * hit], speeds[n + 2 * hit + 1]
        if not (inside > 0.0 and abs(beyond) > TANGENT * inside):
            return RESOLVE
        stuck = beyond < 0.0
        if layout[1 + hit, G_HOLD] == 1:
            stick = layout[1 + hit, G_STUCK]
            zone = 0 if stick < 0 else _held(
                floats[F_TIME], floats[F_LOW], floats[F_SIGMA], n, x, index, rows_in(tables, stick),
                rows_in(numbers, stick)[0], rest_of(band, n + most + 1), integers[I_ORDER],
            )  # fmt: skip
            if zone == 0 or (stuck and zone < 0):
                return RESOLVE
            stuck = zone > 0
        if stuck:
            zeros, what, target = 0, STICK, layout[1 + hit, G_STUCK]
    else:
        zeros, what = layout[1 + hit, G_STUCK], FREE
    if together:
        return RESOLVE
    if target < 0:
        integers[I_WHAT] = what
        return UNKNOWN
    after = rows_in(tables, target)
    if zeros == 0 and what == FREE:
        call_expand(after[0, T_PROBE], floats[F_TIME], floats[F_LOW], 1.0, x, rows_in(numbers, target)[1], speeds)
        integers[I_RHS] += 1
        zeros = zeros_at_release(after, index, rest_of(speeds, n))
        if zeros == 0:
            return RESOLVE
    record(floats, integers, x, records, what, index, mode, target, used)
    integers[I_MODE] = target
    start(multiplicity, after, index, zeros)
    return ACCUMULATED if crowded(floats, integers) else ON
