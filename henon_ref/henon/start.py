"""Where a run starts, and what it is to do, as the compiled loop takes it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from struct import Struct

import numpy as np
from numpy.typing import NDArray

from henon_ref.henon.mode_constants import ModeConstants
from henon_ref.henon.state import RUN, STATE_PLACE, state_places
from henon_ref.henon.workspace import CHUNK
from henon_ref.trajectory import Trajectory

NO_LIMIT = 1 << 62
"""More steps than any run takes."""
_NOTHING = dict.fromkeys(RUN.names or (), 0)
_SCALARS = Struct("".join("d" if RUN[name].kind == "f" else "q" for name in _NOTHING))
"""The scalars of a run in memory."""


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
    """HENON, NEWTON or BRENT of :mod:`henon_ref.henon.records`."""
    constants: ModeConstants
    """The compiled modes' constants at the problem's parameter values."""
    stop_falling: int = 0
    """Surfaces, a bit each (1 << index), on which the run ends when they are reached from above, where h > 0."""
    stop_rising: int = 0
    """And from below."""
    most_steps: int = NO_LIMIT
    """Steps after which the run ends with status ``timeout``."""

    @cached_property
    def unpacked(self) -> Callable[..., tuple[float, ...]]:
        """Doubles of a state from their place in an array: half the time of a slice and its list."""
        return Struct(f"{len(self.x)}d").unpack_from

    @cached_property
    def state(self) -> NDArray[np.float64]:
        """What a run begins with (see :func:`henon_ref.henon.loop.advance`). Each run copies it to its workspace."""
        n, guards = len(self.x), len(self.zeros)
        length = (self.until[0] - self.time[0]) + (self.until[1] - self.time[1])
        scalars = {
            **_NOTHING,
            "time": self.time[0], "time_low": self.time[1],
            "horizon": self.until[0], "horizon_low": self.until[1],
            "event_time": -math.inf, "unit": max(length, 1e-280), "tolerance": self.tolerance,
            "mode": self.row, "stepped_mode": -1, "transition_capacity": CHUNK, "states": n, "guards": guards,
            "order": self.order, "method": self.landing,
            "stop_falling": self.stop_falling, "stop_rising": self.stop_rising, "most_steps": self.most_steps,
        }  # fmt: skip
        state = np.zeros(state_places(n, guards))
        _SCALARS.pack_into(state.data, 0, *scalars.values())
        high, low = zip(*self.x, strict=True)
        state[STATE_PLACE : STATE_PLACE + 2 * n] = high + low
        if any(self.zeros):
            state[STATE_PLACE + 2 * n : STATE_PLACE + 2 * n + guards].view(np.int64)[:] = self.zeros
        return state
