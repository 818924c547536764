"""Ranking of runs by accuracy and cost: within one reading, over all readings of a case, and over all cases."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from statistics import geometric_mean, median
from typing import TypeVar

from henon_ref.grouping import grouped
from henon_ref.harness.rows import NOT_RUN, RunRow, number
from henon_ref.harness.score.reference import HALF_ULP
from henon_ref.harness.table import Table, digits, duration, significant

LEVELS = (3, 6, 9, 12)
"""Numbers of digits for which prices are given."""
R = TypeVar("R")
AnyRun = TypeVar("AnyRun", bound=RunRow)


def readings_of(rows: Iterable[R]) -> dict[tuple[str, str], list[R]]:
    """Group rows of runs, or of a matrix, by case and reading."""
    return grouped(rows, attrgetter("problem"))


def by_solver(rows: Iterable[R]) -> dict[str, list[R]]:
    """Group rows of runs, or of a matrix, by solver."""
    return grouped(rows, attrgetter("solver"))


def right(rows: Sequence[AnyRun]) -> list[AnyRun]:
    """Return the rows whose sequence and end are right and whose accuracy is known."""
    return [row for row in rows if row.verdict == "right" and row.digits is not None]


def reaching(rows: Sequence[RunRow], digits: int) -> list[RunRow]:
    """Return the right and timed rows with at least a number of digits."""
    return [row for row in right(rows) if number(row.digits) >= digits and row.wall_s is not None]


def cheapest(rows: Sequence[RunRow], digits: int) -> tuple[RunRow | None, RunRow | None]:
    """Return the cheapest right row with at least a number of digits, and the cheapest one of any other solver."""
    able = sorted(reaching(rows, digits), key=_price)
    return next(iter(able), None), next((row for row in able if row.solver != able[0].solver), None)


def most_accurate(rows: Sequence[AnyRun]) -> AnyRun | None:
    """Return the row with the most digits; among equally accurate rows the cheapest."""
    most = max((row.digits or 0.0 for row in rows), default=0.0)
    as_good = [row for row in rows if (row.digits or 0.0) >= most - 0.3]  # 0.3 digits are a factor of two
    return min(as_good, key=_price, default=None)


def best_of(rows: Sequence[RunRow]) -> RunRow:
    """Return the row that represents a solver in a summary: the right one with the most digits, else the last one."""
    return max(right(rows), key=lambda row: number(row.digits), default=rows[-1])


@dataclass(frozen=True)
class WholeRow(RunRow):
    """Summary of a solver at one setting over all readings of a case.

    ``status`` is the first status of a reading in which the solver ran, ``wall_s`` the sum of the times of right runs,
    ``wall_s_iqr`` the sum of their interquartile ranges, and ``digits`` the smallest number in any reading. The verdict
    is "right" if the solver is right in every reading.
    """

    right_in: int = 0
    """Number of readings in which the solver is right."""


def over_all(readings: Sequence[Sequence[RunRow]]) -> list[WholeRow]:
    """Return one row per solver and setting, over all readings of a case."""
    every = grouped((row for rows in readings for row in rows), lambda row: (row.solver, row.rtol, row.step_s))
    found = []
    for (solver, rtol, step), rows in every.items():
        good = [row for row in rows if row.verdict == "right"]
        found.append(
            WholeRow(
                rows[0].case,
                "",
                solver,
                rtol=rtol,
                step_s=step,
                status=next((row.status for row in rows if row.status not in NOT_RUN), rows[0].status),
                verdict="right" if len(good) == len(readings) else "wrong",
                right_in=len(good),
                digits=min((row.digits for row in good if row.digits is not None), default=None),
                wall_s=sum(number(row.wall_s) for row in good),
                wall_s_iqr=sum(row.wall_s_iqr for row in good if row.wall_s_iqr is not None),
            )
        )
    return found


def best_setting(rows: Sequence[WholeRow]) -> WholeRow:
    """Choose the setting that is right in the most readings; among these the most accurate, then the cheapest."""
    most = max(row.right_in for row in rows)
    return most_accurate([row for row in rows if row.right_in == most]) or rows[-1]


def floor(row: RunRow) -> float:
    """Return the smallest error that can be claimed [s]: the radius of the truth, or half a unit in the last place."""
    return max(row.reference_radius_s or 0.0, HALF_ULP * (row.time_unit_s or 0.0))


def _price(row: RunRow) -> float:
    return math.inf if row.wall_s is None else row.wall_s


@dataclass(frozen=True)
class SolverLine:
    """Summary of one solver over all readings, each at its tightest setting."""

    solver: str
    right: int
    """Number of readings in which the solver is right."""
    judged: int
    """Number of readings in which it is right, or wrong by its own fault."""
    digits: float | None
    """Smallest number of digits in a reading in which it is right."""
    time_s: float | None
    """Median wall time of its right runs [s]."""
    times_as_long: float | None
    """Wall time relative to the fastest right run of the same reading; geometric mean over readings."""


def standings(rows: Iterable[RunRow]) -> list[SolverLine]:
    """Rank the solvers: first by right readings, then by relative time.

    All numbers are those of each reading's tightest setting.
    """
    rows = tightest(rows)
    fastest = {problem: min(map(_time, own)) for problem, own in readings_of(rows).items()}
    lines = [_line(solver, own, fastest) for solver, own in by_solver(rows).items()]
    return sorted(lines, key=lambda line: (-line.right, not line.judged, line.times_as_long or math.inf))


def standings_table(lines: Iterable[SolverLine], notes: Mapping[str, str] | None = None) -> Table:
    """Return the ranking as a table; ``notes``: text of an additional column for each solver."""
    cells = [
        (
            line.solver,
            f"{line.right} of {line.judged}" if line.judged else "not judged",
            digits(line.digits),
            duration(line.time_s),
            "" if line.times_as_long is None else significant(line.times_as_long),
            *([] if notes is None else [notes[line.solver]]),
        )
        for line in lines
    ]
    columns = ("solver", "right of judged", "digits", "time", "times as long", "note")
    used = len(columns) - (notes is None)
    return Table(columns[:used], "lrrrrl"[:used], cells)


def tightest(rows: Iterable[RunRow]) -> list[RunRow]:
    """Select the row with the smallest tolerance or step of each reading and solver."""
    groups = grouped(rows, lambda row: (row.problem, row.solver)).values()
    return [min(own, key=attrgetter("size")) for own in groups]


def at_fault(row: RunRow) -> bool:
    """Check whether a run is wrong by its solver's own fault, or ended differently when it was repeated."""
    return row.repeated or row.verdict == "solver defect"


def _line(solver: str, rows: Sequence[RunRow], fastest: Mapping[tuple[str, str], float]) -> SolverLine:
    good = [row for row in rows if row.verdict == "right"]
    ratios = [_time(row) / fastest[row.problem] for row in good if _time(row) < math.inf]
    return SolverLine(
        solver,
        right=sum(not row.repeated for row in good),
        judged=sum(row.verdict == "right" or at_fault(row) for row in rows if row.status != "unavailable"),
        digits=min((row.digits for row in good if row.digits is not None), default=None),
        time_s=median(_time(row) for row in good if _time(row) < math.inf) if ratios else None,
        times_as_long=geometric_mean(ratios) if ratios else None,
    )


def _time(row: RunRow) -> float:
    """Return the wall time of a right run [s]; infinite if the run is not right or has no time."""
    return row.wall_s if row.verdict == "right" and row.wall_s else math.inf
