"""Campaign of one case: its rows are taken from the journal, or made by workers; each is written before the next run.

Each solver runs each reading from the loosest setting to the tightest. Each answer is scored before it is timed.
"""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from henon_ref.casefile.case import Case, Reading
from henon_ref.harness import registry
from henon_ref.harness.campaign import jobs
from henon_ref.harness.campaign.comparison import Comparison, ReadingResult
from henon_ref.harness.campaign.journal import Journal, reading_key, row_key
from henon_ref.harness.campaign.options import (
    MOST_DRAWN,
    Options,
    Setting,
    chosen_solvers,
    fixed_step,
    settings,
    state_scale,
)
from henon_ref.harness.campaign.progress import TRUTH, ProgressLine
from henon_ref.harness.campaign.rows import Outcome, Record, record, scored
from henon_ref.solver import Solver
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job

if TYPE_CHECKING:
    from henon_ref.harness.truth import Truth

_LOG = logging.getLogger(__name__)

NOT_RUN = "not run: "
"""First words of the reason of a run that was skipped because a looser setting of the solver timed out."""
SAMPLERS = ("henon", "scipy-dop853")
"""Solvers that sample the motion for the figures; the first that succeeds is used."""
Slot = tuple[str, str, Setting]
"""Reading, solver and setting of a row."""
Deliver = Callable[[Comparison], None]
"""Function that receives the comparison of a case after its last row is finished."""
Draw = Callable[[ReadingResult, list[Record]], Job]
"""Function that returns the job to draw the figures of a reading; the job's result maps file names to contents."""


class CaseCampaign:
    """Campaign of one case: its truths, its rows, from the journal or from workers, and its figures."""

    def __init__(
        self,
        case: Case,
        options: Options,
        pool: WorkerPool,
        deliver: Deliver,
        draw: Draw | None,
        observer: ProgressLine,
    ) -> None:
        self.case, self.options, self.pool, self.observer = case, options, pool, observer
        self.deliver, self.draw = deliver, draw
        self.readings = [reading for reading in case.readings if chosen_solvers(reading, options)]
        self.truths: dict[str, Truth | Failure] = {}
        self.results: dict[str, ReadingResult] = {}
        """By name of the reading, in the order of the case."""
        self.journal: Journal | None = None
        self.rows: dict[Slot, Record] = {}
        self.keys: dict[Slot, str] = {}
        """Keys of the rows in the journal."""
        self.pending: Counter[str] = Counter()
        """Reading -> number of unfinished job sequences."""
        self.delivered = False

    def fetch_truths(self) -> int:
        """Read the stored truth of every reading; queue those that are not stored, and return their number."""
        from henon_ref.harness.truth.compute import stored_truth

        for reading in self.readings:
            stored = stored_truth(self.case, reading)
            if stored is None:
                self.pool.add("truths", self._truth(reading))
            else:
                self.truths[reading.name] = stored
        return len(self.readings) - len(self.truths)

    def _truth(self, reading: Reading) -> Jobs:
        """Compute the truth of a reading; if that fails, the runs are not scored and the report gives the reason."""
        self.observer.begun(self.case.name, f"{reading.name} {TRUTH}")
        self.truths[reading.name] = yield Job(jobs.fetch_truth, (self.case, reading), jobs.TRUTH_SECONDS)
        self.observer.truth(f"{self.case.name} {reading.name}")

    def queue_runs(self) -> int:
        """Queue the runs that the journal does not hold, and the samples for figures; return the number of runs."""
        options = self.options
        self.results = {own.name: ReadingResult(own, self.truths[own.name]) for own in self.readings}
        if options.folder is not None:
            self.journal = Journal(options.folder / self.case.name, resume=options.resume)
        by_solver: dict[str, list[tuple[ReadingResult, Jobs]]] = {}
        runs = 0
        for result in self.results.values():
            shared = reading_key(self.case.name, result.reading, result.expected)
            for name, solver in chosen_solvers(result.reading, options).items():
                if waiting := self._waiting(result, shared, name, solver):
                    by_solver.setdefault(name, []).append((result, self._rows(result, name, solver, waiting)))
                    runs += len(waiting)
            if self._is_drawn(result):
                by_solver.setdefault(SAMPLERS[0], []).append((result, self._samples(result)))
        # The registry lists the fast solvers first. Started last, they fill the gaps left by the slow solvers.
        for name, sequences in reversed(by_solver.items()):
            for result, sequence in sequences:
                self._add(f"{self.case.name} {name}", result, sequence)
        return runs

    def _waiting(self, result: ReadingResult, shared: str, name: str, solver: str | Solver) -> list[Setting]:
        """Take the rows of a solver on a reading from the journal; return the other settings, the loosest first.

        The journal's row of a skipped run does not count if the run is now required. ``shared`` is the reading's key.
        """
        reading, options = result.reading, self.options
        version = registry.library_version(name) if isinstance(solver, str) else ""
        waiting: list[Setting] = []
        for setting in settings(
            fixed_step=fixed_step(solver) if isinstance(solver, str) else solver.fixed_step,
            tolerances=options.tolerances or reading.tolerances,
            steps=reading.steps,
            scale=state_scale(reading.problem, result.expected),
        ):
            slot = (reading.name, name, setting)
            self.keys[slot] = row_key(shared, name, version, setting, options)
            kept = self.journal.rows.get(self.keys[slot]) if self.journal else None
            skipped = kept is not None and (kept.run.status_reason or "").startswith(NOT_RUN)
            if kept is None or (skipped and self._is_demanded(reading, name)):
                waiting.append(setting)
            else:
                self.rows[slot] = kept
        return waiting

    def _is_demanded(self, reading: Reading, name: str) -> bool:
        """Check whether a bound of the case's gate, or the caller, requires all runs of a solver."""
        return name in self.options.required or name in reading.gate

    def _is_drawn(self, result: ReadingResult) -> bool:
        """Check whether figures are drawn, and the reading is among the first ``MOST_DRAWN``, which have some."""
        return self.draw is not None and list(self.results.values()).index(result) < MOST_DRAWN

    def _add(self, queue: str, result: ReadingResult, sequence: Jobs, *, first: bool = False) -> None:
        """Queue a sequence of jobs on a reading, and count it as pending until it is done."""
        self.pending[result.reading.name] += 1
        self.pool.add(queue, self._counted(result, sequence), first=first)

    def _counted(self, result: ReadingResult, sequence: Jobs) -> Jobs:
        """Yield the jobs; after the last job of a reading queue its figures, after the last of the case deliver it."""
        yield from sequence
        reading = result.reading.name
        self.pending[reading] -= 1
        if self.pending[reading] == 0 and self.draw is not None and self._is_drawn(result) and not result.drawn:
            result.drawn = True
            drawing = self._figures(result, self.draw(result, self._records(reading)))
            self._add("figures", result, drawing, first=True)
        if not self.pending.total():
            self.finish()

    def _rows(self, result: ReadingResult, name: str, solver: str | Solver, waiting: Sequence[Setting]) -> Jobs:
        """Make the rows of one solver on one reading; skip the tighter settings after a timeout.

        They are not skipped if the run that timed out has spurious transitions, since its cost then says nothing
        about other settings, or if all rows of the solver are required.
        """
        remaining = iter(waiting)
        for number, setting in enumerate(remaining):
            outcome = yield from self._outcome(result, name, solver, setting, cold=number == 0)
            self._keep(outcome, result)
            invented = outcome.score is not None and bool(outcome.score.matching.spurious)
            if outcome.timed_out and not (invented or self._is_demanded(result.reading, name)):
                for untried in _untried(outcome, remaining):
                    self._keep(untried, result)

    def _outcome(
        self, result: ReadingResult, name: str, solver: str | Solver, setting: Setting, *, cold: bool
    ) -> Generator[Job, Any, Outcome]:
        """Prepare, run and score one setting; time the run if its answer is right."""
        reading, expected, options = result.reading, result.expected, self.options
        self.observer.begun(self.case.name, f"{reading.name} {name} {setting.label}")
        version = registry.library_version(solver) if isinstance(solver, str) else ""
        outcome = Outcome(self.case.name, reading, name, setting, library_version=version)
        prepared = yield Job(jobs.prepare, (solver, reading.problem, setting, options.timeout), jobs.PREPARE_SECONDS)
        if isinstance(prepared, Failure):
            if prepared.ignored:  # prepare() has no deadline that it could have kept
                prepared = Failure("timeout", jobs.TOO_LONG_TO_PREPARE)
            return replace(outcome, failure=prepared)
        landing, version, took = prepared
        outcome = replace(outcome, landing=landing, library_version=version, compile_s=took)
        most = jobs.MOST_SPARE + jobs.MOST_FOLD * (0 if expected is None else len(expected.transitions))
        seconds = 1.25 * options.timeout + 1.0  # a little longer than the deadline that the solver should keep
        ran = yield Job(jobs.run_once, (most,), seconds, rests=True)
        if isinstance(ran, Failure):
            return replace(outcome, failure=ran)
        trajectory, wall_s = ran
        outcome = scored(replace(outcome, trajectory=trajectory), expected)
        if outcome.score is None or outcome.score.verdict.word != "right" or not options.timed:
            return replace(outcome, samples=(wall_s,) if trajectory.status not in ("timeout", "failed") else ())
        seconds = jobs.SPARE_SECONDS + 4.0 * (jobs.BUDGET + wall_s * (options.repeats or 3))
        samples = yield Job(jobs.time_repeats, (wall_s, options.repeats, cold), seconds, rests=True)
        if isinstance(samples, Failure):
            return replace(outcome, repeat_failure=samples)
        return replace(outcome, samples=samples)

    def _keep(self, outcome: Outcome, result: ReadingResult) -> None:
        """Make the row of an outcome; store it, first in the journal if there is one."""
        finished = record(outcome, result.expected)
        slot = (result.reading.name, outcome.solver, outcome.setting)
        if self.journal is not None:
            self.journal.add(self.keys[slot], finished)
        self.rows[slot] = finished
        self.observer.row(finished)

    def _samples(self, result: ReadingResult) -> Jobs:
        """Sample the motion by the first sampler that succeeds, at the tightest tolerance of the reading's runs."""
        reading, expected, timeout = result.reading, result.expected, self.options.timeout
        problem = reading.problem
        times = jobs.sample_times(
            float(problem.start),
            reading.measure_after,
            float(problem.until) if expected is None else expected.end_time,
            [] if expected is None else [event.time for event in expected.transitions],
        )
        rtol = min(self.options.tolerances or reading.tolerances)
        setting = Setting(rtol=rtol, atol=rtol * state_scale(problem, expected))
        for name in SAMPLERS:
            found = yield Job(jobs.sample, (name, problem, setting, timeout, times), jobs.PREPARE_SECONDS + timeout)
            if found is not None and not isinstance(found, Failure):
                result.samples, result.sampled_by = found, name
                return
            _LOG.info("%s cannot sample %s: %s", name, reading.name, found.reason if found else "no samples")

    def _figures(self, result: ReadingResult, job: Job) -> Jobs:
        drawn: dict[str, bytes] | Failure = yield job
        if isinstance(drawn, Failure):
            result.figures_reason = drawn.reason
        else:
            result.figures = drawn

    def finish(self) -> None:
        """Deliver the comparison."""
        self.delivered = True
        self.deliver(Comparison(self.case, list(self.results.values()), self._records(), self.options))

    def _records(self, reading: str | None = None) -> list[Record]:
        """Return the finished rows of one reading, or of all, sorted by reading, solver and setting."""
        order, names = list(self.results), list(registry.names())

        def place(slot: Slot) -> tuple[int, int, str, float]:
            name, solver, setting = slot
            base = registry.base_name(solver)
            rank = names.index(base) if base in names else len(names)
            return order.index(name), rank, solver, -(setting.rtol or setting.step or 0.0)

        return [self.rows[slot] for slot in sorted(self.rows, key=place) if reading in (None, slot[0])]


def _untried(outcome: Outcome, settings: Iterator[Setting]) -> Iterator[Outcome]:
    """Outcomes of the settings skipped after a timeout; an ignored deadline counts against each of them."""
    step, rtol = outcome.setting.step, outcome.setting.rtol
    at = f"{rtol:g}".replace("e-0", "e-") if step is None else f"a step of {step:g} s"
    prepared = outcome.compile_s is not None
    reason = NOT_RUN + (f"timed out at {at}" if prepared else f"at {at} {jobs.TOO_LONG_TO_PREPARE}")
    ignored = outcome.failure is not None and outcome.failure.ignored
    for setting in settings:
        yield Outcome(
            outcome.case, outcome.reading, outcome.solver, setting, outcome.library_version, outcome.landing,
            failure=Failure("timeout", reason, ignored),
        )  # fmt: skip
