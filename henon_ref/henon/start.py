"""Where a run starts, and what it is to do, as the compiled loop takes it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from struct import Struct

import numpy as np
from numpy.typing import NDArray

from henon_ref.filippov.resting import REMAINING
from henon_ref.henon.mode_constants import ModeConstants
from henon_ref.henon.workspace import CHUNK, LAST_STEPS, RUN_VIEW, STATE_PLACE, places
from henon_ref.kernel.shared import ffi
from henon_ref.trajectory import Trajectory

NO_LIMIT = 1 << 62
"""More steps than any run takes."""
MOST_STEPS = 100_000_000
"""Steps of a run that has no limit of its own."""
_BEGIN, _HORIZON, _MODE = Struct("4d"), Struct("2d"), Struct("q")
_BEGIN_PLACE, _HORIZON_PLACE, _MODE_PLACE = (ffi.offsetof("struct run", name) for name in ("time", "horizon", "mode"))
"""In bytes; behind the time stand what rounding it lost, unit and begin, behind the horizon what rounding that lost."""


def out_of_steps(steps: int, time: float) -> str:
    """Why a run ends that has taken all steps that it may take."""
    return f"stopped after {steps} steps, as many as max_steps allows, at t = {time:.17g}"


@dataclass(eq=False)  # frozen, it would take a microsecond more
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
    most_steps: int = MOST_STEPS
    """Steps after which the run ends with status ``failed``."""

    kept: NDArray[np.float64] | None = field(default=None, init=False)
    """What :meth:`write` writes, for a start of many runs."""

    def write(self, state: NDArray[np.float64], memory: memoryview) -> None:
        """Write what a run begins with (``struct run`` of ``kernel.h``, then vectors) into an array, and its memory."""
        limits = self.stop_falling, self.stop_rising, self.most_steps
        state[...] = _template(len(self.x), len(self.zeros), self.order, self.landing, self.tolerance, *limits)
        (time, low), until = self.time, self.until
        length = (until[0] - time) + (until[1] - low)
        _BEGIN.pack_into(memory, _BEGIN_PLACE, time, low, length if length > 1e-280 else 1e-280, time)
        _HORIZON.pack_into(memory, _HORIZON_PLACE, *until)
        _MODE.pack_into(memory, _MODE_PLACE, self.row)
        high, rest = zip(*self.x, strict=True)
        doubles_of(2 * len(high)).pack_into(memory, 8 * STATE_PLACE, *high, *rest)
        if any(self.zeros):
            first = STATE_PLACE + 3 * len(high)
            state[first : first + len(self.zeros)].view(np.int64)[:] = self.zeros

    def written(self) -> NDArray[np.float64]:
        """The same as an array of its own."""
        state = np.empty(places(len(self.x), len(self.zeros), self.order).end_of_state)
        self.write(state, state.data)
        return state


@lru_cache(maxsize=64)
def doubles_of(count: int) -> Struct:
    """So many doubles, which it takes from an array in half the time of a slice and its list."""
    return Struct(f"{count}d")


@lru_cache(maxsize=64)
def _template(
    states: int,
    guards: int,
    order: int,
    method: int,
    tolerance: float,
    stop_falling: int,
    stop_rising: int,
    most_steps: int,
) -> NDArray[np.float64]:
    """What is the same for many starts. (To put each field in its place takes several microseconds.)"""
    state = np.zeros(places(states, guards, order).end_of_state)
    state[len(state) - guards :] = np.inf
    run = state[:LAST_STEPS].view(RUN_VIEW)[0]
    run.event_time, run.tolerance, run.order, run.method = -np.inf, tolerance, order, method
    run.rest_part, run.more_digits = REMAINING, 1
    run.stepped_mode, run.transition_capacity, run.states, run.guards = -1, CHUNK, states, guards
    run.stop_falling, run.stop_rising, run.most_steps = stop_falling, stop_rising, most_steps
    return state
