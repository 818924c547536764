"""Jobs that make one row, done by one worker (prepare, run, time), and the job that samples a motion for figures.

The worker keeps the prepared run for the later jobs. The campaign decides after the first run whether to time it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from henon_ref.harness import registry
from henon_ref.harness.campaign.contract_check import (
    check_prepared,
    check_repeated,
    check_trajectory,
    check_wall_time,
)
from henon_ref.harness.campaign.options import Setting
from henon_ref.harness.campaign.timing import repeat
from henon_ref.jit.processor_time import run_time
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run, SelfTimedRun, Solver
from henon_ref.trajectory import Samples, Trajectory
from henon_ref.workers.worker import Job, WorkerState

PREPARE_SECONDS = 240.0
"""Limit on the processor time of a preparation [s]; diffrax took 108 s for the 42 modes of block_chain on a busy
machine."""
TOO_LONG_TO_PREPARE = f"preparing it took more than {PREPARE_SECONDS:g} s of processor time"
BUDGET = 0.2
"""Time for all samples of one row if the number of samples is not given [s]."""
MOST_FOLD, MOST_SPARE = 10, 100_000
"""Largest number of returned transitions: this multiple of the exact number, plus this allowance. The limit bounds the
time of scoring, which takes place in the caller's process."""
MOST_SHOWN = 40
"""Largest number of transitions in a figure of the motion; more would overlap."""
SAMPLE_COUNT = 1201
"""Points of a curve in a figure."""
KEPT, FIRST = "run", "first"
"""Keys in the state of a worker: the prepared run and its problem; the first result and the limit on transitions."""


@dataclass(frozen=True)
class Prepared:
    """Result of a preparation."""

    landing: str
    library_version: str
    compile_s: float


@dataclass(frozen=True)
class Ran:
    """Result of the first run, which is checked before any timing."""

    trajectory: Trajectory
    wall_s: float
    """Wall time without compilation [s]."""


@dataclass(frozen=True)
class _SolverJob(Job):
    """A job of one solver at one setting."""

    solver: str | Solver
    """The solver, or its name in the registry."""
    problem: Problem
    setting: Setting
    timeout: float
    """Limit on the processor time of one run [s]."""

    @property
    def seconds(self) -> float:
        return PREPARE_SECONDS

    def found(self) -> Solver:
        return registry.solver(self.solver) if isinstance(self.solver, str) else self.solver

    def prepared(self, solver: Solver, times: NDArray[np.float64] | None = None) -> Run:
        """Prepare a run, with samples at ``times`` [s] if given."""
        own = self.setting
        return solver.prepare(
            self.problem, rtol=own.rtol, atol=own.atol, step=own.step, sample_times=times, deadline=self.timeout
        )


@dataclass(frozen=True)
class PrepareJob(_SolverJob):
    """Prepare a run and keep it in the worker; the result is :class:`Prepared`."""

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
    """Largest number of transitions that the run may return."""

    @property
    def seconds(self) -> float:
        """Time limit of the job [s], a little longer than the deadline that the solver itself should keep."""
        return 1.25 * self.timeout + 1.0

    def run(self, state: WorkerState) -> Ran:
        run, problem = state.kept[KEPT]
        with state.off_the_clock():
            begin = run_time()
            returned = run()
            took = run_time() - begin
        if isinstance(run, SelfTimedRun) and run.wall_s == run.wall_s:  # not NaN
            took = check_wall_time("wall_s", run.wall_s)
        trajectory = check_trajectory(returned, problem, most=self.most)
        state.kept[FIRST] = trajectory, self.most
        return Ran(trajectory, took)


@dataclass(frozen=True)
class TimeJob(Job):
    """Repeat the prepared run for its wall time; the result is the samples [s]."""

    rests: ClassVar[bool] = True

    first: float
    """Wall time of the first run [s]."""
    repeats: int | None
    """Number of samples; None: as many as fit into the budget."""
    cold: bool
    """Whether the first run was the solver's first on this reading, so that its time includes loading of modules."""

    @property
    def seconds(self) -> float:
        """Time limit of all samples [s]."""
        return 5.0 + 4.0 * (BUDGET + self.first * (self.repeats or 3))

    def run(self, state: WorkerState) -> tuple[float, ...]:
        (run, problem), (trajectory, most) = state.kept[KEPT], state.kept[FIRST]
        last: list[object] = []
        with state.off_the_clock():
            samples = repeat(run, first=self.first, repeats=self.repeats, budget=BUDGET, cold=self.cold, result=last)
        for returned in last:
            check_repeated(returned, problem, trajectory, most=most)
        return samples


def most_transitions(exact: int) -> int:
    """Return the largest number of transitions that a run may return, given the exact number (0 if unknown)."""
    return MOST_FOLD * exact + MOST_SPARE


@dataclass(frozen=True)
class SampleJob(_SolverJob):
    """Run one solver with samples on a grid of times; the result is :class:`Samples`, or None without samples."""

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
    """Return the sample times of the figures [s]: a uniform grid on the measured window, which begins at ``after``.

    If the window has more than ``MOST_SHOWN`` of the exact ``transitions`` (times [s]), the grid covers only its end
    with the last ``MOST_SHOWN``.
    """
    begin = max(start, after) if after < until else start
    inside = [time for time in transitions if begin <= time <= until]
    if len(inside) > MOST_SHOWN:
        begin = inside[-MOST_SHOWN]
    return tuple(np.linspace(begin, until, SAMPLE_COUNT).tolist())
