"""Plan of a campaign: the runs of each solver on each reading, without the rows that a journal already holds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from henon_ref.casefile.case import Case, Reading
from henon_ref.errors import CaseError
from henon_ref.harness import registry
from henon_ref.harness.campaign.case_files import fixed_step
from henon_ref.harness.campaign.comparison import ReadingResult
from henon_ref.harness.campaign.jobs import PREPARE_SECONDS, Statement, sample, sample_times
from henon_ref.harness.campaign.journal import Journal, reading_key, row_key
from henon_ref.harness.campaign.options import MOST_DRAWN, Options, Setting, settings, state_scale
from henon_ref.harness.campaign.rows import Record
from henon_ref.solver import Solver
from henon_ref.workers.worker import Job

NOT_RUN = "not run: "
"""First words of the reason of a run that was skipped because a looser setting of the solver timed out."""
SAMPLERS = ("henon", "scipy-dop853")
"""Solvers that sample the motion for the figures; the first that succeeds is used."""
Slot = tuple[str, str, Setting]
"""Reading, solver and setting of a row."""


@dataclass(frozen=True)
class PendingRuns:
    """Runs of one solver on one reading that are still to be done."""

    result: ReadingResult
    name: str
    """Name of the solver."""
    solver: str | Solver
    """The solver, or its name in the registry."""
    settings: tuple[Setting, ...]
    """From the loosest to the tightest."""
    demanded: bool
    """Whether a bound of the case's gate, or the caller, requires all runs, so that none is skipped after a timeout."""


class CaseState:
    """State of a case during a campaign.

    Parameters
    ----------
    case : Case
    statements : mapping
        (case, reading) -> truth of the reading.
    options : Options

    Attributes
    ----------
    results : dict
        Name of a reading -> its results, in the order of the case.
    rows : dict
        Slot -> finished row.
    pending : Counter
        Reading -> number of unfinished job sequences.
    """

    def __init__(self, case: Case, statements: Mapping[tuple[str, str], Statement], options: Options) -> None:
        self.case, self.options = case, options
        chosen = [reading for reading in case.readings if chosen_solvers(reading, options)]
        self.results = {own.name: ReadingResult(own, statements[case.name, own.name]) for own in chosen}
        self.journal = Journal(options.folder / case.name, resume=options.resume) if options.folder else None
        self.rows: dict[Slot, Record] = {}
        self.keys: dict[Slot, str] = {}
        self.pending: Counter[str] = Counter()
        self.delivered = False

    def keep(self, slot: Slot, record: Record) -> None:
        """Store a finished row, first in the journal if there is one."""
        if self.journal is not None:
            self.journal.add(self.keys[slot], record)
        self.rows[slot] = record

    def records(self, reading: str | None = None) -> list[Record]:
        """Return the finished rows of one reading, or of all, sorted by reading, solver and setting."""
        order, names = list(self.results), list(registry.names())

        def place(slot: Slot) -> tuple[int, int, str, float]:
            name, solver, setting = slot
            base = registry.base_name(solver)
            rank = names.index(base) if base in names else len(names)
            return order.index(name), rank, solver, -(setting.rtol or setting.step or 0.0)

        return [self.rows[slot] for slot in sorted(self.rows, key=place) if reading in (None, slot[0])]

    def is_drawn(self, result: ReadingResult) -> bool:
        """Check whether a reading is among the first ``MOST_DRAWN``, which have figures."""
        return list(self.results.values()).index(result) < MOST_DRAWN

    def pending_runs(self, result: ReadingResult) -> list[PendingRuns]:
        """Take the finished rows of a reading from the journal, and return the remaining runs.

        The journal's row of a skipped run does not count if the run is now required.
        """
        reading, options = result.reading, self.options
        shared = reading_key(self.case.name, reading, result.expected)
        found: list[PendingRuns] = []
        for name, solver in chosen_solvers(reading, options).items():
            demanded = name in options.required or name in reading.gate
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
                kept = self.journal.get(self.keys[slot]) if self.journal else None
                if kept is None or (demanded and (kept.run.status_reason or "").startswith(NOT_RUN)):
                    waiting.append(setting)
                else:
                    self.rows[slot] = kept
            if waiting:
                found.append(PendingRuns(result, name, solver, tuple(waiting), demanded))
        return found


def check_solvers(cases: Sequence[Case], options: Options) -> None:
    """Refuse unknown solvers, and a case to which none of the requested solvers applies.

    Raises
    ------
    CaseError
    """
    for entry in options.solvers or ():
        if isinstance(entry, str) and entry != registry.ALL:
            registry.check(entry)
    for case in cases:
        if not any(chosen_solvers(reading, options) for reading in case.readings):
            listed = sorted({name for reading in case.readings for name in reading.solvers or ()})
            raise CaseError(
                f"none of the requested solvers is among those of the case '{case.name}': {', '.join(listed)}",
                file=str(case.path) if case.path else None,
            )


def check_required(cases: Sequence[Case], options: Options) -> None:
    """Refuse a required solver that does not run.

    Raises
    ------
    CaseError
    """
    run = {name for case in cases for reading in case.readings for name in chosen_solvers(reading, options)}
    for name in options.required:
        if registry.check(name) not in run:
            raise CaseError(
                f"--require names '{name}', which is not among the solvers that run: {', '.join(sorted(run))}"
            )


def chosen_solvers(reading: Reading, options: Options) -> dict[str, str | Solver]:
    """Map names to solvers for all solvers that run on a reading, in the order of the registry.

    ``all`` stands for the solvers that the reading lists. If it lists none, ``all`` stands for the default solvers and
    the installed peers.
    """
    if options.solvers is None:
        listed = reading.solvers or registry.default_names()
        return {name: name for name in registry.names() if name in listed}
    chosen: dict[str, str | Solver] = {}
    for entry in options.solvers:
        if not isinstance(entry, str):
            chosen[entry.name] = entry
        elif entry == registry.ALL:
            every = reading.solvers or registry.expanded((registry.ALL,))
            chosen.update((name, name) for name in every)
        elif reading.solvers is None or registry.base_name(entry) in reading.solvers:
            chosen[entry] = entry
    return chosen


def sample_job(result: ReadingResult, name: str, options: Options) -> Job:
    """Make the job that samples the motion of a reading for its figures, at the tightest tolerance of its runs."""
    problem, expected = result.reading.problem, result.expected
    times = sample_times(
        float(problem.start),
        result.reading.measure_after,
        float(problem.until) if expected is None else expected.end_time,
        [] if expected is None else [event.time for event in expected.transitions],
    )
    rtol = min(options.tolerances or result.reading.tolerances)
    setting = Setting(rtol=rtol, atol=rtol * state_scale(problem, expected))
    arguments = name, problem, setting, options.timeout, times
    return Job(sample, arguments, PREPARE_SECONDS + options.timeout)
