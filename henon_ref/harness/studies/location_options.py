"""Options of the libraries' event location: runs with an option compared with runs without it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from henon_ref.baselines.adapter import Adapter
from henon_ref.baselines.heyoka_taylor import HEYOKA
from henon_ref.baselines.scipy_ivp import BDF, DOP853, LSODA, RADAU, RK45
from henon_ref.harness import registry
from henon_ref.harness.rows import NOT_RUN, Row, RunRow
from henon_ref.harness.score.ranking import LEVELS
from henon_ref.harness.table import Table
from henon_ref.text import code

TIGHTEST = 1e-300
"""Absolute tolerance of a root's time [s], so small that only the relative tolerance, 4 eps, has an effect."""


@dataclass(frozen=True)
class OptionRow(Row):
    """Results of a library without and with an option."""

    solver: str
    option: str
    runs: int
    """Number of runs that were made both without and with the option."""
    right_without: int
    right_with: int
    without_alone: int
    """Runs that are right only without the option."""
    with_alone: int
    digits_without: float
    """Sum of the digits, over the runs that are right both without and with the option."""
    digits_with: float


def options_of(libraries: Sequence[str]) -> list[tuple[str, str, Adapter]]:
    """Options of the libraries' event location: name of the library, description, solver with the option.

    SUNDIALS has no such option except the direction, in which two of the restarts differ.
    """
    cooldown = replace(HEYOKA, name="heyoka (cooldown)", cooldown="automatic")
    found: list[tuple[str, str, Adapter]] = [("heyoka", "`cooldown`: heyoka's own", cooldown)]
    for own in (RK45, DOP853, RADAU, BDF, LSODA):
        again = replace(own, name=f"{own.name} (root)", root_tolerance=TIGHTEST)
        found.append((own.name, f"the root located again, `xtol` {TIGHTEST:g}", again))
    return [option for option in found if option[0] in libraries]


def option_rows(options: Sequence[tuple[str, str, Adapter]], runs: Sequence[RunRow]) -> list[OptionRow]:
    """Compare the runs of each library with its default restart, without and with an option."""
    found = []
    for library, words, solver in options:
        default = registry.with_restart(library, registry.restart_of(library))
        without, with_it = (
            {(row.case, row.reading, row.rtol): row for row in runs if row.solver == name and row.status not in NOT_RUN}
            for name in (default, solver.name)
        )
        pairs = [(without[problem], with_it[problem]) for problem in without.keys() & with_it.keys()]
        right = Counter((a.verdict == "right", b.verdict == "right") for a, b in pairs)
        both = [pair for pair in pairs if pair[0].verdict == pair[1].verdict == "right" and pair[0].digits is not None]
        found.append(
            OptionRow(
                library,
                words,
                len(pairs),
                right_without=right[True, True] + right[True, False],
                right_with=right[True, True] + right[False, True],
                without_alone=right[True, False],
                with_alone=right[False, True],
                digits_without=round(sum(min(a.digits or 0.0, LEVELS[-1]) for a, _ in both), 1),
                digits_with=round(sum(min(b.digits or 0.0, LEVELS[-1]) for _, b in both), 1),
            )
        )
    return found


def option_table(rows: Sequence[OptionRow]) -> Table:
    """Table of the options."""
    headings = (
        "library", "option", "runs", "right without", "right with", "right without alone", "right with alone",
        "digits where both are right, without", "with",
    )  # fmt: skip
    lines = [
        (code(row.solver), row.option, *(f"{value:g}" for value in row.values(OptionRow.columns()[2:]))) for row in rows
    ]
    return Table(headings, "ll" + "r" * 7, lines)
