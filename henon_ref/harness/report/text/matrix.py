"""Who is right where, to how many digits: a row a reading, a column a solver."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from henon_ref.harness import registry
from henon_ref.harness.report.text.formats import digits
from henon_ref.harness.report.text.matrix_rows import UNJUDGED, MatrixRow, summary
from henon_ref.harness.report.text.ranking import by_solver
from henon_ref.harness.rows import RunRow
from henon_ref.harness.table import Table
from henon_ref.text import code

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


def matrix(headings: Sequence[str], lines: Sequence[tuple[Sequence[str], Sequence[RunRow]]]) -> Table:
    """Digits that each solver reaches on each reading, or what became of it.

    Parameters
    ----------
    headings : sequence of str
        Of the columns before the solvers'.
    lines : sequence of (cells, rows)
        For each reading the cells of those columns, and its rows (of the runs).
    """
    summed = [(cells, [summary(own) for own in by_solver(rows).values()]) for cells, rows in lines]
    return matrix_table(headings, summed)


def matrix_table(headings: Sequence[str], lines: Sequence[tuple[Sequence[str], Sequence[MatrixRow]]]) -> Table:
    """The same of summed rows, one a solver (:func:`henon_ref.harness.report.text.matrix_rows.summary`)."""
    solvers = solvers_of(row for _, rows in lines for row in rows)
    made = []
    for cells, rows in lines:
        own = {row.solver: _cell(row) for row in rows}
        made.append((*cells, *(own.get(solver, "") for solver in solvers)))
    alignment = "l" + "r" * (len(headings) - 1 + len(solvers))
    return Table((*headings, *(code(solver) for solver in solvers)), alignment, made)


def _cell(row: MatrixRow) -> str:
    if row.right:
        reached = "ok" if row.digits is None else digits(row.digits)
        return reached if row.right == row.settings else f"{reached} *"
    if row.verdict in ("ill-conditioned", "not unique"):
        return row.verdict
    if row.verdict in UNJUDGED and row.status != "timeout":  # its "ok" is no right one
        return "not judged"
    return MARKS.get(row.status, row.status)
