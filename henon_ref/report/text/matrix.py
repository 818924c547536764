"""Who is right where, to how many digits: a row a reading, a column a solver."""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref import registry
from henon_ref.columns import Row
from henon_ref.report.text.formats import digits
from henon_ref.report.text.ranking import best_of, by_solver, name, number
from henon_ref.report.text.tables import Table
from henon_ref.text import code

MARKS = {"unsupported": "–", "unavailable": "·", "timeout": "timeout", "failed": "failed"}
KEY = (
    "Decimal digits of the worst transition time (in seconds, or in the unit of time that the case's report names) at "
    "the most accurate setting with the right sequence. "
    "`*`: not right at another setting. `–`: the solver cannot do this problem, `·`: not installed; otherwise how its "
    "last run ended."
)
"""What the cells mean."""


def solvers_of(readings: Sequence[Sequence[Row]]) -> list[str]:
    """Solvers that ran in any of some readings, in the registry's order."""
    present = {name(row) for rows in readings for row in rows}
    order = [solver for solver in registry.names() if solver in present]
    return order + sorted(present - set(order))


def matrix(headings: Sequence[str], lines: Sequence[tuple[Sequence[str], Sequence[Row]]]) -> Table:
    """Digits that each solver reaches on each reading, or what became of it.

    Parameters
    ----------
    headings : sequence of str
        Of the columns before the solvers'.
    lines : sequence of (cells, rows)
        For each reading the cells of those columns, and its rows.
    """
    solvers = solvers_of([rows for _, rows in lines])
    made = []
    for cells, rows in lines:
        own = by_solver(rows)
        made.append((*cells, *(_cell(own[solver]) if solver in own else "" for solver in solvers)))
    alignment = "l" + "r" * (len(headings) - 1 + len(solvers))
    return Table((*headings, *(code(solver) for solver in solvers)), alignment, made)


def _cell(rows: Sequence[Row]) -> str:
    best = best_of(rows)
    if best["verdict"] == "right":
        reached = digits(number(best, "digits")) if best["digits"] is not None else "ok"
        return reached if all(row["verdict"] == "right" for row in rows) else f"{reached} *"
    if any(row["verdict"] == "right" for row in rows):
        return "ok"
    if best["verdict"] in ("ill-conditioned", "not unique"):
        return str(best["verdict"])
    return MARKS.get(str(best["status"]), str(best["status"]))
