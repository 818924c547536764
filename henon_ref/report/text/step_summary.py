"""Rows as a section of the page that a GitHub workflow shows for a step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from henon_ref.report.text.formats import digits, setting
from henon_ref.report.text.ranking import by_solver, right
from henon_ref.report.text.tables import Table
from henon_ref.rows import RunRow
from henon_ref.score.row_result import RowResult
from henon_ref.text import code, markdown

MOST_ROWS = 50
"""Rows that are shown one by one; such a page may not be longer than a mebibyte."""


def step_summary(rows: Sequence[tuple[RunRow, RowResult]], lines: Sequence[str]) -> str:
    """A table of the solvers, one of the rows that fail, and what else was told, as markdown.

    Parameters
    ----------
    rows : sequence of (RunRow, RowResult)
    lines : sequence of str
        Messages of the command: what is not met, what got worse, what is expected or mended.
    """
    failing = [(row, result) for row, result in rows if result.kind in ("failure", "error")]
    parts = ["## henon_ref", _solvers(rows).markdown]
    if failing:
        parts += ["### Failures", _failures(failing[:MOST_ROWS]).markdown]
    if len(failing) > MOST_ROWS:
        parts.append(f"{len(failing) - MOST_ROWS} more are in `runs.csv`.")
    if lines:
        told = [f"- {markdown(line)}" for line in lines[:MOST_ROWS]]
        parts.append("\n".join([*told, *([f"- and {len(lines) - MOST_ROWS} more"] if len(lines) > MOST_ROWS else [])]))
    return "\n\n".join(parts) + "\n"


def _solvers(rows: Sequence[tuple[RunRow, RowResult]]) -> Table:
    results = {row.key: result.kind for row, result in rows}
    table = []
    for solver, own in by_solver([row for row, _ in rows]).items():
        kinds = Counter(results[row.key] for row in own)
        best = max((row.digits for row in right(own) if row.digits is not None), default=None)
        counts = (kinds["passed"], kinds["failure"] + kinds["error"], kinds["known"], kinds["skipped"])
        table.append((code(solver), *map(str, counts), "" if best is None else digits(best)))
    headings = ("solver", "right", "fail", "fail as expected", "not run or not decidable", "most digits")
    return Table(headings, "lrrrrr", table)


def _failures(rows: Sequence[tuple[RunRow, RowResult]]) -> Table:
    cells = [
        (
            code(row.case),
            code(row.reading),
            code(row.solver),
            setting(row.rtol, row.step_s),
            markdown(result.reason),
        )
        for row, result in rows
    ]
    return Table(("case", "reading", "solver", "setting", "reason"), "lllrl", cells)
