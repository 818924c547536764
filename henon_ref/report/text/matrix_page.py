"""The matrix's own page: every reading, every solver, and how often each solver is right and the cheapest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from urllib.parse import quote

from henon_ref.columns import Row
from henon_ref.report.files.write import REPORT
from henon_ref.report.text.choice import Key, key_of
from henon_ref.report.text.matrix import matrix_table, solvers_of
from henon_ref.report.text.matrix_rows import commits_of
from henon_ref.report.text.paired_times import link
from henon_ref.report.text.ranking import LEVELS, name, number
from henon_ref.report.text.tables import Table
from henon_ref.text import code, markdown


def by_reading(rows: Sequence[Row]) -> dict[Key, list[Row]]:
    """Rows of a matrix by case and reading, in their order."""
    found: dict[Key, list[Row]] = {}
    for row in rows:
        found.setdefault(key_of(row), []).append(row)
    return found


def reading_table(rows: Sequence[Row]) -> Table:
    """Digits that each solver reaches on each reading, with its kind and the commits of the program that ran it."""
    lines = [
        ((link(*key, reports=""), str(own[0]["kind"] or ""), ", ".join(commits_of(own, 7))), own)
        for key, own in by_reading(rows).items()
    ]
    return matrix_table(("reading", "kind", "commit"), lines)


def coverage(rows: Sequence[Row]) -> list[tuple[int, list[str]]]:
    """On how many readings solvers were run, and which on as many, the most first; empty where all were run on all.

    A row of the matrix counts, whether the solver could do the problem or not.
    """
    counts, groups = Counter(map(name, rows)), dict[int, list[str]]()
    for solver in solvers_of(rows):
        groups.setdefault(counts[solver], []).append(solver)
    return [] if set(groups) <= {len(by_reading(rows))} else sorted(groups.items(), reverse=True)


def coverage_table(rows: Sequence[Row]) -> Table:
    """The same as a table."""
    readings = len(by_reading(rows))
    lines = [(f"{own} of {readings}", ", ".join(map(code, solvers))) for own, solvers in coverage(rows)]
    return Table(("readings", "solvers run on them"), "rl", lines)


def titles(rows: Sequence[Row]) -> dict[str, str]:
    """Every case, as a link to its report, and its title."""
    return {
        f"[{markdown(str(row['case']))}]({quote(str(row['case']))}/{REPORT})": markdown(str(row["title"]))
        for row in rows
    }


def solver_table(rows: Sequence[Row], in_turn: Mapping[tuple[str, str, int], str]) -> Table:
    """In how many readings each solver is right, of those it is judged in and run on; how often it is the cheapest.

    Right is a solver that is so at one setting at least. Who is the cheapest for so many digits decide the times taken
    in turn where there are some, by case, reading and digits; elsewhere the reports' own times do. Where nobody else
    gets so far, there is nothing to time in turn.
    """
    wins: dict[str, dict[int, int]] = {}
    reached, contested = dict.fromkeys(LEVELS, 0), dict.fromkeys(LEVELS, 0)
    readings = by_reading(rows)
    for key, own in readings.items():
        for level in LEVELS:
            walls = {name(row): number(row, f"wall_{level}_s") for row in own if row[f"wall_{level}_s"] is not None}
            if walls:
                reached[level] += 1
                contested[level] += len(walls) > 1
                first = in_turn.get((*key, level), "")
                if first not in walls:  # or the reports are newer than that
                    first = min(walls, key=walls.__getitem__)
                wins.setdefault(first, dict.fromkeys(LEVELS, 0))[level] += 1
    lines = []
    for solver in solvers_of(rows):
        own = [row for row in rows if name(row) == solver]
        right, judged = (sum(number(row, column) > 0 for row in own) for column in ("right", "judged"))
        won, counts = wins.get(solver, {}), (f"{right}", f"{judged}", f"{len(own)}")
        lines.append((right, (code(solver), *counts, *(f"{won.get(d) or ''}" for d in LEVELS))))
    cells = [own for _, own in sorted(lines, key=lambda line: -line[0])]
    cells.append(("all readings", "", "", f"{len(readings)}", *(f"{reached[level]}" for level in LEVELS)))
    cells.append(("of these, another solver gets there, too", *3 * ("",), *(f"{contested[level]}" for level in LEVELS)))
    headings = ("solver", "right in", "judged in", "run on", *(f"cheapest for {level} digits" for level in LEVELS))
    return Table(headings, "l" + "r" * (len(headings) - 1), cells)
