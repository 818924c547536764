"""The page on how libraries are restarted: outcomes by library and restart over the suite, and where they differ."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from henon_ref.harness import registry
from henon_ref.harness.report.folder import RUNS
from henon_ref.harness.report.manifest import Provenance
from henon_ref.harness.report.text.restarts import (
    ENDINGS,
    FOLDER,
    MOST,
    QUICKER,
    SUITE,
    WHY,
    SuiteRow,
    beaten_table,
    best_restart,
    libraries_of,
    merged,
    merits,
    read_suite,
    suite_rows,
    wrong_defaults,
)
from henon_ref.harness.rows import RunRow, read_rows, rows_text
from henon_ref.harness.studies.page import write
from henon_ref.harness.studies.restarts import options
from henon_ref.harness.studies.restarts.options import OptionRow, option_rows, option_table, options_of
from henon_ref.harness.studies.restarts.runs import LIMIT, LONGER, Entry, Study, run_all
from henon_ref.harness.studies.study import Asked, Made
from henon_ref.harness.table import Table, duration
from henon_ref.text import code


def run_restarts(asked: Asked) -> Made:
    """Run the study on all readings that have a stored truth, and write its page; it tells defaults that are beaten."""
    names = registry.expanded(asked.options.solvers or registry.default_names())
    found = dict.fromkeys(
        registry.base_name(name) for name in names if isinstance(name, str) and registry.restart_of(name)
    )
    groups: list[tuple[Entry, ...]] = [
        tuple(registry.with_restart(library, way) for way in registry.RESTARTS) for library in found
    ]
    study = run_all(asked.cases, groups, asked.options, asked.observer)
    if not study.rows:
        return Made(None)
    options_tried = options_of(list(found))
    pairs: list[tuple[Entry, ...]] = [(option.without, option.with_it) for option in options_tried]
    runs = run_all(asked.cases, pairs, asked.options, asked.observer).rows if pairs else []
    page = write_page(study, option_rows(options_tried, runs), asked.origin, asked.out)
    return Made(page, wrong_defaults(read_suite(asked.out)))


def write_page(study: Study, tried: Sequence[OptionRow], origin: Provenance, out: Path) -> Path:
    """Write runs, suite, options and page; of cases and libraries that have not run the earlier rows are kept.

    Parameters
    ----------
    study : Study
        A run a reading, library, restart and tolerance.
    tried : sequence of OptionRow
        What the libraries' options come to.
    origin : Provenance
    out : Path
        Folder of the reports; the study's own in it is made if need be.

    Raises
    ------
    OSError
        Where it cannot be written.
    """
    folder = out / FOLDER
    suite = merged(suite_rows(study.rows), read_suite(out))
    ran = {row.solver for row in tried}
    order = {solver: place for place, solver in enumerate(registry.names())}
    tried = [*tried, *(row for row in _earlier_options(folder) if row.solver not in ran)]
    tried.sort(key=lambda row: order.get(row.solver, len(order)))
    context = {
        "runs": f"{sum(row.runs for row in suite)}",
        "cases": len({row.case for row in suite}),
        "cut": study.cut,
        "limit": f"{LIMIT:g}",
        "longer": f"{LIMIT * LONGER:g}",
        "summary": summary_table(suite).markdown,
        "most": MOST,
        "quicker": round(100 * (1 - QUICKER)),
        "defaults": default_table(suite).markdown,
        "beaten": beaten_table(suite, "../").markdown,
        "why": WHY,
        "options": option_table(tried).markdown if tried else "",
        "origin": origin,
    }
    files = {RUNS: rows_text(RunRow, study.rows), SUITE: rows_text(SuiteRow, suite)}
    files |= {options.FILE: rows_text(OptionRow, tried)} if tried else {}
    return write(folder, "restarts", context, files)


def _earlier_options(folder: Path) -> list[OptionRow]:
    """The options' rows of an earlier run; none where they are not there, or are no such rows."""
    try:
        return read_rows(OptionRow, folder / options.FILE)
    except (OSError, ValueError):
        return []


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
        best = best_restart(others)
        cells = [
            (code(restart), f"{found[restart].right}", f"{found[restart].digits:.0f}", duration(found[restart].wall_s))
            for restart in (own, best)
        ]
        cases = len({row.case for row in suite if row.solver == library})
        lines.append((code(library), f"{cases}", *cells[0], *cells[1]))
    side = ("right", "digits", "time")
    return Table(("library", "cases", "default", *side, "best other", *side), "lrlrrrlrrr", lines)
