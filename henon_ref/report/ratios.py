"""Times of two solvers set against each other, at the same bound on the worst error, reading by reading."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from henon_ref.columns import Row
from henon_ref.report.ranking import name, number, right
from henon_ref.report.tables import Table

FIRST, SECOND = "henon", "heyoka"
"""The two that an index sets against each other."""
ERRORS = (1e-6, 1e-9, 1e-12)
"""Bounds on the worst error [s]."""
NAMED = 4
"""Readings of a case that are named."""


def readings_of(rows: Sequence[Row]) -> dict[tuple[str, str], list[Row]]:
    """Rows by case and reading."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        found.setdefault((str(row["case"]), str(row["reading"])), []).append(row)
    return found


def ratio_at(rows: Sequence[Row], error: float, first: str, second: str) -> float | None:
    """Least time of one solver over another's among the rows whose worst error is at most ``error`` [s]."""
    return _ratio([row for row in right(rows) if number(row, "max_time_error_s") <= error], first, second)


def ratios(rows: Sequence[Row], error: float) -> dict[tuple[str, str], float]:
    """The first's time over the second's for every reading that both solve to within ``error`` [s]."""
    found = {key: ratio_at(own, error, FIRST, SECOND) for key, own in readings_of(rows).items()}
    return {key: ratio for key, ratio in found.items() if ratio is not None}


def idle_ratios(rows: Sequence[Row]) -> dict[tuple[str, str], float]:
    """The same for every reading without a transition that both have right: no error to bound."""
    idle = [row for row in rows if row["verdict"] == "right" and row["reference_transitions"] == 0]
    found = {key: _ratio(own, FIRST, SECOND) for key, own in readings_of(idle).items()}
    return {key: ratio for key, ratio in found.items() if ratio is not None}


def _ratio(rows: Sequence[Row], first: str, second: str) -> float | None:
    """Least time of one solver over another's; None where one of them has none."""
    least = [
        min((number(row, "wall_s") for row in rows if name(row) == solver and row["wall_s"]), default=math.nan)
        for solver in (first, second)
    ]
    return None if math.isnan(least[0] / least[1]) else least[0] / least[1]


SPREAD = ("worst error", "readings", "least", "lower quartile", "median", "upper quartile", "largest", "above 1")
"""Headings of :func:`spread`."""


def spread(error: float | None, found: Iterable[float]) -> tuple[str, ...]:
    """How ratios spread, as cells of a table; ``error``: the bound [s], None where there is no transition to time."""
    ordered = sorted(found)
    least, *quartiles, largest = np.quantile(ordered, [0.0, 0.25, 0.5, 0.75, 1.0])
    label = "no transition" if error is None else f"{error:.0e} s"
    above = sum(ratio > 1 for ratio in ordered)
    middle = (f"{quartile:.2g}" for quartile in quartiles)
    return label, f"{len(ordered)}", f"{least:.2g}", *middle, f"{largest:.3g}", f"{above}"


def spread_table(rows: Sequence[Row]) -> Table:
    """How the ratio spreads over the readings that both solve."""
    by_bound = [*((error, ratios(rows, error)) for error in ERRORS), (None, idle_ratios(rows))]
    lines = [spread(error, found.values()) for error, found in by_bound if found]
    return Table(SPREAD, "r" * len(SPREAD), lines)


def slower_table(rows: Sequence[Row]) -> Table:
    """The cases in some reading of which the second is the faster one: at the middle bound, or without a transition."""
    slow: dict[str, list[tuple[float, str]]] = {}
    for (case, reading), ratio in {**ratios(rows, ERRORS[1]), **idle_ratios(rows)}.items():
        if ratio > 1:
            slow.setdefault(case, []).append((ratio, reading))
    lines: list[tuple[str, ...]] = []
    for case, found in sorted(slow.items(), key=lambda item: -max(item[1])[0]):
        names = ", ".join(reading for _, reading in sorted(found, reverse=True)[:NAMED])
        more = f" and {len(found) - NAMED} more" if len(found) > NAMED else ""
        lines.append((f"`{case}`", f"{max(found)[0]:.3g}", names + more))
    return Table(("case", "largest ratio", "readings"), "lrl", lines)
