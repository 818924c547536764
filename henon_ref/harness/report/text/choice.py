"""Which solver to take, by kind of case and digits; who is right how often, and in which case."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from urllib.parse import quote

from henon_ref.harness import registry
from henon_ref.harness.report.folder import REPORT
from henon_ref.harness.report.text.matrix import MatrixRow, solvers_of
from henon_ref.harness.report.text.ranking import LEVELS, readings_of
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
Key = tuple[str, str]
"""Case and reading."""


def by_kind(rows: Iterable[MatrixRow]) -> dict[str, list[MatrixRow]]:
    """Rows of a matrix by the kind of their reading, in the order of KINDS."""
    found: dict[str, list[MatrixRow]] = {kind: [] for kind in KINDS}
    for row in rows:
        found.setdefault(str(row.kind or UNKNOWN), []).append(row)
    return {kind: own for kind, own in found.items() if own}


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


def reaches(rows: Sequence[MatrixRow], level: int | None) -> list[Reach]:
    """The solvers that reach so many digits in about as many readings as any other, the fastest first.

    Parameters
    ----------
    rows : sequence of MatrixRow
        Of a matrix.
    level : int, optional
        Digits, one of LEVELS; None: right.
    """
    walls: dict[str, dict[Key, float]] = {}
    fastest: dict[Key, float] = {}
    for row in rows:
        key, wall = row.problem, row.wall(level)
        if wall is not None:
            walls.setdefault(row.solver, {})[key] = wall
            fastest[key] = min(wall, fastest.get(key, wall))
    most = max(map(len, walls.values()), default=0)
    found = [Reach(solver, own) for solver, own in walls.items() if len(own) >= AS_MANY * most]
    return sorted(found, key=lambda reach: (reach.against(fastest) or 1.0, -len(reach.walls)))


@dataclass(frozen=True)
class Choice:
    """The solver to take, and the one of all other packages."""

    first: Reach
    other: Reach | None
    times: float | None
    """How many times as long the other takes."""


def choice(rows: Sequence[MatrixRow], level: int | None) -> Choice | None:
    """Whom to take for so many digits; None where no solver gets there."""
    found = reaches(rows, level)
    if not found:
        return None
    others = reaches([row for row in rows if package_of(row.solver) != package_of(found[0].solver)], level)
    return Choice(found[0], others[0], others[0].against(found[0].walls)) if others else Choice(found[0], None, None)


def choice_table(rows: Sequence[MatrixRow]) -> Table:
    """A row a kind of case, a column a number of digits: the solver to take, and the one of another package.

    Each with the number of readings in which it gets there, the other with how many times as long it takes.
    """
    columns = {"right": ANY, **{f"{level} digits": level for level in LEVELS}}
    lines = [
        (kind, reading_counts(own), *(_choice(own, level) for level in columns.values()))
        for kind, own in by_kind(rows).items()
    ]
    return Table(("kind of case", "readings", *columns), "lr" + "l" * len(columns), lines)


def reading_counts(rows: Sequence[MatrixRow]) -> str:
    """How many readings there are, and in how many of them digits are counted, where that is in some only.

    Examples
    --------
    >>> rows = [MatrixRow("a", "r", None, "henon", digits=3.0), MatrixRow("a", "s", None, "henon")]
    >>> reading_counts(rows), reading_counts(rows[:1])
    ('2, 1 timed', '1')
    """
    every, timed = (len(readings_for(rows, level)) for level in (ANY, LEVELS[0]))
    return f"{every}, {timed} timed" if 0 < timed < every else f"{every}"


def _choice(rows: Sequence[MatrixRow], level: int | None) -> str:
    found = choice(rows, level)
    if found is None:
        return ""
    words = "; ".join(f"{code(own.solver)} {len(own.walls)}" for own in (found.first, found.other) if own)
    return words if found.times is None else f"{words} (×{significant(found.times, 2)})"


def package_of(solver: str) -> str:
    """The package that a solver belongs to: solvers of one are not set against each other."""
    return registry.distribution(solver) or solver


def often_table(rows: Sequence[MatrixRow]) -> Table:
    """In how many readings each solver is right, of those it is judged in and run on; how often it is the cheapest.

    Right is a solver that is so at one setting at least. Where nobody else gets so far, the one that does is the
    cheapest.
    """
    wins: dict[str, Counter[int]] = {}
    reached, contested = Counter[int](), Counter[int]()
    for own in readings_of(rows).values():
        for level in LEVELS:
            walls = {row.solver: wall for row in own if (wall := row.wall(level)) is not None}
            if walls:
                reached[level] += 1
                contested[level] += len(walls) > 1
                wins.setdefault(min(walls, key=walls.__getitem__), Counter())[level] += 1
    lines = []
    for solver in solvers_of(rows):
        own = [row for row in rows if row.solver == solver]
        counts = sum(row.right > 0 for row in own), sum(row.judged > 0 for row in own), len(own)
        won = wins.get(solver, Counter())
        lines.append((counts[0], (code(solver), *map(str, counts), *(f"{won[level] or ''}" for level in LEVELS))))
    cells = [own for _, own in sorted(lines, key=lambda line: -line[0])]
    cells.append(("all readings", "", "", f"{len(readings_of(rows))}", *(f"{reached[level]}" for level in LEVELS)))
    cells.append(("of these, another solver gets there, too", *3 * ("",), *(f"{contested[level]}" for level in LEVELS)))
    headings = ("solver", "right in", "judged in", "run on", *(f"cheapest for {level} digits" for level in LEVELS))
    return Table(headings, "l" + "r" * (len(headings) - 1), cells)


def coverage_words(rows: Sequence[MatrixRow]) -> str:
    """On how many readings each solver was run, in a sentence; empty where all were run on all."""
    counts, groups, readings = Counter(row.solver for row in rows), dict[int, list[str]](), len(readings_of(rows))
    for solver in solvers_of(rows):
        groups.setdefault(counts[solver], []).append(solver)
    words = "; ".join(f"{own}: {', '.join(solvers)}" for own, solvers in sorted(groups.items(), reverse=True))
    return "" if set(groups) <= {readings} else f"Of {count(readings, 'reading')} the solvers were run on {words}."


def commits(rows: Sequence[MatrixRow]) -> str:
    """How many commits of the program the rows mix."""
    known = len({row.commit for row in rows if row.commit})
    return f"{count(known, 'commit')} of the program" if known else "a program of no known commit"


def case_table(rows: Sequence[MatrixRow]) -> Table:
    """A row a case, its readings folded.

    ``right of judged``: solvers that are right in every reading that they were judged in, at one setting at least,
    and solvers judged. Best digits: the most that one of them gets in all its readings. Cheapest: the one that takes
    the least time for all readings, of those judged in the most.
    """
    cases: dict[str, dict[str, list[MatrixRow]]] = {}
    for row in rows:
        own = cases.setdefault(row.case, {})
        if row.judged:
            own.setdefault(row.solver, []).append(row)
    lines = []
    for case, judged in cases.items():
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
        lines.append(
            (
                f"[{markdown(case)}]({quote(case)}/{REPORT})",
                f"{len(right)}/{len(judged)}",
                digits(max(least)) if least else "",
                "none" if first is None else f"{code(first)}, {duration(walls[first])}",
            )
        )
    return Table(("case", "right of judged", "best digits", "cheapest right solver"), "lrrl", lines)
