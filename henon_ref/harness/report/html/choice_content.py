"""Which solver to take, as the page shows it: a table and a figure for each number of digits."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import Any

from henon_ref.harness.report.text.choice import ANY, Reach, by_kind, choice, readings_for
from henon_ref.harness.report.text.matrix import MatrixRow
from henon_ref.harness.report.text.ranking import LEVELS, by_solver
from henon_ref.harness.table import count, duration, significant

HEADINGS = ("kind of case", "readings", "take", "gets", "time", "other package", "gets", "times as long")
SIDES = "lrlrrlrr"
"""Of each column: text, or numbers."""
CAPTION = (
    "The fastest of the solvers that get {} in the most readings, or in up to a tenth fewer; readings: of all, those "
    "with a transition to time; times are medians"
)
FIRST = 9
"""Digits that the page begins with."""


def choice_levels(rows: Sequence[MatrixRow], solvers: Sequence[str]) -> list[dict[str, Any]]:
    """For each number of digits (0: right, however few) the table, and for all kinds and each one of them the rest.

    Parameters
    ----------
    rows : sequence of MatrixRow
        Of the matrix.
    solvers : sequence of str
        The page's, in its order.
    """
    groups = {"all kinds of case": rows, **by_kind(rows)}
    return [
        {
            "digits": level or 0,
            "wanted": _wanted(level),
            "caption": CAPTION.format(_wanted(level)),
            "rows": choice_rows(rows, level),
            "groups": [_group(kind, own, level, solvers) for kind, own in groups.items()],
        }
        for level in (ANY, *LEVELS)
    ]


def _wanted(level: int | None) -> str:
    return "the right sequence and end" if level is None else count(level, "digit")


def choice_rows(rows: Sequence[MatrixRow], level: int | None) -> list[tuple[str, ...]]:
    """A row a kind of case, in the columns :data:`HEADINGS`: what the index has."""
    made: list[tuple[str, ...]] = []
    for kind, own in by_kind(rows).items():
        every, counted = readings_for(own, ANY), readings_for(own, level)
        readings = f"{len(every)}" if every == counted else f"{len(counted)} of {len(every)}"
        found = choice(own, level)
        cells = ["none", "", "", "", "", ""]
        if found is not None:
            first, other = found.first, found.other
            cells[:3] = first.solver, f"{len(first.walls)}", duration(median(first.walls.values()))
            cells[3:5] = (other.solver, f"{len(other.walls)}") if other else ("", "")
            cells[5] = "" if found.times is None else f"×{significant(found.times, 2)}"
        made.append((kind, readings, *cells))
    return made


def _group(kind: str, rows: Sequence[MatrixRow], level: int | None, solvers: Sequence[str]) -> dict[str, Any]:
    """Of some readings: the answer in words, and a bar a solver."""
    counted, found = readings_for(rows, level), choice(rows, level)
    readings = count(len(counted), "reading") + ("" if level is ANY else " with a transition to time")
    answer = "no solver gets there"
    if found is not None:
        answer = f"take {found.first.solver} (in {len(found.first.walls)} of {readings})"
        if found.other is not None:
            longer = "" if found.times is None else f", {significant(found.times, 2)} times as long"
            answer += f"; of other packages {found.other.solver} (in {len(found.other.walls)}{longer})"
    return {
        "answer": f"For {_wanted(level)}, {kind}: {answer}.",
        "readings": readings,
        "all": len(counted),
        "bars": _bars([row for row in rows if row.problem in counted], level, solvers),
    }


def _bars(rows: Sequence[MatrixRow], level: int | None, solvers: Sequence[str]) -> list[list[Any]]:
    """Solver, readings that it gets, readings in which it is judged, its time over the fastest solver's (or None).

    Those with the most readings first.
    """
    own = {solver: [row for row in ran if row.judged] for solver, ran in by_solver(rows).items()}
    reached = {solver: Reach(solver, _walls(ran, level)) for solver, ran in own.items() if ran}
    fastest: dict[tuple[str, str], float] = {}
    for reach in reached.values():
        for key, wall in reach.walls.items():
            fastest[key] = min(wall, fastest.get(key, wall))
    bars = [
        (solvers.index(solver), len(reach.walls), len(own[solver]), reach.against(fastest))
        for solver, reach in reached.items()
    ]
    bars.sort(key=lambda bar: (-bar[1], bar[3] or float("inf"), bar[2]))
    return [[*bar[:3], None if bar[3] is None else float(f"{bar[3]:.4g}")] for bar in bars]


def _walls(rows: Sequence[MatrixRow], level: int | None) -> dict[tuple[str, str], float]:
    return {row.problem: wall for row in rows if (wall := row.wall(level)) is not None}
