"""The page on how libraries are restarted: outcomes by library and restart over the suite, and where they differ."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from henon_ref import registry
from henon_ref.columns import RUN_COLUMNS, Row
from henon_ref.report.files.csv_files import csv_text
from henon_ref.report.files.manifest import Provenance
from henon_ref.report.files.write import RUNS
from henon_ref.report.text import restarts
from henon_ref.report.text.formats import duration
from henon_ref.report.text.ranking import number
from henon_ref.report.text.restarts import COLUMNS, MOST, QUICKER, SUITE, WHY, beaten_table, libraries_of, merits
from henon_ref.report.text.tables import Table
from henon_ref.score.errors import EARLY
from henon_ref.studies.atlas.family import outcome_of
from henon_ref.studies.page import write
from henon_ref.studies.restarts.options import Option
from henon_ref.studies.restarts.runs import LIMIT, LONGER, Study
from henon_ref.text import code

ENDINGS = ("right", "wrong", "ended early", "failed")
"""How a run may end: with the exact run's transitions, with others, before its time, or not at all."""


def write_page(study: Study, options: Sequence[Option], tried: Sequence[Row], origin: Provenance, folder: Path) -> Path:
    """Write runs, suite and page.

    Parameters
    ----------
    study : Study
        A run a reading, library, restart and tolerance.
    options : sequence of Option
    tried : sequence of Row
        A run a reading, tolerance and library, as it is and with each of its options.
    origin : Provenance
    folder : Path
        The study's own folder; made if need be.

    Raises
    ------
    OSError
        Where it cannot be written.
    """
    rows, suite = study.rows, restarts.suite_rows(study.rows)
    context = {
        "runs": len(rows),
        "readings": len({(row["case"], row["reading"]) for row in rows}),
        "cases": len({row["case"] for row in rows}),
        "cut": study.cut,
        "limit": f"{LIMIT:g}",
        "longer": f"{LIMIT * LONGER:g}",
        "summary": summary_table(rows).markdown,
        "most": MOST,
        "quicker": round(100 * (1 - QUICKER)),
        "defaults": default_table(rows, suite).markdown,
        "beaten": beaten_table(suite, "../").markdown,
        "why": WHY,
        "options": option_table(options, tried).markdown if options else "",
        "origin": origin,
    }
    files = {RUNS: csv_text(RUN_COLUMNS, rows), SUITE: csv_text(COLUMNS, suite)}
    return write(folder, "restarts", context, files)


def of_restart(rows: Sequence[Row], library: str, restart: str) -> list[Row]:
    """The runs of a library that was restarted in one way."""
    name = f"{library}{registry.AT}{restart}"
    return [row for row in rows if row["solver"] == name and outcome_of(row) is not None]


def summary_table(rows: Sequence[Row]) -> Table:
    """Library and restart: how their runs ended, each in one column, and the transitions missed and spurious in them.

    The last column counts the runs that are not right although another way of restarting the library is.
    """
    lines = []
    for library in libraries_of(rows):
        for restart in registry.RESTARTS:
            own = of_restart(rows, library, restart)
            ends = Counter(map(ending, own))
            edits = (sum(int(number(row, c)) for row in own if row[c] is not None) for c in ("missed", "spurious"))
            label = f"**`{restart}`**" if restart == registry.restart_of(library) else f"`{restart}`"
            counts = (*(ends[end] for end in ENDINGS), *edits, broken_runs(rows, library, restart))
            lines.append((f"`{library}`", label, *(f"{n or ''}" for n in counts)))
    headings = ("library", "restart", *ENDINGS, "transitions missed", "spurious", "right by another restart")
    return Table(headings, "ll" + "r" * (len(headings) - 2), lines)


def broken_runs(rows: Sequence[Row], library: str, restart: str) -> int:
    """How many runs of one restart are not right although another one gets the same reading and tolerance right."""
    others = [row for other in registry.RESTARTS if other != restart for row in of_restart(rows, library, other)]
    right = {_problem(row) for row in others if outcome_of(row) == "right"}
    return sum(outcome_of(row) != "right" and _problem(row) in right for row in of_restart(rows, library, restart))


def ending(row: Row) -> str:
    """How a run that was made ended."""
    outcome = outcome_of(row)
    if outcome in ("right", "failed"):
        return outcome
    return "ended early" if row["status"] in EARLY else "wrong"


def default_table(rows: Sequence[Row], suite: Sequence[Row]) -> Table:
    """Each library's default and its best other restart: right runs, digits, time, and what one alone gets right."""
    lines = []
    for library in libraries_of(rows):
        found, own = merits(suite, library), registry.restart_of(library)
        others = [restart for restart in found if restart != own]
        if own not in found or not others:
            continue
        best = next(r for r in others if not any(found[other].beats(found[r]) for other in others))
        mine, theirs = ({_problem(row): row for row in of_restart(rows, library, r)} for r in (own, best))
        pairs = [(mine[problem], theirs[problem]) for problem in mine.keys() & theirs.keys()]
        alone = sum(_gains(a, b) for a, b in pairs), sum(_gains(b, a) for a, b in pairs)
        cells = [
            (code(restart), f"{found[restart].right}", f"{found[restart].digits:.0f}", duration(found[restart].wall_s))
            for restart in (own, best)
        ]
        lines.append((code(library), *cells[0], *cells[1], *(f"{n or ''}" for n in alone)))
    side = ("right", "digits", "time")
    headings = ("library", "default", *side, "best other", *side, "right by the default alone", "by the other alone")
    return Table(headings, "llrrrlrrrrr", lines)


def _problem(row: Row) -> tuple[object, ...]:
    """What a library is to solve: reading and tolerance."""
    return row["case"], row["reading"], row["rtol"]


def _gains(row: Row, other: Row) -> bool:
    """Whether a run is right, and the other is not."""
    return ending(row) == "right" != ending(other)


def option_table(options: Sequence[Option], rows: Sequence[Row]) -> Table:
    """Options of the libraries' event handling: right runs without and with, and what either alone gets right."""
    lines = []
    for option in options:
        without, with_it = (
            {_problem(row): row for row in rows if row["solver"] == adapter.name and outcome_of(row) is not None}
            for adapter in (option.without, option.with_it)
        )
        pairs = [(without[problem], with_it[problem]) for problem in without.keys() & with_it.keys()]
        right = [pair for pair in pairs if all(ending(row) == "right" for row in pair)]
        digits = (
            sum(min(number(pair[side], "digits"), MOST) for pair in right if pair[side]["digits"] is not None)
            for side in (0, 1)
        )
        counts = (
            sum(ending(row) == "right" for row in without.values()),
            sum(ending(row) == "right" for row in with_it.values()),
            sum(_gains(a, b) for a, b in pairs),
            sum(_gains(b, a) for a, b in pairs),
        )
        cells = (f"{len(pairs)}", *(f"{n or ''}" for n in counts), *(f"{n:.1f}" for n in digits))
        lines.append((code(option.without.name), option.words, *cells))
    headings = (
        "library", "option", "runs", "right without", "right with", "right without alone", "right with alone",
        "digits where both are right, without", "with",
    )  # fmt: skip
    return Table(headings, "ll" + "r" * 7, lines)
