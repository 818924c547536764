"""Jobs of a campaign, which workers do: the truth of a reading, a row (prepare, run, time), and samples for figures.

The three jobs of a row are done by one worker, which keeps the prepared run. The campaign decides after the first run
whether to time it.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from henon_ref.casefile.case import Case, Reading
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
from henon_ref.workers.worker import WorkerState

if TYPE_CHECKING:
    from henon_ref.harness.truth import Truth

TRUTH_SECONDS = 300.0
"""Limit on the processor time to compute a truth that is not stored [s]."""
PREPARE_SECONDS = 240.0
"""Limit on the processor time of a preparation [s]; diffrax took 108 s for the 42 modes of block_chain on a busy
machine."""
TOO_LONG_TO_PREPARE = f"preparing it took more than {PREPARE_SECONDS:g} s of processor time"
BUDGET = 0.2
"""Time for all samples of one row if the number of samples is not given [s]."""
SPARE_SECONDS = 5.0
"""Part of the limit on the time of all samples that does not depend on the run [s]."""
MOST_FOLD, MOST_SPARE = 10, 100_000
"""Largest number of returned transitions: this multiple of the exact number, plus this allowance. The limit bounds the
time of scoring, which takes place in the caller's process."""


def fetch_truth(state: WorkerState, case: Case, reading: Reading) -> Truth:
    """Job: return the truth of a reading; compute it if it is not stored."""
    from henon_ref.harness.truth.compute import truth_for

    return truth_for(case, reading)


def prepare(
    state: WorkerState, solver: str | Solver, problem: Problem, setting: Setting, timeout: float
) -> tuple[str, str, float]:
    """Job: prepare a run and keep it; return landing, version of the library, and wall time [s].

    ``solver`` is a solver or its name in the registry, ``timeout`` the limit on the processor time of one run [s].
    """
    state.kept.clear()
    own = registry.solver(solver) if isinstance(solver, str) else solver
    version = own.version
    begin = perf_counter()
    run = _prepared(own, problem, setting, timeout)
    took = perf_counter() - begin
    landing, version = check_prepared(run, landing=own.landing, version=version)
    state.kept["run"] = run, problem
    return landing, version, took


def _prepared(
    solver: Solver, problem: Problem, setting: Setting, timeout: float, times: NDArray[np.float64] | None = None
) -> Run:
    """Prepare a run, with samples at ``times`` [s] if given."""
    return solver.prepare(
        problem, rtol=setting.rtol, atol=setting.atol, step=setting.step, sample_times=times, deadline=timeout
    )


def run_once(state: WorkerState, most: int) -> tuple[Trajectory, float]:
    """Job: do the prepared run once; return its result, checked, and its wall time without compilation [s].

    ``most`` is the largest number of transitions that the run may return.
    """
    run, problem = state.kept["run"]
    with state.off_the_clock():
        begin = run_time()
        returned = run()
        took = run_time() - begin
    if isinstance(run, SelfTimedRun) and run.wall_s == run.wall_s:  # not NaN
        took = check_wall_time("wall_s", run.wall_s)
    trajectory = check_trajectory(returned, problem, most=most)
    state.kept["first"] = trajectory, most
    return trajectory, took


def time_repeats(state: WorkerState, first: float, repeats: int | None, cold: bool) -> tuple[float, ...]:
    """Job: repeat the prepared run for its wall time; return the samples [s].

    See :func:`~henon_ref.harness.campaign.timing.repeat`; the run is cold if it was the solver's first on this
    reading, so that its time ``first`` includes loading of modules.
    """
    (run, problem), (trajectory, most) = state.kept["run"], state.kept["first"]
    last: list[object] = []
    with state.off_the_clock():
        samples = repeat(run, first=first, repeats=repeats, budget=BUDGET, cold=cold, result=last)
    for returned in last:
        check_repeated(returned, problem, trajectory, most=most)
    return samples


def sample(
    state: WorkerState, name: str, problem: Problem, setting: Setting, timeout: float, times: tuple[float, ...]
) -> Samples | None:
    """Job: run a solver with samples at ``times`` [s]; None if it returns no samples."""
    grid = np.array(times)
    trajectory = _prepared(registry.solver(name), problem, setting, timeout, grid)()
    if trajectory.samples is None:
        return None
    return Samples(grid, trajectory.samples, trajectory.sample_modes)


def sample_times(start: float, after: float, until: float, transitions: Sequence[float]) -> tuple[float, ...]:
    """Return the sample times of the figures [s]: a uniform grid on the measured window, which begins at ``after``.

    If the window has more than 40 of the exact ``transitions`` (times [s]), which would overlap, the grid covers only
    its end with the last 40.
    """
    begin = max(start, after) if after < until else start
    inside = [time for time in transitions if begin <= time <= until]
    if len(inside) > 40:
        begin = inside[-40]
    return tuple(np.linspace(begin, until, 1201).tolist())
