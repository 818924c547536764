"""Base classes that make a library a solver. The driver handles everything except one smooth mode.

A library that locates events to rounding needs a :class:`ModeSolver` and a class that integrates one mode. A library
that needs more settings is a subclass of :class:`Adapter`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.driver import Driver
from henon_ref.baselines.library import Library, Times, Work
from henon_ref.baselines.mode_functions import EPSILON
from henon_ref.baselines.restart import STOPPED, Restart
from henon_ref.baselines.smooth_mode import SmoothMode
from henon_ref.errors import UnavailableError, UnsupportedError
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run
from henon_ref.trajectory import without_hidden_kinks
from henon_ref.workers.machine import library_versions

SCOUTING = 1e-6
"""Tolerance of the run that finds the modes that a problem visits. At this tolerance compiling costs far more."""


@dataclass(frozen=True)
class LibrarySolver(ABC):
    """A :class:`henon_ref.solver.Solver` that is a Python package and chooses its steps by tolerances."""

    name: str
    fixed_step: ClassVar[bool] = False
    landing: ClassVar[str]
    distribution: ClassVar[str]
    """Name of the package to install."""
    module: ClassVar[str] = ""
    """Module to import from the package."""
    extra: ClassVar[str] = ""
    """Extra of this project that installs the package; empty if the project itself requires it."""

    @property
    def version(self) -> str:
        """The library's version; empty if it is not installed."""
        return library_versions((self.distribution,))[self.distribution]

    def prepare(
        self,
        problem: Problem,
        *,
        rtol: float | None = None,
        atol: float | None = None,
        step: float | None = None,
        sample_times: NDArray[np.float64] | None = None,
        deadline: float | None = None,
    ) -> Run:
        """Do all work that is done once per problem; see :meth:`henon_ref.solver.Solver.prepare`."""
        if step is not None or rtol is None:
            raise UnsupportedError(f"{self.name} chooses its own steps: give rtol (and atol), not step")
        return self.prepared(problem, rtol, rtol if atol is None else atol, Work(deadline), sample_times)

    @abstractmethod
    def prepared(self, problem: Problem, rtol: float, atol: float, work: Work, times: Times) -> Run:
        """Return a run of the problem at these tolerances; called by :meth:`prepare`."""

    def load(self) -> Any:
        """Import and return the module, class or function that the solver calls."""
        return import_module(self.module) if self.module else None

    def loaded(self) -> Any:
        """Return the result of :meth:`load`; UnavailableError if the library is not installed."""
        try:
            return self.load()
        except ImportError as error:
            raise self._absent() from error

    def check(self) -> None:
        """Raise an error if the library cannot be used, as :meth:`loaded`; one of an extra is not imported for it."""
        if not self.extra:
            self.loaded()
        elif not self.version:
            raise self._absent()

    def _absent(self) -> UnavailableError:
        line = f": pip install 'henon-ref[{self.extra}]'" if self.extra else ""
        return UnavailableError(f"{self.distribution} is not installed{line}")


@dataclass(frozen=True)
class Adapter(LibrarySolver):
    """A library that integrates one smooth mode after another for the driver."""

    restart: Restart = field(default="event-free-step", kw_only=True)
    mode: ClassVar[Callable[..., Any]]
    """Class that integrates one mode; arguments: library, model, work, length of the run [s]. Its method ``advance`` is
    described in :data:`henon_ref.baselines.library.Advance`."""
    least_rtol: ClassVar[float] = 0.0
    """Smallest allowed ``rtol``; a smaller value is raised to it."""
    implicit: ClassVar[bool] = False
    """Whether each step is solved by an iteration that stops at a part of the tolerances. The state then has an error
    of that size from the first step on."""
    located: ClassVar[tuple[float, float]] = (4.0, 1.0)
    """(k, s): an event time t differs from the library's own root by at most k eps (s + abs(t)), s in seconds."""
    samples: ClassVar[bool] = False
    """Whether the modes return the state at the sample times."""
    warm_up: ClassVar[bool] = False
    """Whether to run once while preparing, because the first run of a mode compiles it."""

    def prepared(self, problem: Problem, rtol: float, atol: float, work: Work, times: Times) -> Run:
        """Prepare every mode (lambdify, compile)."""
        driver = Driver(problem, self.library(rtol, atol), work, times if self.samples else None)
        driver.compile()
        if self.warm_up:
            driver.run()
        return lambda: without_hidden_kinks(driver.run(), problem.system)

    def library(self, rtol: float, atol: float) -> Library:
        """Return the library at these tolerances, for the driver."""
        rtol = max(rtol, self.least_rtol)
        # The error of an explicit method's first step vanishes with its length.
        errors = (STOPPED * rtol, STOPPED * atol) if self.implicit else (EPSILON, 0.0)
        return Library(self, self.loaded(), rtol, atol, self.accuracy(rtol, atol), errors)

    def accuracy(self, rtol: float, atol: float) -> tuple[float, float]:
        """Return the relative and absolute error that the tolerances allow per step."""
        return rtol, atol

    def loosened(self, rtol: float, atol: float) -> Library:
        """Return the library at loose tolerances, for the run that finds the visited modes."""
        return self.library(max(rtol, SCOUTING), max(atol, SCOUTING))


@dataclass(frozen=True)
class ModeSolver(Adapter):
    """A solver made of a :class:`SmoothMode`. An entry point of the group ``henon_ref.solvers`` may name such a solver.

    Event times are assumed to be exact to rounding, 4 eps (1 + abs(t)).

    Examples
    --------
    >>> SOLVER = ModeSolver("my-rk", RungeKutta, landing="bisection", distribution="my-rk")  # doctest: +SKIP
    """

    samples: ClassVar[bool] = True
    mode: type[SmoothMode]  # type: ignore[misc]  # a class variable of Adapter, a field here
    """Class that integrates one mode."""
    landing: str = field(kw_only=True)  # type: ignore[misc]
    """How the solver puts the end of a step on the surface, for the ``landing`` column."""
    distribution: str = field(kw_only=True)  # type: ignore[misc]
    """Package of the solver; its version is written into the results."""
    implicit: bool = field(default=False, kw_only=True)  # type: ignore[misc]
    """See :attr:`Adapter.implicit`."""
