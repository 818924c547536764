"""Compiling the mode loop where it is not on the disk yet: two processes that need it share the work.

The first one to come compiles the loop. Another one meanwhile compiles functions that the loop calls (CALLED), then
those that stand apart; numba looks on the disk before it compiles a function, so that the first one finds them there.
Both then load what they did not make.
"""

from __future__ import annotations

from typing import IO, Any

from numba import float64, int64, none, typeof

from henon_ref.henon.apart import COUNTS, FUNCTIONS, LAYOUT, ROW, ROWS
from henon_ref.henon.events import ends_at_zero, first_event
from henon_ref.henon.kernel import advance, through_event
from henon_ref.henon.registers import A_TRUSTED, ALWAYS
from henon_ref.jit import cache_folder, compiling

try:
    import fcntl
except ImportError:  # elsewhere than on Unix every process compiles for itself
    fcntl = None  # type: ignore[assignment]

TABLES, NUMBERS = int64[:, :, ::1], float64[:, :, ::1]
CALLED: tuple[tuple[Any, tuple[Any, ...]], ...] = (
    (first_event, (COUNTS, ROWS, int64, int64, LAYOUT, COUNTS, ROW, float64, int64, ROWS, ROWS)),
    (ends_at_zero, (ROW, int64, int64, float64, int64)),
    (through_event, (ROW, COUNTS, ROWS, TABLES, NUMBERS, none, ROWS, ROW)),
)
"""Functions that the loop calls, with the types that it calls them with: what the second process compiles first."""


def load(settling: tuple[Any, ...] | None) -> None:
    """Make the loop callable; ``settling``: what it will be called with."""
    loop: Any = advance
    given = (ROW, COUNTS, ROW, TABLES, NUMBERS, typeof(settling), ROWS)
    with compiling():
        if given in loop.overloads or any(cache_folder().rglob("kernel.advance-*.nbi")):
            loop.compile(given)
            return
        cache_folder().mkdir(parents=True, exist_ok=True)
        with (cache_folder() / "compiling").open("w") as file:
            if not _mine(file, wait=False):
                for function, types in (*CALLED, *(FUNCTIONS[register] for register in (*ALWAYS, A_TRUSTED))):
                    function.compile(types)
                _mine(file, wait=True)
            loop.compile(given)


def _mine(file: IO[str], *, wait: bool) -> bool:
    """Take the turn to compile, which ends when the file is closed; False where another process has it."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
