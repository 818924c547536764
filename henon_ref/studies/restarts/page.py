"""The page on how libraries are restarted: outcomes by library and way, over all readings and reading by reading."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from henon_ref import registry
from henon_ref.columns import RUN_COLUMNS, Row
from henon_ref.report.files.csv_files import csv_text
from henon_ref.report.files.manifest import Provenance
from henon_ref.report.files.write import REPORT, RUNS
from henon_ref.report.text.formats import setting
from henon_ref.report.text.ranking import LEVELS, number
from henon_ref.report.text.tables import Table
from henon_ref.score.errors import EARLY
from henon_ref.studies.atlas.family import outcome_of
from henon_ref.studies.page import write

FOLDER = "restarts"
MOST = LEVELS[-1]
"""Digits that are counted: more are rounding."""
ENDINGS = ("right", "wrong", "ended early", "failed")
"""How a run may end: with the exact run's transitions, with others, before its time, or not at all."""


def write_page(rows: Sequence[Row], origin: Provenance, folder: Path) -> Path:
    """Write runs and page.

    Parameters
    ----------
    rows : sequence of Row
        A run a reading, library, way of restarting and tolerance.
    origin : Provenance
    folder : Path
        The experiment's own folder; made if need be.

    Raises
    ------
    OSError
        Where it cannot be written.
    """
    context = {
        "runs": len(rows),
        "readings": len({(row["case"], row["reading"]) for row in rows}),
        "summary": summary_table(rows).markdown,
        "most": MOST,
        "defaults": default_table(rows).markdown,
        "details": detail_table(rows).markdown,
        "origin": origin,
    }
    return write(folder, "restarts", context, {RUNS: csv_text(RUN_COLUMNS, rows)})


def libraries_of(rows: Sequence[Row]) -> list[str]:
    """Solvers without what they are restarted by, in the registry's order."""
    present = {registry.base_name(str(row["solver"])) for row in rows}
    return [name for name in registry.names() if name in present]


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
    right = set(_by_problem([row for row in others if outcome_of(row) == "right"]))
    return sum(outcome_of(row) != "right" and _problem(row) in right for row in of_restart(rows, library, restart))


def ending(row: Row) -> str:
    """How a run that was made ended."""
    outcome = outcome_of(row)
    if outcome in ("right", "failed"):
        return outcome
    return "ended early" if row["status"] in EARLY else "wrong"


def default_table(rows: Sequence[Row]) -> Table:
    """Each library's default against the best other restart: runs that one alone gets right, or to a digit more."""
    lines = []
    for library in libraries_of(rows):
        own = registry.restart_of(library)
        others = [restart for restart in registry.RESTARTS if restart != own]
        best = max(others, key=lambda restart: _merit(of_restart(rows, library, restart)))
        mine, other = (_by_problem(of_restart(rows, library, restart)) for restart in (own, best))
        pairs = [(mine[problem], other[problem]) for problem in mine.keys() & other.keys()]
        counts = (
            sum(_gains(ours, theirs) for ours, theirs in pairs),
            sum(_gains(theirs, ours) for ours, theirs in pairs),
            sum(_digit_better(ours, theirs) for ours, theirs in pairs),
            sum(_digit_better(theirs, ours) for ours, theirs in pairs),
        )
        lines.append((f"`{library}`", f"`{own}`", f"`{best}`", *(f"{n or ''}" for n in counts)))
    headings = (
        "library", "default", "other", "right by the default alone", "by the other alone",
        "right by both, by the default a digit closer", "by the other a digit closer",
    )  # fmt: skip
    return Table(headings, "lllrrrr", lines)


def _merit(rows: Sequence[Row]) -> tuple[int, int]:
    """How many runs are right, and whole digits in all of these."""
    good = [row for row in rows if ending(row) == "right"]
    return len(good), sum(int(_counted_digits(row)) for row in good if row["digits"] is not None)


def _counted_digits(row: Row) -> float:
    """Digits up to MOST; more are rounding."""
    return min(number(row, "digits"), MOST)


def _by_problem(rows: Sequence[Row]) -> dict[tuple[object, ...], Row]:
    return {_problem(row): row for row in rows}


def _problem(row: Row) -> tuple[object, ...]:
    """What a library is to solve: reading and tolerance."""
    return row["case"], row["reading"], row["rtol"]


def _gains(row: Row, other: Row) -> bool:
    """Whether a run is right, and the other is not."""
    return ending(row) == "right" != ending(other)


def _digit_better(row: Row, other: Row) -> bool:
    """Whether both are right, and this one gets a digit more."""
    return ending(row) == ending(other) == "right" and _counted_digits(row) - _counted_digits(other) >= 1.0


def detail_table(rows: Sequence[Row]) -> Table:
    """Every reading, library and restart that is not right at every tolerance."""
    lines = []
    keys = dict.fromkeys((str(row["case"]), str(row["reading"])) for row in rows)
    for case, reading in keys:
        own = [row for row in rows if (row["case"], row["reading"]) == (case, reading)]
        for library in libraries_of(own):
            cells = [_cell(of_restart(own, library, restart)) for restart in registry.RESTARTS]
            if any(cells):
                text = case if reading == "default" else f"{case}, {reading}"
                anchor = "" if reading == "default" else f"#{reading}"
                lines.append((f"[{text}](../{case}/{REPORT}{anchor})", f"`{library}`", *(c or "right" for c in cells)))
    return Table(("reading", "library", *(f"`{restart}`" for restart in registry.RESTARTS)), "llllll", lines)


def _cell(rows: Sequence[Row]) -> str:
    """What went wrong, with the tolerances at which it did; empty where nothing did."""
    found: dict[str, list[str]] = {}
    for row in rows:
        if outcome_of(row) != "right":
            found.setdefault(_how(row), []).append(setting(row["rtol"], row["step_s"]))
    return "; ".join(f"{how} ({', '.join(at)})" for how, at in found.items())


def _how(row: Row) -> str:
    edits = Counter({c: int(v) for c in ("missed", "spurious") if isinstance(v := row[c], int | float) and v})
    words = [f"{number} {column}" for column, number in edits.items()]
    if row["status"] not in ("ok", "wrong"):
        words.insert(0, str(row["status"]))
    return ", ".join(words) or str(row["status"])
