"""Where a run starts, and what it is to do, as the compiled loop takes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from struct import Struct

import numpy as np
from numpy.typing import NDArray

from henon_ref.henon.mode_constants import ModeConstants
from henon_ref.henon.state import LAST_STEPS, RUN_VIEW, STATE_PLACE
from henon_ref.henon.workspace import CHUNK
from henon_ref.trajectory import Trajectory


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

    @cached_property
    def unpacked(self) -> Callable[..., tuple[float, ...]]:
        """Doubles of a state from their place in an array: half the time of a slice and its list."""
        return Struct(f"{len(self.x)}d").unpack_from

    @cached_property
    def state(self) -> NDArray[np.float64]:
        """What a run begins with (see :func:`henon_ref.henon.loop.advance`). Each run copies it to its workspace."""
        high, low = zip(*self.x, strict=True)
        state = np.array([0.0] * STATE_PLACE + [*high, *low])
        run = state[:LAST_STEPS].view(RUN_VIEW)[0]
        run.time, run.time_low = self.time
        run.horizon, run.horizon_low = self.until
        run.event_time, run.tolerance = -np.inf, self.tolerance
        run.unit = max((self.until[0] - self.time[0]) + (self.until[1] - self.time[1]), 1e-280)
        run.mode, run.transition_capacity = self.row, CHUNK
        run.states, run.guards = len(self.x), len(self.zeros)
        run.order, run.method = self.order, self.landing
        run.stop_falling, run.stop_rising = self.stop_falling, self.stop_rising
        zeros = np.array([*self.zeros, *(0 for _ in self.zeros)], dtype=np.int64)
        return np.concatenate([state, zeros.view(np.float64)])
