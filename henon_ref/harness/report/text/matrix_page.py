"""The matrix's own page: every reading, every solver, and how often each solver is right and the cheapest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from urllib.parse import quote

from henon_ref.harness.report.files.write import REPORT
from henon_ref.harness.report.text.matrix import matrix_table, solvers_of
from henon_ref.harness.report.text.matrix_rows import MatrixRow, commits_of
from henon_ref.harness.report.text.paired_times import link
from henon_ref.harness.report.text.ranking import LEVELS, readings_of
from henon_ref.harness.table import Table
from henon_ref.text import code, markdown


def reading_table(rows: Sequence[MatrixRow]) -> Table:
    """Digits that each solver reaches on each reading, with its kind and the commits of the program that ran it."""
    lines = [
        ((link(*key, reports=""), own[0].kind or "", ", ".join(commits_of(own, 7))), own)
        for key, own in readings_of(rows).items()
    ]
    return matrix_table(("reading", "kind", "commit"), lines)


def coverage(rows: Sequence[MatrixRow]) -> list[tuple[int, list[str]]]:
    """On how many readings solvers were run, and which on as many, the most first; empty where all were run on all.

    A row of the matrix counts, whether the solver could do the problem or not.
    """
    counts, groups = Counter(row.solver for row in rows), dict[int, list[str]]()
    for solver in solvers_of(rows):
        groups.setdefault(counts[solver], []).append(solver)
    return [] if set(groups) <= {len(readings_of(rows))} else sorted(groups.items(), reverse=True)


def coverage_table(rows: Sequence[MatrixRow]) -> Table:
    """The same as a table."""
    readings = len(readings_of(rows))
    lines = [(f"{own} of {readings}", ", ".join(map(code, solvers))) for own, solvers in coverage(rows)]
    return Table(("readings", "solvers run on them"), "rl", lines)


def titles(rows: Sequence[MatrixRow]) -> dict[str, str]:
    """Every case, as a link to its report, and its title."""
    return {f"[{markdown(str(row.case))}]({quote(str(row.case))}/{REPORT})": markdown(row.title) for row in rows}


def solver_table(rows: Sequence[MatrixRow], in_turn: Mapping[tuple[str, str, int], str]) -> Table:
    """In how many readings each solver is right, of those it is judged in and run on; how often it is the cheapest.

    Right is a solver that is so at one setting at least. Who is the cheapest for so many digits decide the times taken
    in turn where there are some, by case, reading and digits; elsewhere the reports' own times do. Where nobody else
    gets so far, there is nothing to time in turn.
    """
    wins: dict[str, dict[int, int]] = {}
    reached, contested = dict.fromkeys(LEVELS, 0), dict.fromkeys(LEVELS, 0)
    readings = readings_of(rows)
    for key, own in readings.items():
        for level in LEVELS:
            walls = {row.solver: wall for row in own if (wall := row.wall(level)) is not None}
            if walls:
                reached[level] += 1
                contested[level] += len(walls) > 1
                first = in_turn.get((*key, level), "")
                if first not in walls:  # or the reports are newer than that
                    first = min(walls, key=walls.__getitem__)
                wins.setdefault(first, dict.fromkeys(LEVELS, 0))[level] += 1
    lines = []
    for solver in solvers_of(rows):
        own = [row for row in rows if row.solver == solver]
        right, judged = sum(row.right > 0 for row in own), sum(row.judged > 0 for row in own)
        won, counts = wins.get(solver, {}), (f"{right}", f"{judged}", f"{len(own)}")
        lines.append((right, (code(solver), *counts, *(f"{won.get(d) or ''}" for d in LEVELS))))
    cells = [own for _, own in sorted(lines, key=lambda line: -line[0])]
    cells.append(("all readings", "", "", f"{len(readings)}", *(f"{reached[level]}" for level in LEVELS)))
    cells.append(("of these, another solver gets there, too", *3 * ("",), *(f"{contested[level]}" for level in LEVELS)))
    headings = ("solver", "right in", "judged in", "run on", *(f"cheapest for {level} digits" for level in LEVELS))
    return Table(headings, "l" + "r" * (len(headings) - 1), cells)
