"""Paired timing over the ladder: ``henon`` against every other solver, compiled callbacks included."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.campaign.options import Observer, Options
from henon_ref.casefile.case import Case
from henon_ref.columns import Row
from henon_ref.report.text.paired_times import FIRST
from henon_ref.report.text.ranking import LEVELS, by_solver, readings_of
from henon_ref.studies.price.ladder import TIMEOUT, sampled
from henon_ref.studies.price.paired_times import RIVAL_SAMPLES, SAMPLES, PairedTiming, time_pairs
from henon_ref.studies.price.pairs import pairs_of

SECONDS = 4.0
"""Time that the runs of a pair may take."""
FEWEST = 3
"""Rounds at least, so that a median is taken of three even where a round is slow."""


def time_ladder_pairs(
    cases: Sequence[Case], rows: Sequence[Row], options: Options, observer: Observer, seconds: float = SECONDS
) -> tuple[list[Row], list[str]]:
    """Time the pairs on every reading that both solve; their rows, and what could not be timed.

    Parameters
    ----------
    cases : sequence of Case
    rows : sequence of Row
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


def samples_of(found: Sequence[Row]) -> list[Row]:
    """The raw samples behind the pairs' ratios: two rows a pair."""
    rows = []
    for row in found:
        settings: tuple[Row, Row] = (
            {"solver": FIRST, "rtol": row["rtol"], "step_s": None},
            {"solver": row["rival"], "rtol": row["rival_rtol"], "step_s": row["rival_step_s"]},
        )
        for own, column in zip(settings, (SAMPLES, RIVAL_SAMPLES), strict=True):
            rows.append(sampled({**row, **own}, row[column]))  # type: ignore[arg-type]
    return rows
