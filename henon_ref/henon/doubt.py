"""What becomes of a doubtful event, where a closer look is taken from within the loop."""

from __future__ import annotations

from henon_ref.henon.near import look_near
from henon_ref.henon.recording import record
from henon_ref.henon.registers import (
    DOUBTFUL,
    EVENT,
    F_STATE,
    FOUND,
    G_INDEX,
    GRAZE,
    I_ARRIVED,
    I_GUARD,
    I_LANDING,
    I_MODE,
    I_SIZE,
    I_WHAT,
    ON,
)
from henon_ref.henon.window import OPEN, ROOT, TOUCH, UNSURE
from henon_ref.jit import inner


@inner()
def look_closer(floats, integers, records, layout):  # type: ignore[no-untyped-def]
    """Go to a doubtful event with more digits: ON, EVENT, or why Python is needed (DOUBTFUL, FOUND).

    What it comes to counts for nothing where a function turns out to be missing.
    """
    n, most = (floats.size - F_STATE) // 2, (integers.size - I_SIZE) // 2
    mode, guard = integers[I_MODE], integers[I_GUARD]
    integers[I_ARRIVED] = 0
    outcome = look_near(floats, integers, layout)
    if outcome in (UNSURE, OPEN):
        integers[I_WHAT] = outcome
        return DOUBTFUL
    if outcome == TOUCH:  # a stick whose own end is touched goes on, and nothing is told
        x, index = floats[F_STATE : F_STATE + n], layout[1 + guard, G_INDEX]
        record(floats, integers, x, records, GRAZE, index, mode, mode, integers[I_LANDING])
    if outcome == ROOT and integers[I_SIZE + most + guard] == 1:
        return FOUND
    return EVENT if integers[I_ARRIVED] > 0 else ON
