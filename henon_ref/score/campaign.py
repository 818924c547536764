"""A campaign: every solver on every reading of some cases, behind fences, row by row.

The truths come first. Then each case and solver is a lane of runs, from the loosest setting to the tightest; each
answer is scored before it is timed, and each finished row goes to the journal before the next run starts.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from henon_ref import registry
from henon_ref.model.case import Case
from henon_ref.score.fence import Answer, Fence, Lane
from henon_ref.score.options import Deliver, Draw, Observer, Options, Silent
from henon_ref.score.plan import (
    SAMPLERS,
    CaseLane,
    case_lanes,
    check_solvers,
    chosen_solvers,
    reading_is_drawn,
    sample_job,
)
from henon_ref.score.results import CaseState
from henon_ref.score.rows import Outcome, record, score_outcome
from henon_ref.score.runjob import DRAWN, PREPARED, RAN, SAMPLED, TIMED, RunJob, SampleJob
from henon_ref.score.truthjob import KNOWN, Statement, TruthJob, stored_statement
from henon_ref.score.verdict import RIGHT
from henon_ref.score.worker import Failure, Job

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
        self.observer: Observer = observer or Silent()
        self._fence = Fence(processes=options.processes, memory=options.memory)
        self._outcomes: dict[int, Outcome] = {}

    def run(self) -> None:
        """Run everything.

        Raises
        ------
        CaseError
            Where a solver is unknown, or none of those asked for is meant for a case.
        """
        check_solvers(self.cases, self.options)
        statements = self._truths()
        lanes: list[CaseLane] = []
        states: list[CaseState] = []
        for case in self.cases:
            state, new = case_lanes(case, statements, self.options, figures=self.draw is not None)
            states.append(state)
            lanes += new
        waiting = sum(isinstance(job, RunJob) for lane in lanes for job in lane.jobs)
        kept = sum(len(state.rows) for state in states)
        self.observer.runs(waiting + kept, kept)
        self._fence.run(lanes, self)
        for state in states:
            if not state.delivered:  # all its rows were kept from before, and nothing is drawn
                self._deliver(state)

    def _truths(self) -> dict[tuple[str, str], Statement]:
        """What every reading is scored against: read where it is stored, else computed behind the fence."""
        collected = _Truths(self.observer)
        lanes: list[Lane] = []
        for case in self.cases:
            for reading in case.readings:
                if not chosen_solvers(reading, self.options):
                    continue
                known = stored_statement(case, reading)
                if known is None:
                    lanes.append(Lane(case.name, deque([TruthJob(case, reading)]), kin="truth"))
                else:
                    collected.statements[case.name, reading.name] = known
        self.observer.truths(len(lanes))
        self._fence.run(lanes, collected)
        return collected.statements

    def receive(self, lane: Lane, job: Job, stage: str, payload: Any) -> Answer:
        """A stage of a job is reached: say whether and how long to go on."""
        state = _state(lane)
        if isinstance(job, RunJob):
            return self._run_stage(state, job, stage, payload)
        result = state.results[job.reading]  # type: ignore[attr-defined]
        if stage == SAMPLED and isinstance(job, SampleJob):
            result.samples, result.sampled_by = payload, job.name
        elif stage == DRAWN:
            result.figures = payload
        return Answer(None, job.seconds)

    def _run_stage(self, state: CaseState, job: RunJob, stage: str, payload: Any) -> Answer:
        outcome = self._outcome(state, job)
        if stage == PREPARED:
            outcome.landing, outcome.library_version = payload.landing, payload.library_version
            outcome.compile_s = payload.compile_s
            return Answer(None, job.grace)
        if stage == RAN:
            outcome.trajectory = payload.trajectory
            score_outcome(outcome, state.results[job.reading].expected)
            right = outcome.score is not None and outcome.score.verdict == RIGHT
            if not (right and self.options.timed) and outcome.trajectory.status not in ("timeout", "failed"):
                outcome.samples = (payload.wall_s,)
            return Answer(right and self.options.timed, job.timing_seconds(payload.wall_s))
        if stage == TIMED:
            outcome.samples = payload
        return Answer(None, job.seconds)

    def finished(self, lane: Lane, job: Job, failure: Failure | None) -> None:
        """A job is over; a run's row goes to the journal."""
        state = _state(lane)
        if isinstance(job, RunJob):
            outcome = self._outcome(state, job)
            del self._outcomes[id(job)]
            if outcome.trajectory is None:
                outcome.failure = failure
            else:
                outcome.repeat_failure = failure
            self._keep(state, job, outcome)
            if _timed_out(outcome):
                self._give_up_on_tighter(lane, state, job, outcome)
        elif isinstance(job, SampleJob):
            self._sampled(lane, state, job, failure)
        elif failure is not None:
            state.results[job.reading].figures_reason = failure.reason  # type: ignore[attr-defined]
        self._done(state, job.reading, drawable=isinstance(job, RunJob | SampleJob))  # type: ignore[attr-defined]

    def tick(self) -> None:
        """Some time has passed."""
        self.observer.tick()

    def _outcome(self, state: CaseState, job: RunJob) -> Outcome:
        if id(job) not in self._outcomes:
            version = registry.library_version(job.solver) if isinstance(job.solver, str) else ""
            reading = state.results[job.reading].reading
            self._outcomes[id(job)] = Outcome(state.case.name, reading, job.name, job.setting, library_version=version)
            self.observer.begun(state.case.name, f"{job.reading} {job.name} {job.setting.label}")
        return self._outcomes[id(job)]

    def _keep(self, state: CaseState, job: RunJob, outcome: Outcome) -> None:
        finished = record(outcome, state.results[job.reading].expected)
        state.keep((job.reading, job.name, job.setting), finished)
        self.observer.row(finished)

    def _give_up_on_tighter(self, lane: Lane, state: CaseState, job: RunJob, outcome: Outcome) -> None:
        """A solver that ran out of time is not asked for more accuracy on the same reading."""
        reason = f"not tried: with {job.setting.label} it took more than {job.timeout:g} s"
        for skipped in [j for j in lane.jobs if isinstance(j, RunJob) and j.reading == job.reading]:
            lane.jobs.remove(skipped)
            untried = replace(outcome, setting=skipped.setting, trajectory=None, score=None, samples=(), compile_s=None)
            untried.failure = Failure("timeout", reason)
            self._keep(state, skipped, untried)
            state.pending[job.reading] -= 1

    def _sampled(self, lane: Lane, state: CaseState, job: SampleJob, failure: Failure | None) -> None:
        """Where one sampler cannot, the next one tries."""
        result = state.results[job.reading]
        following = SAMPLERS.index(job.name) + 1
        if result.samples is None and following < len(SAMPLERS):
            _LOG.info("%s cannot sample %s: %s", job.name, job.reading, failure.reason if failure else "no samples")
            lane.jobs.append(sample_job(result, SAMPLERS[following], self.options))
            state.pending[job.reading] += 1

    def _done(self, state: CaseState, reading: str, *, drawable: bool) -> None:
        """One job less; a reading that is complete is drawn, a case that is complete is handed over."""
        state.pending[reading] -= 1
        result = state.results[reading]
        if state.pending[reading] == 0 and drawable and self.draw is not None and reading_is_drawn(state, result):
            job = self.draw(result, state.records(reading))
            self._fence.add(CaseLane(state.case.name, deque([job]), "figures", here=True, state=state))
            state.pending[reading] += 1
        if not state.pending.total():
            self._deliver(state)

    def _deliver(self, state: CaseState) -> None:
        state.delivered = True
        self.deliver(state.case, list(state.results.values()), state.records())
        if state.journal is not None and not self.options.keep_journals:
            state.journal.remove()


class _Truths:
    """Collects the truths."""

    def __init__(self, observer: Observer) -> None:
        self.observer = observer
        self.statements: dict[tuple[str, str], Statement] = {}

    def receive(self, lane: Lane, job: Job, stage: str, payload: Any) -> Answer:
        """The truth of a reading is known."""
        if isinstance(job, TruthJob) and stage == KNOWN:
            self.statements[job.case.name, job.reading.name] = payload
        return Answer(None, job.seconds)

    def finished(self, lane: Lane, job: Job, failure: Failure | None) -> None:
        """Where there is none, the runs are not scored, and the report says why."""
        if not isinstance(job, TruthJob):
            return
        if failure is not None:
            self.statements[job.case.name, job.reading.name] = Statement(None, reason=failure.reason)
        self.observer.truth(f"{job.case.name} {job.reading.name}")

    def tick(self) -> None:
        """Pass the time on to the observer."""
        self.observer.tick()


def _state(lane: Lane) -> CaseState:
    if not isinstance(lane, CaseLane):
        raise TypeError(f"the lane {lane.name} belongs to no case")
    return lane.case


def _timed_out(outcome: Outcome) -> bool:
    if outcome.failure is not None:
        return outcome.failure.status == "timeout"
    return outcome.trajectory is not None and outcome.trajectory.status == "timeout"
