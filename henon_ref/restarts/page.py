"""The experiment's page: libraries against habits, over all readings and reading by reading."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from henon_ref import registry
from henon_ref.atlas.family import outcome_of
from henon_ref.columns import RUN_COLUMNS, Row
from henon_ref.report.csvfiles import csv_text
from henon_ref.report.manifest import Provenance
from henon_ref.report.markdown import environment
from henon_ref.report.tables import Table
from henon_ref.report.words import listing, setting
from henon_ref.report.write import REPORT, RUNS, replace_file

FOLDER = "restarts"
PAGE = "README.md"


def write_page(rows: Sequence[Row], origin: Provenance, folder: Path) -> Path:
    """Write runs and page.

    Parameters
    ----------
    rows : sequence of Row
        A run a reading, library, habit and tolerance.
    origin : Provenance
    folder : Path
        The experiment's own folder; made if need be.

    Raises
    ------
    OSError
        Where it cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    replace_file(folder / RUNS, csv_text(RUN_COLUMNS, rows).encode())
    text = (
        environment()
        .get_template("restarts.md.j2")
        .render(
            runs=len(rows),
            readings=len({(row["case"], row["reading"]) for row in rows}),
            broken=broken(rows),
            summary=summary_table(rows).markdown,
            details=detail_table(rows).markdown,
            rerun=origin.rerun,
            machine=origin.machine_text,
            commit=origin.commit[:12],
        )
    )
    replace_file(folder / PAGE, text.strip().encode() + b"\n")
    return folder / PAGE


def libraries_of(rows: Sequence[Row]) -> list[str]:
    """Solvers without their habit, in the registry's order."""
    present = {registry.plain_name(str(row["solver"])) for row in rows}
    return [name for name in registry.names() if name in present]


def of_habit(rows: Sequence[Row], library: str, habit: str) -> list[Row]:
    """The runs of a library that was restarted by a habit."""
    name = f"{library}{registry.AT}{habit}"
    return [row for row in rows if row["solver"] == name and outcome_of(row) is not None]


def summary_table(rows: Sequence[Row]) -> Table:
    """Library against habit: runs that are right, transitions missed and spurious, runs that failed."""
    lines = []
    for library in libraries_of(rows):
        cells = [_summed(of_habit(rows, library, habit)) for habit in registry.RESTARTS]
        own = registry.RESTARTS.index(registry.restart_of(library))
        cells[own] = f"**{cells[own]}**"
        lines.append((f"`{library}`", *cells))
    return Table(("library", *(f"`{habit}`" for habit in registry.RESTARTS)), "lllll", lines)


def _summed(rows: Sequence[Row]) -> str:
    right = sum(outcome_of(row) == "right" for row in rows)
    words = [f"{right} of {len(rows)} right"]
    for column in ("missed", "spurious"):
        total = sum(int(value) for row in rows if isinstance(value := row[column], int | float))
        words += [f"{total} {column}"] if total else []
    failed = sum(outcome_of(row) == "failed" for row in rows)
    return ", ".join([*words, f"{failed} failed"] if failed else words)


def broken(rows: Sequence[Row]) -> list[str]:
    """One sentence a habit: the libraries that it makes wrong where another habit is right."""
    sentences = []
    for habit in registry.RESTARTS:
        losses = {}
        for library in libraries_of(rows):
            lost = [row for row in of_habit(rows, library, habit) if outcome_of(row) != "right"]
            losses[library] = sum(_right_otherwise(rows, library, row) for row in lost)
        worst = [f"`{library}` ({lost})" for library, lost in losses.items() if lost]
        sentences.append(f"`{habit}` breaks {listing(worst)}." if worst else f"`{habit}` breaks none.")
    return sentences


def _right_otherwise(rows: Sequence[Row], library: str, lost: Row) -> bool:
    """Whether another habit of the same library gets the same reading and tolerance right."""
    same = ("case", "reading", "rtol")
    return any(
        outcome_of(row) == "right" and all(row[column] == lost[column] for column in same)
        for habit in registry.RESTARTS
        for row in of_habit(rows, library, habit)
    )


def detail_table(rows: Sequence[Row]) -> Table:
    """Every reading, library and habit that is not right at every tolerance."""
    lines = []
    keys = dict.fromkeys((str(row["case"]), str(row["reading"])) for row in rows)
    for case, reading in keys:
        own = [row for row in rows if (row["case"], row["reading"]) == (case, reading)]
        for library in libraries_of(own):
            cells = [_cell(of_habit(own, library, habit)) for habit in registry.RESTARTS]
            if any(cells):
                text = case if reading == "default" else f"{case}, {reading}"
                anchor = "" if reading == "default" else f"#{reading}"
                lines.append((f"[{text}](../{case}/{REPORT}{anchor})", f"`{library}`", *(c or "right" for c in cells)))
    return Table(("reading", "library", *(f"`{habit}`" for habit in registry.RESTARTS)), "llllll", lines)


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
