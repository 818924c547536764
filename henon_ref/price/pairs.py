"""``henon`` against another solver: both in turn, each at its cheapest setting for the same worst error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from henon_ref import registry
from henon_ref.model.case import Case
from henon_ref.price.timer import in_turn
from henon_ref.report.ranking import name, number, right
from henon_ref.report.ratios import readings_of
from henon_ref.score.columns import Row
from henon_ref.solver import Run
from henon_ref.trajectory import Problem

RIVALS = ("heyoka", "scipy-dop853", "scipy-dop853+numba", "cvode-adams", "cvode-adams+numba")
ERRORS = (1e-9, 1e-12)
"""Bounds on the worst error [s]."""
SECONDS, FEWEST, MOST = 1.0, 5, 200
"""Time a pair may take, and how often each of it is run."""


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
    rounds: int

    @property
    def ratio(self) -> float:
        """`henon`'s time over the other's."""
        return self.wall_s / self.rival_wall_s


def pairs(cases: Sequence[Case], rows: Sequence[Row], seconds: float = SECONDS) -> list[Pair]:
    """Time the pairs on every reading that both solve to within a bound.

    Parameters
    ----------
    cases : sequence of Case
    rows : sequence of Row
        The ladder's: they tell the settings.
    seconds : float
        Time a pair may take.
    """
    problems = {(case.name, reading.name): reading.problem for case in cases for reading in case.readings}
    found = []
    for key, own in readings_of(rows).items():
        for error in ERRORS:
            first = _cheapest(own, "henon", error)
            for rival in RIVALS:
                other = _cheapest(own, rival, error)
                if first is not None and other is not None:
                    found.append(_timed(*key, error, problems[key], first, other, seconds))
    return found


def _cheapest(rows: Sequence[Row], solver: str, error: float) -> Row | None:
    """A solver's cheapest right row whose worst error is at most ``error`` [s]."""
    able = [row for row in right(rows) if name(row) == solver and number(row, "max_time_error_s") <= error]
    return min((row for row in able if row["wall_s"]), key=lambda row: number(row, "wall_s"), default=None)


def _timed(
    case: str, reading: str, error: float, problem: Problem, first: Row, other: Row, seconds: float
) -> Pair:  # fmt: skip
    runs = {name(row): _prepared(row, problem) for row in (first, other)}
    rounds = min(max(int(seconds / number(other, "wall_s")), FEWEST), MOST)
    times = in_turn(runs, rounds=rounds)
    settings = number(first, "rtol"), number(other, "rtol")
    walls = times[name(first)].median, times[name(other)].median
    return Pair(case, reading, error, name(other), *settings, *walls, rounds)


def _prepared(row: Row, problem: Problem) -> Run:
    return registry.solver(name(row)).prepare(problem, rtol=number(row, "rtol"), atol=number(row, "atol"))
