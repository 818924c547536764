"""Hénon's event integrator: the compiled system, shared by all runs, and the starts of runs.

The signs of the surfaces at a start are decided in double-double with error bounds, otherwise in balls (exactly if all
numbers are rational). Compiled normal velocities decide a start off all surfaces, and on one surface with a clear
crossing or slide; :mod:`henon_ref.modes.selection` decides every other start.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from typing import Any, cast

import numpy as np
import sympy as sp
from flint import arb

from henon_ref.errors import ModelError
from henon_ref.integrator.constants import ModeConstants, ParameterPrograms
from henon_ref.integrator.mode_table import ModeTable
from henon_ref.integrator.pairs import Pair, exact_expression, pair_of_exact
from henon_ref.integrator.records import CHUNK, STATE_PLACE, Workspace, written
from henon_ref.kernel.library import doubles, ffi, integers, kernel
from henon_ref.modes.arithmetic import time_unit
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.problem import Problem
from henon_ref.modes.resets import REMAINING
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import working_precision
from henon_ref.trajectory import Trajectory

NO_LIMIT = 1 << 62
"""Limit on steps that no run reaches."""
RUN_ERROR = 100
"""Error of the end of a run, in local errors of a step: a start this far off a surface of its given mode is on it."""
MOST_STEPS = 100_000_000
"""Default limit on the steps of a run."""


def local_error(rtol: float) -> float:
    """Return the local error of a step for a tolerance."""
    return max(0.1 * rtol, 2e-16)  # below this rounding dominates


def order_for(tolerance: float) -> int:
    """Return the order of the Taylor method for a tolerance, 4 to 24: 1 - 0.75 ln(tolerance).

    Jorba and Zou (2005) use 1 - ln(tolerance) / 2, which is optimal if the cost of a step grows as order^2. Here a step
    has other costs (events, sines), and the cost of a coefficient grows more slowly: at a tolerance of 1e-13 the longer
    runs of the shipped cases are fastest at orders 20 to 24, within a few percent; runs of a few steps are fastest at
    lower orders, and beyond 26 most runs take longer.
    """
    return min(max(math.ceil(1 - 0.75 * math.log(tolerance)), 4), 24)


def out_of_steps(steps: int, time: float) -> str:
    """Return the reason of a run that ends at its limit on steps."""
    return f"stopped after {steps} step{'' if steps == 1 else 's'}, as many as max_steps allows, at t = {time:.17g}"


@dataclass(eq=False)
class Start:
    """Start and horizon of a problem, as the compiled loop reads them."""

    time: Pair
    """Initial time [s]."""
    until: Pair
    """Horizon [s]."""
    x: tuple[Pair, ...]
    """Initial state."""
    refused: Trajectory | None
    """Result of every run if no initial mode exists; None if one exists."""
    constants: ModeConstants
    """Constants of the compiled modes at the problem's parameter values."""
    block: bytearray
    """First part of a run's block of memory, up to ``end_of_state`` of ``struct places``."""

    def __post_init__(self) -> None:
        self.scalars = ffi.from_buffer("struct run *", self.block)
        """The block as ``struct run *``; a change of a field applies to all later runs."""


@lru_cache(maxsize=64)
def run_template(
    sizes: tuple[int, ...],
    tolerance: float,
    landing: int = kernel.HENON,
    stop_falling: int = 0,
    stop_rising: int = 0,
    most_steps: int = MOST_STEPS,
    stepping: int = kernel.ALONE,
) -> Any:
    """Return a :attr:`Start.block`, in doubles, without numbers and mode.

    ``sizes``: :attr:`ModeTable.sizes`; ``tolerance``: local error of a step, relative to the size of each state and
    guard on the step; ``landing``: HENON, NEWTON or BRENT of ``kernel.h``; ``stop_falling``, ``stop_rising``: surfaces,
    a bit each (1 << index), on which the run ends if their expression falls (rises) to zero; ``most_steps``: steps
    after which the run ends with status ``failed``; ``stepping``: ALONE or TOGETHER.
    """
    state = np.zeros(kernel.places_of(*sizes).end_of_state)
    run = ffi.cast("struct run *", doubles(state))
    run.states, run.guards, run.order, run.contacts, run.constants = sizes
    state[len(state) - run.guards :] = np.inf
    run.event_time, run.tolerance, run.method = -np.inf, tolerance, landing
    run.rest_part, run.more_digits, run.stepped_mode, run.transition_capacity = REMAINING, 1, -1, CHUNK
    run.stop_falling, run.stop_rising, run.most_steps, run.stepping = stop_falling, stop_rising, most_steps, stepping
    return doubles(state)


class Integrator:
    """Compiled system for runs at one order of the Taylor method, from any thread.

    A run is ``run_to_horizon(integrator, integrator.begin(values, initial, ...))``;
    :class:`henon_ref.integrator.points.PointRuns` does many runs in one call. Modes are compiled on first use. The
    library keeps one integrator per system and order.

    The system has values of its parameters, or none: then runs may have any values. (The modes are then derived for all
    values; surfaces that coincide for some values are still two surfaces.)
    """

    def __init__(self, system: FilippovSystem, order: int) -> None:
        self.system = system
        self.order = order
        self.mode_table = ModeTable(system, order)
        self.programs = ParameterPrograms(self.mode_table)
        self.constants = lru_cache(maxsize=64)(self._constants)
        """Constants of the compiled modes at values of :attr:`parameters`."""
        self.steps_of_points = 0
        """Number of steps of :class:`henon_ref.integrator.points.PointRuns` in compiled code."""
        self.free: list[Workspace] = []
        """Unused memory for runs: see :meth:`workspace`."""

    def workspace(self) -> Workspace:
        """Return memory for a run, which is appended to :attr:`free` afterwards; allocating it costs a short run.

        (``pop`` and ``append`` of a list are atomic.)
        """
        try:
            return self.free.pop()
        except IndexError:
            program = self.programs.start.alone
            return Workspace.of(self.mode_table.sizes, program.room if program else 0)

    @property
    def parameters(self) -> tuple[sp.Symbol, ...]:
        """Parameters in the system's expressions, by name: the order of the values of :meth:`begin`."""
        return self.programs.parameters

    def _constants(self, values: tuple[Any, ...]) -> ModeConstants:
        own, exact = self.system.parameters, list(map(exact_expression, values))
        if own and exact != [own[symbol] for symbol in self.parameters]:
            raise ModelError("an integrator of a system with values of its parameters runs that system alone")
        return ModeConstants(self.programs, tuple(chain.from_iterable(map(pair_of_exact, values))), lambda: exact)

    def start(self, problem: Problem, **settings: Any) -> Start:
        """Return the start of a problem of this system, which has exact values of all parameters."""
        values = tuple(problem.system.parameters[symbol] for symbol in self.parameters)
        given = {"start": problem.start, "until": problem.until, "mode": problem.initial_mode}
        return self.begin(values, problem.initial, **given, **settings)

    def begin(
        self,
        values: tuple[Any, ...],
        initial: Sequence[Any],
        *,
        start: Any = 0.0,
        until: Any,
        mode: Mapping[int, int] | None = None,
        held: Sequence[int] = (),
        **settings: Any,
    ) -> Start:
        """Return the start of a run, in microseconds if it is clearly off every surface.

        Numbers are int, Fraction, exact SymPy numbers, or float (the decimal number that Python prints for it):
        ``values`` of :attr:`parameters`, in their order, the state at the start ``initial``, shape (n,), the initial
        time ``start`` and the horizon ``until`` [s]. ``mode``: surface -> -1, 0 or +1, for a start on a surface from
        which several motions are possible. ``held``: surfaces that held before; the state counts as on them if it is
        off them by no more than an error (:data:`RUN_ERROR`). ``settings``: ``tolerance``, ``landing`` and others of
        :func:`run_template`.

        ModelError if the system has other values of its parameters, or no program evaluates an expression in them.
        """
        numbers = tuple(map(pair_of_exact, (until, start, *initial)))
        template, point = run_template(self.mode_table.sizes, **settings), (start, *initial)
        exact = lambda: list(map(exact_expression, point))  # noqa: E731
        return self.begin_at(self.constants(values), template, numbers, exact, mode or {}, held)

    def begin_at(
        self,
        constants: ModeConstants,
        template: Any,
        numbers: tuple[Pair, ...],
        exact: Callable[[], Sequence[Any]],
        mode: Mapping[int, int],
        held: Sequence[int] = (),
    ) -> Start:
        """Return the start of a run from pairs of doubles.

        ``template``: as :func:`run_template` returns it; ``numbers``: horizon, initial time and states; ``exact``:
        returns time and states as exact numbers, of Python or SymPy, if pairs do not decide a sign; ``mode`` and
        ``held``: as in :meth:`begin`.
        """
        workspace = self.workspace()
        signs = constants.start(workspace, template, numbers)
        off = tuple([i for i in held if not signs or signs[i] != 0])
        clear = signs is None and not mode and not off
        refused = None if clear else _entered(constants, workspace, signs or (), exact, mode, off)
        found = Start(numbers[1], numbers[0], numbers[2:], refused, constants, bytearray(workspace.memory))
        self.free.append(workspace)
        return found


def row_at_start(table: ModeTable, signs: Sequence[int]) -> tuple[int, int] | None:
    """Return the row of a start's mode and the surface that it lies on (-1: none); None if Python must decide the mode.

    On a surface this is the row of the mode below it, and all modes that may follow are compiled. For contacts that do
    not act on each other it is the number of the mode. ``signs``: of the surfaces, then of the ``valid`` expressions.
    """
    count = len(table.system.surfaces)
    mode = tuple(signs[:count])
    on = [i for i, sign in enumerate(mode) if sign == 0]
    if kernel.UNCLEAR_SIGN in mode or len(on) > 1 or any(sign != 1 for sign in signs[count:]):
        return None
    if on and (table.system.overrides or on[0] in table.system.resets):
        return None
    rows = [table.row(replaced(mode, i, entry)) for i in on for entry in (-1, 0, 1)]
    row = rows[0] if on else table.row(mode)
    return None if row is None else (row, on[0] if on else -1)


def _entered(
    constants: ModeConstants,
    workspace: Workspace,
    signs: Sequence[int],
    exact: Callable[[], Sequence[Any]],
    given: Mapping[int, int],
    held: tuple[int, ...],
) -> Trajectory | None:
    """Put a run into its initial mode; if no mode exists, return the result of every run.

    ``signs``: see :func:`row_at_start`; ``exact``, ``given``: of :meth:`Integrator.begin_at`; ``held``: surfaces that
    held before and on which the start is not.
    """
    if not given and not held and _entered_clearly(constants, workspace, signs):
        return None
    exact_signs = constants.exact_signs(exact())
    if held:
        from henon_ref.modes.end_of_run import held_signs  # rarely needed

        at = constants.in_doubles.at(workspace.run.time, _state(constants, workspace))
        exact_signs = held_signs(at, exact_signs, held, RUN_ERROR * workspace.run.tolerance)
    if not given and _entered_clearly(constants, workspace, exact_signs):
        return None
    return _decided(constants, workspace, exact_signs, given)


def _entered_clearly(constants: ModeConstants, workspace: Workspace, signs: Sequence[int | None]) -> bool:
    """Put a run into a mode off all surfaces, or on one with a clear crossing or slide; False for other starts."""
    found = None if None in signs else row_at_start(constants.table, cast(Sequence[int], signs))
    return found is not None and _enter(constants, workspace, *found)


def _enter(constants: ModeConstants, workspace: Workspace, row: int, surface: int) -> bool:
    """Put a run into a mode (``enter_at_start`` of ``kernel/start.c``); False if the next mode is not clear."""
    contacts = constants.table.contacts
    mode = integers(written(row, contacts) if contacts else np.array([row]))
    return bool(kernel.enter_at_start(workspace.run, constants.update().tables, mode, surface))


def _state(constants: ModeConstants, workspace: Workspace) -> tuple[float, ...]:
    return tuple(workspace.state[STATE_PLACE : STATE_PLACE + len(constants.table.system.states)].tolist())


def _decided(
    constants: ModeConstants,
    workspace: Workspace,
    signs: Sequence[int | None],
    given: Mapping[int, int],
) -> Trajectory | None:
    """Put a run into the mode that the fields and their derivatives select, as :func:`_entered`."""
    table, t = constants.table, workspace.run.time
    states, surfaces, x = len(table.system.states), len(table.system.surfaces), _state(constants, workspace)
    unit, part = time_unit(workspace.run.horizon - t), RUN_ERROR * workspace.run.tolerance
    found = constants.start_mode(t, x, tuple(signs), tuple(given.items()), part, unit)
    row = None if found.mode is None else table.row(found.mode)
    if found.mode is None or row is None:
        reason = found.reason or "the mode at the start has no equations"
        return Trajectory(found.status, (), t, x, (0,) * surfaces, reason)
    _enter(constants, workspace, row, -1)
    if found.orders:
        first = STATE_PLACE + 3 * states
        zeros = [found.orders[place] if place >= 0 else 0 for place in table.places(found.mode)]
        workspace.state[first : first + len(zeros)].view(np.int64)[:] = zeros
    for surface in found.still:
        _record_rounding(constants, workspace, found.mode, surface)
    resting = tuple(i for i, entry in given.items() if entry == found.mode[i] == 0 and table.system.rests(i))
    if resting:
        _put_at_rest(constants, workspace, found.mode, resting)
    return None


def _put_at_rest(constants: ModeConstants, workspace: Workspace, mode: Mode, surfaces: tuple[int, ...]) -> None:
    """Make the speeds zero of bodies that rest on surfaces in a given mode; they are errors of a run at most."""
    from henon_ref.integrator.multiprecision_roots import BITS
    from henon_ref.integrator.precise_modes import split  # rarely needed
    from henon_ref.modes.cascade import Cascade

    run, states = workspace.run, len(constants.table.system.states)
    pairs = workspace.state[STATE_PLACE : STATE_PLACE + 2 * states].reshape(2, -1)
    with working_precision(BITS):
        t, x = arb(run.time) + arb(run.time_low), [arb(high) + arb(low) for high, low in pairs.T.tolist()]
        still = Cascade(constants.table.system, constants.precise, mode, t).at_rest(x, surfaces).state
        found = [split(value) for value in still]
    if found != list(map(tuple, pairs.T.tolist())):
        pairs[:] = np.transpose(found)
        run.more_digits = 0  # the state is not that of the start


def _record_rounding(constants: ModeConstants, workspace: Workspace, mode: Mode, index: int) -> None:
    """Record that a surface on which a run starts is below its rounding, if its function is zero along the motion.

    A function that no rounding of the states changes (x at x = 0) is left out.
    """
    from henon_ref.integrator.multiprecision_roots import BITS  # rarely needed
    from henon_ref.modes.consistency import stays

    run, system = workspace.run, constants.table.system
    high, low = workspace.state[STATE_PLACE : STATE_PLACE + 2 * len(system.states)].reshape(2, -1).tolist()
    rounded = {symbol for symbol, x in zip(system.states, high, strict=True) if x}
    if rounded.isdisjoint(system.surfaces[index].free_symbols):
        return
    with working_precision(BITS):
        state = [arb(x) + arb(rest) for x, rest in zip(high, low, strict=True)]
        if stays(constants.precise.in_balls.at(arb(run.time) + arb(run.time_low), state), mode, index):
            workspace.since[kernel.rounding_place(False, index, len(workspace.since))] = run.time
            run.below_rounding += 1
