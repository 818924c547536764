"""Making the mode loop callable."""

from __future__ import annotations

from typing import Any

from numba import boolean, float64, int64, typeof

from henon_ref.henon.compile_units import NUMBERS, ROW, ROWS, TABLES, link
from henon_ref.henon.events import ends_at_zero, fails_at_once, first_event
from henon_ref.henon.kernel import advance
from henon_ref.henon.passage import through_event
from henon_ref.henon.stepping import glide
from henon_ref.jit.shared_compiling import Compiled, compile_all
from henon_ref.jit.views import DOUBLES, GRID, INTEGERS, TABLE


def called(settling: Any) -> tuple[Compiled, ...]:
    """Functions that the loop calls, with the types that it calls them with: the parts that processes share.

    ``settling``: type of that argument. What takes longest comes first.
    """
    return (
        (glide, (DOUBLES, INTEGERS, DOUBLES, DOUBLES, INTEGERS, TABLE, DOUBLES, GRID, DOUBLES, boolean, int64)),
        (through_event, (DOUBLES, INTEGERS, GRID, TABLES, NUMBERS, settling, GRID, DOUBLES)),
        (first_event, (INTEGERS, GRID, int64, int64, TABLE, INTEGERS, DOUBLES, float64, float64, int64, GRID, GRID)),
        (ends_at_zero, (DOUBLES, int64, int64, float64, int64)),
        (fails_at_once, (GRID, int64, int64, TABLE, INTEGERS, INTEGERS, float64)),
    )


def load(settling: tuple[Any, ...] | None) -> None:
    """Make the loop callable; ``settling``: what it will be called with."""
    link()
    kind = typeof(settling)
    compile_all([(advance, (ROW, TABLES, NUMBERS, kind, ROWS))], called(kind))
