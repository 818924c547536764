"""The array that a run is: how it starts, and what of it Python reads and sets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from struct import Struct

import numpy as np
from numpy.typing import NDArray

from henon_ref.henon import registers as k
from henon_ref.trajectory import Trajectory

CHUNK = 1024
"""Transitions kept in one block of memory."""


@dataclass(frozen=True, eq=False)
class Start:
    """A problem's start and horizon as the compiled loop takes them."""

    time: tuple[float, float]
    """Initial time and what rounding it lost."""
    until: tuple[float, float]
    """Horizon and what rounding it lost."""
    x: tuple[tuple[float, float], ...]
    """Initial state and what rounding it lost."""
    refused: Trajectory | None
    """What every run comes to where there is no mode to begin with; None where there is one."""
    row: int
    """Row of the mode at the start in the compiled tables."""
    zeros: tuple[int, ...]
    """Known zeros of the guards, as many as the largest mode has: surfaces that the start lies on."""
    order: int
    """Order of the Taylor method."""
    tolerance: float
    """Local error of a step, relative to the size of each state and guard on the step."""
    landing: int
    """HENON, NEWTON or BRENT of :mod:`henon_ref.henon.registers`."""
    work: NDArray[np.float64]
    """Work space, the engine's own: the state holds its address only."""

    @cached_property
    def unpacked(self) -> Callable[..., tuple[float, ...]]:
        """Doubles of a state from their place in an array: half the time of a slice and its list."""
        return Struct(f"{len(self.x)}d").unpack_from

    @cached_property
    def behind(self) -> int:
        """Bytes of the state that are doubles; integers follow."""
        return 8 * (k.F_STATE + 2 * len(self.x))

    @cached_property
    def state(self) -> NDArray[np.float64]:
        """What a run begins with (see :func:`henon_ref.henon.kernel.advance`). Each run copies it."""
        high, low = zip(*self.x, strict=True)
        floats = np.array([0.0] * k.F_STATE + [*high, *low])
        floats[k.F_TIME], floats[k.F_LOW] = self.time
        floats[k.F_UNTIL], floats[k.F_UNTIL_LOW] = self.until
        floats[k.F_LAST], floats[k.F_TOLERANCE] = -np.inf, self.tolerance
        floats[k.F_SIGMA] = max((self.until[0] - self.time[0]) + (self.until[1] - self.time[1]), 1e-280)
        integers = np.array([0] * k.I_SIZE + [*self.zeros] + [0] * len(self.zeros))
        integers[k.I_MODE], integers[k.I_BLOCK] = self.row, CHUNK
        integers[k.I_STATES], integers[k.I_GUARDS] = len(self.x), len(self.zeros)
        integers[k.I_ORDER], integers[k.I_METHOD] = self.order, self.landing
        integers[k.I_WORK] = self.work.ctypes.data
        return np.concatenate([floats, integers.view(np.float64)])


class State:
    """A run's array, and views of its parts. (A session sets these itself: a call costs a tenth of a short run.)"""

    __slots__ = ("_parts", "start", "state")

    start: Start
    state: NDArray[np.float64]
    """A copy of the start's, the run's own."""
    _parts: tuple[NDArray[np.float64], NDArray[np.int64]] | None
    """Its doubles and integers; None where nobody has asked for them."""

    def _views(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """The state's doubles and integers. (Made when they are asked for: the shortest runs do without.)"""
        if self._parts is None:
            count = self.start.behind // 8
            self._parts = self.state[:count], self.state[count:].view(np.int64)
        return self._parts

    @property
    def floats(self) -> NDArray[np.float64]:
        """Doubles of the run (F_...), the present state and what rounding it lost: a view."""
        return self._views()[0]

    @property
    def integers(self) -> NDArray[np.int64]:
        """Integers of the run (I_...), known zeros of the guards, and which of them are at zero: a view."""
        return self._views()[1]

    @property
    def until(self) -> tuple[float, float]:
        """Horizon [s] and what rounding it lost; a later one may be set to go on from where the run stands."""
        return self.floats.item(k.F_UNTIL), self.floats.item(k.F_UNTIL_LOW)

    @until.setter
    def until(self, until: tuple[float, float]) -> None:
        self.floats[k.F_UNTIL], self.floats[k.F_UNTIL_LOW] = until

    @property
    def x(self) -> NDArray[np.float64]:
        """Present state, shape (n,): a view."""
        return self.floats[k.F_STATE : k.F_STATE + len(self.start.x)]

    @property
    def x_low(self) -> NDArray[np.float64]:
        """What rounding it lost: a view; whoever changes ``x`` sets it to 0 there."""
        return self.floats[k.F_STATE + len(self.start.x) :]

    @property
    def multiplicity(self) -> NDArray[np.int64]:
        """Known zeros of each guard at the present point: a view."""
        return self.integers[k.I_SIZE : k.I_SIZE + len(self.start.zeros)]

    @property
    def hits(self) -> NDArray[np.int64]:
        """1 for each guard that is at zero: a view."""
        return self.integers[k.I_SIZE + len(self.start.zeros) :]

    @property
    def time(self) -> float:
        """Present time [s], rounded to double."""
        return self.floats.item(k.F_TIME)
