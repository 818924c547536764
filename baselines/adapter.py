"""A library as a solver: what is said of it, and its modes; all else is the driver's.

A library that locates events to rounding is a :class:`ModeSolver` of its class for one mode; one of which more is to
be said is an :class:`Adapter` of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.driver import Driver, tolerances
from henon_ref.baselines.library import Flow, Library
from henon_ref.baselines.mode_functions import EPSILON
from henon_ref.baselines.restart import STOPPED, Restart
from henon_ref.baselines.smooth_mode import SmoothMode
from henon_ref.baselines.work import Work, installed_version
from henon_ref.errors import UnavailableError
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run
from henon_ref.trajectory import Trajectory, without_hidden_kinks

SCOUTING = 1e-6
"""Tolerance of the run that finds out which modes a problem visits: loose enough to cost nothing beside compiling."""


@dataclass(frozen=True)
class Adapter:
    """A library as a :class:`henon_ref.solver.Solver`."""

    name: str
    restart: Restart = field(default="event-free-step", kw_only=True)
    fixed_step: ClassVar[bool] = False
    mode: ClassVar[Callable[..., Flow]]
    """Its class for one mode, of (library, model, work, horizon)."""
    landing: ClassVar[str]
    distribution: ClassVar[str]
    """The package that has to be installed, as messages name it."""
    module: ClassVar[str] = ""
    """What is imported of it."""
    extra: ClassVar[str] = ""
    """The extra of this project that brings it; empty where the project itself does."""
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
        """Make every mode ready (lambdify, compile); see :meth:`henon_ref.solver.Solver.prepare`."""
        library = self.library(*tolerances(self.name, rtol, atol, step))
        driver = Driver(problem, library, Work(deadline), sample_times if self.samples else None)
        driver.compile()
        if self.warm_up:
            driver.run()
        return partial(_visible, driver) if problem.system.kinks else driver.run

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

    def load(self) -> Any:
        """Import what the modes call (a module, a class, a function)."""
        return import_module(self.module) if self.module else None

    def library(self, rtol: float, atol: float) -> Library:
        """The library at these tolerances, for the driver.

        Raises
        ------
        UnavailableError
            Where it is not installed.
        """
        try:
            module = self.load()
        except ImportError as error:
            raise UnavailableError(self._absent) from error
        rtol = max(rtol, self.least_rtol)
        # An explicit method's first step is as exact as it is short.
        errors = (STOPPED * rtol, STOPPED * atol) if self.implicit else (EPSILON, 0.0)
        return Library(
            self, module, rtol, atol, self.landing, self.restart, self.accuracy(rtol, atol), errors, self.located,
            self.mode, partial(self.loosened, rtol, atol),
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
