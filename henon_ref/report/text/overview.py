"""What a case of many readings (a sweep, a family) shows over all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from henon_ref.campaign.comparison import Comparison
from henon_ref.campaign.options import MOST_DRAWN
from henon_ref.columns import Row
from henon_ref.report.files.figure_jobs import READINGS
from henon_ref.report.text.formats import setting
from henon_ref.report.text.matrix import KEY, matrix
from henon_ref.report.text.ranking import NOT_RUN, by_solver, number, over_all
from henon_ref.report.text.tables import MARK, Table, price_table
from henon_ref.text import code

MANY = 4
"""Readings from which on a report begins with tables over all of them, and each one's tables stand in its section."""
LEGEND = f"{MARK}: the ranges of all readings' samples add up to more than a tenth of it."
"""Below a table that is marked so."""


def overview(comparison: Comparison) -> dict[str, Any] | None:
    """In how many readings each solver is right at one setting, what the cheapest setting that is right in all of
    them costs, and who is right where.

    None for a case of few readings, or without a truth for any.
    """
    readings = judged(comparison)
    if len(comparison.readings) < MANY or not readings:
        return None
    whole = over_all([rows for _, rows in readings])
    prices = price_table(whole)
    lines = [((f"[{reading}](#{reading})", _transitions(rows)), rows) for reading, rows in readings]
    return {
        "solvers": right_in_all_table(whole, len(readings), len(comparison.readings)).markdown,
        "prices": prices.markdown if prices else "",
        "legend": LEGEND if prices and MARK in prices.markdown else "",
        "figure": READINGS if is_drawn(comparison) else "",
        "matrix": matrix(("reading", "transitions"), lines).markdown,
        "key": KEY,
    }


def judged(comparison: Comparison) -> list[tuple[str, list[Row]]]:
    """The readings that have a truth, by name, and their rows."""
    return [
        (result.reading.name, [record.run for record in comparison.of_reading(result.reading.name)])
        for result in comparison.readings
        if result.expected is not None
    ]


def is_drawn(comparison: Comparison) -> bool:
    """Whether all readings get a figure: where they are too many for figures of their own, and figures are wanted."""
    wanted = len(comparison.readings) > MOST_DRAWN and any(result.figures for result in comparison.readings)
    return wanted and any(record.run["status"] not in NOT_RUN for record in comparison.records)


def right_in_all_table(whole: Sequence[Row], judged: int, readings: int) -> Table:
    """In how many readings each solver is right at one and the same setting, and at which settings it is.

    Parameters
    ----------
    whole : sequence of Row
        From :func:`over_all`.
    judged, readings : int
        Readings with a truth, and all of them.
    """
    lines = []
    for solver, rows in by_solver(whole).items():
        most = max(int(number(row, "right_in")) for row in rows)
        at = [setting(row["rtol"], row["step_s"]) for row in rows if row["right_in"] == most] if most else []
        lines.append((most, (code(solver), f"{most} of {judged}", ", ".join(at), f"{len(at)} of {len(rows)}")))
    ordered = [cells for _, cells in sorted(lines, key=lambda line: -line[0])]
    last = ("all readings", f"{readings}", "", "" if judged == readings else f"without a truth: {readings - judged}")
    headings = ("solver", "readings right at one setting", "at", "settings")
    return Table(headings, "lrll", [*ordered, last])


def _transitions(rows: Sequence[Row]) -> str:
    """How many transitions the truth has; nothing where no solver ran."""
    return next((f"{row['reference_transitions']}" for row in rows if row["reference_transitions"] is not None), "")
