"""Making the mode loop callable."""

from __future__ import annotations

from typing import Any

from numba import float64, int64, none, typeof

from henon_ref.henon.apart import COUNTS, FUNCTIONS, LAYOUT, ROW, ROWS
from henon_ref.henon.events import ends_at_zero, first_event
from henon_ref.henon.kernel import advance, through_event
from henon_ref.henon.registers import A_TRUSTED, ALWAYS
from henon_ref.henon.sharing import Compiled, compile_all

TABLES, NUMBERS = int64[:, :, ::1], float64[:, :, ::1]
CALLED: tuple[Compiled, ...] = (
    (first_event, (COUNTS, ROWS, int64, int64, LAYOUT, COUNTS, ROW, float64, int64, ROWS, ROWS)),
    (ends_at_zero, (ROW, int64, int64, float64, int64)),
    (through_event, (ROW, COUNTS, ROWS, TABLES, NUMBERS, none, ROWS, ROW)),
)
"""Functions that the loop calls, with the types that it calls them with: who waits for the loop compiles them first."""


def load(settling: tuple[Any, ...] | None) -> None:
    """Make the loop callable; ``settling``: what it will be called with."""
    given = (ROW, COUNTS, ROW, TABLES, NUMBERS, typeof(settling), ROWS)
    compile_all([(advance, given)], [*CALLED, *(FUNCTIONS[place] for place in (*ALWAYS, A_TRUSTED))])
