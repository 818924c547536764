"""Work of the command ``compare``: read the cases, run the campaign, write each finished report and then the index.

Standard output receives one line per finished case, then the final table and the path of the report.
"""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from henon_ref.casefile.case import Case
from henon_ref.commands import status_line
from henon_ref.commands.exit_status import DONE, NOT_MET, say
from henon_ref.grouping import grouped
from henon_ref.harness import registry
from henon_ref.harness.campaign.campaign import compare_all
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.journal import FILE, read
from henon_ref.harness.campaign.options import Options, check_required, check_solvers, load_cases
from henon_ref.harness.campaign.progress import ProgressLine
from henon_ref.harness.report.case_report import write_report
from henon_ref.harness.report.folder import check_report, check_writable, locked, remove_if_empty
from henon_ref.harness.report.folder_report import earlier_details, write_folder_report
from henon_ref.harness.report.gate import bounds_left_out, demands_state, gate_state, why_unchecked
from henon_ref.harness.report.manifest import provenance
from henon_ref.harness.report.matrix import read_matrix
from henon_ref.harness.report.rendering import environment
from henon_ref.harness.report.svg import KINDS, figure_job, file_name
from henon_ref.harness.rows import UNJUDGED, RunRow
from henon_ref.harness.score.gate import bounds_of, demand, gate
from henon_ref.harness.score.ranking import at_fault, standings, standings_table, tightest
from henon_ref.harness.table import count
from henon_ref.text import listed, message


def run(
    paths: Sequence[Path],
    options: Mapping[str, Any],
    *,
    gated: bool = False,
    figures: bool = True,
    as_json: bool = False,
) -> int:
    """Compare cases and write reports; return the exit status.

    ``options`` are arguments of :class:`Options`, with the folder of the reports. The exit status is 1 if a required
    solver is wrong or was not judged in any reading. With ``gated``, it is also 1 if a bound of the gate is violated,
    or if there are bounds and none was checked. With ``as_json`` the table is printed as a JSON document, and nothing
    else is printed on standard output. CaseError if a case file or an argument is invalid; nothing has been written
    then.
    """
    out: Path = options["folder"]
    check_writable(out)
    read_matrix(out)  # a damaged matrix or page is an error now, not after the runs
    earlier_details(out)
    cases, asked = load_cases(paths), Options(**options)
    for case in cases:
        drawn = [file_name(reading.name, kind) for reading in case.readings for kind in KINDS] if figures else []
        check_report(out / case.name, drawn)
    check_solvers(cases, asked)
    check_required(cases, asked)
    rerun = rerun_command(paths, asked, figures=figures)
    with locked([out / case.name for case in cases]):
        for case in cases if not asked.resume else ():
            if rows := len(read(out / case.name / FILE)):
                say(f"starting from the beginning; --resume would keep {rows} rows of {case.name}")
        return _compared(cases, asked, out, rerun, gated=gated, figures=figures, as_json=as_json)


def _compared(
    cases: Sequence[Case], options: Options, out: Path, rerun: str, *, gated: bool, figures: bool, as_json: bool
) -> int:
    """Run the campaign and write its reports; the caller has locked the folders of the cases."""
    written: list[Path] = []
    failures: list[str] = []
    every: list[RunRow] = []
    environment()
    origin = provenance(rerun)

    def deliver(comparison: Comparison) -> None:
        own, name = comparison.run_rows, comparison.case.name
        written.append(write_report(comparison, origin, out))
        every.extend(own)
        failures.extend(f"{name}: {words}" for words in comparison.gate_failures())
        if not (as_json or shown.seen):
            print(case_line(name, own, written[-1]), flush=True)

    status_line.clear()
    with ProgressLine(sys.stderr) as shown:
        compare_all(cases, options, deliver, draw=figure_job if figures else None, observer=shown)
    with locked([out], wait=True):
        index = write_folder_report(out)
    discard(out, cases)
    where, rows = written[0] if len(written) == 1 else index, tightest(every)
    found = gate([bounds for case in cases for bounds in bounds_of(case)], every)
    demands = {solver: demand(solver, every) for solver in options.required}
    state = gate_state(found, bool(failures), wanted=gated)
    if as_json:
        print(document(rows, where, gate=state.removeprefix("; ") or None))
    else:
        print_end(rows, readings=sum(len(case.readings) for case in cases))
        print(message(f"{where}{state}{demands_state(demands)}"))
    if gated and found.missing:
        failures.append(why_unchecked(found))
    if gated and found.left_out:
        say(f"gate: {bounds_left_out(found)}")
    required = [words for solver, own in demands.items() for words in own.unmet(solver)]
    for words in [*(f"gate: {words}" for words in failures), *(f"required: {words}" for words in required)]:
        say(words)
    return NOT_MET if required or (gated and failures) else DONE


def discard(folder: Path, cases: Sequence[Case]) -> None:
    """Remove the journals in a folder, whose rows are in the reports now."""
    for case in cases:
        (folder / case.name / FILE).unlink(missing_ok=True)
        remove_if_empty(folder / case.name)


def rerun_command(paths: Sequence[Path], given: Options, *, figures: bool = True) -> str:
    """Return the command that makes the same reports again."""
    here = Path.cwd()
    words = ["python", "-m", "henon_ref.compare"]
    for path in map(Path.absolute, paths):  # relative paths: a report must not name folders of this machine
        word = path.relative_to(here).as_posix() if path.is_relative_to(here) else path.name
        words.append(f"./{word}" if word.startswith("-") else word)  # not an option
    for option, value in (
        ("--solvers", ",".join(map(str, given.solvers or ()))),
        ("--tolerances", ",".join(map(_digits, given.tolerances or ()))),
        ("--repeats", str(given.repeats or "")),
        ("--timeout", _digits(given.timeout) if given.timeout != Options().timeout else ""),
    ):
        words += [option, value] if value else []
    words += [] if figures else ["--no-figures"]
    # Bytes of a path that the locale does not decode are UTF-8, or no text.
    return shlex.join(words).encode(errors="surrogateescape").decode(errors="replace")


def _digits(value: float) -> str:
    """Format a number briefly, but exactly."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)


def case_line(name: str, rows: Sequence[RunRow], report: Path) -> str:
    right = sum(row.verdict == "right" for row in rows)
    return message(f"{name}: {count(len(rows), 'row')}, {right} right: {report}")


def print_end(rows: Sequence[RunRow], *, readings: int) -> None:
    """Print the table of solvers, and the runs that are not right with reasons, for rows at the tightest settings."""
    print(standings_table(standings(rows)).text)
    if readings > 1:
        print(
            "Each solver at its tightest setting, over the readings in which it is right: smallest number of digits, "
            "median time, and geometric mean of its time relative to the fastest solver (times as long)."
        )
    found = failing(rows)
    most = 24  # the JSON document and the reports list all
    for own in found[:most]:
        print(failing_line(own))
    if len(found) > most:
        print(f"and {len(found) - most} more, see the reports")
    absent = {row.solver for row in rows if row.status == "unavailable"}
    if missing := sorted(set(map(registry.missing_package, absent)) - {""}):
        print(f"to install missing packages: {shlex.join(['pip', 'install', *missing])}")


def document(rows: Sequence[RunRow], report: Path, **more: Any) -> str:
    """Format the content of :func:`print_end` and the path of the report as JSON; a missing value is null."""
    lists = {"solvers": [*map(asdict, standings(rows))], "failing": [*map(asdict, failing(rows))]}
    return json.dumps({**lists, "report": str(report), **more}, indent=1)


@dataclass(frozen=True)
class Failing:
    """Runs of a solver that are not right, with one status and one reason."""

    solver: str
    status: str
    reason: str
    where: tuple[str, ...]
    """``case reading at setting``."""


def failing(rows: Sequence[RunRow]) -> list[Failing]:
    """Group the runs that are wrong by a fault of the solver, or have no answer, by solver, status and reason."""
    bad = (row for row in rows if at_fault(row) or row.status == "unavailable" or row.verdict in UNJUDGED)
    alike = grouped(bad, lambda row: (row.solver, row.status, row.status_reason or ""))
    return [
        Failing(*key, tuple(f"{row.case} {row.reading} at {row.setting}" for row in own)) for key, own in alike.items()
    ]


def failing_line(found: Failing) -> str:
    reason = f" ({found.reason.rstrip('.')})" if found.reason else ""
    return message(f"{found.solver}: {found.status}{reason}: {listed(found.where, 3)}")
