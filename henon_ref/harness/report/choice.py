"""Recommended solvers by kind of case and digits; how often each solver is right, and in which cases."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any
from urllib.parse import quote

from henon_ref.grouping import grouped
from henon_ref.harness import registry
from henon_ref.harness.report.folder import REPORT
from henon_ref.harness.report.matrix import MatrixRow, commits_of, solvers_of
from henon_ref.harness.rows import number
from henon_ref.harness.score.ranking import LEVELS, by_solver, readings_of
from henon_ref.harness.score.reference import KINDS
from henon_ref.harness.table import Table, count, digits, duration, significant
from henon_ref.text import code, markdown

ANY = None
"""Used instead of a number of digits: the run must be right, with any number of digits."""
UNKNOWN = "kind not known"
Key = tuple[str, str]
"""Case and reading."""


def by_kind(rows: Iterable[MatrixRow]) -> dict[str, list[MatrixRow]]:
    """Group the rows of a matrix by the kind of their reading, in the order of ``KINDS``."""
    found = grouped(rows, lambda row: str(row.kind or UNKNOWN))
    return {kind: found[kind] for kind in dict.fromkeys([*KINDS, *found]) if kind in found}


def readings_for(rows: Iterable[MatrixRow], level: int | None) -> set[Key]:
    """Return the readings that count for a number of digits: all for :data:`ANY`, else those with a transition time."""
    return {row.problem for row in rows if level is None or row.digits is not None}


@dataclass(frozen=True)
class Reach:
    """Readings in which one solver reaches a number of digits, and its wall times there [s]."""

    solver: str
    walls: Mapping[Key, float]

    def against(self, others: Mapping[Key, float]) -> float | None:
        """Return the median ratio of the times to other times, over common readings; None if there are none."""
        ratios = [wall / others[key] for key, wall in self.walls.items() if others.get(key)]
        return median(ratios) if ratios else None


def _reaches(rows: Iterable[MatrixRow], level: int | None) -> tuple[list[Reach], dict[Key, float]]:
    """Return the reach of every solver, and the shortest time of all solvers in each reading."""
    found, fastest = [], dict[Key, float]()
    for solver, own in by_solver(rows).items():
        walls = {row.problem: wall for row in own if (wall := row.wall(level)) is not None}
        found.append(Reach(solver, walls))
        fastest |= {key: min(wall, fastest.get(key, wall)) for key, wall in walls.items()}
    return found, fastest


def reaches(rows: Sequence[MatrixRow], level: int | None) -> list[Reach]:
    """Return the solvers that reach a number of digits in the most readings, or a tenth fewer, fastest first."""
    every, fastest = _reaches(rows, level)
    least = max(1, 0.9 * max((len(reach.walls) for reach in every), default=0))
    found = [reach for reach in every if len(reach.walls) >= least]
    return sorted(found, key=lambda reach: (reach.against(fastest) or 1.0, -len(reach.walls)))


def choice(rows: Sequence[MatrixRow], level: int | None) -> tuple[Reach | None, Reach | None, str]:
    """Choose the solver for a number of digits, and the best one of all other packages; None if there is none.

    The last value is the time of the latter relative to the former, with two digits; empty if unknown.
    """
    first = next(iter(reaches(rows, level)), None)
    if first is None:
        return None, None, ""
    own = package_of(first.solver)
    other = next(iter(reaches([row for row in rows if package_of(row.solver) != own], level)), None)
    times = None if other is None else other.against(first.walls)
    return first, other, "" if times is None else significant(times, 2)


def package_of(solver: str) -> str:
    return registry.distribution(solver) or solver


def choice_table(rows: Sequence[MatrixRow]) -> Table:
    """Make the table of recommended solvers, with a row per kind of case and a column per number of digits.

    A cell names the recommended solver and the best one of another package, each with the number of readings in which
    it reaches the digits, and the time of the latter relative to the former.
    """
    columns = {"right": ANY, **{f"{level} digits": level for level in LEVELS}}
    lines = []
    for kind, own in by_kind(rows).items():
        every, timed = (len(readings_for(own, level)) for level in (ANY, LEVELS[0]))
        readings = f"{every}, {timed} timed" if 0 < timed < every else f"{every}"
        lines.append((kind, readings, *(_choice_cell(*choice(own, level)) for level in columns.values())))
    return Table(("kind of case", "readings", *columns), "lrl", lines)


def _choice_cell(first: Reach | None, other: Reach | None, longer: str) -> str:
    words = "; ".join(f"{code(own.solver)} {len(own.walls)}" for own in (first, other) if own is not None)
    return f"{words} (×{longer})" if longer else words


def choice_levels(rows: Sequence[MatrixRow], solvers: Sequence[str]) -> list[dict[str, Any]]:
    """Return the data of the page on the choice of a solver, for each number of digits (0: right, any digits).

    It consists of the table of :func:`choice_rows` and, for each kind of case and for all together, the answer in words
    and a bar per solver. A solver is given by its index in ``solvers``.
    """
    groups = {"all kinds of case": rows, **by_kind(rows)}
    wanted = {level: count(level, "digit") if level else "the right sequence and end" for level in (ANY, *LEVELS)}
    return [
        {
            "digits": level or 0,
            "wanted": words,
            "caption": f"Fastest of the solvers that obtain {words} in the most readings (or in up to a tenth fewer), "
            "and best solver of all other packages. Success: number of these readings. Readings: for digits, those "
            "with a transition time, of all. Times are medians",
            "rows": choice_rows(rows, level),
            "groups": [_group(f"For {words}, {kind}", own, level, solvers) for kind, own in groups.items()],
        }
        for level, words in wanted.items()
    ]


def choice_rows(rows: Sequence[MatrixRow], level: int | None) -> list[tuple[str, ...]]:
    """Return one row per kind of case, for the first table of the page."""
    made: list[tuple[str, ...]] = []
    for kind, own in by_kind(rows).items():
        every, counted = readings_for(own, ANY), readings_for(own, level)
        readings = f"{len(every)}" if every == counted else f"{len(counted)} of {len(every)}"
        first, other, longer = choice(own, level)
        cells = ["none", "", "", "", "", f"×{longer}" if longer else ""]
        if first is not None:
            cells[:3] = first.solver, f"{len(first.walls)}", duration(median(first.walls.values()))
        if other is not None:
            cells[3:5] = other.solver, f"{len(other.walls)}"
        made.append((kind, readings, *cells))
    return made


def _group(requirement: str, rows: Sequence[MatrixRow], level: int | None, solvers: Sequence[str]) -> dict[str, Any]:
    """Return the answer in words, and a bar per solver, for some readings."""
    counted, (first, other, longer) = readings_for(rows, level), choice(rows, level)
    readings = count(len(counted), "reading") + ("" if level is ANY else " with a transition time")
    answer = "no solver obtains this"
    if first is not None:
        answer = f"{first.solver} (in {len(first.walls)} of {readings})"
    if other is not None:
        times = f", {longer} times as long" if longer else ""
        answer += f"; best of all other packages: {other.solver} (in {len(other.walls)}{times})"
    bars = _bars([row for row in rows if row.judged and row.problem in counted], level, solvers)
    return {"answer": f"{requirement}: {answer}.", "readings": readings, "all": len(counted), "bars": bars}


def _bars(rows: Sequence[MatrixRow], level: int | None, solvers: Sequence[str]) -> list[list[Any]]:
    """Return (solver, readings reached, readings judged, time relative to the fastest solver or None) of every solver.

    The solvers are sorted by decreasing number of readings reached.
    """
    (every, fastest), judged = _reaches(rows, level), Counter(row.solver for row in rows)
    bars = [(solvers.index(own.solver), len(own.walls), judged[own.solver], own.against(fastest)) for own in every]
    bars.sort(key=lambda bar: (-bar[1], bar[3] or float("inf"), bar[2]))
    return [[*bar[:3], None if bar[3] is None else float(f"{bar[3]:.4g}")] for bar in bars]


def frequency_table(rows: Sequence[MatrixRow]) -> Table:
    """Make the table of the numbers of readings in which each solver is right, judged, run and cheapest.

    A solver is right in a reading if it is right at one setting at least. If only one solver reaches a number of
    digits, it counts as the cheapest.
    """
    wins: dict[str, Counter[int]] = {}
    reached, contested = Counter[int](), Counter[int]()
    readings = readings_of(rows)
    for own in readings.values():
        for level in LEVELS:
            walls = {row.solver: wall for row in own if (wall := row.wall(level)) is not None}
            if walls:
                reached[level] += 1
                contested[level] += len(walls) > 1
                wins.setdefault(min(walls, key=walls.__getitem__), Counter())[level] += 1
    solvers, lines = by_solver(rows), []
    for solver in solvers_of(rows):
        own = solvers[solver]
        counts = sum(row.right > 0 for row in own), sum(row.judged > 0 for row in own), len(own)
        won = wins.get(solver, Counter())
        lines.append((counts[0], (code(solver), *map(str, counts), *(f"{won[level] or ''}" for level in LEVELS))))
    cells = [own for _, own in sorted(lines, key=lambda line: -line[0])]
    cells.append(("all readings", "", "", f"{len(readings)}", *(f"{reached[level]}" for level in LEVELS)))
    cells.append(("of these, reached by another solver, too", *3 * ("",), *(f"{contested[level]}" for level in LEVELS)))
    headings = ("solver", "right in", "judged in", "run on", *(f"cheapest for {level} digits" for level in LEVELS))
    return Table(headings, "lr", cells)


def coverage_sentence(rows: Sequence[MatrixRow]) -> str:
    """Return a sentence on the numbers of readings on which the solvers were run; empty if all were run on all."""
    counts, readings = Counter(row.solver for row in rows), len(readings_of(rows))
    groups = grouped(solvers_of(rows), counts.__getitem__)
    words = "; ".join(f"{own}: {', '.join(solvers)}" for own, solvers in sorted(groups.items(), reverse=True))
    return "" if set(groups) <= {readings} else f"Of {count(readings, 'reading')} the solvers were run on {words}."


def commits(rows: Sequence[MatrixRow]) -> str:
    """Describe the number of commits of the program from which the rows come."""
    known = len(commits_of(rows))
    return f"{count(known, 'commit')} of the program" if known else "a program of no known commit"


def case_table(rows: Sequence[MatrixRow]) -> Table:
    """Make the table with one row per case, over all its readings.

    The columns are: ``right of judged``, the number of solvers that are right at one setting at least in every reading
    in which they were judged, and the number of judged solvers; the best digits that one of the right solvers reaches
    in all its readings; and the solver with the shortest total time, among right solvers judged in the most readings.
    """
    lines = []
    for case, own in grouped(rows, lambda row: row.case).items():
        judged = by_solver(row for row in own if row.judged)
        right = {solver: own for solver, own in judged.items() if all(row.right for row in own)}
        most = max(map(len, judged.values()), default=0)
        whole = {solver: own for solver, own in right.items() if len(own) == most}
        least = [min(known) for own in whole.values() if (known := [r.digits for r in own if r.digits is not None])]
        walls = {
            solver: sum(number(row.wall_s) for row in own)
            for solver, own in whole.items()
            if all(row.wall_s is not None for row in own)
        }
        first = min(walls, key=walls.__getitem__, default=None)
        cheapest = "none" if first is None else f"{code(first)}, {duration(walls[first])}"
        link, best = f"[{markdown(case)}]({quote(case)}/{REPORT})", digits(max(least, default=None))
        lines.append((link, f"{len(right)}/{len(judged)}", best, cheapest))
    return Table(("case", "right of judged", "best digits", "cheapest right solver"), "lrrl", lines)
