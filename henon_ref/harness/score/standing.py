"""Ranking of solvers by right readings, with digits and cost: one line per solver at its tightest settings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import geometric_mean, median

from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.gate import Demand, demand
from henon_ref.harness.table import Table, digits, duration, significant

RIGHT = "right"


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
    fastest: dict[tuple[str, str], float] = {}
    solvers: dict[str, list[RunRow]] = {}
    for row in tightest(rows):
        fastest[row.problem] = min(_time(row), fastest.get(row.problem, math.inf))
        solvers.setdefault(row.solver, []).append(row)
    lines = [_line(solver, own, fastest) for solver, own in solvers.items()]
    return sorted(lines, key=lambda line: (-line.right, not line.judged, line.times_as_long or math.inf))


def standings_table(lines: Iterable[SolverLine], notes: Mapping[str, str] | None = None) -> Table:
    """Return the ranking as a table; ``notes``: text of an additional column for each solver."""
    cells = [
        (
            line.solver,
            f"{line.right} of {line.judged}" if line.judged else "not judged",
            "" if line.digits is None else digits(line.digits),
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
    found: dict[tuple[tuple[str, str], str], RunRow] = {}
    for row in rows:
        key = row.problem, row.solver
        if key not in found or row.size < found[key].size:
            found[key] = row
    return list(found.values())


def _line(solver: str, rows: Sequence[RunRow], fastest: Mapping[tuple[str, str], float]) -> SolverLine:
    total = sum((demand(solver, [row]) for row in rows), Demand())
    good = [row for row in rows if row.verdict == RIGHT]
    timed = [row for row in good if _time(row) < math.inf]
    return SolverLine(
        solver=solver,
        right=total.right,
        judged=total.judged,
        digits=min((row.digits for row in good if row.digits is not None), default=None),
        time_s=median(map(_time, timed)) if timed else None,
        times_as_long=geometric_mean(_time(row) / fastest[row.problem] for row in timed) if timed else None,
    )


def _time(row: RunRow) -> float:
    """Wall time of a right run [s]; infinite if the run is not right or has no time."""
    return row.wall_s if row.verdict == RIGHT and row.wall_s else math.inf
