"""Start of a run: its initial mode, its settings, and the block of memory that the compiled loop begins with.

The signs of the surfaces at the start are decided in double-double with error bounds, otherwise in balls (exactly if
all numbers are rational). Compiled normal velocities decide a start off all surfaces, and on one surface with a clear
crossing or slide; :mod:`henon_ref.modes.selection` decides every other start.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, cast

import numpy as np

from henon_ref.integrator.constants import ModeConstants
from henon_ref.integrator.mode_table import ModeTable
from henon_ref.integrator.pairs import Pair
from henon_ref.integrator.records import CHUNK, HENON, STATE_PLACE, Workspace, written
from henon_ref.kernel.shared import doubles, ffi, integers, kernel
from henon_ref.modes.mode import replaced
from henon_ref.modes.resets import REMAINING
from henon_ref.trajectory import Status, Trajectory

NO_LIMIT = 1 << 62
"""Limit on steps that no run reaches."""
MOST_STEPS = 100_000_000
"""Default limit on the steps of a run."""
_RUN = ffi.typeof("struct run *")


def out_of_steps(steps: int, time: float) -> str:
    """Return the reason of a run that ends at its limit on steps."""
    return f"stopped after {steps} step{'' if steps == 1 else 's'}, as many as max_steps allows, at t = {time:.17g}"


class Start:
    """Start and horizon of a problem, as the compiled loop reads them.

    Attributes
    ----------
    time, until : Pair
        Initial time and horizon [s].
    x : tuple of Pair
        Initial state.
    refused : Trajectory or None
        Result of every run if no initial mode exists; None if one exists.
    constants : ModeConstants
        Constants of the compiled modes at the problem's parameter values.
    block : bytearray
        First part of a run's block of memory, up to ``end_of_state`` of ``struct places``.
    scalars : cdata
        The block as ``struct run *``; a change of a field applies to all later runs.
    """

    def __init__(
        self,
        time: Pair,
        until: Pair,
        x: tuple[Pair, ...],
        refused: Trajectory | None,
        constants: ModeConstants,
        block: bytearray,
    ) -> None:
        self.time, self.until, self.x, self.refused, self.constants = time, until, x, refused, constants
        self.block, self.scalars = block, ffi.from_buffer(_RUN, block)


@lru_cache(maxsize=64)
def run_template(
    sizes: tuple[int, ...],
    tolerance: float,
    landing: int = HENON,
    stop_falling: int = 0,
    stop_rising: int = 0,
    most_steps: int = MOST_STEPS,
) -> Any:
    """Return a :attr:`Start.block`, in doubles, without numbers and mode.

    Parameters
    ----------
    sizes : tuple of int
        :attr:`ModeTable.sizes`.
    tolerance : float
        Local error of a step, relative to the size of each state and guard on the step.
    landing : int
        HENON, NEWTON or BRENT of :mod:`henon_ref.integrator.records`.
    stop_falling, stop_rising : int
        Surfaces, a bit each (1 << index), on which the run ends if their expression falls (rises) to zero.
    most_steps : int
        Steps after which the run ends with status ``failed``.
    """
    state = np.zeros(kernel.places_of(*sizes).end_of_state)
    run = ffi.cast("struct run *", doubles(state))
    run.states, run.guards, run.order, run.contacts, run.constants = sizes
    state[len(state) - run.guards :] = np.inf
    run.event_time, run.tolerance, run.method = -np.inf, tolerance, landing
    run.rest_part, run.more_digits, run.stepped_mode, run.transition_capacity = REMAINING, 1, -1, CHUNK
    run.stop_falling, run.stop_rising, run.most_steps = stop_falling, stop_rising, most_steps
    return doubles(state)


def begin(
    workspace: Workspace,
    constants: ModeConstants,
    template: Any,
    numbers: tuple[Pair, ...],
    exact: Callable[[], Sequence[Any]],
    mode: Mapping[int, int],
) -> Start:
    """Return the start of a run, in microseconds if it is clearly off every surface.

    Parameters
    ----------
    workspace : Workspace
        Memory that is free again afterwards.
    constants : ModeConstants
    template : cdata
        As :func:`run_template` returns it.
    numbers : tuple of Pair, shape (2 + n,)
        Horizon and initial time [s], and initial state.
    exact : callable
        Returns time and state as exact numbers, of Python or SymPy; called only if pairs do not decide a sign.
    mode : mapping
        Surface -> -1, 0 or +1, for a start on a surface from which several motions are possible.
    """
    signs = constants.start(workspace, template, numbers)
    clear = signs is None and not mode
    refused = None if clear else _entered(constants, workspace, signs or (), exact, mode)
    return Start(numbers[1], numbers[0], numbers[2:], refused, constants, bytearray(workspace.memory))


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
) -> Trajectory | None:
    """Put a run into its initial mode; if no mode exists, return the result of every run.

    ``signs``: see :func:`row_at_start`.
    """
    if not given and _entered_clearly(constants, workspace, signs):
        return None
    exact_signs = constants.exact_signs(exact())
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


def _decided(
    constants: ModeConstants, workspace: Workspace, signs: Sequence[int | None], given: Mapping[int, int]
) -> Trajectory | None:
    """Put a run into the mode that the fields and their derivatives select, as :func:`_entered`."""
    from henon_ref.modes.selection import contact_orders, mode_by_signs  # rarely needed

    table, system = constants.table, constants.table.system
    count, t = len(system.surfaces), workspace.run.time
    x = workspace.state[STATE_PLACE : STATE_PLACE + len(system.states)].tolist()

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
    _enter(constants, workspace, row, -1)
    if active or edges:
        orders, first = contact_orders(at, decision.mode, active, edges), STATE_PLACE + 3 * len(x)
        zeros = [orders[place] if place >= 0 else 0 for place in table.places(decision.mode)]
        workspace.state[first : first + len(zeros)].view(np.int64)[:] = zeros
    return None
