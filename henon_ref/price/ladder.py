"""Every solver at every tolerance: the rows that prices are read from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from henon_ref import registry
from henon_ref.columns import Row
from henon_ref.comparison import Comparison, compare_all
from henon_ref.model.case import Case
from henon_ref.report.ranking import by_solver, number, prices, readings_of, right
from henon_ref.score.options import Observer, Options

LADDER = tuple(10.0**-k for k in range(3, 16))
"""Relative tolerances. A library that refuses one says so, and the row with it."""
TIMEOUT = 4.0
"""Seconds that one run may take: what takes longer is no bargain."""


def solvers() -> tuple[str, ...]:
    """What stands on the list: all that is run by default and has a tolerance, and each with compiled callbacks."""
    known = registry.names()
    plain = [n for n in registry.default_names() if not registry.fixed_step(n) and n not in ("scipy-sign",)]
    return tuple(n for own in plain for n in (own, own + registry.COMPILED) if n in known)


def run_ladder(cases: Sequence[Case], options: Options, observer: Observer) -> list[Row]:
    """Run the ladder on the cases' readings; rows as in ``runs.csv``.

    Parameters
    ----------
    cases : sequence of Case
    options : Options
        Solvers, processes and journals; tolerances and deadline are the ladder's own.
    observer : Observer
    """
    rows: list[Row] = []

    def deliver(comparison: Comparison) -> None:
        rows.extend(comparison.run_rows)

    asked = replace(options, solvers=options.solvers or solvers(), tolerances=LADDER, timeout=TIMEOUT)
    compare_all([_without_listings(case) for case in cases], asked, deliver, observer=observer)
    return rows


def _without_listings(case: Case) -> Case:
    """The readings that are not tied to a solver of their own (Listing 1 as printed)."""
    return replace(case, readings=tuple(reading for reading in case.readings if reading.solvers is None))


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


def paid_after(row: Row, other: Row) -> float | None:
    """Runs after which what a solver compiles has paid for itself against another; None where it never does."""
    gain = number(other, "wall_s") - number(row, "wall_s")
    extra = number(row, "compile_s") - number(other, "compile_s")
    return None if gain <= 0 else max(extra / gain, 0.0)
