"""What a tolerance buys: digits of each solver by tolerance, from the rows of the committed reports."""

from __future__ import annotations

from pathlib import Path
from statistics import median

from henon_ref.columns import Row
from henon_ref.report.files.csv_files import read_rows
from henon_ref.report.files.write import RUNS
from henon_ref.report.text.formats import digits, exponential
from henon_ref.report.text.ranking import NOT_RUN, name, number
from henon_ref.report.text.tables import Table
from henon_ref.text import code

REPORTS = Path(__file__).resolve().parents[2] / "reports"
MANY = 0.5
"""Part of the readings from which on a tolerance has a column: some cases try further ones of their own."""


def table() -> str:
    """A row a solver, a column a tolerance, as markdown."""
    rows = [
        row
        for file in sorted(REPORTS.glob(f"*/{RUNS}"))
        for row in read_rows(file)
        if row["rtol"] is not None and row["status"] not in NOT_RUN
    ]
    cells: dict[str, dict[float, list[Row]]] = {}
    for row in rows:
        cells.setdefault(name(row), {}).setdefault(number(row, "rtol"), []).append(row)
    tried = {rtol for own in cells.values() for rtol in own}
    most = {rtol: max(len(own.get(rtol, ())) for own in cells.values()) for rtol in tried}
    shown = sorted((rtol for rtol in tried if most[rtol] >= MANY * max(most.values())), reverse=True)
    lines = [(code(solver), *(_cell(own.get(rtol, [])) for rtol in shown)) for solver, own in cells.items()]
    return Table(("solver", *(exponential(rtol, 1) for rtol in shown)), "l" + "r" * len(shown), lines).markdown


def _cell(rows: list[Row]) -> str:
    right = [number(row, "digits") for row in rows if row["verdict"] == "right" and row["digits"] is not None]
    counted = f"({sum(row['verdict'] == 'right' for row in rows)} of {len(rows)})"
    return f"{digits(median(right))} {counted}" if right else counted
