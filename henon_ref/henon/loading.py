"""Making the mode loop callable."""

from __future__ import annotations

from typing import Any

from numba import float64, int64, typeof

from henon_ref.henon.apart import COUNTS, FUNCTIONS, LAYOUT, NUMBERS, ROW, ROWS, TABLES
from henon_ref.henon.events import ends_at_zero, first_event
from henon_ref.henon.kernel import advance
from henon_ref.henon.passage import through_event
from henon_ref.henon.registers import A_TRUSTED, ALWAYS
from henon_ref.henon.sharing import Compiled, compile_all


def called(settling: Any) -> tuple[Compiled, ...]:
    """Functions that the loop calls, with the types that it calls them with: what is compiled by who waits for it.

    ``settling``: type of that argument.
    """
    return (
        (first_event, (COUNTS, ROWS, int64, int64, LAYOUT, COUNTS, ROW, float64, int64, ROWS, ROWS)),
        (ends_at_zero, (ROW, int64, int64, float64, int64)),
        (through_event, (ROW, COUNTS, ROWS, TABLES, NUMBERS, settling, ROWS, ROW)),
    )


def load(settling: tuple[Any, ...] | None) -> None:
    """Make the loop callable; ``settling``: what it will be called with."""
    kind = typeof(settling)
    ahead = [*called(kind), *(FUNCTIONS[place] for place in (*ALWAYS, A_TRUSTED))]
    compile_all([(advance, (ROW, TABLES, NUMBERS, kind, ROWS))], ahead)
