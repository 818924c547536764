"""The experiment's page: libraries against habits, over all readings and reading by reading."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from henon_ref import registry
from henon_ref.columns import RUN_COLUMNS, Row
from henon_ref.report.files.csv_files import csv_text
from henon_ref.report.files.manifest import Provenance
from henon_ref.report.files.write import REPORT, RUNS, replace_file
from henon_ref.report.text.formats import listing, setting
from henon_ref.report.text.markdown import environment
from henon_ref.report.text.ranking import LEVELS, number
from henon_ref.report.text.tables import Table
from henon_ref.score.errors import EARLY
from henon_ref.studies.atlas.family import outcome_of

FOLDER = "restarts"
PAGE = "README.md"
MOST = LEVELS[-1]
"""Digits that are told apart."""
ENDINGS = ("right", "wrong", "ended early", "failed")
"""How a run may end: with the exact run's transitions, with others, before its time, or not at all."""


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
            most=MOST,
            defaults=default_table(rows).markdown,
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
    present = {registry.base_name(str(row["solver"])) for row in rows}
    return [name for name in registry.names() if name in present]


def of_habit(rows: Sequence[Row], library: str, habit: str) -> list[Row]:
    """The runs of a library that was restarted by a habit."""
    name = f"{library}{registry.AT}{habit}"
    return [row for row in rows if row["solver"] == name and outcome_of(row) is not None]


def summary_table(rows: Sequence[Row]) -> Table:
    """Library and habit: how their runs ended, each in one column, and the transitions missed and spurious in them."""
    lines = []
    for library in libraries_of(rows):
        for habit in registry.RESTARTS:
            own = of_habit(rows, library, habit)
            ends = Counter(map(ending, own))
            edits = (sum(int(number(row, c)) for row in own if row[c] is not None) for c in ("missed", "spurious"))
            label = f"**`{habit}`**" if habit == registry.restart_of(library) else f"`{habit}`"
            lines.append(
                (f"`{library}`", label, *(f"{ends[end] or ''}" for end in ENDINGS), *(f"{n or ''}" for n in edits))
            )
    return Table(("library", "habit", *ENDINGS, "transitions missed", "spurious"), "llrrrrrr", lines)


def ending(row: Row) -> str:
    """How a run that was made ended."""
    outcome = outcome_of(row)
    if outcome in ("right", "failed"):
        return outcome
    return "ended early" if row["status"] in EARLY else "wrong"


def default_table(rows: Sequence[Row]) -> Table:
    """Each library's default against the best other habit: what either gives up."""
    lines = []
    for library in libraries_of(rows):
        own = registry.restart_of(library)
        others = [habit for habit in registry.RESTARTS if habit != own]
        best = max(others, key=lambda habit: _merit(of_habit(rows, library, habit)))
        mine, other = (_by_problem(of_habit(rows, library, habit)) for habit in (own, best))
        pairs = [(mine[problem], other[problem]) for problem in mine.keys() & other.keys()]
        counts = (
            sum(_gains(ours, theirs) for ours, theirs in pairs),
            sum(_gains(theirs, ours) for ours, theirs in pairs),
            sum(_closer(ours, theirs) for ours, theirs in pairs),
            sum(_closer(theirs, ours) for ours, theirs in pairs),
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
    return len(good), sum(int(_told(row)) for row in good if row["digits"] is not None)


def _told(row: Row) -> float:
    """Digits; what is beyond MOST is rounding."""
    return min(number(row, "digits"), MOST)


def _by_problem(rows: Sequence[Row]) -> dict[tuple[object, ...], Row]:
    return {(row["case"], row["reading"], row["rtol"]): row for row in rows}


def _gains(row: Row, other: Row) -> bool:
    """Whether a run is right, and the other is not."""
    return ending(row) == "right" != ending(other)


def _closer(row: Row, other: Row) -> bool:
    """Whether both are right, and this one gets a digit more."""
    return ending(row) == ending(other) == "right" and _told(row) - _told(other) >= 1.0


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
