"""A library as a solver, and with its tolerances as the driver sees it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.driver import prepared, tolerances
from henon_ref.baselines.flow import Flow, Library
from henon_ref.baselines.mode_functions import ModeFunctions
from henon_ref.baselines.restart import STOPPED, Restart
from henon_ref.baselines.work import Work, installed_version
from henon_ref.errors import UnavailableError
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run

SCOUTING = 1e-6
"""Tolerance of the run that finds out which modes a problem visits: loose enough to cost nothing beside compiling."""


@dataclass(frozen=True)
class Adapter(ABC):
    """A library as a :class:`henon_ref.solver.Solver`."""

    name: str
    restart: Restart = field(default="event-free-step", kw_only=True)
    fixed_step: ClassVar[bool] = False
    landing: ClassVar[str]
    distribution: ClassVar[str]
    """The package that has to be installed, as messages name it."""
    extra: ClassVar[str] = ""
    """The extra of this project that brings it; empty where the project itself does."""
    least_rtol: ClassVar[float] = 0.0
    """A smaller ``rtol`` is raised to this."""
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
        return prepared(problem, library, sample_times=sample_times, deadline=deadline, warm_up=self.warm_up)

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

    def library(self, rtol: float, atol: float) -> ConfiguredLibrary:
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
        return ConfiguredLibrary(self, module, max(rtol, self.least_rtol), atol)

    @abstractmethod
    def load(self) -> Any:
        """Import what the flows call (a module, a class, a function)."""

    @abstractmethod
    def flow(self, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float) -> Flow:
        """All that is done once a mode; see :meth:`henon_ref.baselines.flow.Library.flow`."""

    @abstractmethod
    def location_error(self, t: float) -> float:
        """See :meth:`henon_ref.baselines.flow.Library.location_error`."""

    def accuracy(self, rtol: float, atol: float) -> tuple[float, float]:
        """Relative and absolute error that the tolerances allow a step."""
        return rtol, atol

    def start_errors(self, rtol: float, atol: float) -> tuple[float, float]:
        """Relative and absolute error just after a start: here an implicit step's, whose iteration is stopped."""
        return STOPPED * rtol, STOPPED * atol

    def loosened(self, library: ConfiguredLibrary) -> Library:
        """The library at tolerances for finding out which modes are visited."""
        return replace(library, rtol=max(library.rtol, SCOUTING), atol=max(library.atol, SCOUTING))


@dataclass(frozen=True)
class ConfiguredLibrary:
    """A library with its tolerances, as the driver sees it (:class:`henon_ref.baselines.flow.Library`)."""

    adapter: Adapter
    module: Any
    """What its ``load`` imported."""
    rtol: float
    atol: float

    @property
    def landing(self) -> str:
        return self.adapter.landing

    @property
    def accuracy(self) -> tuple[float, float]:
        return self.adapter.accuracy(self.rtol, self.atol)

    @property
    def errors(self) -> tuple[float, float]:
        return self.adapter.start_errors(self.rtol, self.atol)

    def loosened(self) -> Library:
        return self.adapter.loosened(self)

    def location_error(self, t: float) -> float:
        return self.adapter.location_error(t)

    def flow(self, model: ModeFunctions, work: Work, horizon: float) -> Flow:
        return self.adapter.flow(self, model, work, horizon)
