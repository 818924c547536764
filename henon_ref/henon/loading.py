"""Compiling the mode loop where it is not on the disk yet: two processes that need it share the work.

The first one to come compiles the loop. Another one meanwhile compiles functions that the loop calls, from the
last on; numba looks on the disk before it compiles a function, so that the first one finds them there. Both then load
what they did not make.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import IO, Any

from numba import float64, int64

from henon_ref.henon.events import first_event
from henon_ref.henon.holding import held
from henon_ref.henon.kernel import advance
from henon_ref.henon.recording import crowded, record, sample
from henon_ref.henon.stepping import polish
from henon_ref.jit import cache_folder, compiling

try:
    import fcntl
except ImportError:  # elsewhere than on Unix every process compiles for itself
    fcntl = None  # type: ignore[assignment]

_ROW, _ROWS = float64[::1], float64[:, ::1]
_COUNTS, _LAYOUT = int64[::1], int64[:, ::1]
CALLED: tuple[tuple[Any, tuple[Any, ...]], ...] = (
    (first_event, (
        _COUNTS, _ROWS, int64, int64, _LAYOUT, _COUNTS, _ROW, float64, int64, _ROWS, _ROWS,
    )),
    (held, (float64, float64, float64, _ROW, int64, _LAYOUT, _ROW, _ROWS, int64)),
    (polish, (_ROW, _COUNTS, _ROW, _ROW, _LAYOUT, _ROW, _ROWS, _ROW, int64, float64, float64)),
    (sample, (_ROW, _COUNTS, _ROWS, int64, float64, int64, _ROWS)),
    (record, (_ROW, _COUNTS, _ROW, _ROWS, int64, int64, int64, int64, int64)),
    (crowded, (_ROW, _COUNTS)),
)  # fmt: skip
"""What the second process compiles: functions that the loop calls, with the types that it calls them with."""


def load(run: Callable[[], object]) -> None:
    """Make the loop callable; ``run`` calls it, with nothing to do."""
    loop: Any = advance
    with compiling():
        if loop.signatures or any(cache_folder().rglob("kernel.advance-*.nbi")):
            run()
            return
        cache_folder().mkdir(parents=True, exist_ok=True)
        with (cache_folder() / "compiling").open("w") as file:
            if not _mine(file, wait=False):
                for function, types in CALLED:
                    function.compile(types)
                _mine(file, wait=True)
            run()


def _mine(file: IO[str], *, wait: bool) -> bool:
    """Take the turn to compile, which ends when the file is closed; False where another process has it."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
