"""The runs of the study: a library on a reading at one tolerance, restarted in each way, by one worker.

The equations of a reading's modes are made once, for all libraries: that takes longer than most of the runs.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from henon_ref.baselines.adapter import Adapter
from henon_ref.baselines.mode_table import ModeTable
from henon_ref.baselines.work import Work
from henon_ref.casefile.case import Case, Reading
from henon_ref.harness import registry
from henon_ref.harness.campaign.contract_check import check_trajectory
from henon_ref.harness.campaign.options import Observer, Options
from henon_ref.harness.campaign.rows import Outcome, record, scored
from henon_ref.harness.campaign.run_jobs import PREPARE_SECONDS, most_transitions
from henon_ref.harness.campaign.settings import Setting, settings, state_scale
from henon_ref.harness.campaign.truth_job import stored_statement
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.reference import Expected
from henon_ref.jit.processor_time import run_time
from henon_ref.solver import Run, Solver
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job, WorkerState, failure_of

Entry = str | Solver | Adapter
"""A solver, or the name under which a worker finds it."""
LIMIT = 2.0
"""Processor time that one run may take [s]; ..."""
LONGER = 5.0
"""... so many times longer where another restart of the library is right in it."""
EQUATIONS = "equations"
"""Name under which a worker keeps the modes of a reading."""


@dataclass(frozen=True)
class Restarted(Job):
    """Run some solvers once each on one reading; the result is their rows, in order."""

    case: str
    reading: Reading
    expected: Expected
    setting: Setting
    solvers: tuple[Entry, ...]
    """A library in each of its restarts, or with each of its options."""
    limit: float = LIMIT

    @property
    def seconds(self) -> float:
        return PREPARE_SECONDS + (1.0 + LONGER) * self.limit * len(self.solvers)

    def run(self, state: WorkerState) -> list[RunRow]:
        rows = {entry: self._row(state, entry, self.limit) for entry in self.solvers}
        if any(row.verdict == "right" for row in rows.values()):
            late = [entry for entry, row in rows.items() if row.status == "timeout"]
            rows |= {entry: self._row(state, entry, LONGER * self.limit) for entry in late}
        return list(rows.values())

    def failed(self, entry: Entry, failure: Failure) -> RunRow:
        """The row of a solver that has no answer."""
        return record(replace(self._outcome(entry), failure=failure), self.expected).run

    def _outcome(self, entry: Entry) -> Outcome:
        name = entry if isinstance(entry, str) else entry.name
        version = registry.library_version(name) if isinstance(entry, str) else entry.version
        return Outcome(self.case, self.reading, name, self.setting, library_version=version)

    def _row(self, state: WorkerState, entry: Entry, limit: float) -> RunRow:
        outcome = self._outcome(entry)
        try:
            solver: Solver | Adapter = registry.solver(entry) if isinstance(entry, str) else entry
            run = self._prepared(state, solver, limit)
            with state.off_the_clock():
                begin = run_time()
                returned = run()
                took = run_time() - begin
            most = most_transitions(len(self.expected.transitions))
            trajectory = check_trajectory(returned, self.reading.problem, most=most)
        except Exception as error:  # noqa: BLE001 - a library's failure is a row, whatever it raises
            return self.failed(entry, failure_of(error))
        whole = trajectory.status not in ("timeout", "failed")
        outcome = replace(outcome, landing=solver.landing, trajectory=trajectory, samples=(took,) if whole else ())
        return record(scored(outcome, self.expected), self.expected).run

    def _prepared(self, state: WorkerState, solver: Solver | Adapter, limit: float) -> Run:
        problem, rtol, atol = self.reading.problem, self.setting.rtol, self.setting.atol
        if not isinstance(solver, Adapter) or rtol is None or atol is None:
            return solver.prepare(problem, rtol=rtol, atol=atol, deadline=limit)
        reading, known = state.kept.get(EQUATIONS, (None, None))
        if reading != (self.case, self.reading.name):
            # An empty table: solvers leave the modes' equations there for each other.
            horizon = float(problem.until) - float(problem.start)
            known = ModeTable(problem.system, solver.library(rtol, atol), Work(None), horizon)
            state.kept[EQUATIONS] = (self.case, self.reading.name), known
        return solver.prepare(problem, rtol=rtol, atol=atol, deadline=limit, known=known)


@dataclass
class Study:
    """What has been run, and what has not."""

    rows: list[RunRow]
    cut: int = 0
    """Tolerances of a library on a reading that were left out, for all of its restarts alike."""


def run_all(cases: Sequence[Case], groups: Sequence[tuple[Entry, ...]], options: Options, observer: Observer) -> Study:
    """Run groups of solvers on every reading that has a truth.

    A tolerance is left out for a whole group where at a looser one nothing in it was right and something ran out of
    time.

    Parameters
    ----------
    cases : sequence of Case
    groups : sequence of tuples
        What is to be compared: a library in each of its restarts, say.
    options : Options
        Tolerances, processes and memory are taken from it.
    observer : Observer
    """
    study = Study([])
    pool = WorkerPool(workers=options.processes, memory=options.memory)
    for case in cases:
        for reading in case.readings:
            pool.add(case.name, _sequence(study, case, reading, groups, options.tolerances or reading.tolerances))
    pool.run(observer.tick)
    order = {(case.name, reading.name): k for k, (case, reading) in enumerate(_readings(cases))}
    study.rows.sort(key=lambda row: order[row.problem])
    return study


def _readings(cases: Sequence[Case]) -> Iterator[tuple[Case, Reading]]:
    return ((case, reading) for case in cases for reading in case.readings)


def _sequence(
    study: Study,
    case: Case,
    reading: Reading,
    groups: Sequence[tuple[Entry, ...]],
    tolerances: Sequence[float],
) -> Jobs:
    """All groups on one reading, by one worker."""
    truth = stored_statement(case, reading)
    if truth is None or truth.expected is None:
        return
    scale = state_scale(reading.problem, truth.expected)
    wanted = settings(fixed_step=False, tolerances=tolerances, steps=(), scale=scale)
    for group in groups:
        if not _listed(reading, group[0]):
            continue
        for number, setting in enumerate(wanted):
            rows = yield from _ran(Restarted(case.name, reading, truth.expected, setting, group))
            study.rows += rows
            late = any(row.status == "timeout" for row in rows)
            if late and not any(row.verdict == "right" for row in rows):
                study.cut += len(wanted) - number - 1
                break


def _listed(reading: Reading, entry: Entry) -> bool:
    """Whether a reading is meant for a solver."""
    name = registry.base_name(entry if isinstance(entry, str) else entry.name)
    return reading.solvers is None or name in reading.solvers


def _ran(job: Restarted) -> Generator[Job, Any, list[RunRow]]:
    """The rows of a job; where one of its solvers takes the worker with it, each has a worker of its own."""
    result = yield job
    if not isinstance(result, Failure):
        return list(result)
    if len(job.solvers) == 1:
        return [job.failed(job.solvers[0], result)]
    rows: list[RunRow] = []
    for entry in job.solvers:
        rows += yield from _ran(replace(job, solvers=(entry,)))
    return rows
