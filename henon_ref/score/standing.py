"""Who is right most often, to how many digits, at what cost: a line a solver at its tightest settings."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import geometric_mean, median

from henon_ref.columns import Row
from henon_ref.score.gate import Demand, demand

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


def standings(rows: Iterable[Row]) -> list[SolverLine]:
    """A line a solver: those that are right most often first, among them the fastest.

    All numbers are of each reading's tightest setting.
    """
    last = tightest(rows)
    fastest: dict[object, float] = {}
    solvers: dict[str, list[Row]] = {}
    for row in last:
        fastest[_reading(row)] = min(_time(row), fastest.get(_reading(row), math.inf))
        solvers.setdefault(str(row["solver"]), []).append(row)
    lines = [_line(solver, own, fastest) for solver, own in solvers.items()]
    return sorted(lines, key=lambda line: (-line.right, not line.judged, line.times_as_long or math.inf))


def tightest(rows: Iterable[Row]) -> list[Row]:
    """Of each reading and solver the row with the smallest tolerance or step."""
    found: dict[tuple[object, object], Row] = {}
    for row in rows:
        key = _reading(row), row["solver"]
        if key not in found or _size(row) < _size(found[key]):
            found[key] = row
    return list(found.values())


def _line(solver: str, rows: Sequence[Row], fastest: dict[object, float]) -> SolverLine:
    total = sum((demand(solver, [row]) for row in rows), Demand())
    good = [row for row in rows if row["verdict"] == RIGHT]
    timed = [row for row in good if _time(row) < math.inf]
    return SolverLine(
        solver=solver,
        right=total.right,
        judged=total.judged,
        digits=min((_number(row["digits"]) for row in good if row["digits"] is not None), default=None),
        time_s=median(map(_time, timed)) if timed else None,
        times_as_long=geometric_mean(_time(row) / fastest[_reading(row)] for row in timed) if timed else None,
    )


def _reading(row: Row) -> object:
    return row["case"], row["reading"]


def _size(row: Row) -> float:
    return _number(row["step_s"] if row["rtol"] is None else row["rtol"])


def _time(row: Row) -> float:
    """Wall time of a right run [s]; infinite for any other."""
    wall = _number(row["wall_s"])
    return wall if row["verdict"] == RIGHT and wall > 0 else math.inf


def _number(value: object) -> float:
    return float(value) if isinstance(value, float | int) else math.nan
