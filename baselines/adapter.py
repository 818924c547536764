"""A library as a solver: what is said of it, and its modes; all else is the driver's.

A library that locates events to rounding is a :class:`ModeSolver` of its class for one mode; one of which more is to
be said is an :class:`Adapter` of its own.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.driver import Driver
from henon_ref.baselines.library import Flow, Library
from henon_ref.baselines.mode_functions import EPSILON
from henon_ref.baselines.restart import STOPPED, Restart
from henon_ref.baselines.smooth_mode import SmoothMode
from henon_ref.baselines.work import Work, installed_version
from henon_ref.errors import UnavailableError, UnsupportedError
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run
from henon_ref.trajectory import Trajectory, without_hidden_kinks

SCOUTING = 1e-6
"""Tolerance of the run that finds out which modes a problem visits: loose enough to cost nothing beside compiling."""


class Asked(NamedTuple):
    """What :meth:`henon_ref.solver.Solver.prepare` is asked for besides a problem."""

    rtol: float
    atol: float
    sample_times: NDArray[np.float64] | None
    deadline: float | None


@dataclass(frozen=True)
class LibrarySolver(ABC):
    """A solver that is a Python package and is driven by tolerances (:class:`henon_ref.solver.Solver`)."""

    name: str
    fixed_step: ClassVar[bool] = False
    landing: ClassVar[str]
    distribution: ClassVar[str]
    """The package that has to be installed, as messages name it."""
    module: ClassVar[str] = ""
    """What is imported of it."""
    extra: ClassVar[str] = ""
    """The extra of this project that brings it; empty where the project itself does."""

    @property
    def version(self) -> str:
        """The library's version, empty where it is not installed."""
        return installed_version(self.distribution)

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
        """Make all ready that is made once a problem; see :meth:`henon_ref.solver.Solver.prepare`.

        Raises
        ------
        UnsupportedError
            For a step, or no ``rtol``; and where the solver cannot do the problem.
        UnavailableError
            Where the library is not installed.
        """
        if step is not None or rtol is None:
            raise UnsupportedError(f"{self.name} chooses its own steps: give rtol (and atol), not step")
        return self.prepared(problem, Asked(rtol, rtol if atol is None else atol, sample_times, deadline))

    @abstractmethod
    def prepared(self, problem: Problem, asked: Asked) -> Run:
        """The same, where the tolerances are given."""

    def load(self) -> Any:
        """Import what is called (a module, a class, a function)."""
        return import_module(self.module) if self.module else None

    def loaded(self) -> Any:
        """What :meth:`load` imports.

        Raises
        ------
        UnavailableError
            Where it is not installed.
        """
        try:
            return self.load()
        except ImportError as error:
            raise UnavailableError(self._absent) from error

    def unavailable(self) -> str:
        """Why the library cannot be had; empty where it can. One that comes with an extra is not imported for it."""
        if self.extra:
            return "" if self.version else self._absent
        try:
            self.load()
        except ImportError:
            return self._absent
        return ""

    @property
    def _absent(self) -> str:
        line = f": pip install 'henon-ref[{self.extra}]'" if self.extra else ""
        return f"{self.distribution} is not installed{line}"


@dataclass(frozen=True)
class Adapter(LibrarySolver):
    """A library that integrates one smooth mode after another for the driver."""

    restart: Restart = field(default="event-free-step", kw_only=True)
    mode: ClassVar[Callable[..., Flow]]
    """Its class for one mode, of (library, model, work, horizon)."""
    least_rtol: ClassVar[float] = 0.0
    """A smaller ``rtol`` is raised to this."""
    implicit: ClassVar[bool] = False
    """Whether its steps are solved by an iteration that the tolerances stop: it then leaves a part of them in the state
    from the first step on."""
    located: ClassVar[tuple[float, float]] = (4.0, 1.0)
    """See :attr:`henon_ref.baselines.library.Library.located`: here to rounding."""
    samples: ClassVar[bool] = False
    """Whether its modes give the state at wanted times."""
    warm_up: ClassVar[bool] = False
    """Whether preparing runs once, since compiling a mode costs more than a run."""

    def prepared(self, problem: Problem, asked: Asked) -> Run:
        """Make every mode ready (lambdify, compile)."""
        library, times = self.library(asked.rtol, asked.atol), asked.sample_times if self.samples else None
        driver = Driver(problem, library, Work(asked.deadline), times)
        driver.compile()
        if self.warm_up:
            driver.run()
        return partial(_visible, driver) if problem.system.kinks else driver.run

    def library(self, rtol: float, atol: float) -> Library:
        """The library at these tolerances, for the driver."""
        rtol = max(rtol, self.least_rtol)
        # An explicit method's first step is as exact as it is short.
        errors = (STOPPED * rtol, STOPPED * atol) if self.implicit else (EPSILON, 0.0)
        return Library(
            self, self.loaded(), rtol, atol, self.landing, self.restart, self.accuracy(rtol, atol), errors,
            self.located, self.mode, partial(self.loosened, rtol, atol),
        )  # fmt: skip

    def accuracy(self, rtol: float, atol: float) -> tuple[float, float]:
        """Relative and absolute error that the tolerances allow a step."""
        return rtol, atol

    def loosened(self, rtol: float, atol: float) -> Library:
        """The library at tolerances for finding out which modes are visited."""
        return self.library(max(rtol, SCOUTING), max(atol, SCOUTING))


def _visible(driver: Driver) -> Trajectory:
    return without_hidden_kinks(driver.run(), driver.problem.system)


@dataclass(frozen=True)
class ModeSolver(Adapter):
    """A solver made of a :class:`SmoothMode`: what an entry point of the group ``henon_ref.solvers`` names.

    Event times are taken to be located to rounding, 4 eps (1 + abs(t)).

    Examples
    --------
    >>> SOLVER = ModeSolver("my-rk", RungeKutta, landing="bisection", distribution="my-rk")  # doctest: +SKIP
    """

    samples: ClassVar[bool] = True
    mode: type[SmoothMode]  # type: ignore[misc]  # an adapter's class has these, here each object
    """Its class for one mode."""
    landing: str = field(kw_only=True)  # type: ignore[misc]
    """How it puts a step's end on the surface, for the ``landing`` column."""
    distribution: str = field(kw_only=True)  # type: ignore[misc]
    """The package it comes from, whose version stands in the results."""
    implicit: bool = field(default=False, kw_only=True)  # type: ignore[misc]
    """Whether its steps are solved by an iteration that the tolerances stop: it then leaves a part of them in the state
    from the first step on."""
