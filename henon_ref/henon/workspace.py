"""The memory that a run works on: its block, which the compiled loop is handed, and views of the block's parts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from henon_ref.henon.mode_selection import selection_space
from henon_ref.henon.records import TRANSITION_PLACES
from henon_ref.henon.state import REMEMBERED_STEPS, state_places
from henon_ref.jit.ir_writer import row_length
from henon_ref.jit.njit import inner
from henon_ref.jit.views import integers_in, rest_of, rows_of
from henon_ref.roots.double import DEPTH

CHUNK = 1024
"""Transitions kept in one block of memory."""
ALIGNMENT = 8
"""Doubles in a line of the processor's cache: the parts of a block begin with one."""
BANDS = 6 + 2 * DEPTH
"""Rows of the work space that root isolation needs."""


@register_jitable
def work_places(n, most, order):  # type: ignore[no-untyped-def]
    """Where in a block the band, the room and the transitions begin, and length of a row of the band."""
    width = row_length(order)
    band = -(-state_places(n, most) // ALIGNMENT) * ALIGNMENT
    room = band + (2 * (n + most + 1) + BANDS) * width
    return band, room, room + 3 * (n + most) + REMEMBERED_STEPS, width


@inner()
def work_space(block, n, most, order):  # type: ignore[no-untyped-def]
    """Parts of what the loop works on, which stand behind the run's state.

    Parameters
    ----------
    block : row
        The run's.
    n, most, order : int
        States; guards of the largest mode, G; order.

    Returns
    -------
    band : rows, shape (2 (n + G + 1) + BANDS, row length)
        Taylor coefficients of states and guards in the unit, then the norms of the last ones; the same at the
        end of a step that is checked; what isolating roots needs.
    room : row of 3 n + 3 G doubles
        Change of the states over a step and bounds of the guards from below; a state; normal velocities.
    remembered : row of REMEMBERED_STEPS integers
        Modes whose last step the run keeps.
    records : rows, shape (transitions kept, TRANSITION_PLACES + n)
        Transitions, a row each.
    """
    band, room, records, width = work_places(n, most, order)
    own = rows_of(rest_of(block, records), TRANSITION_PLACES + n)
    remembered = integers_in(rest_of(block, records - REMEMBERED_STEPS))
    return rows_of(rest_of(block, band), width), rest_of(block, room), remembered, own


@dataclass(frozen=True, eq=False)
class Workspace:
    """Memory of one run at a time."""

    block: NDArray[np.float64]
    """All of it."""
    state: NDArray[np.float64]
    """A view: the run's scalars and vectors (:mod:`henon_ref.henon.state`)."""
    band: NDArray[np.float64]
    """A view: coefficients of the last expansion (see :func:`work_space`)."""
    transitions: NDArray[np.float64]
    """A view: transitions, shape (CHUNK, TRANSITION_PLACES + n), each :data:`henon_ref.henon.records.TRANSITION` and a
    state. (An array of records is copied field by field: as long as half of a short run.)"""
    selection: tuple[NDArray[Any], ...]
    """Room of :func:`henon_ref.henon.mode_selection.select_mode`."""

    @classmethod
    def of(cls, states: int, guards: int, order: int, surfaces: int) -> Workspace:
        """For systems of so many states and surfaces, with so many guards in the largest mode.

        Parts of an unused one may be used at once: they are zero where the loop takes that for granted.
        """
        band, room, records, width = work_places(states, guards, order)
        size = records + CHUNK * (TRANSITION_PLACES + states)
        block = np.zeros(size + ALIGNMENT)
        first = -(block.ctypes.data // 8) % ALIGNMENT
        block = block[first : first + size]
        return cls(
            block,
            block[: state_places(states, guards)],
            block[band:room].reshape(-1, width),
            block[records:].reshape(CHUNK, -1),
            selection_space(states, surfaces),
        )


class WorkspacePool:
    """Workspaces that runs of one integrator take and give back, from any thread.

    Making one takes as long as a short run. To take one is ``free.pop()``, to give it back ``free.append``: one
    operation on a list each, which is a thread's alone.

    Parameters
    ----------
    states, guards, order, surfaces : int
        See :meth:`Workspace.of`.

    Attributes
    ----------
    free : list of Workspace
        Those that nobody has.
    """

    def __init__(self, states: int, guards: int, order: int, surfaces: int) -> None:
        self._sizes = states, guards, order, surfaces
        self.free: list[Workspace] = []

    def new(self) -> Workspace:
        """One more, where none is free."""
        return Workspace.of(*self._sizes)
