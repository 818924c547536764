"""Hénon's event integrator: what is made once for a system, and where a run of it starts."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.filippov.exact_numbers import double_double, exact_sign
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.problem import Problem
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.compile_units import link
from henon_ref.henon.loop import load
from henon_ref.henon.mode_constants import ModeConstants
from henon_ref.henon.mode_table import ModeTable
from henon_ref.henon.start import Start
from henon_ref.henon.workspace import WorkspacePool
from henon_ref.jit.processor_time import compiling
from henon_ref.precision import one_at_a_time
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Trajectory

KEPT_VALUES = 64
"""Parameter values of which the constants are kept."""


class Integrator:
    """Runs of one system at one order, from any thread; compiles what it needs and keeps it.

    Parameters
    ----------
    system : FilippovSystem
        With values of its parameters; without them, problems of the system with any values can be started.
    order : int
        Order of the Taylor method.
    """

    def __init__(self, system: FilippovSystem, order: int) -> None:
        link()  # before anything that calls a compile unit is compiled or loaded: a missing symbol ends the process
        self.system = system
        self.order = order
        self.mode_table = ModeTable(system, order)
        states, surfaces = len(system.states), len(system.surfaces)
        self.workspaces = WorkspacePool(states, self.mode_table.most_guards, order, surfaces)
        self.several = self.mode_table.compiled.rows.size > 0
        """Whether the compiled loop decides events of several surfaces."""
        self._constants: dict[tuple[sp.Expr, ...], ModeConstants] = {}

    def load(self) -> None:
        """Make the compiled loop callable, as the first run does otherwise."""
        load(several=self.several)

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
                found = self._constants.setdefault(key, ModeConstants(self.mode_table, values))
                if len(self._constants) > KEPT_VALUES:
                    del self._constants[next(iter(self._constants))]
        return found

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
        system, constants = problem.system, self.constants(problem.system)
        decision = constants.switching.initial_mode(problem.start, problem.initial, problem.initial_mode)
        at = {TIME: problem.start, **dict(zip(system.states, problem.initial, strict=True))}
        x = [double_double(v) for v in problem.initial]
        active, edges = (
            [i for i, e in enumerate(expressions) if exact_sign(system.numeric(e).xreplace(at)) == 0]
            for expressions in (system.surfaces, system.valid)
        )
        time, until, point = double_double(problem.start), double_double(problem.until), tuple(high for high, _ in x)
        refused, row, zeros = None, 0, (0,) * self.mode_table.most_guards
        if decision.mode is None:
            nowhere = (0,) * len(system.surfaces)
            refused = Trajectory(decision.ending, (), time[0], point, nowhere, decision.reason)
        elif (found := self.mode_table.row(decision.mode)) is None:
            refused = Trajectory("failed", (), time[0], point, decision.mode, "the mode at the start has no equations")
        else:
            row, own = found, self.known_zeros(constants, time[0], point, decision.mode, active, edges)
            zeros = own + zeros[len(own) :]
        return Start(time, until, tuple(x), refused, row, zeros, self.order, tolerance, landing, constants)

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
        orders = constants.switching.contact_orders(t, x, mode, active, edges)
        return tuple(orders[place] if place >= 0 else 0 for place in places)
