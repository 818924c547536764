"""Tables of the matrix: digits by reading and solver, how often each solver is right and the cheapest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from urllib.parse import quote

from henon_ref.harness import registry
from henon_ref.harness.report.files.write import REPORT
from henon_ref.harness.report.text.formats import digits
from henon_ref.harness.report.text.matrix_rows import UNJUDGED, MatrixRow, commits_of, summary
from henon_ref.harness.report.text.paired_times import link
from henon_ref.harness.report.text.ranking import LEVELS, by_solver, readings_of
from henon_ref.harness.rows import RunRow
from henon_ref.harness.table import Table
from henon_ref.text import code, markdown

MARKS = {"unsupported": "–", "unavailable": "·"}
KEY = (
    "Decimal digits of the worst transition time (in seconds, or in the unit of time that the case's report names) at "
    "the most accurate setting with the right sequence. "
    "`ok`: right, nothing to time. `*`: not right at another setting. `–`: the solver cannot do this problem, `·`: not "
    "installed, empty: it was not run on it; otherwise how its last run ended, or why that is not judged."
)
"""What the cells mean."""


def solvers_of(rows: Iterable[MatrixRow | RunRow]) -> list[str]:
    """Solvers of some rows, in the registry's order."""
    present = {row.solver for row in rows}
    order = [solver for solver in registry.names() if solver in present]
    return order + sorted(present - set(order))


def matrix(headings: Sequence[str], lines: Sequence[tuple[Sequence[str], Sequence[MatrixRow]]]) -> Table:
    """Digits that each solver reaches on each reading, or what became of it.

    Parameters
    ----------
    headings : sequence of str
        Of the columns before the solvers'.
    lines : sequence of (cells, rows)
        For each reading the cells of those columns, and its rows, one a solver.
    """
    solvers = solvers_of(row for _, rows in lines for row in rows)
    made = []
    for cells, rows in lines:
        own = {row.solver: _cell(row) for row in rows}
        made.append((*cells, *(own.get(solver, "") for solver in solvers)))
    alignment = "l" + "r" * (len(headings) - 1 + len(solvers))
    return Table((*headings, *(code(solver) for solver in solvers)), alignment, made)


def summed(rows: Sequence[RunRow]) -> list[MatrixRow]:
    """The rows of a reading's runs, one a solver."""
    return [summary(own) for own in by_solver(rows).values()]


def _cell(row: MatrixRow) -> str:
    if row.right:
        reached = "ok" if row.digits is None else digits(row.digits)
        return reached if row.right == row.settings else f"{reached} *"
    if row.verdict in ("ill-conditioned", "not unique"):
        return row.verdict
    if row.verdict in UNJUDGED and row.status != "timeout":  # its "ok" is no right one
        return "not judged"
    return MARKS.get(row.status, row.status)


def reading_table(rows: Sequence[MatrixRow]) -> Table:
    """Digits that each solver reaches on each reading, with its kind and the commits of the program that ran it."""
    lines = [
        ((link(*key, reports=""), own[0].kind or "", ", ".join(commits_of(own, 7))), own)
        for key, own in readings_of(rows).items()
    ]
    return matrix(("reading", "kind", "commit"), lines)


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
