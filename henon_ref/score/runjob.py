"""The jobs that a worker does: a solver's run with its timing, and the samples that figures are drawn from."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from henon_ref import registry
from henon_ref.model.modes import Mode
from henon_ref.score.returned import check_prepared, check_returned
from henon_ref.score.settings import Setting
from henon_ref.score.timing import repeat
from henon_ref.score.worker import Stages
from henon_ref.solver import Solver
from henon_ref.trajectory import Problem, Trajectory

PREPARE_SECONDS = 120.0
"""Time that the preparation of a run may take [s]."""
LOADING_SECONDS = 20.0
"""Time that a first run of a reading may take for what its preparation could not foresee (compiling, loading) [s]."""
BUDGET = 0.3
"""Seconds that the samples of one row may take where the caller does not say how many to take."""
FOLD, SPARE = 10, 100_000
"""A run may return so many times the truth's transitions, and so many more: scoring takes time outside of the fence."""
MOST_SHOWN = 40
"""Transitions in a figure of the motion; more cannot be told apart."""
SAMPLE_COUNT = 1201
"""Points of a curve in a figure."""
PREPARED, RAN, TIMED, SAMPLED, DRAWN = "prepared", "ran", "timed", "sampled", "drawn"
"""Stages of the messages."""


@dataclass(frozen=True)
class Prepared:
    """What is known once a run is prepared."""

    landing: str
    library_version: str
    compile_s: float


@dataclass(frozen=True)
class Ran:
    """The first run: its answer, which is checked before anything is timed."""

    trajectory: Trajectory
    wall_s: float


@dataclass(frozen=True)
class RunJob:
    """One row: prepare, run, and once the answer has been checked, time."""

    reading: str
    """Name of the reading."""
    name: str
    """Name of the solver."""
    solver: str | Solver
    """The solver, or the name under which the worker finds it."""
    problem: Problem
    setting: Setting
    timeout: float
    """Seconds that one run may take."""
    repeats: int | None
    """Samples to time; None: as many as fit the budget."""
    most: int
    """Transitions that it may return."""
    cold: bool = False
    """The solver's first run of this reading: whatever it loads on the way is not what a run costs."""

    @property
    def seconds(self) -> float:
        return PREPARE_SECONDS

    @property
    def grace(self) -> float:
        """Seconds after which a run that does not keep its deadline is stopped from outside."""
        return 1.25 * self.timeout + 1.0 + (LOADING_SECONDS if self.cold else 0.0)

    def timing_seconds(self, first: float) -> float:
        """Time that all samples may take, given the first run's."""
        return 5.0 + 4.0 * (BUDGET + first * (self.repeats or 3))

    def stages(self) -> Stages:
        chosen = registry.solver(self.solver) if isinstance(self.solver, str) else self.solver
        version = chosen.version
        begin = time.perf_counter()
        run = chosen.prepare(
            self.problem,
            rtol=self.setting.rtol,
            atol=self.setting.atol,
            step=self.setting.step,
            deadline=self.timeout,
        )
        took = time.perf_counter() - begin
        landing, version = check_prepared(run, landing=chosen.landing, version=version)
        yield PREPARED, Prepared(landing, version, took)
        begin = time.perf_counter()
        returned = run()
        first = time.perf_counter() - begin
        again = yield RAN, Ran(check_returned(returned, self.problem, most=self.most), first)
        if again:
            yield TIMED, repeat(run, first=first, repeats=self.repeats, budget=BUDGET, cold=self.cold)


def most_transitions(exact: int) -> int:
    """How many transitions a run may return where the exact one has so many (nought where that is not known)."""
    return FOLD * exact + SPARE


@dataclass(frozen=True)
class Samples:
    """A trajectory on a grid of times, for figures."""

    times: NDArray[np.float64]
    """(k,) [s]."""
    states: NDArray[np.float64]
    """(k, n)."""
    modes: tuple[Mode, ...] | None
    """Mode at each time."""


@dataclass(frozen=True)
class SampleJob:
    """The trajectory on a grid of times, by one solver at one setting."""

    reading: str
    name: str
    solver: str | Solver
    problem: Problem
    setting: Setting
    times: tuple[float, ...]
    timeout: float

    @property
    def seconds(self) -> float:
        return PREPARE_SECONDS + self.timeout

    def stages(self) -> Stages:
        chosen = registry.solver(self.solver) if isinstance(self.solver, str) else self.solver
        times = np.array(self.times)
        trajectory = chosen.prepare(
            self.problem,
            rtol=self.setting.rtol,
            atol=self.setting.atol,
            step=self.setting.step,
            sample_times=times,
            deadline=self.timeout,
        )()
        if trajectory.samples is not None:
            yield SAMPLED, Samples(times, trajectory.samples, trajectory.sample_modes)


def sample_times(start: float, after: float, until: float, transitions: Sequence[float]) -> tuple[float, ...]:
    """Times at which figures want the state: the measured window, or its last part where it is crowded.

    Parameters
    ----------
    start, after, until : float
        Initial time, start of the measured window, end of the run [s].
    transitions : sequence of float
        Times of the truth's transitions [s].
    """
    begin = max(start, after) if after < until else start
    inside = [time for time in transitions if begin <= time <= until]
    if len(inside) > MOST_SHOWN:
        begin = inside[-MOST_SHOWN]
    return tuple(np.linspace(begin, until, SAMPLE_COUNT).tolist())
