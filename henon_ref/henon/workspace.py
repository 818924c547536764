"""The memory that a run works on: its block, which the compiled loop is handed, and views of the block's parts.

Where the parts stand says ``struct places`` of ``henon_ref/kernel/kernel.h``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.kernel.shared import doubles, ffi, kernel, record_dtype

CHUNK: int = kernel.CHUNK
"""Transitions kept in one block of memory."""
RUN = record_dtype("run")
"""A run's scalars, the same for every system; the vectors stand behind them."""
RUN_VIEW = np.dtype((np.record, RUN))
"""What Python sees the scalars as."""
LAST_STEPS = RUN.itemsize // 8
"""Where, in doubles, the last steps stand in the block."""
STATE_PLACE: int = kernel.places_of(0, 0, 0, 0, 0).state
"""Where the state stands, followed by what rounding it lost, and by the state before the last jump."""


@lru_cache(maxsize=64)
def places(states: int, guards: int, order: int, contacts: int = 0, constants: int = 0) -> Any:
    """Where the parts of a block stand: of so many states, and guards of the largest mode.

    ``contacts``, ``constants``: where modes are entries of contacts, how many these are, and a mode's constants.
    """
    return kernel.places_of(states, guards, order, contacts, constants)


@dataclass(frozen=True, eq=False)
class Workspace:
    """Memory of one run at a time."""

    block: NDArray[np.float64]
    """All of it."""
    run: Any
    """The same as the compiled loop takes it: a pointer."""
    state: NDArray[np.float64]
    """A view: the run's scalars and vectors."""
    memory: memoryview
    """The same as bytes are packed into it."""
    band: NDArray[np.float64]
    """A view: coefficients of the last expansion, a row a state, then a guard."""
    transitions: NDArray[np.float64]
    """A view: transitions, shape (CHUNK, TRANSITION_PLACES + n), each :data:`henon_ref.henon.records.TRANSITION` and a
    state, and behind it with contacts the words of the mode before and after. (An array of records is copied field by
    field: as long as half of a short run.)"""

    @classmethod
    def of(cls, *sizes: int) -> Workspace:
        """For systems of some :func:`places`.

        Parts of an unused one may be used at once: they are zero where the loop takes that for granted.
        """
        own = places(*sizes)
        block = np.zeros(own.size + kernel.ALIGNMENT)
        first = -(block.ctypes.data // 8) % kernel.ALIGNMENT
        block = block[first : first + own.size]
        return cls(
            block,
            ffi.cast("struct run *", doubles(block)),
            block[: own.end_of_state],
            block[: own.end_of_state].data,
            block[own.band : own.room].reshape(-1, own.width),
            block[own.records :].reshape(CHUNK, -1),
        )


class WorkspacePool:
    """Workspaces that runs of one integrator take and give back, from any thread.

    Making one takes as long as a short run. To take one is ``free.pop()``, to give it back ``free.append``: one
    operation on a list each, which is a thread's alone.

    Parameters
    ----------
    sizes : int
        See :func:`places`.

    Attributes
    ----------
    free : list of Workspace
        Those that nobody has.
    """

    def __init__(self, *sizes: int) -> None:
        self._sizes = sizes
        self.free: list[Workspace] = []

    def new(self) -> Workspace:
        """One more, where none is free."""
        return Workspace.of(*self._sizes)
