"""Who is right to how many digits at what cost: the rows of one reading, ranked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from henon_ref.columns import Row
from henon_ref.score.reference import HALF_ULP

LEVELS = (3, 6, 9, 12)
"""Digits that prices are given for."""
NOT_RUN = ("unsupported", "unavailable")
"""Statuses of solvers that were not run."""
AS_GOOD = 0.3
"""Digits that two solvers may differ by and still count as equally accurate (a factor of two)."""


def number(row: Row, column: str) -> float:
    """A numeric value of a row; NaN where it is missing."""
    value = row[column]
    return float(value) if isinstance(value, float | int) else float("nan")


def name(row: Row) -> str:
    """The row's solver."""
    return str(row["solver"])


def readings_of(rows: Sequence[Row]) -> dict[tuple[str, str], list[Row]]:
    """Rows by case and reading."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        found.setdefault((str(row["case"]), str(row["reading"])), []).append(row)
    return found


def by_solver(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Rows of each solver, in order."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(name(row), []).append(row)
    return found


def right(rows: Sequence[Row]) -> list[Row]:
    """Rows whose sequence and end are right and whose accuracy is known."""
    return [row for row in rows if row["verdict"] == "right" and row["digits"] is not None]


def reaching(rows: Sequence[Row], digits: int) -> list[Row]:
    """Right rows that reach so many digits, and were timed."""
    return [row for row in right(rows) if number(row, "digits") >= digits and row["wall_s"] is not None]


def most_accurate(rows: Sequence[Row]) -> Row | None:
    """The right row with the most digits; among those as good, the cheapest."""
    candidates = right(rows)
    best = max((number(row, "digits") for row in candidates), default=0.0)
    return min((row for row in candidates if number(row, "digits") >= best - AS_GOOD), key=_price, default=None)


def best_of(rows: Sequence[Row]) -> Row:
    """The row that a summary shows of one solver: the right one with the most digits, else the last one."""
    candidates = right(rows)
    return max(candidates, key=lambda row: number(row, "digits")) if candidates else rows[-1]


def over_all(readings: Sequence[Sequence[Row]]) -> list[Row]:
    """A row for every solver and setting, over all readings of a case.

    ``status`` is one of a reading in which it ran, ``wall_s`` the time of all readings, ``wall_s_iqr`` the sum of their
    ranges, ``digits`` the fewest in any. The verdict is right where it is so in every reading; in how many it is says
    ``right_in``.
    """
    own: dict[tuple[object, ...], list[Row]] = {}
    for row in (row for rows in readings for row in rows):
        own.setdefault((row["solver"], row["rtol"], row["step_s"]), []).append(row)
    found: list[Row] = []
    for (solver, rtol, step), rows in own.items():
        good = [row for row in rows if row["verdict"] == "right"]
        reached = [number(row, "digits") for row in good if row["digits"] is not None]
        found.append(
            {
                "solver": solver,
                "rtol": rtol,
                "step_s": step,
                "status": next((row["status"] for row in rows if row["status"] not in NOT_RUN), rows[0]["status"]),
                "verdict": "right" if len(good) == len(readings) else "wrong",
                "right_in": len(good),
                "digits": min(reached, default=None),
                "wall_s": sum(number(row, "wall_s") for row in good),
                "wall_s_iqr": sum(number(row, "wall_s_iqr") for row in good if row["wall_s_iqr"] is not None),
            }
        )
    return found


@dataclass(frozen=True)
class Price:
    """The cheapest way to so many digits, and the next solver's."""

    digits: int
    row: Row | None
    next_row: Row | None
    """The cheapest row of another solver."""


def prices(rows: Sequence[Row], levels: Sequence[int] = LEVELS) -> list[Price]:
    """For each level, the cheapest right row that reaches it, and the cheapest of any other solver."""
    found = []
    for level in levels:
        able = sorted(reaching(rows, level), key=_price)
        first = able[0] if able else None
        others = [row for row in able if first is not None and row["solver"] != first["solver"]]
        found.append(Price(level, first, others[0] if others else None))
    return found


def floor(row: Row) -> float:
    """The least error that can be claimed [s]: the truth's radius, or what double precision holds."""
    unit, radius = row["time_unit_s"], row["reference_radius_s"]
    return max(
        float(radius) if isinstance(radius, float | int) else 0.0,
        HALF_ULP * float(unit) if isinstance(unit, float | int) else 0.0,
    )


def _price(row: Row) -> float:
    wall = number(row, "wall_s")
    return wall if wall == wall else float("inf")
