"""Options of the libraries' own event handling that somebody who knows them might set, beside their defaults here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from henon_ref.baselines.adapter import Adapter
from henon_ref.baselines.heyoka_taylor import HEYOKA
from henon_ref.baselines.scipy_ivp import BDF, DOP853, LSODA, RADAU, RK45
from henon_ref.harness.report.text.restarts import MOST, ending
from henon_ref.harness.rows import NOT_RUN, Row, RunRow
from henon_ref.harness.table import Table
from henon_ref.text import code

AGAIN = "the root located again, `xtol` 1e-300"
FILE = "options.csv"
TIGHTEST = 1e-300
"""Absolute tolerance of a root's time that leaves the relative one, 4 eps, alone [s]."""


@dataclass(frozen=True)
class OptionRow(Row):
    """An option of a library: what its runs without and with it come to."""

    solver: str
    option: str
    runs: int
    """Made without and with it."""
    right_without: int
    right_with: int
    without_alone: int
    """Runs that are right without it alone."""
    with_alone: int
    digits_without: float
    """Of those that are right both ways, in all."""
    digits_with: float


@dataclass(frozen=True)
class Option:
    """One option of one library."""

    without: Adapter
    with_it: Adapter
    words: str
    """What is set."""


def options_of(libraries: Sequence[str]) -> list[Option]:
    """The options of these libraries; SUNDIALS has none beside the direction, which two of the restarts differ in."""
    found = [
        Option(HEYOKA, replace(HEYOKA, name="heyoka (cooldown)", cooldown="automatic"), "`cooldown`: heyoka's own"),
        *(
            Option(own, replace(own, name=f"{own.name} (root)", root_tolerance=TIGHTEST), AGAIN)
            for own in (RK45, DOP853, RADAU, BDF, LSODA)
        ),
    ]
    return [option for option in found if option.without.name in libraries]


def option_rows(options: Sequence[Option], runs: Sequence[RunRow]) -> list[OptionRow]:
    """What each option comes to, from the runs of its library without and with it."""
    found = []
    for option in options:
        without, with_it = (
            {(row.case, row.reading, row.rtol): row for row in runs
             if row.solver == adapter.name and row.status not in NOT_RUN}
            for adapter in (option.without, option.with_it)
        )  # fmt: skip
        pairs = [(without[problem], with_it[problem]) for problem in without.keys() & with_it.keys()]
        right = [tuple(ending(row) == "right" for row in pair) for pair in pairs]
        both = [pair for pair, ends in zip(pairs, right, strict=True) if all(ends) and pair[0].digits is not None]
        digits = (round(sum(min(pair[side].digits or 0.0, MOST) for pair in both), 1) for side in (0, 1))
        found.append(
            OptionRow(
                option.without.name,
                option.words,
                len(pairs),
                sum(a for a, _ in right),
                sum(b for _, b in right),
                sum(a and not b for a, b in right),
                sum(b and not a for a, b in right),
                *digits,
            )
        )
    return found


def option_table(rows: Sequence[OptionRow]) -> Table:
    """The same as a table."""
    headings = (
        "library", "option", "runs", "right without", "right with", "right without alone", "right with alone",
        "digits where both are right, without", "with",
    )  # fmt: skip
    lines = [
        (code(row.solver), row.option, *(f"{value:g}" for value in row.values(OptionRow.columns()[2:]))) for row in rows
    ]
    return Table(headings, "ll" + "r" * 7, lines)
