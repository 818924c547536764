"""The index of all reports in a folder: who is right where, to how many digits, and who is cheapest."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from henon_ref.columns import RUN_COLUMNS, Row
from henon_ref.errors import CaseError
from henon_ref.report.files.csv_files import read_rows
from henon_ref.report.files.write import INDEX, MANIFEST, REPORT, RUNS, check_index, replace_file
from henon_ref.report.text.markdown import environment
from henon_ref.report.text.matrix import KEY, matrix, solvers_of
from henon_ref.report.text.paired_times import cheapest, read_ratios, slower_table, spread_table
from henon_ref.report.text.ranking import LEVELS, NOT_RUN, by_solver, name, prices, reaching
from henon_ref.report.text.tables import Table
from henon_ref.text import code, markdown, message

ATLAS, RESTARTS, CAUSES, RIVALS, PAPER, PRICE = "atlas", "restarts", "causes", "rivals", "paper", "price"
"""Folders of the further pages."""


@dataclass(frozen=True)
class Entry:
    """One reading of one report."""

    case: str
    title: str
    reading: str
    rows: list[Row]

    @property
    def label(self) -> str:
        """Link to the report, with the reading where the case has several."""
        if self.reading == "default":
            return self.link(self.case)
        return self.link(f"{self.case}, {self.reading}", f"#{quote(self.reading)}")

    def link(self, text: str, anchor: str = "") -> str:
        """Link to the report."""
        return f"[{markdown(text)}]({quote(self.case)}/{REPORT}{anchor})"


def write_index(folder: Path) -> Path:
    """Write the index of all reports in a folder.

    Raises
    ------
    CaseError
        Where it would replace a README.md of somebody else's.
    """
    check_index(folder)
    path = folder / INDEX
    replace_file(path, index_text(entries(folder), pages(folder), read_ratios(folder)).encode())
    return path


def pages(folder: Path) -> dict[str, list[str]]:
    """The further pages in a folder, with their figures: paths relative to it."""
    found: dict[str, list[str]] = {}
    for name_, page in (
        ("atlas", ATLAS),
        ("restarts", RESTARTS),
        ("causes", CAUSES),
        ("rivals", RIVALS),
        ("paper", PAPER),
        ("price", PRICE),
    ):
        if (folder / page / INDEX).exists():
            found[name_] = [f"{page}/{quote(path.name)}" for path in sorted((folder / page).glob("*.svg"))]
    return found


def entries(folder: Path) -> list[Entry]:
    """The readings of all reports in a folder, by case and reading; one that cannot be read is named and left out."""
    found: list[Entry] = []
    for manifest in sorted(folder.glob(f"*/{MANIFEST}")):
        if manifest.with_name(RUNS).exists():
            try:
                found += _entries(manifest)
            except CaseError as error:
                print(message(f"left out of the index: {error}"), file=sys.stderr)
    return found


def _entries(manifest: Path) -> list[Entry]:
    """The readings of one report.

    Raises
    ------
    CaseError
        Where manifest or runs are not what this package writes.
    """
    file = manifest
    try:
        content = json.loads(manifest.read_text(encoding="utf-8"))
        if not isinstance(content, dict) or not isinstance(content.get("title"), str):
            raise CaseError("is no manifest of a report: it names no title", file=str(file))
        file = manifest.with_name(RUNS)
        rows = read_rows(file)
    except (OSError, RecursionError, ValueError, csv.Error) as error:
        raise CaseError(f"cannot be read: {error}", file=str(file)) from error
    by_reading: dict[str, list[Row]] = {}
    for row in rows:
        missing = [column for column in RUN_COLUMNS if column not in row]
        if missing:
            raise CaseError(f"is no list of runs of this package: it has no column {missing[0]}", file=str(file))
        by_reading.setdefault(str(row["reading"]), []).append(row)
    return [Entry(manifest.parent.name, content["title"], reading, rows) for reading, rows in by_reading.items()]


def index_text(
    found: Sequence[Entry], further: Mapping[str, Sequence[str]] | None = None, ratios: Sequence[Row] = ()
) -> str:
    """The index as markdown.

    Parameters
    ----------
    found : sequence of Entry
    further : mapping, optional
        Pages beside the reports, with their figures.
    ratios : sequence of Row
        Ratios of times taken in turn, if there are any.
    """
    runs = [row for entry in found for row in entry.rows]
    spread, slower = spread_table(ratios), slower_table(ratios, runs, reports="")
    return (
        environment()
        .get_template("index.md.j2")
        .render(
            key=KEY,
            matrix=matrix(("case",), [((entry.label,), entry.rows) for entry in found]).markdown,
            solvers=ranking_table(found, cheapest(ratios)).markdown,
            cases=len({entry.case for entry in found}),
            spread=spread.markdown if spread.rows else "",
            slower=slower.markdown if slower.rows else "",
            pages=dict(further or {}),
            titles={
                f"[{markdown(entry.case)}]({quote(entry.case)}/{REPORT})": markdown(entry.title) for entry in found
            },
        )
    )


def ranking_table(found: Sequence[Entry], in_turn: Mapping[tuple[str, str, int], str]) -> Table:
    """In how many readings each solver is right, and how often it is the cheapest for so many digits.

    Right is a solver that is so at one setting at least; of the readings those count that it was run on. Who is the
    cheapest decide the times taken in turn where there are some, by case, reading and digits; elsewhere the reports'
    own times do. Where nobody else gets so far, there is nothing to time in turn.
    """
    wins: dict[str, dict[int, int]] = {}
    reached, contested = dict.fromkeys(LEVELS, 0), dict.fromkeys(LEVELS, 0)
    for entry in found:
        for price in prices(entry.rows):
            if price.row is not None:
                reached[price.digits] += 1
                contested[price.digits] += price.next_row is not None
                first = in_turn.get((entry.case, entry.reading, price.digits), "")
                if first not in by_solver(reaching(entry.rows, price.digits)):  # or the reports are newer than that
                    first = name(price.row)
                wins.setdefault(first, dict.fromkeys(LEVELS, 0))[price.digits] += 1
    lines = []
    for solver in solvers_of([entry.rows for entry in found]):
        runs = [own for entry in found if (own := by_solver(entry.rows).get(solver))]
        tried = [rows for rows in runs if rows[-1]["status"] not in NOT_RUN]
        right = sum(any(row["verdict"] == "right" for row in rows) for rows in tried)
        won = wins.get(solver, {})
        lines.append((right, (code(solver), f"{right}", f"{len(tried)}", *(f"{won.get(d) or ''}" for d in LEVELS))))
    rows = [cells for _, cells in sorted(lines, key=lambda line: -line[0])]
    rows.append(("all readings", "", f"{len(found)}", *(f"{reached[level]}" for level in LEVELS)))
    rows.append(("of these, another solver gets there, too", "", "", *(f"{contested[level]}" for level in LEVELS)))
    headings = ("solver", "right in", "run on", *(f"cheapest for {level} digits" for level in LEVELS))
    return Table(headings, "l" + "r" * (len(headings) - 1), rows)
