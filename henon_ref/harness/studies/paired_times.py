"""Paired times over a folder of reports: ``henon`` against the cheapest other solvers of every reading."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from henon_ref.casefile.case import Case
from henon_ref.errors import CaseError
from henon_ref.harness.report.folder import RUNS
from henon_ref.harness.result_files import rows_in_file, rows_text
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.ranking import LEVELS, readings_of
from henon_ref.harness.studies.page import report_link, write
from henon_ref.harness.studies.pairs import (
    FIRST,
    SECOND,
    PairedTiming,
    PairRow,
    able_rows,
    bound,
    own_words,
    pairs_of,
    time_pairs,
)
from henon_ref.harness.studies.study import StudyRequest, StudyResult
from henon_ref.harness.table import Table, duration, setting, significant
from henon_ref.harness.table import digits as shown_digits
from henon_ref.text import code, markdown

SECONDS = 1.0
"""Time that all runs of a reading may take together [s]."""
RATIOS = "ratios.csv"
OTHERS, FROM_C = "the cheapest other", "CVODE from C"
"""Rivals of the reference in addition to :data:`SECOND`: the cheapest of all others, and CVODE without Python."""


def run_paired_times(request: StudyRequest) -> StudyResult:
    """Time the reference and its rivals in interleaved runs on every reading, and write the page.

    CaseError if a case has no report.
    """
    assert request.rows is not None  # the command requires it
    files = {case.name: request.rows / case.name / RUNS for case in request.cases}
    for file in files.values():
        if not file.is_file():
            raise CaseError(f"{file} is not there: henon-ref compare CASES --out {file.parents[1]} writes it")
    runs = {name: rows_in_file(RunRow, file) for name, file in files.items()}
    timings = [own for case in request.cases for own in timings_of(case, runs[case.name], request.options.timeout)]
    if not timings:
        return StudyResult(None)
    rows, failed = time_pairs(timings, request.options, request.observer)
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
        "origin": request.origin,
    }
    return StudyResult(write(request.folder, "paired_times", context, {RATIOS: rows_text(PairRow, rows)}))


def timings_of(case: Case, rows: Sequence[RunRow], deadline: float) -> Iterator[PairedTiming]:
    """Yield the timings of a case's readings, from the rows of its report; ``deadline`` is that of one run [s]."""
    by_reading = readings_of(rows)
    for reading in case.readings:
        own = by_reading.get((case.name, reading.name), [])
        others = {row.solver for row in own} - {FIRST}
        rivals = {SECOND: (SECOND,), FROM_C: ("cvode-c-adams", "cvode-c-bdf"), OTHERS: others}
        found = tuple(pairs_of(own, rivals, LEVELS))
        if found:
            yield PairedTiming(case.name, reading.name, reading.problem, found, SECONDS, deadline)


def left_out(rows: Sequence[RunRow]) -> dict[str, list[str]]:
    """Links to the readings without a pair, by the solver that has no right run with the lowest level of digits."""
    found: dict[str, list[str]] = {}
    for (case, reading), own in readings_of(rows).items():
        able = {row.solver for _, level in able_rows(own, LEVELS) for row in level if row.wall_s}
        if FIRST not in able:
            found.setdefault(f"of `{FIRST}`", []).append(report_link(case, reading))
        elif able == {FIRST}:
            found.setdefault("of any other solver", []).append(report_link(case, reading))
    return found


def spread_table(rows: Sequence[PairRow]) -> Table:
    """Table of the distribution over readings of a rival's time divided by ``henon``'s, and of the faster readings."""
    lines = []
    for label, against, times in (
        (code(SECOND), SECOND, "times_as_long"),
        (f"{code(SECOND)}, its own calls alone", SECOND, "own_times_as_long"),
        (FROM_C, FROM_C, "times_as_long"),
        (OTHERS, OTHERS, "times_as_long"),
    ):
        for digits in (*LEVELS, None):
            own = [getattr(row, times) for row in rows if (row.against, row.digits) == (against, digits)]
            found = [value for value in own if value is not None]
            if found:
                quantiles = (significant(value) for value in np.quantile(found, [0.0, 0.25, 0.5, 0.75, 1.0]))
                faster = sum(value < 1 for value in found)
                lines.append((label, bound(digits), f"{len(found)}", *quantiles, f"{faster}"))
    headings = (
        "solver", "digits", "readings", "times as long, minimum", "lower quartile", "median", "upper quartile",
        "maximum", f"faster than {code(FIRST)} in",
    )  # fmt: skip
    return Table(headings, "lr", lines)


def slower_table(rows: Sequence[PairRow], runs: Sequence[RunRow]) -> Table:
    """Table of the readings in which another solver is faster, at the level of digits with the largest ratio.

    ``runs`` are the rows of the reports, which contain the digits and steps of each setting.
    """
    known = {run.key: run for run in runs}
    lines = []
    for problem, own in readings_of(row for row in rows if row.against == OTHERS and row.ratio > 1).items():
        row = max(own, key=lambda row: row.ratio)
        cells = [report_link(*problem), bound(row.digits)]
        for solver, rtol, step, wall in (
            (FIRST, row.rtol, None, row.wall_s),
            (row.rival, row.rival_rtol, row.rival_step_s, row.rival_wall_s),
        ):
            run = known.get((*problem, solver, rtol, step))
            got = "" if run is None or run.digits is None else shown_digits(run.digits)
            steps = "" if run is None or run.steps is None else f"{run.steps}"
            cells += [code(solver)] if solver != FIRST else []
            cells += [setting(rtol, step), got, steps, duration(wall)]
        lines.append((*cells, significant(row.ratio)))
    first, reached = code(FIRST), ("reached", "steps", "time")
    headings = ("reading", "digits", f"{first} at", *reached, "solver", "setting", *reached, f"times as long, {first}")
    return Table(headings, "lrrrrrlrrrrr", lines)
