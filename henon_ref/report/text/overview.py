"""What a case of many readings (a sweep, a family) shows over all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from henon_ref.campaign.comparison import Comparison
from henon_ref.campaign.options import MOST_DRAWN
from henon_ref.columns import Row
from henon_ref.report.files.figure_jobs import READINGS
from henon_ref.report.text.formats import codes, listing, setting
from henon_ref.report.text.matrix import KEY, matrix
from henon_ref.report.text.ranking import by_solver, name, number, over_all
from henon_ref.report.text.summary import NOT_RUN
from henon_ref.report.text.tables import MARK, price_table
from henon_ref.text import code

MANY = 4
"""Readings from which on a report begins with all of them at once, and tells of each in its own section."""
LEGEND = f"{MARK}: the ranges of all readings' samples add up to more than a tenth of it."
"""Below a table that is marked so."""


def overview(comparison: Comparison) -> dict[str, Any] | None:
    """Who is right in every reading at one setting, what the cheapest such setting costs, and who is right where.

    None for a case of few readings, or without a truth for any.
    """
    readings = judged(comparison)
    if len(comparison.readings) < MANY or not readings:
        return None
    whole = over_all([rows for _, rows in readings])
    prices = price_table(whole)
    lines = [((f"[{reading}](#{reading})", _transitions(rows)), rows) for reading, rows in readings]
    return {
        "answer": f"{_counted(len(readings), len(comparison.readings))} {_everywhere(whole, len(readings))}",
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


def _counted(judged: int, readings: int) -> str:
    return f"{readings} readings." if judged == readings else f"{readings} readings, {judged} of them with a truth."


def _everywhere(whole: Sequence[Row], readings: int) -> str:
    """Who is right in all readings at one and the same setting; else who is in most."""
    told: dict[str, list[str]] = {}
    for solver, rows in by_solver(whole).items():
        always = [setting(row["rtol"], row["step_s"]) for row in rows if row["verdict"] == "right"]
        if always:
            where = "at every setting" if len(always) == len(rows) else f"at {listing(always)}"
            told.setdefault(where, []).append(solver)
    if told:
        phrases = [f"{codes(solvers)} ({where})" for where, solvers in told.items()]
        return f"Right in every one of them at one and the same setting: {'; '.join(phrases)}."
    most = max(whole, key=lambda row: number(row, "right_in"), default=None)
    if most is None or not most["right_in"]:
        return "No solver is right in any."
    where = setting(most["rtol"], most["step_s"])
    return f"No solver is right in all at one setting; most often {code(name(most))} at {where}, in {most['right_in']}."


def _transitions(rows: Sequence[Row]) -> str:
    """How many transitions the truth has; nothing where no solver ran."""
    return next((f"{row['reference_transitions']}" for row in rows if row["reference_transitions"] is not None), "")
