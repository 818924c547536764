"""What the compiled loop and Python share, as ``henon_ref/kernel/kernel.h`` describes it.

Records and the numbers in their fields, and the memory that a run works on: its block, which the loop is handed (where
its parts stand says ``struct places``), with views of the parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.kernel.shared import doubles, ffi, kernel, record_dtype

STICK: int = kernel.STICK
RELEASED: int = kernel.RELEASED
CROSSING: int = kernel.CROSSING
GRAZE: int = kernel.GRAZE
RESET: int = kernel.RESET
"""Kinds of transitions."""
HENON: int = kernel.HENON
NEWTON: int = kernel.NEWTON
BRENT: int = kernel.BRENT
"""Ways of landing."""
LANDINGS = ("henon", "newton", "brent", "bracket")
"""Their names, and that of bisection, which they fall back on."""
MODE, GUARD = record_dtype("mode"), record_dtype("guard")
"""A compiled mode, and a guard of it."""
TRANSITION = record_dtype("transition")
"""A transition; behind it in memory stands the state, n doubles (see :func:`transition_dtype`)."""
TRANSITION_PLACES = TRANSITION.itemsize // 8
"""Its length in doubles."""
STEP = record_dtype("step")
"""A step that was taken; behind it in memory stand the states' Taylor coefficients (see :func:`step_dtype`)."""
STEP_PLACES = STEP.itemsize // 8
"""Its length in doubles."""
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


def mode_dtype(guards: int) -> np.dtype[Any]:
    """A mode with its guards, as one row of a table; ``guards``: of the largest mode."""
    return np.dtype([("mode", MODE), ("guards", GUARD, (guards,))])


def transition_dtype(states: int) -> np.dtype[Any]:
    """A transition with its state."""
    return _followed(TRANSITION, "state", (states,))


def step_dtype(states: int, order: int) -> np.dtype[Any]:
    """A step with the states' coefficients: x_i(time + tau unit) = sum over k of coefficients[i, k] tau^k."""
    return _followed(STEP, "coefficients", (states, order + 1))


def _followed(record: np.dtype[Any], name: str, shape: tuple[int, ...]) -> np.dtype[Any]:
    """A record and the doubles that stand behind it."""
    assert record.names is not None
    return np.dtype([*((field, record[field]) for field in record.names), (name, "f8", shape)], align=True)


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
    """A view: transitions, shape (CHUNK, TRANSITION_PLACES + n), each :data:`TRANSITION` and a
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
