"""Campaign: run every solver on every reading of some cases in a pool of workers.

The truths are fetched first. Then each solver runs each reading from the loosest setting to the tightest. Each answer
is scored before it is timed, and each finished row is written to the journal before the next run starts.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from typing import Any, TypeVar

from henon_ref.casefile.case import Case, Reading
from henon_ref.errors import CaseError
from henon_ref.harness import registry
from henon_ref.harness.campaign import WORKERS_NEED
from henon_ref.harness.campaign.comparison import Comparison, ReadingResult
from henon_ref.harness.campaign.jobs import (
    PREPARE_SECONDS,
    TOO_LONG_TO_PREPARE,
    TRUTH_SECONDS,
    Statement,
    fetch_truth,
    most_transitions,
    prepare,
    repeats_seconds,
    run_once,
    run_seconds,
    stored_statement,
    time_repeats,
)
from henon_ref.harness.campaign.options import Options, Setting
from henon_ref.harness.campaign.plan import (
    NOT_RUN,
    SAMPLERS,
    CaseState,
    PendingRuns,
    check_solvers,
    chosen_solvers,
    sample_job,
)
from henon_ref.harness.campaign.progress import TRUTH, Observer, ProgressLine, is_seen
from henon_ref.harness.campaign.rows import Outcome, Record, record, scored
from henon_ref.harness.score.verdict import RIGHT
from henon_ref.jit.cache_folder import cache_root
from henon_ref.solver import Solver
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job

_LOG = logging.getLogger(__name__)

T = TypeVar("T")
Deliver = Callable[[Comparison], None]
"""Function that receives the comparison of a case after its last row is finished."""
Draw = Callable[[ReadingResult, list[Record]], Job]
"""Function that returns the job to draw the figures of a reading; the job's result maps file names to contents."""


def compare(
    case: Case,
    *,
    solvers: Sequence[str | Solver] | None = None,
    tolerances: Sequence[float] | None = None,
    repeats: int | None = None,
    timeout: float = 10.0,
    processes: int = 2,
    progress: bool | None = None,
) -> Comparison:
    """Run every solver on every reading of a case and score the runs against the truth.

    Each run takes place in a worker, a separate process with limits on time and memory. If a solver hangs or crashes,
    its row reports that. An interrupt (Ctrl-C, the stop button of a notebook) ends all workers. A script requires an
    ``if __name__ == "__main__"`` guard only if it has threads and passes a solver that it defines itself. In a
    notebook, a solver of your own must be imported from a module.

    Parameters
    ----------
    case : Case
        From :func:`henon_ref.load_case`.
    solvers : sequence of str or Solver, optional
        Names or instances; None: the solvers that the case lists, or the default solvers if it lists none.
    tolerances : sequence of float, optional
        Relative tolerances that replace those of the case, each at least 1e-16 and below 1.
    repeats : int, optional
        Timing samples per row, at least 1; None: as many as fit into a fraction of a second.
    timeout : float
        Limit on the processor time of one run [s], at least 0.01.
    processes : int
        Number of concurrent runs, at least 1.
    progress : bool, optional
        Whether to show the number of finished rows on standard error; None: only in a terminal or a notebook.

    Returns
    -------
    Comparison

    Raises
    ------
    CaseError
        If an argument is not allowed, for example an unknown solver or a tolerance of 0, or if no solver applies to
        the case.
    """
    if not isinstance(case, Case):
        raise CaseError(f"case is {case!r}, wanted a Case: henon_ref.load_case(path) reads one")
    options = Options(
        solvers=_listed("solvers", solvers),
        tolerances=_listed("tolerances", tolerances),
        repeats=repeats,
        timeout=timeout,
        processes=processes,
    )
    if progress not in (None, True, False):
        raise CaseError(f"progress is {progress!r}, wanted None, True or False")
    found: list[Comparison] = []
    shown = sys.stderr is not None and (is_seen(sys.stderr) if progress is None else progress)
    with ProgressLine(sys.stderr, case.name) if shown else nullcontext() as line:
        compare_all([case], options, found.append, observer=line)
    return found[0]


def _listed(name: str, values: Sequence[T] | None) -> tuple[T, ...] | None:
    """Convert an argument to a tuple; refuse a single string or number."""
    if values is None:
        return None
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise CaseError(f"{name} is {values!r}, wanted a sequence: {name}=[{values!r}]")
    return tuple(values)


def compare_all(
    cases: Sequence[Case],
    options: Options,
    deliver: Deliver,
    *,
    draw: Draw | None = None,
    observer: Observer | None = None,
) -> None:
    """Compare several cases; deliver the comparison of each case after its last run.

    ``draw`` returns the job that draws the figures of a reading after its rows are finished; None: no figures and no
    samples.

    Raises
    ------
    CaseError
        If a solver is unknown, or if none of the requested solvers applies to a case.
    """
    cache_root()  # chooses a usable cache folder, which the workers inherit
    check_solvers(cases, options)
    _Campaign(cases, options, deliver, draw, observer or Observer()).run()


class _Campaign:
    def __init__(
        self, cases: Sequence[Case], options: Options, deliver: Deliver, draw: Draw | None, observer: Observer
    ) -> None:
        self.cases, self.options, self.deliver, self.draw, self.observer = cases, options, deliver, draw, observer
        self._pool = WorkerPool(
            workers=options.processes, memory=options.memory, main=options.of_main, modules=WORKERS_NEED
        )
        self._statements: dict[tuple[str, str], Statement] = {}

    def run(self) -> None:
        """Fetch the truths, run all queued jobs, and deliver every case."""
        self._fetch_truths()
        states = [CaseState(case, self._statements, self.options) for case in self.cases]
        waiting = sum(self._queue_runs(state) for state in states)
        kept = sum(len(state.rows) for state in states)
        self.observer.stage("rows", waiting + kept, kept)
        self._pool.run(self.observer.tick)
        for state in states:
            if not state.delivered:  # all rows came from the journal, and no figure is drawn
                self._deliver(state)

    def _fetch_truths(self) -> None:
        """Read the stored truth of every reading; let a worker compute it if none is stored."""
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
        self.observer.stage("truths", unknown)
        self._pool.run(self.observer.tick)

    def _truth(self, case: Case, reading: Reading) -> Jobs:
        """Compute the truth of a reading; if that fails, the runs are not scored and the report gives the reason."""
        self.observer.begun(case.name, f"{reading.name} {TRUTH}")
        found: Statement | Failure = yield Job(fetch_truth, (case, reading), TRUTH_SECONDS)
        if isinstance(found, Failure):
            found = Statement(None, reason=found.reason)
        self._statements[case.name, reading.name] = found
        self.observer.truth(f"{case.name} {reading.name}")

    def _queue_runs(self, state: CaseState) -> int:
        """Queue the runs of a case and the samples for its figures; return the number of rows to make."""
        by_solver: dict[str, list[tuple[ReadingResult, Jobs]]] = {}
        rows = 0
        for result in state.results.values():
            for pending in state.pending_runs(result):
                by_solver.setdefault(pending.name, []).append((result, self._rows(state, pending)))
                rows += len(pending.settings)
            if self.draw is not None and state.is_drawn(result):
                by_solver.setdefault(SAMPLERS[0], []).append((result, self._samples(result)))
        # The registry lists the fast solvers first. Started last, they fill the gaps left by the slow solvers.
        for name, sequences in reversed(by_solver.items()):
            for result, jobs in sequences:
                self._add(f"{state.case.name} {name}", state, result, jobs)
        return rows

    def _add(self, queue: str, state: CaseState, result: ReadingResult, jobs: Jobs, *, first: bool = False) -> None:
        """Queue a sequence of jobs on a reading, and count it as pending until it is done."""
        state.pending[result.reading.name] += 1
        self._pool.add(queue, self._counted(state, result, jobs), first=first)

    def _counted(self, state: CaseState, result: ReadingResult, jobs: Jobs) -> Jobs:
        """Yield the jobs; after the last job of a reading queue its figures, after the last of a case deliver it."""
        yield from jobs
        reading = result.reading.name
        state.pending[reading] -= 1
        if state.pending[reading] == 0 and self.draw is not None and state.is_drawn(result) and not result.drawn:
            result.drawn = True
            drawing = self._figures(result, self.draw(result, state.records(reading)))
            self._add("figures", state, result, drawing, first=True)
        if not state.pending.total():
            self._deliver(state)

    def _rows(self, state: CaseState, pending: PendingRuns) -> Jobs:
        """Make the rows of one solver on one reading; skip the tighter settings after a timeout.

        They are not skipped if the run that timed out has spurious transitions, since its cost then says nothing
        about other settings, or if the caller requires all rows of the solver.
        """
        settings = iter(pending.settings)
        for number, setting in enumerate(settings):
            outcome = yield from self._outcome(state, pending, setting, cold=number == 0)
            self._keep(state, outcome, pending.result)
            invented = outcome.score is not None and bool(outcome.score.matching.spurious)
            if outcome.timed_out and not (invented or pending.demanded):
                for untried in _untried(outcome, settings):
                    self._keep(state, untried, pending.result)

    def _outcome(
        self, state: CaseState, pending: PendingRuns, setting: Setting, *, cold: bool
    ) -> Generator[Job, Any, Outcome]:
        """Prepare, run and score one setting; time the run if its answer is right."""
        reading, expected, options = pending.result.reading, pending.result.expected, self.options
        self.observer.begun(state.case.name, f"{reading.name} {pending.name} {setting.label}")
        version = registry.library_version(pending.solver) if isinstance(pending.solver, str) else ""
        outcome = Outcome(state.case.name, reading, pending.name, setting, library_version=version)
        given = pending.solver, reading.problem, setting, options.timeout
        prepared = yield Job(prepare, given, PREPARE_SECONDS)
        if isinstance(prepared, Failure):
            if prepared.ignored:  # prepare() has no deadline that it could have kept
                prepared = Failure("timeout", TOO_LONG_TO_PREPARE)
            return replace(outcome, failure=prepared)
        landing, version, took = prepared
        outcome = replace(outcome, landing=landing, library_version=version, compile_s=took)
        most = most_transitions(0 if expected is None else len(expected.transitions))
        ran = yield Job(run_once, (most,), run_seconds(options.timeout), rests=True)
        if isinstance(ran, Failure):
            return replace(outcome, failure=ran)
        trajectory, wall_s = ran
        outcome = scored(replace(outcome, trajectory=trajectory), expected)
        if outcome.score is None or outcome.score.verdict != RIGHT or not options.timed:
            return replace(outcome, samples=(wall_s,) if trajectory.status not in ("timeout", "failed") else ())
        seconds = repeats_seconds(wall_s, options.repeats)
        samples = yield Job(time_repeats, (wall_s, options.repeats, cold), seconds, rests=True)
        if isinstance(samples, Failure):
            return replace(outcome, repeat_failure=samples)
        return replace(outcome, samples=samples)

    def _keep(self, state: CaseState, outcome: Outcome, result: ReadingResult) -> None:
        finished = record(outcome, result.expected)
        state.keep((result.reading.name, outcome.solver, outcome.setting), finished)
        self.observer.row(finished)

    def _samples(self, result: ReadingResult) -> Jobs:
        """Sample the motion by the first sampler that succeeds."""
        for name in SAMPLERS:
            found = yield sample_job(result, name, self.options)
            if found is not None and not isinstance(found, Failure):
                result.samples, result.sampled_by = found, name
                return
            _LOG.info("%s cannot sample %s: %s", name, result.reading.name, found.reason if found else "no samples")

    def _figures(self, result: ReadingResult, job: Job) -> Jobs:
        drawn: dict[str, bytes] | Failure = yield job
        if isinstance(drawn, Failure):
            result.figures_reason = drawn.reason
        else:
            result.figures = drawn

    def _deliver(self, state: CaseState) -> None:
        state.delivered = True
        self.deliver(Comparison(state.case, list(state.results.values()), state.records(), self.options))


def _untried(outcome: Outcome, settings: Iterator[Setting]) -> Iterator[Outcome]:
    """Outcomes of the settings skipped after a timeout; an ignored deadline counts against each of them."""
    step, rtol = outcome.setting.step, outcome.setting.rtol
    at = f"{rtol:g}".replace("e-0", "e-") if step is None else f"a step of {step:g} s"
    prepared = outcome.compile_s is not None
    reason = NOT_RUN + (f"timed out at {at}" if prepared else f"at {at} {TOO_LONG_TO_PREPARE}")
    ignored = outcome.failure is not None and outcome.failure.ignored
    for setting in settings:
        yield Outcome(
            outcome.case, outcome.reading, outcome.solver, setting, outcome.library_version, outcome.landing,
            failure=Failure("timeout", reason, ignored),
        )  # fmt: skip
