"""Options of a campaign, its cases, the solvers that run on them, and the settings of each: tolerances or steps.

A worker loads each third-party solver before this process does, because importing its module may hang or crash.
"""

from __future__ import annotations

import math
import os
import pickle
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path

from henon_ref.casefile.case import Case, Reading, load_case
from henon_ref.casefile.files import case_files
from henon_ref.errors import CaseError
from henon_ref.harness import registry
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.reference import Expected
from henon_ref.modes.problem import Problem
from henon_ref.solver import Solver, fault
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job, WorkerState

MOST_DRAWN = 6
"""Largest number of readings of a case with figures; the figures of a large family would look alike."""
MOST_REPEATS = 10_000
"""Largest number of timing samples per row; the interval of their median then takes 0.2 GB."""
LOADING_SECONDS = 60.0
"""Limit on the processor time to import a third-party solver [s]."""


@dataclass(frozen=True)
class Options:
    """Options of a campaign.

    CaseError if a value is not allowed; :func:`check_solvers` checks later whether the solvers exist.
    """

    solvers: tuple[str | Solver, ...] | None = None
    """Solvers to run, restricted to those that a case lists; None: all that it lists."""
    tolerances: tuple[float, ...] | None = None
    """Relative tolerances that replace those of the cases."""
    repeats: int | None = None
    """Timing samples per row; None: as many as fit into a fraction of a second."""
    timeout: float = 10.0
    """Limit on the processor time of one run [s]."""
    processes: int = 2
    """Number of concurrent runs."""
    memory: int = 4 * 2**30
    """Limit on the memory of one worker and its child processes [bytes]."""
    folder: Path | None = None
    """Folder of the journals, with one subfolder per case; None: no journal. The caller removes the journals."""
    resume: bool = False
    """Whether to use the rows of existing journals."""
    timed: bool = True
    """Whether right runs are repeated for their wall times."""
    required: tuple[str, ...] = ()
    """Solvers that run at all their settings, even after a timeout."""

    def __post_init__(self) -> None:
        for name, entries in (("solvers", self.solvers), ("tolerances", self.tolerances)):
            if entries is not None and not entries:
                raise CaseError(f"{name} is empty; None stands for the {name} of the case")
        own = [solver for solver in self.solvers or () if not isinstance(solver, str)]
        for solver in own:
            if words := fault(solver):
                raise CaseError(f"solvers: {shown(solver)} {words}")
        names = [solver if isinstance(solver, str) else solver.name for solver in self.solvers or ()]
        for solver in own:
            if names.count(solver.name) > 1:
                raise CaseError(f"solvers: more than one is named '{solver.name}'; names must be unique")
        for tolerance in self.tolerances or ():
            if not (_is_number(tolerance) and 1e-16 <= tolerance < 1):
                raise CaseError(f"a tolerance lies between 1e-16 and 1, not {shown(tolerance)}")
        if type(self.processes) is not int or self.processes < 1:
            raise CaseError(f"processes is a whole number from 1 on, not {shown(self.processes)}")
        if self.repeats is not None and (type(self.repeats) is not int or not 1 <= self.repeats <= MOST_REPEATS):
            raise CaseError(f"repeats is a whole number from 1 to {MOST_REPEATS}, not {shown(self.repeats)}")
        if not (_is_number(self.timeout) and 0.01 <= self.timeout <= 1e6):
            raise CaseError(f"timeout is a number of seconds from 0.01 to 1e+06, not {shown(self.timeout)}")

    @property
    def of_main(self) -> bool:
        """Whether a solver is an object of the main module, for example defined in the caller's script."""
        return any(not isinstance(solver, str) and b"__main__" in _pickled(solver) for solver in self.solvers or ())


def _pickled(value: object) -> bytes:
    """Pickle a value; empty if that fails, since sending the job to a worker then reports the error."""
    try:
        return pickle.dumps(value)
    except Exception:  # noqa: BLE001 - the solver's own classes may raise any exception when they are pickled
        return b""


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def shown(value: object) -> str:
    """Format a value in at most 60 characters."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def check_solvers(cases: Sequence[Case], options: Options) -> None:
    """Raise CaseError for an unknown solver, and a case to which none of the requested solvers applies."""
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
    """Raise CaseError for a required solver that does not run."""
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


@dataclass(frozen=True)
class Setting:
    """Setting of one row: the step of a fixed-step solver, or the tolerances of any other solver."""

    rtol: float | None = None
    atol: float | None = None
    """Absolute tolerance, in units of the state."""
    step: float | None = None
    """Step [s]."""

    @classmethod
    def of(cls, run: RunRow) -> Setting:
        return cls(run.rtol, run.atol, run.step_s)

    @property
    def label(self) -> str:
        """Name of the setting in messages."""
        return f"step {self.step:g} s" if self.step is not None else f"rtol {self.rtol:g}"


def settings(
    *, fixed_step: bool, tolerances: Sequence[float], steps: Sequence[float], scale: float
) -> tuple[Setting, ...]:
    """Return the settings of one solver on one reading, loosest first; ``scale`` is the :func:`state_scale`."""
    if fixed_step:
        return tuple(Setting(step=step) for step in sorted(set(steps), reverse=True))
    return tuple(Setting(rtol=rtol, atol=rtol * scale) for rtol in sorted(set(tolerances), reverse=True))


def state_scale(problem: Problem, expected: Expected | None) -> float:
    """Return the size of the largest state entry, at the start and at the exact transitions, as a power of ten.

    The power is rounded towards 1, so that ``atol`` equals ``rtol`` if states are of order one. Scaling ``atol`` by it
    requests the same number of digits if the system is written in other units.
    """
    sizes = [abs(float(value)) for value in problem.initial]
    if expected is not None:
        sizes.append(expected.state_size)
    largest = max((size for size in sizes if math.isfinite(size)), default=0.0)
    return 10.0 ** math.trunc(math.log10(largest)) if largest > 0 else 1.0


def load_cases(paths: Sequence[Path], *, check_solvers: bool = True) -> list[Case]:
    """Read the case files, and check the solvers that they name; a folder means all of its files outside ``truth``.

    CaseError if a file is not a case, a folder contains no case, or two cases have the same name.
    """
    known = registry.names() if check_solvers else None
    cases: dict[str, Case] = {}
    # Several paths may lead to the same file; it is read once, under its first path.
    files: dict[str, Path] = {}
    for path in paths:
        for found in case_files(path):
            files.setdefault(os.path.realpath(found), found)
    for file in files.values():
        case = load_case(file, solvers=known, fixed_step=fixed_step if check_solvers else None)
        if case.name in cases:
            raise CaseError(f"the name '{case.name}' is also that of {cases[case.name].path}", file=str(file))
        cases[case.name] = case
    return list(cases.values())


def fixed_step(name: str) -> bool:
    """Check whether a solver takes a fixed step instead of tolerances; False if a third-party solver cannot load."""
    known = registry.fixed_step(name)
    return _probed(registry.entry_point(name)) if known is None else known


def _load(state: WorkerState, name: str, value: str, group: str) -> bool:
    """Job: import the solver of an entry point, and check whether it takes a fixed step."""
    return registry.loaded(EntryPoint(name, value, group)).fixed_step


@cache
def _probed(point: EntryPoint) -> bool:
    """Check in a worker whether a solver takes a fixed step; if loading fails, forbid this process to load it."""
    found: list[bool | Failure] = []

    def loading() -> Jobs:
        found.append((yield Job(_load, (point.name, point.value, point.group), LOADING_SECONDS)))

    pool = WorkerPool(workers=1, memory=Options().memory)
    pool.add(point.name, loading())
    pool.run()
    (result,) = found
    if not isinstance(result, Failure):
        return result
    if result.status != "unavailable":  # an unavailable solver reports a better reason itself
        registry.refuse(point, result.reason)
    return False
