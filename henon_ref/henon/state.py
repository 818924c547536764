"""A run's state, which the compiled loop and Python share: codes, places in its array, and the memory it works on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from struct import Struct

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from henon_ref.jit.ir_writer import row_length
from henon_ref.jit.njit import inner
from henon_ref.jit.views import rest_of, row_at, rows_of
from henon_ref.roots.double import DEPTH
from henon_ref.trajectory import Trajectory

# Why the loop came back.
(
    HORIZON,
    SELECT_MODE,
    BLOCK_FULL,
    DIVERGED,
    STALLED,
    BUDGET_SPENT,
    LEFT_DOMAIN,
    EVENTS_ACCUMULATE,
    UNDECIDED_EVENT,
    MODE_NOT_COMPILED,
) = range(10)
# Between its own parts: an event is to be gone through, or there is nothing to say.
EVENT, ON = 10, 11
# Kinds of guards.
SURFACE, RELEASE, VALID = 0, 1, 2
# Kinds of transitions.
STICK, RELEASED, CROSSING, GRAZE = range(4)
# Ways of landing.
HENON, NEWTON, BRENT, BRACKET = range(4)
LANDINGS = ("henon", "newton", "brent", "bracket")
# Floats of a run: t and what rounding it lost, unit, time of the last event and what it lost; where on the step an
# undecided event is, and the step's end, both counted from its start; the longest step that a mode just entered, or one
# with branch points, may begin with; horizon and what rounding it lost; tolerance.
(
    F_TIME,
    F_TIME_LOW,
    F_UNIT,
    F_EVENT_TIME,
    F_EVENT_TIME_LOW,
    F_SUSPECT,
    F_STEP_LENGTH,
    F_LONGEST_STEP,
    F_HORIZON,
    F_HORIZON_LOW,
    F_TOLERANCE,
    F_SIZE,
) = range(12)
REMEMBERED_STEPS = 64
"""Modes of which the last step is kept, in the floats behind those above: a mode seen before begins with it."""
F_STATE = F_SIZE + REMEMBERED_STEPS
"""Where the state stands, followed by what rounding it lost."""
# Integers of a run: mode; counts; last guard hit and its landing; steps that time cannot tell apart, events that it
# cannot tell apart; next sample; mode of the last step; kind of the event that leads to a mode not known yet; order;
# method of landing; transitions that a block of memory holds; address of the work space; states, and guards of the
# largest mode.
(
    I_MODE,
    I_STEPS,
    I_EXPANSIONS,
    I_GUARD_EVALUATIONS,
    I_TRANSITIONS,
    I_GUARD,
    I_LANDING,
    I_STALLED,
    I_EVENTS_AT_ONCE,
    I_NEXT_SAMPLE,
    I_STEPPED_MODE,
    I_PENDING_KIND,
    I_ORDER,
    I_METHOD,
    I_TRANSITION_CAPACITY,
    I_WORKSPACE,
    I_STATES,
    I_GUARDS,
    I_SIZE,
) = range(19)
# Behind them, an integer a guard each: known zeros at the present point (the surface just left), which are divided
# out; 1 for a guard that is at zero.

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
    def behind(self) -> int:
        """Bytes of the state that are doubles; integers follow."""
        return 8 * (F_STATE + 2 * len(self.x))

    @cached_property
    def state(self) -> NDArray[np.float64]:
        """What a run begins with (see :func:`henon_ref.henon.loop.advance`). Each run copies it."""
        high, low = zip(*self.x, strict=True)
        floats = np.array([0.0] * F_STATE + [*high, *low])
        floats[F_TIME], floats[F_TIME_LOW] = self.time
        floats[F_HORIZON], floats[F_HORIZON_LOW] = self.until
        floats[F_EVENT_TIME], floats[F_TOLERANCE] = -np.inf, self.tolerance
        floats[F_UNIT] = max((self.until[0] - self.time[0]) + (self.until[1] - self.time[1]), 1e-280)
        integers = np.array([0] * I_SIZE + [*self.zeros] + [0] * len(self.zeros))
        integers[I_MODE], integers[I_TRANSITION_CAPACITY] = self.row, CHUNK
        integers[I_STATES], integers[I_GUARDS] = len(self.x), len(self.zeros)
        integers[I_ORDER], integers[I_METHOD] = self.order, self.landing
        integers[I_WORKSPACE] = self.work.ctypes.data
        return np.concatenate([floats, integers.view(np.float64)])


class State:
    """A run's array, and views of its parts. (A run sets these itself: a call costs a tenth of a short run.)"""

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
        return self.floats.item(F_HORIZON), self.floats.item(F_HORIZON_LOW)

    @until.setter
    def until(self, until: tuple[float, float]) -> None:
        self.floats[F_HORIZON], self.floats[F_HORIZON_LOW] = until

    @property
    def x(self) -> NDArray[np.float64]:
        """Present state, shape (n,): a view."""
        return self.floats[F_STATE : F_STATE + len(self.start.x)]

    @property
    def x_low(self) -> NDArray[np.float64]:
        """What rounding it lost: a view; whoever changes ``x`` sets it to 0 there."""
        return self.floats[F_STATE + len(self.start.x) :]

    @property
    def known_zeros(self) -> NDArray[np.int64]:
        """Known zeros of each guard at the present point: a view."""
        return self.integers[I_SIZE : I_SIZE + len(self.start.zeros)]

    @property
    def hits(self) -> NDArray[np.int64]:
        """1 for each guard that is at zero: a view."""
        return self.integers[I_SIZE + len(self.start.zeros) :]

    @property
    def time(self) -> float:
        """Present time [s], rounded to double."""
        return self.floats.item(F_TIME)


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
        Taylor coefficients of states and guards in units of unit, then the norms of the last ones; the same at the
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
