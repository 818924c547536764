"""A campaign: every solver on every reading of some cases, by a pool of workers, row by row.

The truths come first. Then each solver runs each reading from the loosest setting to the tightest; each answer is
scored before it is timed, and each finished row goes to the journal before the next run starts.
"""

from __future__ import annotations

import logging
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from typing import Any

from henon_ref.casefile.case import Case, Reading
from henon_ref.harness import registry
from henon_ref.harness.campaign import WORKERS_NEED
from henon_ref.harness.campaign.options import TRUTH, Deliver, Draw, Observer, Options
from henon_ref.harness.campaign.plan import (
    NOT_RUN,
    SAMPLERS,
    PendingRuns,
    case_state,
    check_solvers,
    chosen_solvers,
    pending_runs,
    reading_is_drawn,
    sample_job,
)
from henon_ref.harness.campaign.results import CaseState, ReadingResult
from henon_ref.harness.campaign.rows import Outcome, record, scored
from henon_ref.harness.campaign.run_jobs import TOO_LONG_TO_PREPARE, PrepareJob, RunJob, TimeJob, most_transitions
from henon_ref.harness.campaign.settings import Setting
from henon_ref.harness.campaign.truth_job import Statement, TruthJob, stored_statement
from henon_ref.harness.score.verdict import RIGHT
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job

_LOG = logging.getLogger(__name__)


class Campaign:
    """Runs the cases; hands over each one's results as soon as its last job is done.

    Parameters
    ----------
    cases : sequence of Case
    options : Options
    deliver : callable
        Called with the case, its readings' results and its rows.
    draw : callable, optional
        Makes the job that draws a reading's figures, once its rows are in; None: no figures, and no samples.
    observer : Observer, optional
    """

    def __init__(
        self,
        cases: Sequence[Case],
        options: Options,
        deliver: Deliver,
        *,
        draw: Draw | None = None,
        observer: Observer | None = None,
    ) -> None:
        self.cases = cases
        self.options = options
        self.deliver = deliver
        self.draw = draw
        self.observer: Observer = observer or Observer()
        self._pool = WorkerPool(
            workers=options.processes, memory=options.memory, main=options.of_main, modules=WORKERS_NEED
        )
        self._statements: dict[tuple[str, str], Statement] = {}

    def run(self) -> None:
        """Run everything.

        Raises
        ------
        CaseError
            Where a solver is unknown, or none of those asked for is meant for a case.
        """
        check_solvers(self.cases, self.options)
        self._fetch_truths()
        states = [case_state(case, self._statements, self.options) for case in self.cases]
        waiting = sum(self._queue_runs(state) for state in states)
        kept = sum(len(state.rows) for state in states)
        self.observer.runs(waiting + kept, kept)
        self._pool.run(self.observer.tick)
        for state in states:
            if not state.delivered:  # all its rows were kept from before, and nothing is drawn
                self._deliver(state)

    def _fetch_truths(self) -> None:
        """What every reading is scored against: read where it is stored, else computed by a worker."""
        unknown = 0
        for case in self.cases:
            for reading in case.readings:
                if not chosen_solvers(reading, self.options):
                    continue
                stored = stored_statement(case, reading)
                if stored is None:
                    unknown += 1
                    self._pool.add("truths", self._truth(case, reading))
                else:
                    self._statements[case.name, reading.name] = stored
        self.observer.truths(unknown)
        self._pool.run(self.observer.tick)

    def _truth(self, case: Case, reading: Reading) -> Jobs:
        """Where there is none, the runs are not scored, and the report says why."""
        self.observer.begun(case.name, f"{reading.name} {TRUTH}")
        found: Statement | Failure = yield TruthJob(case, reading)
        if isinstance(found, Failure):
            found = Statement(None, reason=found.reason)
        self._statements[case.name, reading.name] = found
        self.observer.truth(f"{case.name} {reading.name}")

    def _queue_runs(self, state: CaseState) -> int:
        """Queue a case's runs, and what is sampled for its figures; how many rows are to be made."""
        by_solver: dict[str, list[tuple[ReadingResult, Jobs]]] = {}
        rows = 0
        for result in state.results.values():
            for pending in pending_runs(state, result, self.options):
                by_solver.setdefault(pending.name, []).append((result, self._rows(state, pending)))
                rows += len(pending.settings)
            if self.draw is not None and reading_is_drawn(state, result):
                by_solver.setdefault(SAMPLERS[0], []).append((result, self._samples(result)))
        # The registry names the fast solvers first: begun last, they fill the gaps that the slow ones leave.
        for name, sequences in reversed(by_solver.items()):
            for result, jobs in sequences:
                self._add(f"{state.case.name} {name}", state, result, jobs)
        return rows

    def _add(self, queue: str, state: CaseState, result: ReadingResult, jobs: Jobs, *, first: bool = False) -> None:
        """Queue jobs on a reading, and count them until they are done."""
        state.pending[result.reading.name] += 1
        self._pool.add(queue, self._counted(state, result, jobs), first=first)

    def _counted(self, state: CaseState, result: ReadingResult, jobs: Jobs) -> Jobs:
        """The jobs; after the last ones of a reading its figures are queued, after a case's it is delivered."""
        yield from jobs
        reading = result.reading.name
        state.pending[reading] -= 1
        drawn = self.draw is None or not reading_is_drawn(state, result) or result.drawn
        if state.pending[reading] == 0 and not drawn:
            result.drawn = True
            self._add("figures", state, result, self._figures(state, result), first=True)
        if not state.pending.total():
            self._deliver(state)

    def _rows(self, state: CaseState, pending: PendingRuns) -> Jobs:
        """The rows of one solver on one reading; one that ran out of time is not asked for more accuracy.

        Unless it did so among transitions that are not the truth's (what such a run costs tells nothing of the others),
        or its rows are demanded.
        """
        settings = iter(pending.settings)
        for number, setting in enumerate(settings):
            outcome = yield from self._outcome(state, pending, setting, cold=number == 0)
            self._keep(state, outcome, pending.result)
            if outcome.timed_out and not (outcome.invented or pending.demanded):
                for untried in _untried(outcome, settings):
                    self._keep(state, untried, pending.result)

    def _outcome(
        self, state: CaseState, pending: PendingRuns, setting: Setting, *, cold: bool
    ) -> Generator[Job, Any, Outcome]:
        """Prepare, run, score, and where the answer is right, time."""
        reading, expected, options = pending.result.reading, pending.result.expected, self.options
        self.observer.begun(state.case.name, f"{reading.name} {pending.name} {setting.label}")
        version = registry.library_version(pending.solver) if isinstance(pending.solver, str) else ""
        outcome = Outcome(state.case.name, reading, pending.name, setting, library_version=version)
        prepared = yield PrepareJob(pending.solver, reading.problem, setting, options.timeout)
        if isinstance(prepared, Failure):
            if prepared.ignored:  # there is no deadline that it was told of
                prepared = Failure("timeout", TOO_LONG_TO_PREPARE)
            return replace(outcome, failure=prepared)
        outcome = replace(outcome, **vars(prepared))
        ran = yield RunJob(options.timeout, most_transitions(0 if expected is None else len(expected.transitions)))
        if isinstance(ran, Failure):
            return replace(outcome, failure=ran)
        outcome = scored(replace(outcome, trajectory=ran.trajectory), expected)
        if outcome.score is None or outcome.score.verdict != RIGHT or not options.timed:
            whole = ran.trajectory.status not in ("timeout", "failed")
            return replace(outcome, samples=(ran.wall_s,) if whole else ())
        samples = yield TimeJob(ran.wall_s, options.repeats, cold)
        if isinstance(samples, Failure):
            return replace(outcome, repeat_failure=samples)
        return replace(outcome, samples=samples)

    def _keep(self, state: CaseState, outcome: Outcome, result: ReadingResult) -> None:
        finished = record(outcome, result.expected)
        state.keep((result.reading.name, outcome.solver, outcome.setting), finished)
        self.observer.row(finished)

    def _samples(self, result: ReadingResult) -> Jobs:
        """The motion, by the first sampler that can."""
        for name in SAMPLERS:
            found = yield sample_job(result, name, self.options)
            if found is not None and not isinstance(found, Failure):
                result.samples, result.sampled_by = found, name
                return
            _LOG.info("%s cannot sample %s: %s", name, result.reading.name, found.reason if found else "no samples")

    def _figures(self, state: CaseState, result: ReadingResult) -> Jobs:
        if self.draw is None:
            return
        drawn: dict[str, bytes] | Failure = yield self.draw(result, state.records(result.reading.name))
        if isinstance(drawn, Failure):
            result.figures_reason = drawn.reason
        else:
            result.figures = drawn

    def _deliver(self, state: CaseState) -> None:
        state.delivered = True
        self.deliver(state.case, list(state.results.values()), state.records())
        if state.journal is not None and not self.options.keep_journals:
            state.journal.remove()


def _untried(outcome: Outcome, settings: Iterator[Setting]) -> Iterator[Outcome]:
    """What is said of tighter settings than one that took too long: an ignored deadline is the fault of them all."""
    step, rtol = outcome.setting.step, outcome.setting.rtol
    at = f"{rtol:g}".replace("e-0", "e-") if step is None else f"a step of {step:g} s"
    reason = NOT_RUN + (f"timed out at {at}" if outcome.prepared else f"at {at} {TOO_LONG_TO_PREPARE}")
    ignored = outcome.failure is not None and outcome.failure.ignored
    for setting in settings:
        yield Outcome(
            outcome.case, outcome.reading, outcome.solver, setting, outcome.library_version, outcome.landing,
            failure=Failure("timeout", reason, ignored),
        )  # fmt: skip
