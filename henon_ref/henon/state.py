"""A run's state, which the compiled loop and Python share: codes, places in its array, and the memory it works on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from struct import Struct
from typing import Any

import numpy as np
from numba import from_dtype
from numba.extending import intrinsic, register_jitable
from numpy.typing import NDArray

from henon_ref.jit.ir_writer import row_length
from henon_ref.jit.njit import inner
from henon_ref.jit.views import integers_in, rest_of, row_at, rows_of
from henon_ref.roots.double import DEPTH
from henon_ref.trajectory import Trajectory


class ReturnCode(IntEnum):
    """Why the compiled loop returned. (It returns the value: making the member of it costs some percent of a run.)"""

    HORIZON = 0
    SELECT_MODE = 1
    BLOCK_FULL = 2
    DIVERGED = 3
    STALLED = 4
    BUDGET_SPENT = 5
    LEFT_DOMAIN = 6
    EVENTS_ACCUMULATE = 7
    UNDECIDED_EVENT = 8
    MODE_NOT_COMPILED = 9


# Between its own parts: an event is to be gone through, or there is nothing to say.
EVENT, ON = 10, 11
# Kinds of guards.
SURFACE, RELEASE, VALID = 0, 1, 2
# Kinds of transitions.
STICK, RELEASED, CROSSING, GRAZE = range(4)
# Ways of landing.
HENON, NEWTON, BRENT, BRACKET = range(4)
LANDINGS = ("henon", "newton", "brent", "bracket")
REMEMBERED_STEPS = 64
"""Modes of which the last step is kept: a mode seen before begins with it."""
RUN = np.dtype(
    [
        ("time", "f8"), ("time_low", "f8"),  # s, and what rounding it lost
        ("unit", "f8"),  # s: unit of the expansion
        ("event_time", "f8"), ("event_time_low", "f8"),  # s: last event
        ("suspect", "f8"),  # s: where an undecided event is, from the step's start
        ("step_length", "f8"),  # s: of an undecided step
        ("longest_step", "f8"),  # s: that a mode just entered, or one with branch points, may begin with
        ("horizon", "f8"), ("horizon_low", "f8"),  # s
        ("tolerance", "f8"),  # local error, relative to each row's size on the step
        ("mode", "i8"), ("steps", "i8"), ("expansions", "i8"), ("guard_evaluations", "i8"), ("transitions", "i8"),
        ("guard", "i8"), ("landing", "i8"),  # last guard hit, and its landing
        ("stalled", "i8"),  # steps that time cannot tell apart
        ("events_at_once", "i8"),  # events that it cannot tell apart
        ("next_sample", "i8"),
        ("stepped_mode", "i8"),  # mode of the last step
        ("pending_kind", "i8"),  # of the event that leads to a mode without a row
        ("order", "i8"),
        ("method", "i8"),  # of landing
        ("transition_capacity", "i8"),  # of a block of memory
        ("workspace", "i8"),  # its address
        ("states", "i8"), ("guards", "i8"),  # guards: of the largest mode
    ],
    align=True,
)  # fmt: skip
"""A run's scalars, the same for every system; behind them in one block of doubles: the last step of modes [s], shape
(REMEMBERED_STEPS,); x and what rounding it lost, shape (n,) each; as integers known zeros of each guard at the present
point (the surface just left), which are divided out, and 1 for a guard that is at zero, shape (G,) each."""
RUN_RECORD = from_dtype(RUN)
"""Its type in compiled code."""
LAST_STEPS = RUN.itemsize // 8
"""Where, in doubles, the last steps stand in the block."""
STATE_PLACE = LAST_STEPS + REMEMBERED_STEPS
"""Where the state stands, followed by what rounding it lost."""


@intrinsic
def run_of(typing, row):  # type: ignore[no-untyped-def]
    """The scalars of a run at the begin of its block. (A record array costs 120 ns a call more.)"""

    def codegen(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.bitcast(arguments[0], context.get_value_type(RUN_RECORD))

    return RUN_RECORD(row), codegen


@inner(forceinline=True)
def vectors_of(block, n, most):  # type: ignore[no-untyped-def]
    """Rows behind the scalars: last steps, x, what rounding it lost, known zeros, guards at zero."""
    integers = integers_in(rest_of(block, STATE_PLACE + 2 * n))
    x = rest_of(block, STATE_PLACE)
    return rest_of(block, LAST_STEPS), x, rest_of(x, n), integers, rest_of(integers, most)


# A mode's table: its own row, then a row a guard. T_POLYNOMIAL_DEGREE: degree of the motion where that is a polynomial
# which the expansion holds whole, else 0. T_SLOPES: where the field has branch points, the code of its first
# coefficients alone, else 0.
T_GUARDS, T_EXPANSION, T_STEP_END, T_NORMAL_VELOCITIES, T_BERNSTEIN, T_POLYNOMIAL_DEGREE, T_SLOPES, T_SIZE = range(8)
# Kind, index, whether only its rise counts, whether it has a hold zone, whether it acts on a sliding surface; row of
# the mode after a crossing (or a release) and after a stick, -1 where not known yet. For a release the last is the
# number of zeros that the surface is left with.
G_KIND, G_INDEX, G_RISING, G_HOLD, G_ACTS, G_MODE_ACROSS, G_MODE_STUCK = range(7)
# A transition.
R_TIME, R_TIME_LOW, R_KIND, R_SURFACE, R_FROM, R_TO, R_LANDING, R_STATE = range(8)

NOWHERE = -1
"""In place of the guard last hit: nothing was hit, a guard is at zero where a step begins."""
TANGENT = 1e-9
"""Relative normal velocity below which a contact is left to Python's mode selection."""


_RECORD = np.dtype((np.record, RUN))
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
    """HENON, NEWTON or BRENT of :mod:`henon_ref.henon.state`."""
    work: NDArray[np.float64]
    """Work space, the integrator's own: the state holds its address only."""

    @cached_property
    def unpacked(self) -> Callable[..., tuple[float, ...]]:
        """Doubles of a state from their place in an array: half the time of a slice and its list."""
        return Struct(f"{len(self.x)}d").unpack_from

    @cached_property
    def state(self) -> NDArray[np.float64]:
        """What a run begins with (see :func:`henon_ref.henon.loop.advance`). Each run copies it."""
        high, low = zip(*self.x, strict=True)
        state = np.array([0.0] * STATE_PLACE + [*high, *low])
        run = state[:LAST_STEPS].view(_RECORD)[0]
        run.time, run.time_low = self.time
        run.horizon, run.horizon_low = self.until
        run.event_time, run.tolerance = -np.inf, self.tolerance
        run.unit = max((self.until[0] - self.time[0]) + (self.until[1] - self.time[1]), 1e-280)
        run.mode, run.transition_capacity = self.row, CHUNK
        run.states, run.guards = len(self.x), len(self.zeros)
        run.order, run.method = self.order, self.landing
        run.workspace = self.work.ctypes.data
        zeros = np.array([*self.zeros, *(0 for _ in self.zeros)], dtype=np.int64)
        return np.concatenate([state, zeros.view(np.float64)])


class State:
    """A run's block, and views of its parts. (A run sets these itself: a call costs a tenth of a short run.)"""

    __slots__ = ("_scalars", "start", "state")

    start: Start
    state: NDArray[np.float64]
    """A copy of the start's, the run's own."""
    _scalars: Any
    """None where nobody has asked for them."""

    @property
    def scalars(self) -> Any:
        """Fields of :data:`RUN`: a view. (Made when it is asked for: the shortest runs do without.)"""
        if self._scalars is None:
            self._scalars = self.state[:LAST_STEPS].view(_RECORD)[0]
        return self._scalars

    @property
    def _integers(self) -> NDArray[np.int64]:
        return self.state[STATE_PLACE + 2 * len(self.start.x) :].view(np.int64)

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
    def known_zeros(self) -> NDArray[np.int64]:
        """Known zeros of each guard at the present point: a view."""
        return self._integers[: len(self.start.zeros)]

    @property
    def hits(self) -> NDArray[np.int64]:
        """1 for each guard that is at zero: a view."""
        return self._integers[len(self.start.zeros) :]

    @property
    def time(self) -> float:
        """Present time [s], rounded to double."""
        return float(self.scalars.time)


BANDS = 6 + 2 * DEPTH
"""Rows of the work space that root isolation needs."""


@register_jitable
def work_places(n, most, order):  # type: ignore[no-untyped-def]
    """Of what the loop works on: length of a row of the band, and where the other two parts begin."""
    width = row_length(order)
    room = (2 * (n + most + 1) + BANDS) * width
    return width, room, room + 3 * (n + most)


@inner()
def work_space(address, n, most, order):  # type: ignore[no-untyped-def]
    """Parts of what the loop works on.

    Parameters
    ----------
    address : int
        Where it is in memory.
    n, most, order : int
        States; guards of the largest mode, G; order.

    Returns
    -------
    band : rows, shape (2 (n + G + 1) + BANDS, row length)
        Taylor coefficients of states and guards in the unit, then the norms of the last ones; the same at the
        end of a step that is checked; what isolating roots needs.
    room : row of 3 n + 3 G doubles
        Change of the states over a step and bounds of the guards from below; a state; normal velocities.
    records : rows, shape (transitions kept, R_STATE + n)
        Transitions, a row each.
    """
    width, room, records = work_places(n, most, order)
    work = row_at(address)
    own = rows_of(rest_of(work, records), R_STATE + n)
    return rows_of(work, width), rest_of(work, room), own
