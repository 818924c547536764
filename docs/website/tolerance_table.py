"""What a tolerance buys: digits of each solver by tolerance, from the rows of the committed reports."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from statistics import median

from henon_ref.harness.report.folder import RUNS
from henon_ref.harness.result_files import read_rows
from henon_ref.harness.rows import NOT_RUN, RunRow
from henon_ref.harness.table import Table, digits, exponential
from henon_ref.text import code

REPORTS = Path(__file__).resolve().parents[2] / "reports"
MANY = 0.5
"""Part of the readings from which on a tolerance has a column: some cases try further ones of their own."""


def table() -> str:
    """A row a solver, a column a tolerance, as markdown."""
    cells = _cells()
    most = {rtol: max(len(own.get(rtol, ())) for own in cells.values()) for own in cells.values() for rtol in own}
    shown = sorted((rtol for rtol in most if most[rtol] >= MANY * max(most.values())), reverse=True)
    lines = [(code(solver), *(_cell(own.get(rtol, [])) for rtol in shown)) for solver, own in cells.items()]
    return Table(("solver", *(exponential(rtol, 1) for rtol in shown)), "l" + "r" * len(shown), lines).markdown


@cache
def _cells() -> dict[str, dict[float, list[RunRow]]]:
    """Rows by solver and tolerance."""
    cells: dict[str, dict[float, list[RunRow]]] = {}
    for file in sorted(REPORTS.glob(f"*/{RUNS}")):
        for row in read_rows(RunRow, file):
            if row.rtol is not None and row.status not in NOT_RUN:
                cells.setdefault(row.solver, {}).setdefault(row.rtol, []).append(row)
    return cells


def _digits(rows: list[RunRow]) -> list[float]:
    return [row.digits for row in rows if row.verdict == "right" and row.digits is not None]


def _cell(rows: list[RunRow]) -> str:
    counted = f"({sum(row.verdict == 'right' for row in rows)} of {len(rows)})"
    return f"{digits(median(_digits(rows)))} {counted}" if _digits(rows) else counted
