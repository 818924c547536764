"""What the command does: read the cases, run the campaign, write each report as it is done, then the index."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from henon_ref import registry
from henon_ref.atlas.page import FOLDER as ATLAS
from henon_ref.atlas.run import run_atlas
from henon_ref.commandline import say
from henon_ref.comparison import Comparison, compare_all
from henon_ref.model.case import Case
from henon_ref.model.files import read_cases
from henon_ref.report.causes import FOLDER as CAUSES
from henon_ref.report.causes import write_causes
from henon_ref.report.figures import figure_job, preload
from henon_ref.report.folder_lock import locked, locked_for_a_moment
from henon_ref.report.index import write_index
from henon_ref.report.manifest import Provenance, provenance
from henon_ref.report.markdown import environment, gate_words, left_out_words
from henon_ref.report.request import Request
from henon_ref.report.write import check_index, check_writable, remove_if_empty, write_report
from henon_ref.restarts.experiment import run_restarts
from henon_ref.restarts.page import FOLDER as RESTARTS
from henon_ref.rivals.experiment import run_rivals
from henon_ref.rivals.page import FOLDER as RIVALS
from henon_ref.score.gate import Demand, Tally, demand, gate_tally
from henon_ref.score.journal import FILE, read
from henon_ref.score.options import Observer, Options, Silent
from henon_ref.score.plan import check_required, check_solvers
from henon_ref.score.rows import Record
from henon_ref.text import message

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


class Unmet(NamedTuple):
    """What the command's exit status may depend on, a sentence each."""

    gate: list[str]
    """Bounds of the gate that are not met; where it decides (``--gate``) and none was checked, that."""
    required: list[str]
    """Where a required solver is not right; where one was judged nowhere, that."""


def run(request: Request) -> Unmet:
    """Compare and report.

    Raises
    ------
    CaseError
        For a case file or an argument that cannot be used; nothing has been written then.
    """
    check_writable(request.out)
    further = [request.out / page for page in (ATLAS, RESTARTS, CAUSES, RIVALS)] if request.whole else []
    for page in further:
        check_index(page)
    cases = load_cases(request.cases)
    options = Options(
        keep_journals=True,
        solvers=request.solvers,
        restarts=request.restarts,
        tolerances=request.tolerances,
        repeats=request.repeats,
        timeout=request.timeout,
        processes=request.processes,
        folder=request.out,
        resume=request.resume,
    )
    check_solvers(cases, options)
    check_required(request.required, cases, options)
    with locked([*(request.out / case.name for case in cases), *further]):
        _mention_unfinished(cases, request)
        return _compared(cases, options, request)


def _compared(cases: Sequence[Case], options: Options, request: Request) -> Unmet:
    """Run everything and write it into folders that nobody else writes into."""
    written: list[Path] = []
    failures: list[str] = []
    tallies: list[Tally] = []
    demands = dict.fromkeys(request.required, Demand())
    environment()
    origin = provenance(rerun_command(request))

    def deliver(comparison: Comparison) -> None:
        written.append(write_report(comparison, origin, request.out))
        failures.extend(f"{comparison.case.name}: {words}" for words in comparison.gate_failures())
        tallies.append(gate_tally(comparison.case.readings, comparison.run_rows))
        for solver in demands:
            demands[solver] += demand(solver, comparison.run_rows)

    with Shown() as shown:
        draw = figure_job if request.figures else None
        compare_all(cases, options, deliver, draw=draw, ready=preload, observer=shown)
        if request.whole:
            written += experiments(cases, options, origin, request.out, shown)
    with locked_for_a_moment(request.out):
        index = write_index(request.out)
    discard(request.out, cases)
    where = written[0] if len(written) == 1 else index
    tally = sum(tallies, Tally())
    told = "".join(f"; {solver} right in {own.right} of {own.judged} judged" for solver, own in demands.items())
    print(message(f"{where}{gate_state(tally, failures, wanted=request.gate)}{told}"))
    if request.gate and tally.missing:
        failures.append(gate_words(tally))
    if request.gate and tally.left_out:
        print(message(f"gate: {left_out_words(tally)}"), file=sys.stderr)
    return Unmet(failures, [words for solver, own in demands.items() for words in _unmet(solver, own)])


def _unmet(solver: str, own: Demand) -> tuple[str, ...]:
    return own.failures or (() if own.judged else (f"there is no reading in which {solver} can be judged",))


def gate_state(tally: Tally, failures: Sequence[str], *, wanted: bool) -> str:
    """What became of the gate, behind the report's name; ``wanted``: whether it decides the exit status."""
    if not tally.total and not wanted:
        return ""
    if failures:
        return "; gate not met"
    if not tally.checked:
        return f"; gate not checked: {gate_words(tally)}"
    part = "" if tally.checked == tally.total else f" ({tally.checked} of {tally.total} bounds checked)"
    return f"; gate met{part}"


def experiments(
    cases: Sequence[Case], options: Options, origin: Provenance, out: Path, observer: Observer
) -> list[Path]:
    """What a whole folder gets besides its reports: atlas, restart habits, causes, rivals; the pages written."""
    pages = [
        run_atlas(cases, options, origin, out, observer),
        run_restarts(cases, options, origin, out, observer),
        write_causes(out),
        run_rivals(cases, options, origin, out, observer),
    ]
    return [page for page in pages if page is not None]


def discard(out: Path, cases: Sequence[Case]) -> None:
    """Remove the journals: everything that they hold is written."""
    for folder in (out, out / ATLAS, out / RESTARTS):
        for case in cases:
            (folder / case.name / FILE).unlink(missing_ok=True)
            if folder != out:
                remove_if_empty(folder / case.name)


def load_cases(paths: Sequence[Path]) -> list[Case]:
    """Read the case files that paths lead to, held against the solvers that there are.

    Raises
    ------
    CaseError
        See :func:`henon_ref.model.files.read_cases`.
    """
    return read_cases(paths, solvers=registry.names(), fixed_step=registry.fixed_step)


def rerun_command(request: Request) -> str:
    """The command that makes the same reports again."""
    words = ["python", "-m", "henon_ref.compare", *(_relative(path) for path in request.cases)]
    for option, value in (
        ("--solvers", ",".join(request.solvers) if request.solvers else None),
        ("--tolerances", ",".join(map(_digits, request.tolerances)) if request.tolerances else None),
        ("--restart", ",".join(request.restarts) or None),
        ("--repeats", request.repeats),
        ("--timeout", _digits(request.timeout) if request.timeout != Options().timeout else None),
    ):
        if value is not None:
            words += [option, str(value)]
    if not request.figures:
        words.append("--no-figures")
    return shlex.join(words).encode(errors="replace").decode()  # a path need not be text


def _digits(value: float) -> str:
    """A number as short as it reads back to the same double."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)


def _relative(path: Path) -> str:
    """A path as it is seen from here, so that a report does not name folders of this machine."""
    absolute, here = path.absolute(), Path.cwd()
    return absolute.relative_to(here).as_posix() if absolute.is_relative_to(here) else path.name


def _mention_unfinished(cases: Sequence[Case], request: Request) -> None:
    """Say that there are rows which --resume would keep."""
    if request.resume:
        return
    for case in cases:
        rows = len(read(request.out / case.name / FILE))
        if rows:
            say(f"starting afresh: --resume would keep {rows} rows of {case.name}")


class Shown(Silent, AbstractContextManager["Shown"]):
    """Progress on a terminal; elsewhere nothing. It never starts a thread, so that workers can be forked."""

    def __init__(self) -> None:
        self._progress: Progress | None = None
        self._task: TaskID | None = None

    def __enter__(self) -> Shown:
        if sys.stderr is not None and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

            columns = (
                TextColumn("{task.description}", markup=False),
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
            )
            self._progress = Progress(*columns, console=Console(stderr=True), transient=True, auto_refresh=False)
            self._progress.start()
        return self

    def __exit__(self, *exception: object) -> None:
        if self._progress is not None:
            self._progress.stop()

    def truths(self, readings: int) -> None:
        """The truths of so many readings are being read or computed."""
        if self._progress is not None:
            self._task = self._progress.add_task("truth", total=readings)

    def truth(self, name: str) -> None:
        """The truth of a reading is known."""
        self._step(f"truth of {name}")

    def runs(self, rows: int, kept: int) -> None:
        """So many rows are to be made, so many of them are kept from before."""
        if self._progress is not None:
            if self._task is not None:
                self._progress.remove_task(self._task)
            self._task = self._progress.add_task("runs", total=rows, completed=kept)

    def begun(self, case: str, what: str) -> None:
        """A run is begun."""
        if self._progress is not None and self._task is not None:
            self._progress.update(self._task, description=message(f"{case} {what}"))

    def row(self, finished: Record) -> None:
        """A row is finished."""
        self._step(None)

    def tick(self) -> None:
        """Some time has passed."""
        if self._progress is not None:
            self._progress.refresh()

    def _step(self, description: str | None) -> None:
        if self._progress is not None and self._task is not None:
            if description is not None:
                self._progress.update(self._task, description=description)
            self._progress.advance(self._task)
