"""Which solver to take, by kind of case and digits; who is right how often, and in which case."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any
from urllib.parse import quote

from henon_ref.harness import registry
from henon_ref.harness.report.folder import REPORT
from henon_ref.harness.report.text.matrix import MatrixRow, commits_of, solvers_of
from henon_ref.harness.report.text.ranking import LEVELS, by_solver, grouped, readings_of
from henon_ref.harness.rows import number
from henon_ref.harness.score.kinds import KINDS
from henon_ref.harness.table import Table, count, digits, duration, significant
from henon_ref.text import code, markdown

ANY = None
"""In place of a number of digits: right, however few its digits."""
UNKNOWN = "kind not known"
"""Kind of readings whose report does not say theirs."""
AS_MANY = 0.9
"""Part of the most readings from which on a solver counts as getting there in as many."""
HEADINGS = ("kind of case", "readings", "take", "gets", "time", "other package", "gets", "times as long")
SIDES = "lrlrrlrr"
"""Columns of the page's table, and of each whether it is text or numbers."""
CAPTION = (
    "The fastest of the solvers that get {} in the most readings, or in up to a tenth fewer; readings: of all, those "
    "with a transition to time; times are medians"
)
Key = tuple[str, str]
"""Case and reading."""


def by_kind(rows: Iterable[MatrixRow]) -> dict[str, list[MatrixRow]]:
    """Rows of a matrix by the kind of their reading, in the order of KINDS."""
    found = grouped(rows, lambda row: str(row.kind or UNKNOWN))
    return {kind: found[kind] for kind in dict.fromkeys([*KINDS, *found]) if kind in found}


def readings_for(rows: Iterable[MatrixRow], level: int | None) -> set[Key]:
    """The readings that count for so many digits: all for :data:`ANY`, else those with a transition to time."""
    return {row.problem for row in rows if level is None or row.digits is not None}


@dataclass(frozen=True)
class Reach:
    """The readings in which one solver reaches so many digits, and its times there [s]."""

    solver: str
    walls: Mapping[Key, float]

    def against(self, others: Mapping[Key, float]) -> float | None:
        """How many times as long as others it takes: the median over the readings that both reach."""
        ratios = [wall / others[key] for key, wall in self.walls.items() if others.get(key)]
        return median(ratios) if ratios else None


def _reaches(rows: Iterable[MatrixRow], level: int | None) -> tuple[list[Reach], dict[Key, float]]:
    """Every solver, and the shortest time of any of them in each reading."""
    found, fastest = [], dict[Key, float]()
    for solver, own in by_solver(rows).items():
        walls = {row.problem: wall for row in own if (wall := row.wall(level)) is not None}
        found.append(Reach(solver, walls))
        fastest |= {key: min(wall, fastest.get(key, wall)) for key, wall in walls.items()}
    return found, fastest


def reaches(rows: Sequence[MatrixRow], level: int | None) -> list[Reach]:
    """The solvers that reach so many digits in about as many readings as any other, the fastest first."""
    every, fastest = _reaches(rows, level)
    least = max(1, AS_MANY * max((len(reach.walls) for reach in every), default=0))
    found = [reach for reach in every if len(reach.walls) >= least]
    return sorted(found, key=lambda reach: (reach.against(fastest) or 1.0, -len(reach.walls)))


@dataclass(frozen=True)
class Choice:
    """The solver to take, and the one of all other packages."""

    first: Reach
    other: Reach | None
    times: float | None
    """How many times as long the other takes."""

    @property
    def longer(self) -> str:
        """The same with two places; empty where it is not known."""
        return "" if self.times is None else significant(self.times, 2)


def choice(rows: Sequence[MatrixRow], level: int | None) -> Choice | None:
    """Whom to take for so many digits; None where no solver gets there. Solvers of one package are no alternatives."""
    found = reaches(rows, level)
    if not found:
        return None
    own = package_of(found[0].solver)
    others = reaches([row for row in rows if package_of(row.solver) != own], level)
    return Choice(found[0], others[0], others[0].against(found[0].walls)) if others else Choice(found[0], None, None)


def package_of(solver: str) -> str:
    """The package that a solver belongs to."""
    return registry.distribution(solver) or solver


def choice_table(rows: Sequence[MatrixRow]) -> Table:
    """A row a kind of case, a column a number of digits: the solver to take, and the one of another package.

    Each with the number of readings in which it gets there, the other with how many times as long it takes.
    """
    columns = {"right": ANY, **{f"{level} digits": level for level in LEVELS}}
    lines = []
    for kind, own in by_kind(rows).items():
        every, timed = (len(readings_for(own, level)) for level in (ANY, LEVELS[0]))
        readings = f"{every}, {timed} timed" if 0 < timed < every else f"{every}"
        lines.append((kind, readings, *(_choice_cell(choice(own, level)) for level in columns.values())))
    return Table(("kind of case", "readings", *columns), "lr" + "l" * len(columns), lines)


def _choice_cell(found: Choice | None) -> str:
    if found is None:
        return ""
    words = "; ".join(f"{code(own.solver)} {len(own.walls)}" for own in (found.first, found.other) if own)
    return f"{words} (×{found.longer})" if found.longer else words


def choice_levels(rows: Sequence[MatrixRow], solvers: Sequence[str]) -> list[dict[str, Any]]:
    """What the page shows of the choice, for each number of digits (0: right, however few).

    The table of :func:`choice_rows`; and for all kinds of case, and each one of them, the answer in words and a bar a
    solver, which is told by its place among ``solvers``.
    """
    groups = {"all kinds of case": rows, **by_kind(rows)}
    wanted = {level: count(level, "digit") if level else "the right sequence and end" for level in (ANY, *LEVELS)}
    return [
        {
            "digits": level or 0,
            "wanted": words,
            "caption": CAPTION.format(words),
            "rows": choice_rows(rows, level),
            "groups": [_group(f"For {words}, {kind}", own, level, solvers) for kind, own in groups.items()],
        }
        for level, words in wanted.items()
    ]


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
            cells[5] = f"×{found.longer}" if found.longer else ""
        made.append((kind, readings, *cells))
    return made


def _group(asked: str, rows: Sequence[MatrixRow], level: int | None, solvers: Sequence[str]) -> dict[str, Any]:
    """Of some readings: the answer in words, and a bar a solver."""
    counted, found = readings_for(rows, level), choice(rows, level)
    readings = count(len(counted), "reading") + ("" if level is ANY else " with a transition to time")
    answer = "no solver gets there"
    if found is not None:
        answer = f"take {found.first.solver} (in {len(found.first.walls)} of {readings})"
        if found.other is not None:
            longer = f", {found.longer} times as long" if found.longer else ""
            answer += f"; of other packages {found.other.solver} (in {len(found.other.walls)}{longer})"
    bars = _bars([row for row in rows if row.judged and row.problem in counted], level, solvers)
    return {"answer": f"{asked}: {answer}.", "readings": readings, "all": len(counted), "bars": bars}


def _bars(rows: Sequence[MatrixRow], level: int | None, solvers: Sequence[str]) -> list[list[Any]]:
    """Solver, readings that it gets, readings in which it is judged, its time over the fastest solver's (or None).

    Those with the most readings first.
    """
    (every, fastest), judged = _reaches(rows, level), Counter(row.solver for row in rows)
    bars = [(solvers.index(own.solver), len(own.walls), judged[own.solver], own.against(fastest)) for own in every]
    bars.sort(key=lambda bar: (-bar[1], bar[3] or float("inf"), bar[2]))
    return [[*bar[:3], None if bar[3] is None else float(f"{bar[3]:.4g}")] for bar in bars]


def often_table(rows: Sequence[MatrixRow]) -> Table:
    """In how many readings each solver is right, of those it is judged in and run on; how often it is the cheapest.

    Right is a solver that is so at one setting at least. Where nobody else gets so far, the one that does is the
    cheapest.
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
    cells.append(("of these, another solver gets there, too", *3 * ("",), *(f"{contested[level]}" for level in LEVELS)))
    headings = ("solver", "right in", "judged in", "run on", *(f"cheapest for {level} digits" for level in LEVELS))
    return Table(headings, "l" + "r" * (len(headings) - 1), cells)


def coverage_words(rows: Sequence[MatrixRow]) -> str:
    """On how many readings each solver was run, in a sentence; empty where all were run on all."""
    counts, readings = Counter(row.solver for row in rows), len(readings_of(rows))
    groups = grouped(solvers_of(rows), counts.__getitem__)
    words = "; ".join(f"{own}: {', '.join(solvers)}" for own, solvers in sorted(groups.items(), reverse=True))
    return "" if set(groups) <= {readings} else f"Of {count(readings, 'reading')} the solvers were run on {words}."


def commits(rows: Sequence[MatrixRow]) -> str:
    """How many commits of the program the rows mix."""
    known = len(commits_of(rows))
    return f"{count(known, 'commit')} of the program" if known else "a program of no known commit"


def case_table(rows: Sequence[MatrixRow]) -> Table:
    """A row a case, its readings folded.

    ``right of judged``: solvers that are right in every reading that they were judged in, at one setting at least,
    and solvers judged. Best digits: the most that one of them gets in all its readings. Cheapest: the one that takes
    the least time for all readings, of those judged in the most.
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
