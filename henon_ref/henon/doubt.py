"""What becomes of a doubtful event, where a closer look is taken from within the loop."""

from __future__ import annotations

from numba import int64

from henon_ref.henon.apart import apart, missing
from henon_ref.henon.beyond import zeros_beyond
from henon_ref.henon.near import look_near
from henon_ref.henon.recording import crowded, record, start
from henon_ref.henon.registers import (
    A_BEYOND,
    ACCUMULATED,
    CROSS,
    DOUBTFUL,
    EVENT,
    F_STATE,
    FOUND,
    FREE,
    G_ACTS,
    G_AFTER,
    G_HOLD,
    G_INDEX,
    G_KIND,
    G_STUCK,
    GRAZE,
    I_ARRIVED,
    I_GUARD,
    I_GUARDS,
    I_LANDING,
    I_MODE,
    I_SIZE,
    I_WHAT,
    ON,
    RELEASE,
    SURFACE,
)
from henon_ref.henon.views import DOUBLES, INTEGERS, TABLE, rest_of, rows_in
from henon_ref.henon.window import OPEN, ROOT, TOUCH, UNSURE
from henon_ref.jit import inner

_zeros_beyond = apart(A_BEYOND, zeros_beyond, int64, DOUBLES, INTEGERS, int64, TABLE, DOUBLES, int64)


@inner()
def look_closer(floats, integers, records, tables, numbers):  # type: ignore[no-untyped-def]
    """Go to a doubtful event with more digits: ON, EVENT, or why Python is needed (DOUBTFUL, FOUND, ACCUMULATED).

    What it comes to counts for nothing where a function turns out to be missing.
    """
    most = integers[I_GUARDS]
    mode = integers[I_MODE]
    layout = rows_in(tables, mode)
    integers[I_ARRIVED] = 0
    outcome = look_near(floats, integers, layout)
    if outcome in (UNSURE, OPEN):
        integers[I_WHAT] = outcome
        return DOUBTFUL
    guard, x = integers[I_GUARD], rest_of(floats, F_STATE)
    index = layout[1 + guard, G_INDEX]
    if outcome == TOUCH:  # a stick whose own end is touched goes on, and nothing is told
        for g in range(most):
            if integers[I_SIZE + most + g] == 1:
                touched = layout[1 + g, G_INDEX]
                record(floats, integers, x, records, GRAZE, touched, mode, mode, integers[I_LANDING])
                integers[I_SIZE + most + g] = 0
    if outcome == ROOT and integers[I_SIZE + most + guard] == 1:
        target, alone = layout[1 + guard, G_AFTER], True
        for g in range(most):
            alone = alone and (g == guard or integers[I_SIZE + most + g] == 0)
        if not alone or target < 0 or not _goes_through(layout[1 + guard]) or missing(integers, A_BEYOND):
            return FOUND
        zeros = _zeros_beyond(
            integers, floats, integers, target, rows_in(tables, target), rows_in(numbers, target)[0], index
        )
        if zeros == 0:
            return FOUND
        what = CROSS if layout[1 + guard, G_KIND] == SURFACE else FREE
        record(floats, integers, x, records, what, index, mode, target, integers[I_LANDING])
        integers[I_MODE] = target
        start(rest_of(integers, I_SIZE), rows_in(tables, target), index, zeros)
        return ACCUMULATED if crowded(floats, integers) else ON
    return EVENT if integers[I_ARRIVED] > 0 else ON


@inner()
def _goes_through(guard):  # type: ignore[no-untyped-def]
    """True if nothing but the field beyond decides what becomes of a guard's root."""
    if guard[G_KIND] == SURFACE:
        return guard[G_HOLD] == 0 and guard[G_ACTS] == 0
    return guard[G_KIND] == RELEASE and guard[G_STUCK] > 0  # Filippov's: where it is overridden zeros are measured
