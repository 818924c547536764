"""Every solver at every tolerance: the rows that prices are read from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from henon_ref import registry
from henon_ref.comparison import Comparison, compare_all
from henon_ref.model.case import Case
from henon_ref.report.ranking import by_solver, name, number, prices, right
from henon_ref.score.columns import Row
from henon_ref.score.options import Observer, Options

LADDER = tuple(10.0**-k for k in range(3, 16))
"""Relative tolerances. A library that refuses one says so, and the row with it."""
DUEL = ("henon", "heyoka")
"""Who runs on the whole suite."""
DUEL_TOLERANCES = (1e-6, 1e-9, 1e-11, 1e-13)
FAIR = "+numba"
"""Mark of a baseline whose callbacks are compiled."""
TIMEOUT = 4.0
"""Seconds that one run may take: what takes longer is no bargain."""


def solvers() -> tuple[str, ...]:
    """What stands on the list: all that is run by default and has a tolerance, and each with compiled callbacks."""
    known = registry.names()
    plain = [n for n in registry.default_names() if not registry.fixed_step(n) and n not in ("scipy-sign",)]
    return tuple(n for own in plain for n in (own, own + FAIR) if n in known)


def run_ladder(
    cases: Sequence[Case], options: Options, observer: Observer, tolerances: Sequence[float] = LADDER
) -> list[Row]:
    """Run the ladder on the cases' readings; rows as in ``runs.csv``.

    Parameters
    ----------
    cases : sequence of Case
    options : Options
        Solvers, processes and journals; the deadline is the ladder's own.
    observer : Observer
    tolerances : sequence of float
    """
    rows: list[Row] = []

    def deliver(comparison: Comparison) -> None:
        rows.extend(comparison.run_rows)

    asked = replace(options, solvers=options.solvers or solvers(), tolerances=tuple(tolerances), timeout=TIMEOUT)
    compare_all([_without_listings(case) for case in cases], asked, deliver, observer=observer)
    return rows


def _without_listings(case: Case) -> Case:
    """The readings that are not tied to a solver of their own (Listing 1 as printed)."""
    return replace(case, readings=tuple(reading for reading in case.readings if reading.solvers is None))


def readings_of(rows: Sequence[Row]) -> dict[tuple[str, str], list[Row]]:
    """Rows by case and reading."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        found.setdefault((str(row["case"]), str(row["reading"])), []).append(row)
    return found


def relative_costs(rows: Sequence[Row], level: int) -> dict[str, float]:
    """Geometric mean, over all readings, of each solver's least time for so many digits over the least of all.

    Solvers that do not reach them on every reading that anybody does are left out.
    """
    logs: dict[str, list[float]] = {}
    count = 0
    for own in readings_of(rows).values():
        (price,) = prices(own, (level,))
        if price.row is None:
            continue
        count += 1
        least = number(price.row, "wall_s")
        for solver, ladder in by_solver(own).items():
            costs = [number(r, "wall_s") for r in right(ladder) if number(r, "digits") >= level and r["wall_s"]]
            if costs:
                logs.setdefault(solver, []).append(math.log(min(costs) / least))
    return {solver: math.exp(sum(own) / count) for solver, own in logs.items() if len(own) == count}


def ratio_at(rows: Sequence[Row], error: float, first: str, second: str) -> float | None:
    """Least time of one solver over another's among the rows whose worst error is at most ``error`` [s]."""
    least = {}
    for solver in (first, second):
        able = [r for r in right(rows) if name(r) == solver and number(r, "max_time_error_s") <= error and r["wall_s"]]
        least[solver] = min((number(row, "wall_s") for row in able), default=math.nan)
    ratio = least[first] / least[second]
    return None if math.isnan(ratio) else ratio


def ratios(rows: Sequence[Row], error: float) -> dict[tuple[str, str], float]:
    """Time of ``henon`` over heyoka's at the same bound on the worst error, for every reading that both solve."""
    found = {key: ratio_at(own, error, *DUEL) for key, own in readings_of(rows).items()}
    return {key: ratio for key, ratio in found.items() if ratio is not None}


def paid_after(row: Row, other: Row) -> float | None:
    """Runs after which what a solver compiles has paid for itself against another; None where it never does."""
    gain = number(other, "wall_s") - number(row, "wall_s")
    extra = number(row, "compile_s") - number(other, "compile_s")
    return None if gain <= 0 else max(extra / gain, 0.0)
