"""Which solver to take: by kind of case and digits, and by case."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from urllib.parse import quote

from henon_ref import registry
from henon_ref.columns import Row
from henon_ref.report.files.write import REPORT
from henon_ref.report.text.formats import digits, duration, significant
from henon_ref.report.text.ranking import LEVELS, name, number
from henon_ref.report.text.tables import Table
from henon_ref.score.kinds import KINDS
from henon_ref.text import code, markdown

ANY = "wall_s"
"""Column of the shortest time of a right run, however few its digits."""
UNKNOWN = "kind not known"
"""Kind of readings whose report does not say theirs."""
AS_MANY = 0.9
"""Part of the most readings from which on a solver counts as getting there in as many."""
Key = tuple[str, str]
"""Case and reading."""


def key_of(row: Row) -> Key:
    """Case and reading of a row."""
    return str(row["case"]), str(row["reading"])


def by_kind(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows of a matrix by the kind of their reading, in the order of KINDS."""
    found: dict[str, list[Row]] = {kind: [] for kind in KINDS}
    for row in rows:
        found.setdefault(str(row["kind"] or UNKNOWN), []).append(row)
    return {kind: own for kind, own in found.items() if own}


def readings_for(rows: Iterable[Row], column: str) -> set[Key]:
    """The readings that a column of times counts: all for :data:`ANY`, for digits those with a transition to time."""
    return {key_of(row) for row in rows if column == ANY or row["digits"] is not None}


@dataclass(frozen=True)
class Reach:
    """The readings in which one solver reaches so many digits, and its times there [s]."""

    solver: str
    walls: Mapping[Key, float]

    def against(self, others: Mapping[Key, float]) -> float | None:
        """How many times as long as others it takes: the median over the readings that both reach."""
        ratios = [wall / others[key] for key, wall in self.walls.items() if others.get(key)]
        return median(ratios) if ratios else None


def reaches(rows: Sequence[Row], column: str) -> list[Reach]:
    """The solvers that reach a column's digits in about as many readings as any other, the fastest first.

    Parameters
    ----------
    rows : sequence of Row
        Of a matrix.
    column : str
        ``wall_s`` or one of ``wall_N_s``.
    """
    walls: dict[str, dict[Key, float]] = {}
    fastest: dict[Key, float] = {}
    for row in rows:
        if row[column] is not None:
            key, wall = key_of(row), number(row, column)
            walls.setdefault(name(row), {})[key] = wall
            fastest[key] = min(wall, fastest.get(key, wall))
    most = max(map(len, walls.values()), default=0)
    found = [Reach(solver, own) for solver, own in walls.items() if len(own) >= AS_MANY * most]
    return sorted(found, key=lambda reach: (reach.against(fastest) or 1.0, -len(reach.walls)))


def choice_table(rows: Sequence[Row]) -> Table:
    """A row a kind of case, a column a number of digits: the solver to take, and the one of another package.

    Each with the number of readings in which it gets there, the other with how many times as long it takes.
    """
    columns = {"right": ANY, **{f"{level} digits": f"wall_{level}_s" for level in LEVELS}}
    lines = [
        (kind, reading_counts(own), *(_choice(own, column) for column in columns.values()))
        for kind, own in by_kind(rows).items()
    ]
    return Table(("kind of case", "readings", *columns), "lr" + "l" * len(columns), lines)


def reading_counts(rows: Sequence[Row]) -> str:
    """How many readings there are, and in how many of them digits are counted, where that is in some only.

    Examples
    --------
    >>> rows = [{"case": "a", "reading": "r", "digits": 3.0}, {"case": "a", "reading": "s", "digits": None}]
    >>> reading_counts(rows), reading_counts(rows[:1])
    ('2, 1 timed', '1')
    """
    every, timed = (len(readings_for(rows, column)) for column in (ANY, f"wall_{LEVELS[0]}_s"))
    return f"{every}, {timed} timed" if 0 < timed < every else f"{every}"


def _choice(rows: Sequence[Row], column: str) -> str:
    found = reaches(rows, column)
    if not found:
        return ""
    first = found[0]
    words = f"{code(first.solver)} {len(first.walls)}"
    others = reaches([row for row in rows if package_of(name(row)) != package_of(first.solver)], column)
    if not others:
        return words
    other = others[0]
    times = other.against(first.walls)
    longer = "" if times is None else f" (×{significant(times, 2)})"
    return f"{words}; {code(other.solver)} {len(other.walls)}{longer}"


def package_of(solver: str) -> str:
    """The package that a solver belongs to: solvers of one are not set against each other."""
    return registry.distribution(solver) or solver


def case_table(rows: Sequence[Row]) -> Table:
    """A row a case, its readings folded.

    ``right of judged``: solvers that are right in every reading that they were judged in, at one setting at least,
    and solvers judged. Best digits: the most that one of them gets in all its readings. Cheapest: the one that takes
    the least time for all readings, of those judged in the most.
    """
    cases: dict[str, dict[str, list[Row]]] = {}
    for row in rows:
        own = cases.setdefault(str(row["case"]), {})
        if number(row, "judged"):
            own.setdefault(name(row), []).append(row)
    lines = []
    for case, judged in cases.items():
        right = {solver: own for solver, own in judged.items() if all(number(row, "right") for row in own)}
        most = max(map(len, judged.values()), default=0)
        whole = {solver: own for solver, own in right.items() if len(own) == most}
        best = max((_fewest_digits(own) for own in whole.values()), default=None, key=lambda least: least or 0.0)
        walls = {
            solver: sum(number(row, ANY) for row in own)
            for solver, own in whole.items()
            if all(row[ANY] is not None for row in own)
        }
        first = min(walls, key=walls.__getitem__, default=None)
        lines.append(
            (
                f"[{markdown(case)}]({quote(case)}/{REPORT})",
                f"{len(right)}/{len(judged)}",
                "" if best is None else digits(best),
                "none" if first is None else f"{code(first)}, {duration(walls[first])}",
            )
        )
    return Table(("case", "right of judged", "best digits", "cheapest right solver"), "lrrl", lines)


def _fewest_digits(rows: Sequence[Row]) -> float | None:
    """The fewest digits in any reading; None where none has a transition to time."""
    return min((number(row, "digits") for row in rows if row["digits"] is not None), default=None)
