"""The experiment's page: how the ratios spread, and where a rival is faster."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from henon_ref.columns import Row
from henon_ref.report.csvfiles import csv_text, read_rows
from henon_ref.report.manifest import Provenance
from henon_ref.report.markdown import environment
from henon_ref.report.ranking import number
from henon_ref.report.ratios import ERRORS, SECOND, SPREAD, spread
from henon_ref.report.tables import Table
from henon_ref.report.write import REPORT, replace_file

FOLDER = "rivals"
PAGE, RATIOS = "README.md", "ratios.csv"
COLUMNS = (
    "case", "reading", "worst_error_s", "rtol", "rival", "rival_rtol", "rival_step_s", "wall_s", "rival_wall_s",
    "ratio", "rounds",
)  # fmt: skip
"""Columns of ``ratios.csv``: the bound (none where there is no transition to time), settings, medians, their ratio."""
OTHERS = "the cheapest other"


def write_page(rows: Sequence[Row], failed: Sequence[str], origin: Provenance, folder: Path) -> Path:
    """Write ratios and page.

    Parameters
    ----------
    rows : sequence of Row
        A ratio a reading, bound and rival.
    failed : sequence of str
        Readings that could not be timed, and why.
    origin : Provenance
    folder : Path
        The experiment's own folder; made if need be.

    Raises
    ------
    OSError
        Where it cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows = sorted(rows, key=lambda row: (str(row["case"]), str(row["reading"]), -number(row, "worst_error_s")))
    replace_file(folder / RATIOS, csv_text(COLUMNS, rows).encode())
    text = (
        environment()
        .get_template("rivals.md.j2")
        .render(
            readings=len({(row["case"], row["reading"]) for row in rows}),
            spread=spread_table(rows).markdown,
            slower=slower.markdown if (slower := slower_table(rows)).rows else "",
            failed=failed,
            rerun=origin.rerun,
            machine=origin.machine_text,
            commit=origin.commit[:12],
        )
    )
    replace_file(folder / PAGE, text.strip().encode() + b"\n")
    return folder / PAGE


def read_ratios(folder: Path) -> list[Row]:
    """The ratios in a folder of reports; none where they are not there, or no ratios."""
    try:
        rows = read_rows(folder / FOLDER / RATIOS)
    except (OSError, ValueError, csv.Error):
        return []
    return rows if all(set(COLUMNS) <= set(row) for row in rows) else []


def against(rows: Sequence[Row], rival: str, error: float | None) -> dict[tuple[str, str], float]:
    """Ratio by case and reading against a rival, or (OTHERS) whoever is the quickest of all others."""
    found: dict[tuple[str, str], float] = {}
    for row in rows:
        if row["worst_error_s"] == error and rival in (OTHERS, row["rival"]):
            key = str(row["case"]), str(row["reading"])
            found[key] = max(found.get(key, 0.0), number(row, "ratio"))
    return found


def spread_table(rows: Sequence[Row]) -> Table:
    """How the ratios spread over the readings."""
    lines = [
        (label, *spread(error, ratios.values()))
        for rival, label in ((SECOND, f"`{SECOND}`"), (OTHERS, OTHERS))
        for error in (*ERRORS, None)
        if (ratios := against(rows, rival, error))
    ]
    return Table(("against", *SPREAD), "l" + "r" * len(SPREAD), lines)


def slower_table(rows: Sequence[Row], reports: str = "../") -> Table:
    """Where a rival is faster; ``reports``: the folder of the reports, as links have it."""
    lines = []
    for row in rows:
        if number(row, "ratio") > 1:
            case, reading = str(row["case"]), str(row["reading"])
            text, anchor = (case, "") if reading == "default" else (f"{case}, {reading}", f"#{reading}")
            bound = f"{number(row, 'worst_error_s'):.0e} s" if row["worst_error_s"] else "no transition"
            times = (f"{1e6 * number(row, column):.3g} us" for column in ("wall_s", "rival_wall_s"))
            link = f"[{text}]({reports}{case}/{REPORT}{anchor})"
            lines.append((link, bound, f"`{row['rival']}`", *times, f"{number(row, 'ratio'):.3g}"))
    return Table(("reading", "worst error", "rival", "`henon`", "rival's time", "ratio"), "lrlrrr", lines)
