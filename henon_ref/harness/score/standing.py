"""Who is right most often, to how many digits, at what cost: a line a solver at its tightest settings."""

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
    """One solver over all readings, each at its tightest setting."""

    solver: str
    right: int
    """Readings in which it is right."""
    judged: int
    """Those and the ones in which it is wrong by its own fault."""
    digits: float | None
    """The fewest in any reading in which it is right."""
    time_s: float | None
    """Median wall time of its right runs [s]."""
    times_as_long: float | None
    """As the fastest right solver's run of the same reading; the geometric mean over readings."""


def standings(rows: Iterable[RunRow]) -> list[SolverLine]:
    """A line a solver: those that are right most often first, among them the fastest.

    All numbers are of each reading's tightest setting.
    """
    fastest: dict[tuple[str, str], float] = {}
    solvers: dict[str, list[RunRow]] = {}
    for row in tightest(rows):
        fastest[row.problem] = min(_time(row), fastest.get(row.problem, math.inf))
        solvers.setdefault(row.solver, []).append(row)
    lines = [_line(solver, own, fastest) for solver, own in solvers.items()]
    return sorted(lines, key=lambda line: (-line.right, not line.judged, line.times_as_long or math.inf))


def standings_table(lines: Iterable[SolverLine], notes: Mapping[str, str] | None = None) -> Table:
    """The same as a table; ``notes``: what is said of each solver in a column of its own."""
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
    """Of each reading and solver the row with the smallest tolerance or step."""
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
    """Wall time of a right run [s]; infinite for any other."""
    return row.wall_s if row.verdict == RIGHT and row.wall_s else math.inf
