"""Paired timing over a folder of reports: ``henon`` against the cheapest other solvers of every reading."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from henon_ref.casefile.case import Case
from henon_ref.errors import CaseError
from henon_ref.harness.report.folder import RUNS
from henon_ref.harness.report.text.ranking import LEVELS, readings_of
from henon_ref.harness.rows import RunRow, read_rows, rows_text
from henon_ref.harness.studies.page import write
from henon_ref.harness.studies.paired_times.rows import (
    FIRST,
    FOLDER,
    FROM_C,
    OTHERS,
    RATIOS,
    SECOND,
    PairRow,
    link,
    own_words,
    slower_table,
    spread_table,
)
from henon_ref.harness.studies.paired_times.timing import PairedTiming, able_rows, pairs_of, time_pairs
from henon_ref.harness.studies.study import Asked, Made
from henon_ref.text import markdown

SECONDS = 1.0
"""Time that the runs of a reading may take in all."""
CVODE_FROM_C = ("cvode-c-adams", "cvode-c-bdf")


def run_paired_times(asked: Asked) -> Made:
    """Time the reference and its rivals in turn on every reading whose report is there, and write the page.

    Raises
    ------
    CaseError
        Where a case has no report.
    """
    files = {case.name: (asked.rows or asked.out) / case.name / RUNS for case in asked.cases}
    for file in files.values():
        if not file.is_file():
            raise CaseError(f"{file} is not there: henon-ref compare CASES --out {file.parents[1]} writes it")
    runs = {name: read_rows(RunRow, file) for name, file in files.items()}
    timings = {case.name: list(timings_of(case, runs[case.name], asked.options.timeout)) for case in asked.cases}
    if not any(timings.values()):
        return Made(None)
    rows, failed = time_pairs(timings, asked.options, asked.observer)
    every = [row for own in runs.values() for row in own]
    slower = slower_table(rows, every)
    context = {
        "readings": len({row.problem for row in rows}),
        "total": len(readings_of(every)),
        "left": left_out(every),
        "fewest": LEVELS[0],
        "own": own_words(rows),
        "spread": spread_table(rows).markdown,
        "slower": slower.markdown if slower.rows else "",
        "failed": [markdown(each) for each in failed],
        "origin": asked.origin,
    }
    return Made(write(asked.out / FOLDER, "paired_times", context, {RATIOS: rows_text(PairRow, rows)}))


def left_out(rows: Sequence[RunRow]) -> dict[str, list[str]]:
    """Links to the readings without a pair, by the solver that has no right run to the fewest digits of a level."""
    found: dict[str, list[str]] = {}
    for (case, reading), own in readings_of(rows).items():
        able = {row.solver for _, level in able_rows(own, LEVELS) for row in level if row.wall_s}
        if FIRST not in able:
            found.setdefault(f"of `{FIRST}`", []).append(link(case, reading))
        elif able == {FIRST}:
            found.setdefault("of any other solver", []).append(link(case, reading))
    return found


def timings_of(case: Case, rows: Sequence[RunRow], deadline: float) -> Iterator[PairedTiming]:
    """What is to be timed on a case's readings, by the rows of its report; ``deadline``: of one run [s]."""
    by_reading = readings_of(rows)
    for reading in case.readings:
        own = by_reading.get((case.name, reading.name), [])
        rivals = {SECOND: (SECOND,), FROM_C: CVODE_FROM_C, OTHERS: {row.solver for row in own} - {FIRST}}
        found = tuple(pairs_of(own, rivals, LEVELS))
        if found:
            yield PairedTiming(case.name, reading.name, reading.problem, found, SECONDS, deadline)
