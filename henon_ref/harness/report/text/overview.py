"""What a case of many readings (a sweep, a family) shows over all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.options import MOST_DRAWN
from henon_ref.harness.report.files.figure_jobs import READINGS
from henon_ref.harness.report.text.formats import digits, setting
from henon_ref.harness.report.text.matrix import KEY, matrix, summed
from henon_ref.harness.report.text.ranking import AS_GOOD, WholeRow, by_solver, over_all
from henon_ref.harness.report.text.summary import HEADINGS, times_as_long
from henon_ref.harness.report.text.tables import MARK, price_table, timed
from henon_ref.harness.rows import NOT_RUN, RunRow, number
from henon_ref.harness.table import Table
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
    lines = [((f"[{reading}](#{reading})", _transitions(rows)), summed(rows)) for reading, rows in readings]
    return {
        "solvers": right_in_all_table(whole, len(readings)).markdown,
        "explained": _explained(len(readings), len(comparison.readings)),
        "prices": prices.markdown if prices else "",
        "legend": LEGEND if prices and MARK in prices.markdown else "",
        "figure": READINGS if is_drawn(comparison) else "",
        "matrix": matrix(("reading", "transitions"), lines).markdown,
        "key": KEY,
    }


def judged(comparison: Comparison) -> list[tuple[str, list[RunRow]]]:
    """The readings that have a truth, by name, and their rows."""
    return [
        (result.reading.name, [record.run for record in comparison.of_reading(result.reading.name)])
        for result in comparison.readings
        if result.expected is not None
    ]


def is_drawn(comparison: Comparison) -> bool:
    """Whether all readings get a figure: where they are too many for figures of their own, and figures are wanted."""
    wanted = len(comparison.readings) > MOST_DRAWN and any(result.figures for result in comparison.readings)
    return wanted and any(record.run.status not in NOT_RUN for record in comparison.records)


def right_in_all_table(whole: Sequence[WholeRow], judged: int) -> Table:
    """A row a solver: the setting with which it is right in most readings, and its cost over all where that is in all.

    Of settings that are right in as many, one is shown, and the others are noted.

    Parameters
    ----------
    whole : sequence of WholeRow
        From :func:`over_all`.
    judged : int
        Readings with a truth.
    """
    solvers = by_solver(whole)
    best = {solver: _best(rows) for solver, rows in solvers.items()}
    walls = {solver: number(row.wall_s) for solver, row in best.items() if row.verdict == "right"}
    lines = []
    for solver in sorted(solvers, key=lambda solver: (-best[solver].right_in, walls.get(solver, 0.0))):
        row, most = best[solver], best[solver].right_in
        others = [setting(own.rtol, own.step_s) for own in solvers[solver] if own.right_in == most]
        own = setting(row.rtol, row.step_s)
        lines.append(
            (
                code(solver),
                "" if row.digits is None else digits(row.digits),
                timed(row) if solver in walls else "",
                times_as_long(walls, solver),
                own if most else "",
                f"{most} of {judged}",
                f"in as many at {', '.join(at for at in others if at != own)}" if most and len(others) > 1 else "",
            )
        )
    return Table(HEADINGS, "lrrrrrl", lines)


def _best(rows: Sequence[WholeRow]) -> WholeRow:
    """Of the settings that are right in most readings the most accurate one; among those as good, the cheapest."""
    most = max(row.right_in for row in rows)
    able = [row for row in rows if row.right_in == most]
    reached = [row.digits or 0.0 for row in able]
    good = [row for row, own in zip(able, reached, strict=True) if own >= max(reached) - AS_GOOD]
    return min(good, key=lambda row: number(row.wall_s))


def _explained(judged: int, readings: int) -> str:
    """What the first table's columns mean, and how many readings they are over."""
    without = f", {readings - judged} more without a truth" if judged < readings else ""
    return (
        f"Right: in how many of {judged} readings{without}, at one and the same setting. Digits: the fewest in any "
        "reading that is right; time: of all readings, where all are right."
    )


def _transitions(rows: Sequence[RunRow]) -> str:
    """How many transitions the truth has; nothing where no solver ran."""
    return next((f"{row.reference_transitions}" for row in rows if row.reference_transitions is not None), "")
