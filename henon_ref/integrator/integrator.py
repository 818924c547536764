"""Hénon's event integrator: the compiled system, shared by all runs, and the starts of runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import chain
from typing import Any

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.integrator.constants import ModeConstants, ParameterPrograms
from henon_ref.integrator.mode_table import ModeTable
from henon_ref.integrator.pairs import exact_expression, pair_of_exact
from henon_ref.integrator.records import Workspace
from henon_ref.integrator.start import Start, begin, run_template
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem


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


class Integrator:
    """Compiled system for runs at one order of the Taylor method, from any thread.

    A run is ``run_to_horizon(integrator, integrator.begin(values, initial, ...))``;
    :class:`henon_ref.integrator.points.PointRuns` does many runs in one call. Modes are compiled on first use. The
    library keeps one integrator per system and order.

    Parameters
    ----------
    system : FilippovSystem
        With values of its parameters, or without: then runs may have any values. (The modes are then derived for all
        values; surfaces that coincide for some values are still two surfaces.)
    order : int
        Order of the Taylor method.

    Attributes
    ----------
    programs : ParameterPrograms
        Programs of the constants.
    free : list of Workspace
        Unused memory for runs: see :meth:`workspace`.

    Raises
    ------
    UnsupportedError
        If too many contacts with static friction act on each other.
    """

    def __init__(self, system: FilippovSystem, order: int) -> None:
        self.system = system
        self.order = order
        self.mode_table = ModeTable(system, order)
        self.programs = ParameterPrograms(self.mode_table)
        self.constants = lru_cache(maxsize=64)(self._constants)
        """Constants of the compiled modes at values of :attr:`parameters`."""
        self.free: list[Workspace] = []

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
        **settings: Any,
    ) -> Start:
        """Return the start of a run, in microseconds if it is clearly off every surface.

        Numbers are int, Fraction, exact SymPy numbers, or float (the decimal number that Python prints for it).

        Parameters
        ----------
        values : tuple of number
            Values of :attr:`parameters`, in their order.
        initial : sequence of number, shape (n,)
            State at the start.
        start, until : number
            Initial time and horizon [s].
        mode : mapping, optional
            Surface -> -1, 0 or +1, for a start on a surface from which several motions are possible.
        **settings
            ``tolerance``, ``landing`` and others of :func:`henon_ref.integrator.start.run_template`.

        Raises
        ------
        ModelError
            If the system has other values of its parameters, or no program evaluates an expression in them.
        """
        numbers = tuple(map(pair_of_exact, (until, start, *initial)))
        block, point = run_template(self.mode_table.sizes, **settings), (start, *initial)
        exact = lambda: list(map(exact_expression, point))  # noqa: E731
        workspace = self.workspace()
        found = begin(workspace, self.constants(values), block, numbers, exact, mode or {})
        self.free.append(workspace)
        return found
