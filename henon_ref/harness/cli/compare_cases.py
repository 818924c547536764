"""What the command does: read the cases, run the campaign, write each report as it is done, then the index."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from henon_ref.casefile.case import Case
from henon_ref.commands import status_line
from henon_ref.commands.exit_status import say
from henon_ref.harness.campaign.case_files import load_cases
from henon_ref.harness.campaign.comparison import Comparison, compare_all
from henon_ref.harness.campaign.journal import FILE, read
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.plan import check_required, check_solvers
from henon_ref.harness.campaign.progress import ProgressLine
from henon_ref.harness.cli.end_output import EndTable, case_line, document, print_end
from henon_ref.harness.cli.request import Request
from henon_ref.harness.report.case_report import write_report
from henon_ref.harness.report.figure_jobs import figure_job
from henon_ref.harness.report.folder import check_writable, locked, remove_if_empty
from henon_ref.harness.report.folder_report import write_folder_report
from henon_ref.harness.report.manifest import provenance
from henon_ref.harness.report.text.gate import bounds_left_out, demands_state, gate_state, why_unchecked
from henon_ref.harness.report.text.markdown import environment
from henon_ref.harness.score.gate import Demand, Gate, demand
from henon_ref.text import message


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
    cases = load_cases(request.cases)
    options = Options(
        keep_journals=True,
        solvers=request.solvers,
        tolerances=request.tolerances,
        repeats=request.repeats,
        timeout=request.timeout,
        processes=request.processes,
        folder=request.out,
        resume=request.resume,
        required=request.required,
    )
    check_solvers(cases, options)
    check_required(request.required, cases, options)
    with locked([request.out / case.name for case in cases]):
        _mention_unfinished(cases, request)
        return _compared(cases, options, request)


def _compared(cases: Sequence[Case], options: Options, request: Request) -> Unmet:
    """Run everything and write it into folders that nobody else writes into."""
    written: list[Path] = []
    failures: list[str] = []
    gates: list[Gate] = []
    demands = dict.fromkeys(request.required, Demand())
    table = EndTable()
    environment()
    origin = provenance(rerun_command(request))

    def deliver(comparison: Comparison) -> None:
        written.append(write_report(comparison, origin, request.out))
        table.add(comparison.run_rows)
        failures.extend(f"{comparison.case.name}: {words}" for words in comparison.gate_failures())
        gates.append(comparison.gate)
        for solver in demands:
            demands[solver] += demand(solver, comparison.run_rows)
        if not (request.json or shown.seen):
            print(case_line(comparison.case.name, comparison.run_rows, written[-1]), flush=True)

    status_line.clear()
    with ProgressLine() as shown:
        draw = figure_job if request.figures else None
        compare_all(cases, options, deliver, draw=draw, observer=shown)
    with locked([request.out], wait=True):
        index = write_folder_report(request.out)
    discard(request.out, cases)
    where = written[0] if len(written) == 1 else index
    gate = sum(gates, Gate())
    state = gate_state(gate, bool(failures), wanted=request.gate)
    if request.json:
        print(document(table, where, gate=state.removeprefix("; ") or None))
    else:
        print_end(table, readings=sum(len(case.readings) for case in cases))
        print(message(f"{where}{state}{demands_state(demands)}"))
    if request.gate and gate.missing:
        failures.append(why_unchecked(gate))
    if request.gate and gate.left_out:
        say(f"gate: {bounds_left_out(gate)}")
    return Unmet(failures, [words for solver, own in demands.items() for words in own.unmet(solver)])


def discard(folder: Path, cases: Sequence[Case]) -> None:
    """Remove the journals in a folder: everything that they hold is written."""
    for case in cases:
        (folder / case.name / FILE).unlink(missing_ok=True)
        remove_if_empty(folder / case.name)


def rerun_command(request: Request) -> str:
    """The command that makes the same reports again."""
    words = ["python", "-m", "henon_ref.compare", *(_relative(path) for path in request.cases)]
    for option, value in (
        ("--solvers", ",".join(request.solvers) if request.solvers else None),
        ("--tolerances", ",".join(map(_digits, request.tolerances)) if request.tolerances else None),
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
