"""What a comparison comes to, over all its cases: a line a solver at its tightest settings, and what is not right."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from statistics import geometric_mean, median
from typing import Any

from henon_ref.columns import Row
from henon_ref.report.text.formats import setting
from henon_ref.report.text.ranking import by_solver, number, readings_of
from henon_ref.score.gate import Demand, demand

RIGHT = "right"
NOT_JUDGED = ("not run", "not judged")
"""Verdicts on what is no solver's fault, and yet no answer."""


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


@dataclass(frozen=True)
class Failing:
    """What keeps a solver from being right, and where."""

    solver: str
    status: str
    reason: str
    where: tuple[str, ...]
    """``case reading at setting``."""


@dataclass
class EndTable:
    """Collects the rows of finished cases; of each reading and solver the one at the tightest setting."""

    rows: list[Row] = field(default_factory=list)

    def add(self, rows: Sequence[Row]) -> None:
        """Take the rows of a finished case."""
        self.rows += tightest(rows)

    def solvers(self) -> list[SolverLine]:
        """A line a solver: those that are right most often first, among them the fastest."""
        fastest = {key: min(map(_time, own), default=math.inf) for key, own in readings_of(self.rows).items()}
        lines = [_line(solver, rows, fastest) for solver, rows in by_solver(self.rows).items()]
        return sorted(lines, key=lambda line: (-line.right, not line.judged, line.times_as_long or math.inf))

    def failing(self) -> list[Failing]:
        """What is wrong by a solver's own fault, and what has no answer, the same ones of a solver together."""
        found: dict[tuple[str, str, str], list[str]] = {}
        for row in self.rows:
            solver, status, reason = str(row["solver"]), str(row["status"]), str(row["status_reason"] or "")
            if demand(solver, [row]).failures or row["verdict"] in NOT_JUDGED:
                where = f"{row['case']} {row['reading']} at {setting(row['rtol'], row['step_s'])}"
                found.setdefault((solver, status, reason), []).append(where)
        return [Failing(*key, tuple(where)) for key, where in found.items()]

    def document(self) -> dict[str, Any]:
        """Both as they stand in a JSON document; a missing value is null."""
        return {
            "solvers": [asdict(line) for line in self.solvers()],
            "failing": [asdict(failing) for failing in self.failing()],
        }


def tightest(rows: Iterable[Row]) -> list[Row]:
    """Of each reading and solver the row with the smallest tolerance or step."""
    found: dict[tuple[object, ...], Row] = {}
    for row in rows:
        key = row["case"], row["reading"], row["solver"]
        if key not in found or _size(row) < _size(found[key]):
            found[key] = row
    return list(found.values())


def _size(row: Row) -> float:
    return number(row, "step_s" if row["rtol"] is None else "rtol")


def _time(row: Row) -> float:
    """Wall time of a right run; infinite for any other."""
    wall = number(row, "wall_s")
    return wall if row["verdict"] == RIGHT and wall > 0 else math.inf


def _line(solver: str, rows: Sequence[Row], fastest: dict[tuple[str, str], float]) -> SolverLine:
    total = sum((demand(solver, [row]) for row in rows), Demand())
    good = [row for row in rows if row["verdict"] == RIGHT]
    timed = {(str(row["case"]), str(row["reading"])): _time(row) for row in good if _time(row) < math.inf}
    return SolverLine(
        solver=solver,
        right=total.right,
        judged=total.judged,
        digits=min((number(row, "digits") for row in good if row["digits"] is not None), default=None),
        time_s=median(timed.values()) if timed else None,
        times_as_long=geometric_mean(wall / fastest[key] for key, wall in timed.items()) if timed else None,
    )
