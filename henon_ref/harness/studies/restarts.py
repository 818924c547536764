"""How libraries are restarted: each in each of its restarts over the suite, and with options of its event location.

The runs are a campaign's. The page says which default is beaten by another restart of its library.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from henon_ref.baselines.adapter import Adapter
from henon_ref.baselines.heyoka_taylor import HEYOKA
from henon_ref.baselines.scipy_ivp import BDF, DOP853, LSODA, RADAU, RK45
from henon_ref.casefile.case import Case
from henon_ref.harness import registry
from henon_ref.harness.campaign.truth_job import stored_statement
from henon_ref.harness.report.folder import RUNS
from henon_ref.harness.rows import NOT_RUN, Row, RunRow, earlier_rows, rows_text
from henon_ref.harness.studies.page import write
from henon_ref.harness.studies.restart_tables import (
    ENDINGS,
    FOLDER,
    MOST,
    QUICKER,
    SUITE,
    WHY,
    SuiteRow,
    beaten_table,
    best_restart,
    ending,
    libraries_of,
    merged,
    merits,
    read_suite,
    suite_rows,
    wrong_defaults,
)
from henon_ref.harness.studies.runs import rows_of
from henon_ref.harness.studies.study import Asked, Made
from henon_ref.harness.table import Table, duration
from henon_ref.text import code

OPTIONS = "options.csv"
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
    """What somebody who knows a library might set of its event handling."""

    solver: Adapter
    """The library with it."""
    library: str
    words: str
    """What is set."""


def options_of(libraries: Sequence[str]) -> list[Option]:
    """The options of these libraries; SUNDIALS has none beside the direction, which two of the restarts differ in."""
    cooldown = replace(HEYOKA, name="heyoka (cooldown)", cooldown="automatic")
    found = [Option(cooldown, "heyoka", "`cooldown`: heyoka's own")]
    for own in (RK45, DOP853, RADAU, BDF, LSODA):
        again = replace(own, name=f"{own.name} (root)", root_tolerance=TIGHTEST)
        found.append(Option(again, own.name, f"the root located again, `xtol` {TIGHTEST:g}"))
    return [option for option in found if option.library in libraries]


def run_restarts(asked: Asked) -> Made:
    """Run the study on all readings that have a stored truth, and write its page; it tells defaults that are beaten."""
    names = registry.expanded(asked.options.solvers or registry.default_names())
    libraries = list(
        dict.fromkeys(registry.base_name(name) for name in names if isinstance(name, str) and registry.restart_of(name))
    )
    cases = [own for case in asked.cases if (own := _with_truths(case, libraries)).readings]
    if not cases or not libraries:
        return Made(None)
    ways = [registry.with_restart(library, way) for library in libraries for way in registry.RESTARTS]
    options = options_of(libraries)
    solvers: tuple[Any, ...] = (*ways, *(option.solver for option in options))
    changed = replace(asked.options, solvers=solvers, timed=False, folder=asked.out / FOLDER)
    rows = [row for own in rows_of(cases, changed, asked.observer).values() for row in own]
    tried = option_rows(options, rows)
    ran = {row.solver for row in tried}
    return _written(
        asked, changed.timeout, [row for row in rows if row.solver in ways],
        [*tried, *(row for row in earlier_rows(OptionRow, asked.out / FOLDER / OPTIONS) if row.solver not in ran)],
    )  # fmt: skip


def _with_truths(case: Case, libraries: Sequence[str]) -> Case:
    """The readings with a stored truth that one of the libraries is meant for."""
    readings = [
        reading
        for reading in case.readings
        if (reading.solvers is None or set(libraries) & set(reading.solvers))
        and (truth := stored_statement(case, reading)) is not None
        and truth.expected is not None
    ]
    return replace(case, readings=tuple(readings))


def _written(asked: Asked, timeout: float, rows: Sequence[RunRow], tried: list[OptionRow]) -> Made:
    """Write runs, suite, options and page; of cases and libraries that have not run the earlier rows are kept."""
    suite = merged(suite_rows(rows), read_suite(asked.out))
    order = {solver: place for place, solver in enumerate(registry.names())}
    tried.sort(key=lambda row: order.get(row.solver, len(order)))
    context = {
        "runs": f"{sum(row.runs for row in suite)}",
        "cases": len({row.case for row in suite}),
        "limit": f"{timeout:g}",
        "summary": summary_table(suite).markdown,
        "most": MOST,
        "quicker": round(100 * (1 - QUICKER)),
        "defaults": default_table(suite).markdown,
        "beaten": beaten_table(suite, "../").markdown,
        "why": WHY,
        "options": option_table(tried).markdown if tried else "",
        "origin": asked.origin,
    }
    files = {RUNS: rows_text(RunRow, rows), SUITE: rows_text(SuiteRow, suite)}
    files |= {OPTIONS: rows_text(OptionRow, tried)} if tried else {}
    return Made(write(asked.out / FOLDER, "restarts", context, files), wrong_defaults(suite))


def summary_table(suite: Sequence[SuiteRow]) -> Table:
    """Library and restart: how their runs ended, each in one column, and the transitions missed and spurious in them.

    The last column counts the runs that are not right although another way of restarting the library is.
    """
    columns = (*ENDINGS, "missed", "spurious", "elsewhere")
    lines = []
    for library in libraries_of(suite):
        for restart in registry.RESTARTS:
            own = [row for row in suite if (row.solver, row.restart) == (library, restart)]
            label = code(restart)
            label = f"**{label}**" if restart == registry.restart_of(library) else label
            counts = map(sum, zip(*(row.values(columns) for row in own), strict=True)) if own else [0] * len(columns)
            lines.append((code(library), label, *(f"{n or ''}" for n in counts)))
    ends = (end.replace("_", " ") for end in ENDINGS)
    headings = ("library", "restart", *ends, "transitions missed", "spurious", "right by another restart")
    return Table(headings, "ll" + "r" * len(columns), lines)


def default_table(suite: Sequence[SuiteRow]) -> Table:
    """Cases of each library, its default and its best other restart: right runs, digits and time of these."""
    lines = []
    for library in libraries_of(suite):
        found, own = merits(suite, library), registry.restart_of(library)
        others = {restart: merit for restart, merit in found.items() if restart != own}
        if own not in found or not others:
            continue
        cells = [
            (code(restart), f"{found[restart].right}", f"{found[restart].digits:.0f}", duration(found[restart].wall_s))
            for restart in (own, best_restart(others))
        ]
        cases = len({row.case for row in suite if row.solver == library})
        lines.append((code(library), f"{cases}", *cells[0], *cells[1]))
    side = ("right", "digits", "time")
    return Table(("library", "cases", "default", *side, "best other", *side), "lrlrrrlrrr", lines)


def option_rows(options: Sequence[Option], runs: Sequence[RunRow]) -> list[OptionRow]:
    """What each option comes to, from the runs of its library without (in its default restart) and with it."""
    found = []
    for option in options:
        default = registry.with_restart(option.library, registry.restart_of(option.library))
        without, with_it = (
            {(row.case, row.reading, row.rtol): row for row in runs
             if row.solver == name and row.status not in NOT_RUN}
            for name in (default, option.solver.name)
        )  # fmt: skip
        pairs = [(without[problem], with_it[problem]) for problem in without.keys() & with_it.keys()]
        right = [tuple(ending(row) == "right" for row in pair) for pair in pairs]
        both = [pair for pair, ends in zip(pairs, right, strict=True) if all(ends) and pair[0].digits is not None]
        digits = (round(sum(min(pair[side].digits or 0.0, MOST) for pair in both), 1) for side in (0, 1))
        counts = [sum(map(bool, column)) for column in zip(*((a, b, a > b, b > a) for a, b in right), strict=True)]
        found.append(OptionRow(option.library, option.words, len(pairs), *(counts or [0] * 4), *digits))
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
