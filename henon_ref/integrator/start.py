"""Where a run starts, in which mode, and what it is to do: in exact terms, then as the compiled loop takes it.

Signs of the surfaces at the start come from double-double with error bounds, else from balls (exactly where all numbers
are rational); the mode off all surfaces, or on one that is left or slid on clearly, from compiled normal
velocities; every other mode from :mod:`henon_ref.modes.selection`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from struct import Struct
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from henon_ref.integrator.constants import ModeConstants
from henon_ref.integrator.mode_table import ModeTable
from henon_ref.integrator.pairs import Pair
from henon_ref.integrator.records import CHUNK, HENON, STATE_PLACE, words_of, written
from henon_ref.kernel.shared import doubles, ffi, kernel
from henon_ref.modes.mode import replaced
from henon_ref.modes.resets import REMAINING
from henon_ref.trajectory import Status, Trajectory

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
    """Row of the mode at the start in the compiled tables, or its number (:meth:`ModeTable.row`)."""
    zeros: tuple[int, ...]
    """Known zeros of the guards, as many as the largest mode has: surfaces that the start lies on."""
    order: int
    """Order of the Taylor method."""
    tolerance: float
    """Local error of a step, relative to the size of each state and guard on the step."""
    constants: ModeConstants
    """The compiled modes' constants at the problem's parameter values."""
    landing: int = HENON
    """HENON, NEWTON or BRENT of :mod:`henon_ref.integrator.records`."""
    stop_falling: int = 0
    """Surfaces, a bit each (1 << index), on which the run ends when they are reached from above, where h > 0."""
    stop_rising: int = 0
    """And from below."""
    most_steps: int = MOST_STEPS
    """Steps after which the run ends with status ``failed``."""

    kept: NDArray[np.float64] | None = field(default=None, init=False)
    """What :meth:`write` writes, of a start of many runs."""

    def write(self, state: NDArray[np.float64], memory: memoryview) -> None:
        """Write what a run begins with (``struct run`` of ``kernel.h``, then vectors) into an array, and its memory."""
        if self.kept is not None:
            state[...] = self.kept
            return
        table, x, zeros = self.constants.table, self.x, self.zeros
        limits = self.stop_falling, self.stop_rising, self.most_steps
        state[...] = _template(len(x), *table.sizes, self.landing, self.tolerance, *limits)
        (time, low), until = self.time, self.until
        length = (until[0] - time) + (until[1] - low)
        _BEGIN.pack_into(memory, _BEGIN_PLACE, time, low, length if length > 1e-280 else 1e-280, time)
        _HORIZON.pack_into(memory, _HORIZON_PLACE, *until)
        if table.contacts:
            last = len(state) - len(zeros)
            state[last - words_of(table.contacts) : last].view(np.int64)[:] = written(self.row, table.contacts)
        else:
            _MODE.pack_into(memory, _MODE_PLACE, self.row)
        high, rest = zip(*x, strict=True)
        doubles_of(2 * len(high)).pack_into(memory, 8 * STATE_PLACE, *high, *rest)
        if any(zeros):
            first = STATE_PLACE + 3 * len(high)
            state[first : first + len(zeros)].view(np.int64)[:] = zeros

    def keep(self) -> NDArray[np.float64]:
        """Write it once for many runs; the array."""
        state = np.empty(kernel.places_of(len(self.x), *self.constants.table.sizes).end_of_state)
        self.write(state, state.data)
        self.kept = state
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
    contacts: int,
    constants: int,
    method: int,
    tolerance: float,
    *limits: int,
) -> NDArray[np.float64]:
    """What is the same for many starts. (To put each field in its place takes several microseconds.)"""
    state = np.zeros(kernel.places_of(states, guards, order, contacts, constants).end_of_state)
    run = ffi.cast("struct run *", doubles(state))
    run.states, run.guards, run.order, run.contacts, run.constants = states, guards, order, contacts, constants
    state[len(state) - run.guards :] = np.inf
    run.event_time, run.tolerance, run.method = -np.inf, tolerance, method
    run.rest_part, run.more_digits, run.stepped_mode, run.transition_capacity = REMAINING, 1, -1, CHUNK
    run.stop_falling, run.stop_rising, run.most_steps = limits
    return state


def begin(
    constants: ModeConstants,
    time: Pair,
    until: Pair,
    x: Sequence[Pair],
    exact: Callable[[], Sequence[Any]],
    mode: Mapping[int, int],
    **settings: Any,
) -> Start:
    """Where a run starts: in microseconds where that is clearly off every surface.

    Parameters
    ----------
    constants : ModeConstants
    time, until : Pair
        Initial time and horizon [s].
    x : sequence of Pair, shape (n,)
    exact : callable
        Time and state as exact numbers, of Python or SymPy, asked for where pairs do not tell a sign.
    mode : mapping
        Surface -> -1, 0 or +1, for a start on a surface that the fields leave open.
    **settings
        ``tolerance``, and what else :class:`Start` is to have.
    """
    t, high, refused = time[0], [v for v, _ in x], None
    found = None if mode else _clearly(constants, constants.signs(time, x), t, high)
    if found is None:
        signs = constants.exact_signs(exact())
        if not mode and None not in signs:
            found = _clearly(constants, cast(list[int], signs), t, high)
        if found is None:
            entered = _entered(constants, signs, t, high, mode)
            refused, found = (entered, (0, constants.no_zeros)) if isinstance(entered, Trajectory) else (None, entered)
    return Start(time, until, tuple(x), refused, *found, constants.table.order, constants=constants, **settings)


def row_at_start(table: ModeTable, signs: Sequence[int]) -> tuple[int, int] | None:
    """Row of a start's mode, and the surface that it is on (-1: none); None where Python has to decide the mode.

    On a surface the row is that of the mode below it; those that may follow are compiled. Of contacts that do not act
    on each other it is the mode's number. ``signs``: of the surfaces, then of the ``valid`` expressions.
    """
    count = len(table.system.surfaces)
    mode = tuple(signs[:count])
    clear = 0 not in signs and kernel.UNCLEAR_SIGN not in signs and -1 not in signs[count:]
    if clear and (known := table.known(mode)) is not None:
        return known, -1
    on = [i for i, sign in enumerate(mode) if sign == 0]
    if kernel.UNCLEAR_SIGN in mode or len(on) > 1 or any(sign != 1 for sign in signs[count:]):
        return None
    if on and (table.system.overrides or on[0] in table.system.resets):
        return None
    rows = [table.row(replaced(mode, i, entry)) for i in on for entry in (-1, 0, 1)]
    row = rows[0] if on else table.row(mode)
    return None if row is None else (row, on[0] if on else -1)


def _clearly(
    constants: ModeConstants, signs: Sequence[int], t: float, x: Sequence[float]
) -> tuple[int, tuple[int, ...]] | None:
    """Row and known zeros of the mode at a start off all surfaces, or on one that is left or slid on clearly.

    ``signs``: see :func:`row_at_start`.
    """
    table, no_zeros = constants.table, constants.no_zeros
    found = row_at_start(table, signs)
    if found is None or found[1] < 0:
        return None if found is None else (found[0], no_zeros)
    if table.contacts:
        return None
    point, speeds = np.array(x, dtype=np.float64), np.empty(len(x) + 2 * len(no_zeros))
    zeros, room = ffi.new("int64_t *"), doubles(speeds)
    tables = constants.update().tables
    row = kernel.mode_on_surface(tables, *found, t, doubles(point), len(x), len(no_zeros), room, zeros)
    if row < 0:
        return None
    guards = table.guards(table.mode(row))
    own = tuple(zeros[0] if g.kind == "surface" and g.index == found[1] else 0 for g in guards)
    return row, own + no_zeros[len(own) :]


def _entered(
    constants: ModeConstants, signs: Sequence[int | None], t: float, x: list[float], given: Mapping[int, int]
) -> Trajectory | tuple[int, tuple[int, ...]]:
    """Row and known zeros of the mode that is decided; what every run comes to where none begins."""
    from henon_ref.modes.selection import contact_orders, mode_by_signs  # most starts have no use for it

    table, system = constants.table, constants.table.system
    count = len(system.surfaces)

    def ended(reason: str, status: Status = "failed") -> Trajectory:
        return Trajectory(status, (), t, tuple(x), (0,) * count, reason)

    known = [1 if sign is None else sign for sign in signs]
    surfaces, valid = known[:count], known[count:]
    at = constants.in_doubles.at(t, x)
    decision = mode_by_signs(at, surfaces, valid, given)
    unused = system.unused_kinks(decision.mode) if None in signs and decision.mode else frozenset[int]()
    for i, sign in enumerate(signs):
        if sign is None and i not in unused:  # a kink in a branch that the mode does not use needs no value
            what = f"the surface of '{system.sign_names[i]}'" if i < count else "an expression of 'valid'"
            return ended(f"{what} has no finite real value at the start")
    if decision.mode is None:
        return ended(decision.reason, decision.ending)
    row = table.row(decision.mode)
    if row is None:
        return ended("the mode at the start has no equations")
    active, edges = ([i for i, sign in enumerate(signs) if sign == 0] for signs in (surfaces, valid))
    own: tuple[int, ...] = ()
    if active or edges:
        orders = contact_orders(at, decision.mode, active, edges)
        own = tuple(orders[place] if place >= 0 else 0 for place in table.places(decision.mode))
    return row, own + constants.no_zeros[len(own) :]
