"""Hénon's event integrator: what is made once for a system, and where a run of it starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
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

KEPT_VALUES = 64
"""Parameter values of which the constants are kept."""


class Integrator:
    """Runs of one system at one order, from any thread; compiles what it needs and keeps it.

    A run is ``Run(integrator, integrator.begin(values, initial, ...)).to_horizon()``. Many runs in one call are
    :class:`henon_ref.integrator.points.PointRuns`. The library keeps one integrator for each system and order.

    Parameters
    ----------
    system : FilippovSystem
        With values of its parameters; without them, problems of the system with any values can be started. (Its modes
        are then derived for all values: surfaces that coincide for some of them are two surfaces all the same.)
    order : int
        Order of the Taylor method.

    Attributes
    ----------
    free : list of Workspace
        Memory of runs that nobody has: see :meth:`workspace`.

    Raises
    ------
    UnsupportedError
        Where too many contacts with static friction act on each other at once.
    """

    def __init__(self, system: FilippovSystem, order: int) -> None:
        self.system = system
        self.order = order
        self.mode_table = ModeTable(system, order)
        self.constants = lru_cache(maxsize=KEPT_VALUES)(self._constants)
        """The compiled modes' constants at values of :attr:`parameters`."""
        self.free: list[Workspace] = []

    def workspace(self) -> Workspace:
        """Memory of a run, which gives it back to :attr:`free`; making some takes as long as a short run.

        (To take it from a list, or give it back, is one operation, which is a thread's alone.)
        """
        try:
            return self.free.pop()
        except IndexError:
            return Workspace.of(*self.mode_table.sizes)

    @property
    def parameters(self) -> tuple[sp.Symbol, ...]:
        """Those that stand in the system's expressions, by name: the order of the values of :meth:`begin`."""
        return self.programs.parameters

    @cached_property
    def programs(self) -> ParameterPrograms:
        """Programs of constants, for values that are doubles."""
        return ParameterPrograms(self.mode_table)

    def _constants(self, values: tuple[Any, ...]) -> ModeConstants:
        own, exact = self.system.parameters, list(map(exact_expression, values))
        if own and exact != [own[symbol] for symbol in self.parameters]:
            raise ModelError("an integrator of a system with values of its parameters runs that system alone")
        return ModeConstants(self.programs, tuple(chain.from_iterable(map(pair_of_exact, values))), lambda: exact)

    def start(self, problem: Problem, **settings: Any) -> Start:
        """:meth:`begin` from a problem of this system, in exact numbers, with values of all parameters."""
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
        """Where a run starts: in microseconds where that is clearly off every surface.

        Numbers are int, Fraction, float, which stands for the decimal number that it is printed as, or exact numbers of
        SymPy.

        Parameters
        ----------
        values : tuple of number
            Of :attr:`parameters`, in their order.
        initial : sequence of number, shape (n,)
            State at the start.
        start, until : number
            Initial time and horizon [s].
        mode : mapping, optional
            Surface -> -1, 0 or +1, for a start on a surface that the fields leave open.
        **settings
            ``tolerance``, ``landing`` and others of :func:`henon_ref.integrator.start.run_template`.

        Raises
        ------
        ModelError
            Where the system has other values of its parameters, or an expression in them that no program evaluates.
        """
        time, end, *x = map(pair_of_exact, (start, until, *initial))
        block, point = run_template(self.mode_table.sizes, **settings), (start, *initial)
        exact = lambda: list(map(exact_expression, point))  # noqa: E731
        return begin(self, self.constants(values), block, time, end, tuple(x), exact, mode or {})
