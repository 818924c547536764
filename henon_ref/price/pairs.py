"""``henon`` against single solvers, compiled callbacks included: each pair in turn, for the same digits."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.columns import Row
from henon_ref.model.case import Case
from henon_ref.price.ladder import TIMEOUT
from henon_ref.report.ranking import readings_of
from henon_ref.rivals.duel import Duel, fight
from henon_ref.rivals.match import matches
from henon_ref.score.options import Observer, Options

RIVALS = ("heyoka", "scipy-dop853", "scipy-dop853+numba", "cvode-adams", "cvode-adams+numba")
LEVELS = (6, 9, 12)
"""Digits of the worst transition."""
SECONDS = 6.0
"""Time that the runs of a pair may take."""


def pairs(
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
    duels = {
        case.name: [
            Duel(case.name, reading.name, reading.problem, found, seconds, TIMEOUT)
            for reading in case.readings
            for rival in RIVALS
            if (found := tuple(matches(by_reading.get((case.name, reading.name), []), {rival: (rival,)}, LEVELS)))
        ]
        for case in cases
    }
    return fight(duels, options, observer)
