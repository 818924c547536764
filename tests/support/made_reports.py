"""Made-up comparisons and requests of studies, for tests of reports."""

from __future__ import annotations

from dataclasses import replace

from fakes import CASE, case, expected, found, trajectory, truth, truth_of

from henon_ref.harness.campaign.comparison import Comparison, ReadingResult
from henon_ref.harness.campaign.options import Options, Setting
from henon_ref.harness.campaign.progress import ProgressLine
from henon_ref.harness.campaign.rows import Outcome, Record, record, scored
from henon_ref.harness.report.manifest import Provenance
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.studies.study import StudyRequest
from henon_ref.harness.table import Table
from henon_ref.workers.worker import Failure

ORIGIN = Provenance(
    "python -m henon_ref.compare made_up.yaml",
    "0123456789abcdef",
    {
        "processor": "A processor",
        "cores": 2,
        "memory_bytes": 2**34,
        "system": "Linux",
        "python": "CPython 3.11",
        "linear_algebra": "openblas Zen",
    },
    {"henon-ref": "1.0", "heyoka": "7.0", "scipy": "1.0"},
)


def study_request(cases, options, folder, rows=None, origin=ORIGIN) -> StudyRequest:
    """Request of a study that reports no progress."""
    return StudyRequest(cases, options, origin, folder, ProgressLine(None), rows)


def made(solver: str, rtol: float, wall: float, *, what: str = "right", truth=None, reading=None) -> Record:
    """One run's rows, with a time error of rtol and given wall times."""
    truth = truth or expected()
    reading = reading or case().readings[0]
    outcome = Outcome("made_up", reading, solver, Setting(rtol=rtol, atol=rtol), compile_s=0.1)
    if what == "unavailable":
        outcome = replace(outcome, failure=Failure("unavailable", "it is not installed"))
    elif what == "untried":
        outcome = replace(outcome, failure=Failure("timeout", "not run: timed out at 1e-6"))
    else:
        transitions = found(error=0.99 * rtol)
        outcome = replace(
            outcome, trajectory=trajectory(transitions[:2] + transitions[3:] if what == "misses" else transitions)
        )
        if what == "fails later":
            outcome = replace(outcome, repeat_failure=Failure("failed", "it died"))
        else:
            outcome = replace(outcome, samples=(wall, wall * 1.01, wall * 0.99))
        outcome = scored(outcome, truth)
    return record(outcome, truth)


def changed(own: Record, **values: object) -> Record:
    """The record with other values in its run's row."""
    return replace(own, run=replace(own.run, **values))


def compared(*records: Record, exact: Expected | None = None, **changes: object) -> Comparison:
    result = ReadingResult(case().readings[0], truth_of(exact or expected(), **changes))
    return Comparison(case(), [result], list(records), Options())


def cells(table: Table) -> dict[str, dict[str, str]]:
    """Rows of a table by their first cell, each by its headings."""
    return {row[0]: dict(zip(table.headings, row, strict=True)) for row in table.rows}


def tables(text: str) -> list[Table]:
    """The tables of a page."""
    blocks = [block.splitlines() for block in text.split("\n\n") if block.startswith("| ")]
    split = [[tuple(cell.strip() for cell in line[1:-1].split(" | ")) for line in block] for block in blocks]
    return [Table(lines[0], "", lines[2:]) for lines in split]


def usual() -> Comparison:
    """Some solvers right, one wrong at one setting, one at every one, one not there."""
    return compared(
        made("henon", 1e-6, 2e-4),
        made("henon", 1e-12, 3e-4),
        made("heyoka", 1e-6, 1e-3),
        made("heyoka", 1e-12, 9e-4),
        made("scipy-rk45", 1e-6, 0.1, what="misses"),
        made("scipy-rk45", 1e-12, 0.3),
        made("scipy-sign", 1e-6, 1e-5, what="misses"),
        made("ida", 1e-6, 0.0, what="unavailable"),
    )


VALUES = (1, 2, 3, 4)
ALL = range(1, 8)
SWEEP = CASE + "readings:\n" + "".join(f"  f{v}: {{{{system: {{{{parameters: {{{{F: {v}}}}}}}}}}}}}\n" for v in ALL)


def sweep(wrong=(), readings=VALUES, without_truth=(), settings=(1e-6, 1e-9)) -> Comparison:
    """A made-up sweep: ``wrong`` are the runs (solver, reading, rtol) that miss a transition."""
    swept = case(text=SWEEP)
    chosen = [r for r in swept.readings if r.name in {f"f{v}" for v in readings}]
    results = [
        ReadingResult(r, Failure("failed", "none") if r.name in without_truth else truth())
        for r in chosen
    ]  # fmt: skip
    records = [
        made(
            solver,
            rtol,
            wall / rtol**0.1,
            what="misses" if (solver, r.name, rtol) in wrong else "right",
            truth=replace(expected(), start=0.0),
            reading=r,
        )
        for r in chosen
        for solver, wall in (("henon", 1e-5), ("heyoka", 4e-5))
        for rtol in settings
    ]
    return Comparison(swept, results, records, Options())
