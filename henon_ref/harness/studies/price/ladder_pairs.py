"""Paired timing over the ladder: ``henon`` against every other solver."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from henon_ref.casefile.case import Case
from henon_ref.harness.campaign.options import Observer, Options
from henon_ref.harness.report.text.paired_times import FIRST
from henon_ref.harness.report.text.ranking import LEVELS, by_solver, readings_of
from henon_ref.harness.rows import Row, RunRow
from henon_ref.harness.studies.paired_times.pairs import pairs_of
from henon_ref.harness.studies.paired_times.timing import PairedTiming, TimedPair, time_pairs
from henon_ref.harness.studies.price.ladder import TIMEOUT

SECONDS = 4.0
"""Time that the runs of a pair may take."""
FEWEST = 3
"""Rounds at least, so that a median is taken of three even where a round is slow."""


def time_ladder_pairs(
    cases: Sequence[Case], rows: Sequence[RunRow], options: Options, observer: Observer, seconds: float = SECONDS
) -> tuple[list[TimedPair], list[str]]:
    """Time the pairs on every reading that both solve; their rows, and what could not be timed.

    Parameters
    ----------
    cases : sequence of Case
    rows : sequence of RunRow
        The ladder's: they tell which settings get how many digits.
    options : Options
        Processes and memory are taken from it.
    observer : Observer
    seconds : float
        Time that the runs of a pair may take.
    """
    by_reading = readings_of(rows)
    rivals = [solver for solver in by_solver(rows) if solver != FIRST]
    timings = {
        case.name: [
            PairedTiming(case.name, reading.name, reading.problem, found, seconds, TIMEOUT, fewest=FEWEST)
            for reading in case.readings
            for rival in rivals
            if (found := tuple(pairs_of(by_reading.get((case.name, reading.name), []), {rival: (rival,)}, LEVELS)))
        ]
        for case in cases
    }
    return time_pairs(timings, options, observer)


@dataclass(frozen=True)
class SampleRow(Row):
    """The raw samples of one side of a pair."""

    case: str
    reading: str
    against: str
    digits: int | None
    solver: str
    rtol: float | None
    step_s: float | None
    samples_us: str
    """In their order, with blanks between them."""


def samples_of(found: Sequence[TimedPair]) -> list[SampleRow]:
    """The raw samples behind the pairs' ratios: two rows a pair."""
    rows = []
    for row in found:
        pair = (*row.problem, row.against, row.digits)
        for solver, rtol, step, samples in (
            (FIRST, row.rtol, None, row.samples_s),
            (row.rival, row.rival_rtol, row.rival_step_s, row.rival_samples_s),
        ):
            rows.append(SampleRow(*pair, solver, rtol, step, " ".join(f"{1e6 * sample:.5g}" for sample in samples)))
    return rows
