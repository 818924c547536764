"""The jobs that a solver's row is made of, done by one worker: prepare, run, time; and the samples for figures.

What the first one prepares stays in the worker, for the others; whether it is worth timing is decided in between.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from henon_ref.harness import registry
from henon_ref.harness.campaign.contract_check import check_prepared, check_trajectory
from henon_ref.harness.campaign.options import Setting
from henon_ref.harness.campaign.timing import repeat
from henon_ref.jit.processor_time import run_time
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run, SelfTimedRun, Solver
from henon_ref.trajectory import Samples, Trajectory
from henon_ref.workers.worker import Job, WorkerState

PREPARE_SECONDS = 240.0
"""Processor time that the preparation of a run may take [s]: diffrax took 108 s for the 42 modes of block_chain,
beside other work."""
TOO_LONG_TO_PREPARE = f"preparing it took more than {PREPARE_SECONDS:g} s of processor time"
BUDGET = 0.2
"""Seconds that the samples of one row may take where the caller does not say how many to take."""
MOST_FOLD, MOST_SPARE = 10, 100_000
"""A run may return so many times the truth's transitions, and so many more: scoring takes the caller's own time."""
MOST_SHOWN = 40
"""Transitions in a figure of the motion; more cannot be told apart."""
SAMPLE_COUNT = 1201
"""Points of a curve in a figure."""
KEPT = "run"
"""Name under which a worker keeps what it has prepared, and the problem."""


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
    """Without what was compiled in it [s]."""


@dataclass(frozen=True)
class _SolverJob(Job):
    """A job of one solver at one setting."""

    solver: str | Solver
    """The solver, or the name under which the worker finds it."""
    problem: Problem
    setting: Setting
    timeout: float
    """Processor time that one run may take [s]."""

    @property
    def seconds(self) -> float:
        return PREPARE_SECONDS

    def found(self) -> Solver:
        """The solver itself."""
        return registry.solver(self.solver) if isinstance(self.solver, str) else self.solver

    def prepared(self, solver: Solver, times: NDArray[np.float64] | None = None) -> Run:
        """A run that is ready; ``times``: where the state is wanted [s]."""
        own = self.setting
        return solver.prepare(
            self.problem, rtol=own.rtol, atol=own.atol, step=own.step, sample_times=times, deadline=self.timeout
        )


@dataclass(frozen=True)
class PrepareJob(_SolverJob):
    """Prepare a run, and keep it; the result is :class:`Prepared`."""

    def run(self, state: WorkerState) -> Prepared:
        state.kept.clear()
        solver = self.found()
        version = solver.version
        begin = perf_counter()
        run = self.prepared(solver)
        took = perf_counter() - begin
        landing, version = check_prepared(run, landing=solver.landing, version=version)
        state.kept[KEPT] = run, self.problem
        return Prepared(landing, version, took)


@dataclass(frozen=True)
class RunJob(Job):
    """Do the prepared run once; the result is :class:`Ran`."""

    rests: ClassVar[bool] = True

    timeout: float
    most: int
    """Transitions that it may return."""

    @property
    def seconds(self) -> float:
        """One that does not keep its deadline is stopped a little later."""
        return 1.25 * self.timeout + 1.0

    def run(self, state: WorkerState) -> Ran:
        run, problem = state.kept[KEPT]
        with state.off_the_clock():
            begin = run_time()
            returned = run()
            took = run_time() - begin
        if isinstance(run, SelfTimedRun) and math.isfinite(run.wall_s):
            took = run.wall_s
        return Ran(check_trajectory(returned, problem, most=self.most), took)


@dataclass(frozen=True)
class TimeJob(Job):
    """Repeat the prepared run for its wall time; the result is the samples [s]."""

    rests: ClassVar[bool] = True

    first: float
    """Wall time of the first run [s]."""
    repeats: int | None
    """Samples to take; None: as many as fit the budget."""
    cold: bool
    """It was the solver's first run of this reading: whatever it loaded on the way is not what a run costs."""

    @property
    def seconds(self) -> float:
        """For all samples, given the first run's time."""
        return 5.0 + 4.0 * (BUDGET + self.first * (self.repeats or 3))

    def run(self, state: WorkerState) -> tuple[float, ...]:
        run, _ = state.kept[KEPT]
        with state.off_the_clock():
            return repeat(run, first=self.first, repeats=self.repeats, budget=BUDGET, cold=self.cold)


def most_transitions(exact: int) -> int:
    """How many transitions a run may return where the exact one has so many (nought where that is not known)."""
    return MOST_FOLD * exact + MOST_SPARE


@dataclass(frozen=True)
class SampleJob(_SolverJob):
    """Run on a grid of times, by one solver at one setting; the result is :class:`Samples`, or None where it cannot."""

    times: tuple[float, ...]

    @property
    def seconds(self) -> float:
        return PREPARE_SECONDS + self.timeout

    def run(self, state: WorkerState) -> Samples | None:
        times = np.array(self.times)
        trajectory = self.prepared(self.found(), times)()
        if trajectory.samples is None:
            return None
        return Samples(times, trajectory.samples, trajectory.sample_modes)


def sample_times(start: float, after: float, until: float, transitions: Sequence[float]) -> tuple[float, ...]:
    """Times [s] at which figures want the state: the measured window (from ``after`` on), or its last part.

    That is what is shown where the truth's transitions, whose times these are, are too many.
    """
    begin = max(start, after) if after < until else start
    inside = [time for time in transitions if begin <= time <= until]
    if len(inside) > MOST_SHOWN:
        begin = inside[-MOST_SHOWN]
    return tuple(np.linspace(begin, until, SAMPLE_COUNT).tolist())
