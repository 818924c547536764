"""Paired times (``henon`` and another solver, their runs interleaved), as their own page shows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote

import numpy as np

from henon_ref.harness.report.folder import REPORT
from henon_ref.harness.report.text.ranking import LEVELS
from henon_ref.harness.rows import Row, RunRow
from henon_ref.harness.table import Table, duration, setting, significant
from henon_ref.harness.table import digits as shown_digits
from henon_ref.text import code, markdown

FIRST = "henon"
"""The solver that all others are set against."""
FOLDER = "rivals"
"""Where the page of paired times lies in a folder of reports."""
RATIOS = "ratios.csv"
SECOND, OTHERS, FROM_C = "heyoka", "the cheapest other", "CVODE from C"
"""What the reference is set against on every reading: the next best, whichever of all others is the cheapest, and the
library that is called without Python in its way."""


@dataclass(frozen=True)
class PairRow(Row):
    """The reference and another solver at settings with the same digits, their runs interleaved."""

    case: str
    reading: str
    digits: int | None
    """None where there is no transition."""
    against: str
    rtol: float | None
    rival: str
    rival_rtol: float | None
    rival_step_s: float | None
    wall_s: float
    """Median [s]."""
    rival_wall_s: float
    ratio: float
    """The reference's time over the other one's."""
    ratio_low: float
    """Lower end of its 95 % bootstrap interval."""
    ratio_high: float
    rounds: int
    rival_own_s: float | None = None
    """What of the rival's time its library takes itself, without the mode switches in Python that a compiled program
    does not pay [s]; heyoka's alone is known."""

    @property
    def problem(self) -> tuple[str, str]:
        """Case and reading."""
        return self.case, self.reading

    def own_ratio(self) -> float | None:
        """Time of the rival's own library over the reference's whole run; None where it is not known."""
        return None if self.rival_own_s is None else self.rival_own_s / self.wall_s


def own_words(rows: Sequence[PairRow]) -> str:
    """In a sentence, what of heyoka's times is heyoka's; empty where that is not known."""
    found = [(row, row.rival_own_s) for row in rows if row.against == SECOND and row.rival_own_s is not None]
    if not found:
        return ""
    part = np.median([own / row.rival_wall_s for row, own in found])
    whole = np.median([1.0 / row.ratio for row, _ in found])
    own = np.median([own / row.wall_s for row, own in found])
    return (
        f"In turn {code(SECOND)} takes {significant(float(whole), 2)} times as long as {code(FIRST)} (median over "
        f"readings and digits), of which its own calls of `propagate_until` are {part:.0%}: a program that switches "
        f"modes in compiled code would take {significant(float(own), 2)} times as long."
    )


def spread_table(rows: Sequence[PairRow]) -> Table:
    """How many times as long as ``henon`` the others take over the readings; and in how many they take less."""
    lines = []
    for label, against, times_of in (
        (code(SECOND), SECOND, _times_as_long),
        (f"{code(SECOND)}, its own calls alone", SECOND, PairRow.own_ratio),
        (FROM_C, FROM_C, _times_as_long),
        (OTHERS, OTHERS, _times_as_long),
    ):
        for digits in (*LEVELS, None):
            own = [times_of(row) for row in rows if (row.against, row.digits) == (against, digits)]
            found = [times for times in own if times is not None]
            if found:
                quantiles = (significant(value) for value in np.quantile(found, [0.0, 0.25, 0.5, 0.75, 1.0]))
                faster = sum(times < 1 for times in found)
                lines.append((label, bound(digits), f"{len(found)}", *quantiles, f"{faster}"))
    headings = (
        "solver", "digits", "readings", "times as long, least", "lower quartile", "median", "upper quartile", "most",
        f"faster than {code(FIRST)} in",
    )  # fmt: skip
    return Table(headings, "l" + "r" * (len(headings) - 1), lines)


def _times_as_long(row: PairRow) -> float | None:
    return 1.0 / row.ratio


def slower_table(rows: Sequence[PairRow], runs: Sequence[RunRow]) -> Table:
    """Readings in which another solver is faster, at the digits at which it is so most: times, and what either gets.

    ``runs``, the rows of the reports, know how many digits and steps a setting has.
    """
    known = {run.key: run for run in runs}
    slower: dict[tuple[str, str], PairRow] = {}
    for row in rows:
        if row.against == OTHERS and row.ratio > 1:
            most = slower.setdefault(row.problem, row)
            if row.ratio > most.ratio:
                slower[row.problem] = row
    lines = []
    for row in slower.values():
        cells = [link(*row.problem), bound(row.digits)]
        for solver, rtol, step, wall in (
            (FIRST, row.rtol, None, row.wall_s),
            (row.rival, row.rival_rtol, row.rival_step_s, row.rival_wall_s),
        ):
            run = known.get((*row.problem, solver, rtol, step))
            got = "" if run is None or run.digits is None else shown_digits(run.digits)
            steps = "" if run is None or run.steps is None else f"{run.steps}"
            cells += [code(solver)] if solver != FIRST else []
            cells += [setting(rtol, step), got, steps, duration(wall)]
        lines.append((*cells, significant(row.ratio)))
    first, own = code(FIRST), ("gets", "steps", "time")
    headings = ("reading", "digits", f"{first} at", *own, "solver", "setting", *own, f"times as long, {first}")
    return Table(headings, "lrrrrrlrrrrr", lines)


def link(case: str, reading: str, reports: str = "../") -> str:
    """A reading as a link to its report; ``reports``: the folder of the reports, as the link has it."""
    text, anchor = (case, "") if reading == "default" else (f"{case}, {reading}", f"#{quote(reading)}")
    return f"[{markdown(text)}]({reports}{quote(case)}/{REPORT}{anchor})"


def bound(digits: int | None) -> str:
    """Digits to be reached, as the cell of a table."""
    return "no transition" if digits is None else f"{digits:g}"
