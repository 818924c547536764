"""Hénon's event integrator: what is made once for a system, and where a run of it starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from henon_ref.henon import registers as k
from henon_ref.henon.closer import CloserLook
from henon_ref.henon.compiled import CompiledSystem, double_double
from henon_ref.henon.kernel import BANDS
from henon_ref.henon.near import NearLook
from henon_ref.henon.rows import row_length
from henon_ref.henon.session import Session
from henon_ref.henon.settling import work_space
from henon_ref.model.decision import Decision
from henon_ref.model.equations import TIME
from henon_ref.model.exact import exact_sign
from henon_ref.model.modes import Mode
from henon_ref.model.switching import ZERO, Switching
from henon_ref.model.system import FilippovSystem
from henon_ref.trajectory import Problem, Trajectory


@dataclass(frozen=True)
class Start:
    """A problem's start and horizon as the compiled loop takes them."""

    time: tuple[float, float]
    """Initial time and what rounding it lost."""
    until: tuple[float, float]
    """Horizon and what rounding it lost."""
    x: tuple[tuple[float, float], ...]
    """Initial state and what rounding it lost."""
    decision: Decision
    """The mode at the start, or why there is none."""
    row: int | None
    """Its row in the compiled tables."""
    zeros: tuple[int, ...]
    """Known zeros of the guards, as many as the largest mode has: surfaces that the start lies on."""

    @cached_property
    def arrays(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Floats and integers that a run begins with (see :mod:`henon_ref.henon.registers`). Each run copies them."""
        high, low = zip(*self.x, strict=True)
        floats = np.array([0.0] * k.F_STATE + [*high, *low])
        floats[k.F_TIME], floats[k.F_LOW] = self.time
        floats[k.F_UNTIL], floats[k.F_UNTIL_LOW] = self.until
        floats[k.F_LAST] = -np.inf
        floats[k.F_SIGMA] = max((self.until[0] - self.time[0]) + (self.until[1] - self.time[1]), 1e-280)
        integers = np.array([0] * k.I_SIZE + [*self.zeros] + [0] * len(self.zeros))
        integers[k.I_MODE] = self.row or 0
        return floats, integers


class Scratch(NamedTuple):
    """Arrays that the compiled loop works on and leaves nothing in: runs of one engine share them."""

    band: NDArray[np.float64]
    room: NDArray[np.float64]


def _scratch(compiled: CompiledSystem) -> Scratch:
    n, most, order = len(compiled.system.states), compiled.most_guards, compiled.order
    return Scratch(
        band=np.zeros((2 * (n + most + 1) + BANDS, row_length(order))),
        room=np.zeros(3 * n + 3 * most),
    )


class Engine:
    """Runs of one system at one order; compiles what it needs and keeps it.

    Parameters
    ----------
    system : FilippovSystem
    order : int
        Order of the Taylor method.
    """

    def __init__(self, system: FilippovSystem, order: int) -> None:
        self.system = system
        self.order = order
        self.compiled = CompiledSystem(system, order)
        self.switching = Switching(system)
        self.near = NearLook(system)
        self.closer = CloserLook(system)
        self.scratch = _scratch(self.compiled)
        self._settling = work_space(len(system.states), len(system.surfaces))

    @property
    def settling(self) -> tuple[Any, ...] | None:
        """What the compiled loop decides events of several surfaces with; None where it need not."""
        compiled = self.compiled
        if not compiled.rows.size:
            return None
        return (*compiled.normals, compiled.signs, compiled.rows, compiled.decoupled, *self._settling)

    def start(self, problem: Problem) -> Start:
        """What is decided once a problem, in exact numbers: where it starts and in which mode."""
        system = self.system
        decision = self.switching.initial_mode(problem.start, problem.initial, problem.initial_mode)
        at = {TIME: problem.start, **dict(zip(system.states, problem.initial, strict=True))}
        x = [double_double(v) for v in problem.initial]
        active, edges = (
            [i for i, e in enumerate(expressions) if exact_sign(system.numeric(e).xreplace(at)) == 0]
            for expressions in (system.surfaces, system.valid)
        )
        time = double_double(problem.start)
        row: int | None = None
        zeros = (0,) * self.compiled.most_guards
        if decision.mode is not None:
            row = self.compiled.compile(decision.mode)
            own = self.known_zeros(time[0], [v[0] for v in x], decision.mode, active, edges)
            zeros = own + zeros[len(own) :]
        return Start(time, double_double(problem.until), tuple(x), decision, row, zeros)

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
        places = self.compiled.places(mode)
        if not active and not edges:
            return (0,) * len(places)
        orders = self.switching.contact_orders(t, x, mode, active, edges, zero=zero)
        return tuple(orders[place] if place >= 0 else 0 for place in places)

    def run(
        self,
        start: Start,
        *,
        tolerance: float,
        landing: int,
        sample_times: NDArray[np.float64] | None = None,
        deadline: float | None = None,
    ) -> Trajectory:
        """Integrate from a start to its horizon.

        Parameters
        ----------
        start : Start
            Of this engine's system.
        tolerance : float
            Local error of a step, relative to the size of each state and guard on the step.
        landing : int
            HENON, NEWTON or BRENT of :mod:`henon_ref.henon.registers`.
        sample_times : ndarray, shape (k,), optional
        deadline : float, optional
            Seconds after which the run stops with status ``timeout``.
        """
        return Session(self, start, tolerance, landing, sample_times, deadline).run()
