"""What the command does: read the cases, run the campaign, write each report as it is done, then the index.

On standard output: a line a finished case, the table at the end, the report's path.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

from henon_ref.casefile.case import Case
from henon_ref.commands import status_line
from henon_ref.commands.exit_status import say
from henon_ref.harness import registry
from henon_ref.harness.campaign.campaign import compare_all
from henon_ref.harness.campaign.case_files import load_cases
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.journal import FILE, read
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.plan import check_required, check_solvers
from henon_ref.harness.campaign.progress import ProgressLine
from henon_ref.harness.report.case_report import write_report
from henon_ref.harness.report.figure_jobs import figure_job
from henon_ref.harness.report.folder import check_writable, locked, remove_if_empty
from henon_ref.harness.report.folder_report import write_folder_report
from henon_ref.harness.report.manifest import provenance
from henon_ref.harness.report.text.gate import bounds_left_out, demands_state, gate_state, why_unchecked
from henon_ref.harness.report.text.markdown import environment
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.gate import Demand, Gate, demand
from henon_ref.harness.score.standing import standings, standings_table, tightest
from henon_ref.harness.table import count
from henon_ref.text import listed, message

MOST_FAILING = 24
"""Lines on what is not right; the JSON document and the reports have all."""
MOST_PLACES = 3
"""Readings that one such line names."""
NOT_JUDGED = ("not run", "not judged")
"""Verdicts on what is no solver's fault, and yet no answer."""
NOTE = (
    "At the tightest setting. Over the readings in which a solver is right: of its digits the fewest, of its time the "
    "median, of its times as long as the fastest the geometric mean."
)


class Unmet(NamedTuple):
    """What the command's exit status may depend on, a sentence each."""

    gate: list[str]
    """Bounds of the gate that are not met; where it decides (``--gate``) and none was checked, that."""
    required: list[str]
    """Where a required solver is not right; where one was judged nowhere, that."""


def run(
    paths: Sequence[Path],
    options: Mapping[str, Any],
    *,
    gated: bool = False,
    figures: bool = True,
    as_json: bool = False,
) -> Unmet:
    """Compare and report; ``options``: arguments of :class:`Options`, whose folder is that of the reports.

    ``gated``: whether the gate decides the exit status. ``as_json``: the table is one JSON document, and nothing else
    stands on standard output.

    Raises
    ------
    CaseError
        For a case file or an argument that cannot be used; nothing has been written then.
    """
    out: Path = options["folder"]
    check_writable(out)
    cases, asked = load_cases(paths), Options(**options)
    check_solvers(cases, asked)
    check_required(cases, asked)
    rerun = rerun_command(paths, asked, figures=figures)
    with locked([out / case.name for case in cases]):
        for case in cases if not asked.resume else ():
            if rows := len(read(out / case.name / FILE)):
                say(f"starting afresh: --resume would keep {rows} rows of {case.name}")
        return _compared(cases, asked, out, rerun, gated=gated, figures=figures, as_json=as_json)


def _compared(
    cases: Sequence[Case], options: Options, out: Path, rerun: str, *, gated: bool, figures: bool, as_json: bool
) -> Unmet:
    """Run everything and write it into folders that nobody else writes into."""
    written: list[Path] = []
    failures: list[str] = []
    rows: list[RunRow] = []
    gate, demands = Gate(), dict.fromkeys(options.required, Demand())
    environment()
    origin = provenance(rerun)

    def deliver(comparison: Comparison) -> None:
        nonlocal gate
        own, name = comparison.run_rows, comparison.case.name
        written.append(write_report(comparison, origin, out))
        rows.extend(tightest(own))
        gate += comparison.gate
        failures.extend(f"{name}: {words}" for words in comparison.gate_failures())
        for solver in demands:
            demands[solver] += demand(solver, own)
        if not (as_json or shown.seen):
            print(case_line(name, own, written[-1]), flush=True)

    status_line.clear()
    with ProgressLine() as shown:
        compare_all(cases, options, deliver, draw=figure_job if figures else None, observer=shown)
    with locked([out], wait=True):
        index = write_folder_report(out)
    discard(out, cases)
    where = written[0] if len(written) == 1 else index
    state = gate_state(gate, bool(failures), wanted=gated)
    if as_json:
        print(document(rows, where, gate=state.removeprefix("; ") or None))
    else:
        print_end(rows, readings=sum(len(case.readings) for case in cases))
        print(message(f"{where}{state}{demands_state(demands)}"))
    if gated and gate.missing:
        failures.append(why_unchecked(gate))
    if gated and gate.left_out:
        say(f"gate: {bounds_left_out(gate)}")
    return Unmet(failures, [words for solver, own in demands.items() for words in own.unmet(solver)])


def discard(folder: Path, cases: Sequence[Case]) -> None:
    """Remove the journals in a folder: everything that they hold is written."""
    for case in cases:
        (folder / case.name / FILE).unlink(missing_ok=True)
        remove_if_empty(folder / case.name)


def rerun_command(paths: Sequence[Path], given: Options, *, figures: bool = True) -> str:
    """The command that makes the same reports again."""
    here = Path.cwd()
    words = ["python", "-m", "henon_ref.compare"]
    for path in map(Path.absolute, paths):  # as seen from here: a report names no folders of this machine
        words.append(path.relative_to(here).as_posix() if path.is_relative_to(here) else path.name)
    for option, value in (
        ("--solvers", ",".join(map(str, given.solvers or ()))),
        ("--tolerances", ",".join(map(_digits, given.tolerances or ()))),
        ("--repeats", str(given.repeats or "")),
        ("--timeout", _digits(given.timeout) if given.timeout != Options().timeout else ""),
    ):
        words += [option, value] if value else []
    words += [] if figures else ["--no-figures"]
    return shlex.join(words).encode(errors="replace").decode()  # a path need not be text


def _digits(value: float) -> str:
    """A number as short as it reads back to the same double."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)


def case_line(name: str, rows: Sequence[RunRow], report: Path) -> str:
    """What is said of a finished case."""
    right = sum(row.verdict == "right" for row in rows)
    return message(f"{name}: {count(len(rows), 'row')}, {right} right: {report}")


def print_end(rows: Sequence[RunRow], *, readings: int) -> None:
    """Print the table, and below it what is not right and why; ``rows``: those at the tightest settings."""
    print(standings_table(standings(rows)).text)
    if readings > 1:
        print(NOTE)
    found = failing(rows)
    for own in found[:MOST_FAILING]:
        print(failing_line(own))
    if len(found) > MOST_FAILING:
        print(f"and {len(found) - MOST_FAILING} more, see the reports")
    absent = {row.solver for row in rows if row.status == "unavailable"}
    if missing := sorted(set(map(registry.missing_package, absent)) - {""}):
        print(f"to install what is missing: {shlex.join(['pip', 'install', *missing])}")


def document(rows: Sequence[RunRow], report: Path, **more: Any) -> str:
    """The same as a JSON document, a missing value null; the report's path, and what else the caller knows."""
    lists = {"solvers": [*map(asdict, standings(rows))], "failing": [*map(asdict, failing(rows))]}
    return json.dumps({**lists, "report": str(report), **more}, indent=1)


@dataclass(frozen=True)
class Failing:
    """What keeps a solver from being right, and where."""

    solver: str
    status: str
    reason: str
    where: tuple[str, ...]
    """``case reading at setting``."""


def failing(rows: Sequence[RunRow]) -> list[Failing]:
    """What is wrong by a solver's own fault, and what has no answer, the same ones of a solver together."""
    found: dict[tuple[str, str, str], list[str]] = {}
    for row in rows:
        if demand(row.solver, [row]).failures or row.verdict in NOT_JUDGED:
            key = row.solver, row.status, row.status_reason or ""
            found.setdefault(key, []).append(f"{row.case} {row.reading} at {row.setting}")
    return [Failing(*key, tuple(where)) for key, where in found.items()]


def failing_line(found: Failing) -> str:
    """What keeps a solver from being right, and where, in one line."""
    reason = f" ({found.reason.rstrip('.')})" if found.reason else ""
    return message(f"{found.solver}: {found.status}{reason}: {listed(found.where, MOST_PLACES)}")
