"""Hénon's event integrator: what is made once for a system, and where a run of it starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.filippov.decision import Decision
from henon_ref.filippov.exact_numbers import double_double
from henon_ref.filippov.modes import Mode, replaced
from henon_ref.filippov.problem import Problem
from henon_ref.filippov.selection import contact_orders, mode_by_signs, signs_at
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.double_constants import DoubleConstants
from henon_ref.henon.mode_constants import ExactConstants, ModeConstants
from henon_ref.henon.mode_table import ModeTable
from henon_ref.henon.pairs import exact_expression, pair_of_exact, three_of
from henon_ref.henon.parameter_programs import ParameterPrograms
from henon_ref.henon.start import Start
from henon_ref.henon.workspace import WorkspacePool
from henon_ref.jit.processor_time import compiling
from henon_ref.kernel.shared import doubles, ffi, kernel
from henon_ref.precision import one_at_a_time
from henon_ref.trajectory import Trajectory

KEPT_VALUES = 64
"""Parameter values of which the constants are kept."""


class Integrator:
    """Runs of one system at one order, from any thread; compiles what it needs and keeps it.

    A run is ``Run(integrator, integrator.start(problem, ...)).to_horizon()``; with :meth:`start_at` in place of
    :meth:`start` from numbers as Python has them, in microseconds. Many runs in one call are
    :class:`henon_ref.henon.points.PointRuns`. The library keeps one integrator for each system and order.

    Parameters
    ----------
    system : FilippovSystem
        With values of its parameters; without them, problems of the system with any values can be started. (Its modes
        are then derived for all values: surfaces that coincide for some of them are two surfaces all the same.)
    order : int
        Order of the Taylor method.

    Raises
    ------
    UnsupportedError
        Where too many contacts with static friction act on each other at once.
    """

    def __init__(self, system: FilippovSystem, order: int) -> None:
        self.system = system
        self.order = order
        self.mode_table = ModeTable(system, order)
        self.no_zeros = (0,) * self.mode_table.most_guards
        """Known zeros of the guards where a start is off every surface."""
        self._constants: dict[tuple[sp.Expr, ...], ModeConstants] = {}
        self.double_constants = lru_cache(maxsize=KEPT_VALUES)(self._double_constants)

    @cached_property
    def workspaces(self) -> WorkspacePool:
        """Memory of runs."""
        table = self.mode_table
        sizes = len(self.system.states), table.most_guards, self.order, table.contacts, table.row_length
        return WorkspacePool(*sizes)

    def constants(self, values: FilippovSystem) -> ModeConstants:
        """The compiled modes' constants at a system's parameter values; the same object for the same values.

        Raises
        ------
        ModelError
            Where this integrator's own system has other values.
        """
        own = self.system.parameters
        if own and own != values.parameters:
            raise ModelError("an integrator of a system with values of its parameters runs that system alone")
        key = tuple(values.parameters.values())
        found = self._constants.get(key)
        if found is None:
            with one_at_a_time(), compiling():
                found = self._constants.setdefault(key, ExactConstants(self.mode_table, values))
                if len(self._constants) > KEPT_VALUES:
                    del self._constants[next(iter(self._constants))]
        return found

    @property
    def parameters(self) -> tuple[sp.Symbol, ...]:
        """Those that stand in the system's expressions, by name: the order of the values of :meth:`start_at`."""
        return self.programs.parameters

    @cached_property
    def programs(self) -> ParameterPrograms:
        """Programs of constants, for values that are doubles."""
        if self.system.parameters:
            raise ModelError("an integrator of a system with values of its parameters runs that system alone")
        return ParameterPrograms(self.mode_table)

    def _double_constants(self, values: tuple[Any, ...]) -> DoubleConstants:
        threes = tuple(three_of(pair_of_exact(v)) for v in values)
        return DoubleConstants(self.programs, threes, lambda: [exact_expression(v) for v in values])

    def start(self, problem: Problem, *, tolerance: float, landing: int) -> Start:
        """What is decided once a problem, in exact numbers: where it starts and in which mode.

        Parameters
        ----------
        problem : Problem
            Of this integrator's system, with values of all parameters.
        tolerance : float
            Local error of a step, relative to the size of each state and guard on the step.
        landing : int
            HENON, NEWTON or BRENT of :mod:`henon_ref.henon.records`.
        """
        constants, x = self.constants(problem.system), [double_double(v) for v in problem.initial]
        time, point = double_double(problem.start), [high for high, _ in x]
        surfaces, valid = signs_at(problem.system, problem.start, problem.initial)
        decision = mode_by_signs(constants.in_doubles.at(time[0], point), surfaces, valid, problem.initial_mode)
        refused, row, zeros = self.entered(constants, time[0], point, decision, surfaces, valid)
        until = double_double(problem.until)
        return Start(time, until, tuple(x), refused, row, zeros, self.order, tolerance, landing, constants)

    def start_at(
        self,
        values: tuple[Any, ...],
        initial: Sequence[Any],
        *,
        start: Any = 0.0,
        until: Any,
        tolerance: float,
        landing: int,
        mode: Mapping[int, int] | None = None,
        **limits: int,
    ) -> Start:
        """The same from single numbers: in microseconds where the start is clearly off every surface.

        They are int, Fraction, float, which stands for the decimal number that it is printed as, or exact numbers of
        SymPy.

        Parameters
        ----------
        values : tuple of number
            Of :attr:`parameters`, in their order.
        initial : sequence of number, shape (n,)
            State at the start.
        start, until : number
            Initial time and horizon [s].
        tolerance, landing
            See :meth:`start`.
        mode : mapping, optional
            Surface -> -1, 0 or +1, for a start on a surface that the fields leave open.
        **limits
            ``stop_falling``, ``stop_rising``, ``most_steps`` of :class:`Start`.

        Raises
        ------
        ModelError
            Where the system has values of its parameters, or an expression in them that no program evaluates.
        """
        constants = self.double_constants(values)
        time, end, *x = map(pair_of_exact, (start, until, *initial))
        high, refused, row, zeros = [v for v, _ in x], None, -1, self.no_zeros
        if not mode:
            row, zeros = self.clear_start(constants, constants.start_signs(time, x), time[0], high)
        if row < 0:
            surfaces, valid = constants.exact_signs(exact_expression(start), [exact_expression(v) for v in initial])
            decision = mode_by_signs(constants.in_doubles.at(time[0], high), surfaces, valid, mode)
            refused, row, zeros = self.entered(constants, time[0], high, decision, surfaces, valid)
        return Start(time, end, tuple(x), refused, row, zeros, self.order, tolerance, landing, constants, **limits)

    def row_at_start(self, signs: Mode) -> tuple[int, int] | None:
        """Row of a start's mode, and the surface that it is on (-1: none); None where Python has to decide the mode.

        On a surface the row is that of the mode below it; those that may follow are compiled. Of contacts that do not
        act on each other it is the mode's number.

        Parameters
        ----------
        signs : tuple of int
            Of the surfaces, then of the ``valid`` expressions.
        """
        count = len(self.system.surfaces)
        mode, on = signs[:count], [i for i, sign in enumerate(signs[:count]) if sign == 0]
        if kernel.UNCLEAR_SIGN in mode or len(on) > 1 or any(sign != 1 for sign in signs[count:]):
            return None
        if on and self.system.overrides:
            return None
        rows = [self.mode_table.row(replaced(mode, i, entry)) for i in on for entry in (-1, 0, 1)]
        row = rows[0] if on else self.mode_table.row(mode)
        return None if row is None else (row, on[0] if on else -1)

    def clear_start(
        self, constants: DoubleConstants, signs: Mode, t: float, x: Sequence[float]
    ) -> tuple[int, tuple[int, ...]]:
        """Row and known zeros of the mode at a start off all surfaces, or on one that is left or slid on clearly.

        Row -1 where it is not clear. ``signs``: see :meth:`row_at_start`.
        """
        found = self.row_at_start(signs)
        if found is None or found[1] < 0 or self.mode_table.contacts:
            if found is not None and found[1] >= 0:
                return -1, self.no_zeros
            return (-1 if found is None else found[0]), self.no_zeros
        data = constants.latest if constants.latest.compiled is self.mode_table.compiled else constants.update()
        point, speeds = np.array(x, dtype=np.float64), np.empty(len(x) + 2 * len(self.no_zeros))
        zeros, guards = ffi.new("int64_t *"), len(self.no_zeros)
        row = kernel.mode_on_surface(data.tables, *found, t, doubles(point), len(x), guards, doubles(speeds), zeros)
        order = zeros[0]
        if row < 0 or order == 0:
            return row, self.no_zeros
        entered = self.mode_table.guards(self.mode_table.mode(row))
        own = tuple(order if g.kind == "surface" and g.index == found[1] else 0 for g in entered)
        return row, own + self.no_zeros[len(own) :]

    def entered(
        self,
        constants: ModeConstants,
        t: float,
        x: Sequence[float],
        decision: Decision,
        surfaces: Sequence[int],
        valid: Sequence[int],
    ) -> tuple[Trajectory | None, int, tuple[int, ...]]:
        """What every run comes to that cannot begin, else None; row and known zeros of the mode at the start."""
        if decision.mode is None:
            nowhere = (0,) * len(surfaces)
            return Trajectory(decision.ending, (), t, tuple(x), nowhere, decision.reason), 0, self.no_zeros
        row = self.mode_table.row(decision.mode)
        if row is None:
            reason = "the mode at the start has no equations"
            return Trajectory("failed", (), t, tuple(x), decision.mode, reason), 0, self.no_zeros
        active, edges = ([i for i, sign in enumerate(signs) if sign == 0] for signs in (surfaces, valid))
        own = self.known_zeros(constants, t, x, decision.mode, active, edges)
        return None, row, own + self.no_zeros[len(own) :]

    def known_zeros(
        self,
        constants: ModeConstants,
        t: float,
        x: Sequence[float],
        mode: Mode,
        active: Sequence[int],
        edges: Sequence[int] = (),
    ) -> tuple[int, ...]:
        """How often each guard of a mode's row is zero at (t, x).

        ``active`` are the surfaces that the state is on, ``edges`` the ``valid`` expressions that are zero there.
        """
        places = self.mode_table.places(mode)
        if not active and not edges:
            return (0,) * len(places)
        orders = contact_orders(constants.in_doubles.at(t, x), mode, active, edges)
        return tuple(orders[place] if place >= 0 else 0 for place in places)
