"""A run's block as Python sees it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from henon_ref.integrator.entries import read, words_of, written
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.records import STATE_PLACE, Workspace
from henon_ref.integrator.start import Start
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode


class State:
    """A run's block, and views of its parts. (A run sets these itself: a call costs a tenth of a short run.)"""

    __slots__ = ("integrator", "start", "state", "workspace")

    integrator: Integrator
    start: Start
    workspace: Workspace
    """The run's own as long as it lives."""
    state: NDArray[np.float64]
    """A copy of the start's, in the run's own workspace."""

    @property
    def scalars(self) -> Any:
        """``struct run`` of the kernel's header, at the begin of the block."""
        return self.workspace.run

    @property
    def guards(self) -> tuple[Guard, ...]:
        """Guards of the present mode, in the order of its row."""
        return self.integrator.mode_table.guards(self.mode)

    @property
    def mode(self) -> Mode:
        """Present mode."""
        return self.integrator.mode_table.mode(self.row)

    @property
    def row(self) -> int:
        """Its row, or number (:meth:`henon_ref.integrator.mode_table.ModeTable.row`)."""
        return read(self._entries) if self.integrator.mode_table.contacts else int(self.scalars.mode)

    @row.setter
    def row(self, row: int) -> None:
        if not self.integrator.mode_table.contacts:
            self.scalars.mode = row
        elif row != self.row:
            self._entries[:] = written(row, self.integrator.mode_table.contacts)
            self.scalars.stepped_mode = -1  # the loop looks which mode it is

    @property
    def _entries(self) -> NDArray[np.int64]:
        """Words of the mode's entries, where it is no row: a view."""
        last = len(self.state) - len(self.start.zeros)
        return self.state[last - words_of(self.integrator.mode_table.contacts) : last].view(np.int64)

    @property
    def _integers(self) -> NDArray[np.int64]:
        return self.state[STATE_PLACE + 3 * len(self.start.x) :].view(np.int64)

    @property
    def until(self) -> tuple[float, float]:
        """Horizon [s] and what rounding it lost; a later one may be set to go on from where the run stands."""
        return float(self.scalars.horizon), float(self.scalars.horizon_low)

    @until.setter
    def until(self, until: tuple[float, float]) -> None:
        self.scalars.horizon, self.scalars.horizon_low = until

    @property
    def x(self) -> NDArray[np.float64]:
        """Present state, shape (n,): a view."""
        return self.state[STATE_PLACE : STATE_PLACE + len(self.start.x)]

    @property
    def x_low(self) -> NDArray[np.float64]:
        """What rounding it lost: a view; whoever changes ``x`` sets it to 0 there."""
        return self.state[STATE_PLACE + len(self.start.x) : STATE_PLACE + 2 * len(self.start.x)]

    @property
    def before_jump(self) -> NDArray[np.float64]:
        """State before the last jump, shape (n,): a view."""
        n = len(self.start.x)
        return self.state[STATE_PLACE + 2 * n : STATE_PLACE + 3 * n]

    @property
    def known_zeros(self) -> NDArray[np.int64]:
        """Known zeros of each guard at the present point: a view."""
        return self._integers[: len(self.start.zeros)]

    @property
    def hits(self) -> NDArray[np.int64]:
        """1 for each guard that is at zero: a view."""
        return self._integers[len(self.start.zeros) :]

    @property
    def since(self) -> NDArray[np.float64]:
        """Since when each guard has been below its rounding [s] (``rounding_place`` of the kernel)."""
        return self.state[len(self.state) - len(self.start.zeros) :]

    @property
    def time(self) -> float:
        """Present time [s], rounded to double."""
        return float(self.scalars.time)
