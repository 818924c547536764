"""``henon`` against another solver: both in turn, each at its cheapest setting for the same worst error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from henon_ref import registry
from henon_ref.columns import Row
from henon_ref.model.case import Case
from henon_ref.price.timer import in_turn
from henon_ref.report.ranking import name, number, right
from henon_ref.report.ratios import readings_of
from henon_ref.solver import Run
from henon_ref.trajectory import Problem

FIRST = "henon"
RIVALS = ("heyoka", "scipy-dop853", "scipy-dop853+numba", "cvode-adams", "cvode-adams+numba")
ERRORS = (1e-9, 1e-12)
"""Bounds on the worst error [s]."""
CANDIDATES = 3
"""Settings of each solver that are timed: the loosest within the bound. The cheapest is among them, or next to it."""
SECONDS, FEWEST, MOST = 3.0, 5, 200
"""Time a pair may take, and how often each of it is run."""
TURN = 1e-3
"""Seconds for which a short run is repeated when it is its turn."""


@dataclass(frozen=True)
class Pair:
    """Two solvers on one reading."""

    case: str
    reading: str
    worst_error_s: float
    rival: str
    rtol: float
    """`henon`'s setting, and the other's."""
    rival_rtol: float
    wall_s: float
    """Median of `henon`'s times, and of the other's."""
    rival_wall_s: float
    ratio: float
    """`henon`'s time over the other's, median over the rounds."""
    rounds: int


def pairs(cases: Sequence[Case], rows: Sequence[Row], seconds: float = SECONDS) -> list[Pair]:
    """Time the pairs on every reading that both solve to within a bound.

    Parameters
    ----------
    cases : sequence of Case
    rows : sequence of Row
        The ladder's: they tell which settings are within the bound.
    seconds : float
        Time a pair may take.
    """
    problems = {(case.name, reading.name): reading.problem for case in cases for reading in case.readings}
    found = []
    for key, own in readings_of(rows).items():
        for error in ERRORS:
            first = _candidates(own, FIRST, error)
            for rival in RIVALS:
                other = _candidates(own, rival, error)
                if first and other:
                    found.append(_timed(*key, error, problems[key], [*first, *other], seconds))
    return found


def _candidates(rows: Sequence[Row], solver: str, error: float) -> list[Row]:
    """A solver's loosest right rows whose worst error is at most ``error`` [s]."""
    able = [row for row in right(rows) if name(row) == solver and number(row, "max_time_error_s") <= error]
    return sorted(able, key=lambda row: -number(row, "rtol"))[:CANDIDATES]


def _timed(case: str, reading: str, error: float, problem: Problem, rows: Sequence[Row], seconds: float) -> Pair:
    runs = {(name(row), number(row, "rtol")): _prepared(row, problem) for row in rows}
    rounds = min(max(int(seconds / sum(number(row, "wall_s") for row in rows)), FEWEST), MOST)
    times = in_turn(runs, rounds=rounds, turn=TURN)
    own, other = (min((key for key in runs if (key[0] == FIRST) is ours), key=times.median) for ours in (True, False))
    return Pair(
        case=case,
        reading=reading,
        worst_error_s=error,
        rival=other[0],
        rtol=own[1],
        rival_rtol=other[1],
        wall_s=times.median(own),
        rival_wall_s=times.median(other),
        ratio=times.ratio(own, other),
        rounds=rounds,
    )


def _prepared(row: Row, problem: Problem) -> Run:
    return registry.solver(name(row)).prepare(problem, rtol=number(row, "rtol"), atol=number(row, "atol"))
