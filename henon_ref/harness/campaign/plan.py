"""The plan of a campaign: which solver runs which reading at which setting, and what a journal has already."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from henon_ref.casefile.case import Case, Reading
from henon_ref.errors import CaseError
from henon_ref.harness import registry
from henon_ref.harness.campaign.case_files import fixed_step
from henon_ref.harness.campaign.comparison import ReadingResult
from henon_ref.harness.campaign.journal import Journal, reading_key, row_key
from henon_ref.harness.campaign.options import MOST_DRAWN, Options, Setting, settings, state_scale
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.campaign.run_jobs import SampleJob, sample_times
from henon_ref.harness.campaign.truth_job import Statement
from henon_ref.solver import Solver

NOT_RUN = "not run: "
"""How the reason begins of a row whose run was left out, since a looser setting of the solver took too long."""
SAMPLERS = ("henon", "scipy-dop853")
"""Solvers that draw the motion for the figures: the first that can."""
Slot = tuple[str, str, Setting]
"""Reading, solver, setting: a row's place."""


@dataclass(frozen=True)
class PendingRuns:
    """What one solver is still to run on one reading."""

    result: ReadingResult
    name: str
    """Name of the solver."""
    solver: str | Solver
    """The solver, or the name under which a worker finds it."""
    settings: tuple[Setting, ...]
    """From the loosest to the tightest."""
    demanded: bool
    """A bound of the case's gate, or the caller, asks for them all: none is left out after a timeout."""


class CaseState:
    """A case at work.

    Parameters
    ----------
    case : Case
    statements : mapping
        (case, reading) -> what is known of its truth.
    options : Options

    Attributes
    ----------
    results : dict
        Name of a reading -> what is known of it, in the order of the case.
    rows : dict
        Slot -> what is finished.
    pending : Counter
        Reading -> sequences of jobs that are not over.
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
        """A row is finished: on the disk first, if there is a journal."""
        if self.journal is not None:
            self.journal.add(self.keys[slot], record)
        self.rows[slot] = record

    def records(self, reading: str | None = None) -> list[Record]:
        """Rows so far, of one reading or all, by reading, solver and setting."""
        order, names = list(self.results), list(registry.names())

        def place(slot: Slot) -> tuple[int, int, str, float]:
            name, solver, setting = slot
            base = registry.base_name(solver)
            rank = names.index(base) if base in names else len(names)
            return order.index(name), rank, solver, -(setting.rtol or setting.step or 0.0)

        return [self.rows[slot] for slot in sorted(self.rows, key=place) if reading in (None, slot[0])]

    def is_drawn(self, result: ReadingResult) -> bool:
        """Whether a reading is among the first few, which get figures."""
        return list(self.results.values()).index(result) < MOST_DRAWN

    def pending_runs(self, result: ReadingResult) -> list[PendingRuns]:
        """What is to be run on a reading; rows that the journal has are taken from there.

        A row of what was not run is none where it is demanded now.
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
    """Refuse unknown solvers, and a case for which none of those asked for is meant.

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
                f"none of the solvers asked for is among those of the case '{case.name}': {', '.join(listed)}",
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
    """Name -> solver of everything that runs on a reading, in the registry's order.

    ``all`` stands for the solvers that the reading lists; where it lists none, for those that run by default and the
    peers that are installed.
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


def sample_job(result: ReadingResult, name: str, options: Options) -> SampleJob:
    """The job that samples a reading's motion for its figures, at the tightest tolerance of its runs."""
    problem, expected = result.reading.problem, result.expected
    times = sample_times(
        float(problem.start),
        result.reading.measure_after,
        float(problem.until) if expected is None else expected.end_time,
        [] if expected is None else [event.time for event in expected.transitions],
    )
    rtol = min(options.tolerances or result.reading.tolerances)
    setting = Setting(rtol=rtol, atol=rtol * state_scale(problem, expected))
    return SampleJob(name, problem, setting, options.timeout, times)
