"""The experiment: ``henon`` and its rivals in turn on every reading of a folder of cases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from henon_ref.columns import Row
from henon_ref.model.case import Case
from henon_ref.report.csvfiles import read_rows
from henon_ref.report.manifest import Provenance
from henon_ref.report.ranking import LEVELS, name, readings_of
from henon_ref.report.write import RUNS
from henon_ref.rivals.duel import Duel, fight
from henon_ref.rivals.match import FIRST, compiled_matches, matches
from henon_ref.rivals.page import FOLDER, LIBRARIES, OTHERS, SECOND, write_page
from henon_ref.score.options import Observer, Options
from henon_ref.score.truthjob import stored_statement

SECONDS = 1.0
"""Time that the runs of a reading may take in all."""
COMPILED_LEVELS = (6, 9)
"""Digits at which libraries with compiled callbacks are timed, too: each has to be compiled at each setting."""


def run_rivals(
    cases: Sequence[Case], options: Options, origin: Provenance, out: Path, observer: Observer
) -> Path | None:
    """Time the reference and its rivals in turn on every reading whose report is there, and write the page.

    Parameters
    ----------
    cases : sequence of Case
    options : Options
        Limits are taken from it.
    origin : Provenance
    out : Path
        Folder of the reports, whose rows tell who is to be timed at which setting.
    observer : Observer

    Returns
    -------
    Path or None
        The page; None where no reading has a rival.
    """
    duels = {case.name: list(duels_of(case, read_rows(out / case.name / RUNS), options.timeout)) for case in cases}
    if not any(duels.values()):
        return None
    rows, failed = fight(duels, options, observer)
    return write_page(rows, failed, origin, out / FOLDER)


def duels_of(case: Case, rows: Sequence[Row], deadline: float) -> Iterator[Duel]:
    """What is to be timed on a case's readings, by the rows of its report; ``deadline``: of one run [s]."""
    by_reading = readings_of(rows)
    for reading in case.readings:
        own = by_reading.get((case.name, reading.name), [])
        rivals = {SECOND: (SECOND,), OTHERS: set(map(name, own)) - {FIRST}}
        found = tuple(matches(own, rivals, LEVELS))
        if found:
            yield Duel(case.name, reading.name, reading.problem, found, SECONDS, deadline)
        truth = stored_statement(case, reading)
        found = tuple(compiled_matches(own, LIBRARIES, COMPILED_LEVELS))
        if found and truth is not None and truth.expected is not None:
            yield Duel(case.name, reading.name, reading.problem, found, SECONDS, deadline, truth.expected)
