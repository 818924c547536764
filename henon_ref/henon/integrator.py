"""Hénon's event integrator: what is made once for a system, and where a run of it starts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from henon_ref.filippov.exact_numbers import exact_sign
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.problem import Problem
from henon_ref.filippov.switching import ZERO, Switching
from henon_ref.filippov.system import FilippovSystem
from henon_ref.henon.compile_units import link
from henon_ref.henon.mode_selection import selection_space
from henon_ref.henon.mode_table import ModeTable, double_double
from henon_ref.henon.precise_modes import PreciseModes
from henon_ref.henon.state import CHUNK, R_STATE, Start, work_places
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Trajectory


class Scratch(NamedTuple):
    """Arrays that the compiled loop works on.

    Runs of one integrator share them: what is in them is a run's own until it hands on its transitions, no longer.
    """

    work: NDArray[np.float64]
    band: NDArray[np.float64]
    """A view: coefficients of the last expansion (see :func:`henon_ref.henon.state.work_space`)."""
    records: NDArray[np.float64]
    """A view: transitions."""


def _scratch(mode_table: ModeTable) -> Scratch:
    n, most = len(mode_table.system.states), mode_table.most_guards
    width, room, records = work_places(n, most, mode_table.order)
    work = np.zeros(records + CHUNK * (R_STATE + n))
    return Scratch(work, work[:room].reshape(-1, width), work[records:].reshape(CHUNK, -1))


class Integrator:
    """Runs of one system at one order; compiles what it needs and keeps it.

    Parameters
    ----------
    system : FilippovSystem
    order : int
        Order of the Taylor method.
    """

    def __init__(self, system: FilippovSystem, order: int) -> None:
        link()  # before anything that calls a compile unit is compiled or loaded: a missing symbol ends the process
        self.system = system
        self.order = order
        self.mode_table = ModeTable(system, order)
        self.switching = Switching(system)
        self.precise = PreciseModes(system, self.switching)
        self.scratch = _scratch(self.mode_table)
        self.several = self.mode_table.rows.size > 0
        """Whether the compiled loop decides events of several surfaces."""
        self._selection_space = selection_space(len(system.states), len(system.surfaces))

    @property
    def selection(self) -> tuple[Any, ...] | None:
        """What the compiled loop decides events of several surfaces with; None where it need not."""
        mode_table = self.mode_table
        if not self.several:
            return None
        return (*mode_table.normals, mode_table.signs, mode_table.rows, mode_table.decoupled, *self._selection_space)

    def start(self, problem: Problem, *, tolerance: float, landing: int) -> Start:
        """What is decided once a problem, in exact numbers: where it starts and in which mode.

        Parameters
        ----------
        problem : Problem
            Of this integrator's system.
        tolerance : float
            Local error of a step, relative to the size of each state and guard on the step.
        landing : int
            HENON, NEWTON or BRENT of :mod:`henon_ref.henon.state`.
        """
        system = self.system
        decision = self.switching.initial_mode(problem.start, problem.initial, problem.initial_mode)
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
        elif (mode_table := self.mode_table.row(decision.mode)) is None:
            refused = Trajectory("failed", (), time[0], point, decision.mode, "the mode at the start has no equations")
        else:
            row, own = mode_table, self.known_zeros(time[0], point, decision.mode, active, edges)
            zeros = own + zeros[len(own) :]
        return Start(time, until, tuple(x), refused, row, zeros, self.order, tolerance, landing, self.scratch.work)

    def known_zeros(
        self,
        t: float,
        x: Sequence[float],
        mode: Mode,
        active: Sequence[int],
        edges: Sequence[int] = (),
        zero: float = ZERO,
    ) -> tuple[int, ...]:
        """How often each guard of a mode's row is zero at (t, x).

        ``active`` are the surfaces that the state is on, ``edges`` the ``valid`` expressions that are zero there.
        """
        places = self.mode_table.places(mode)
        if not active and not edges:
            return (0,) * len(places)
        orders = self.switching.contact_orders(t, x, mode, active, edges, zero=zero)
        return tuple(orders[place] if place >= 0 else 0 for place in places)
