"""The page of a folder of reports, ``index.html``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from henon_ref.atomic_write import replace_file
from henon_ref.harness.report.files.write import INDEX, MATRIX, MATRIX_PAGE, PAGE
from henon_ref.harness.report.html.content import content
from henon_ref.harness.report.html.rendering import rendered, source
from henon_ref.harness.report.text.choice import ANY, by_kind, choice, readings_for
from henon_ref.harness.report.text.formats import count, duration, significant
from henon_ref.harness.report.text.index import PAGES, commits
from henon_ref.harness.report.text.matrix import coverage
from henon_ref.harness.report.text.matrix_rows import MatrixRow
from henon_ref.harness.score.kinds import CLOSE

DIGITS = 9
"""Digits that the page begins with."""
SCRIPTS = (
    "dom.js",
    "numbers.js",
    "axes.js",
    "portrait.js",
    "data.js",
    "choice.js",
    "matrix.js",
    "run.js",
    "reports.js",
)
HEADINGS = (
    "kind of case", "readings", "take", "gets", "time", "other package", "gets", "times as long",
)  # fmt: skip
NUMBERS = (2, 4, 5, 7, 8)
"""Places of the columns of numbers, counted from 1."""


def write_page(folder: Path, rows: Sequence[MatrixRow]) -> Path:
    """Write the page of a folder of reports.

    Parameters
    ----------
    folder : Path
    rows : sequence of MatrixRow
        Of its matrix.
    """
    replace_file(folder / PAGE, page_text(folder, rows).encode())
    return folder / PAGE


def page_text(folder: Path, rows: Sequence[MatrixRow]) -> str:
    """The page as HTML; parameters as for :func:`write_page`."""
    data = content(folder, rows)
    cases, readings = len({row.case for row in rows}), len({row.problem for row in rows})
    solvers = len({row.solver for row in rows})
    return rendered(
        "reports.html",
        source("reports.css") + _colours(data["solvers"]),
        SCRIPTS,
        data,
        digits=DIGITS,
        summary=f"{count(readings, 'reading')} of {count(cases, 'case')}, {count(solvers, 'solver')}; {commits(rows)}.",
        choice={"headings": HEADINGS, "numbers": NUMBERS, "rows": choice_rows(rows, DIGITS)},
        mean_parts=round(1 / CLOSE),
        coverage=coverage_words(rows),
        files=_files(folder),
    )


def coverage_words(rows: Sequence[MatrixRow]) -> str:
    """On how many readings each solver was run, in a sentence; empty where all were run on all."""
    groups = coverage(rows)
    words = "; ".join(f"{own}: {', '.join(solvers)}" for own, solvers in groups)
    return f"Of {len({row.problem for row in rows})} readings the solvers were run on {words}." if groups else ""


def _colours(solvers: Sequence[dict[str, Any]]) -> str:
    """A custom property a solver; the colours come from the figures' style."""
    lines = (f"--s{k}: light-dark({own['light']}, {own['dark']});" for k, own in enumerate(solvers))
    return f":root {{ {' '.join(lines)} }}\n"


def choice_rows(rows: Sequence[MatrixRow], level: int | None) -> list[tuple[str, ...]]:
    """The table of the page's beginning: a row a kind of case, as the index has it (:mod:`...text.choice`)."""
    made: list[tuple[str, ...]] = []
    for kind, own in by_kind(rows).items():
        every, counted = readings_for(own, ANY), readings_for(own, level)
        readings = f"{len(every)}" if every == counted else f"{len(counted)} of {len(every)}"
        found = choice(own, level)
        cells = ["none", "", "", "", "", ""]
        if found is not None:
            first, other = found.first, found.other
            cells[:3] = first.solver, f"{len(first.walls)}", duration(median(first.walls.values()))
            cells[3:5] = (other.solver, f"{len(other.walls)}") if other else ("", "")
            cells[5] = "" if found.times is None else f"×{significant(found.times, 2)}"
        made.append((kind, readings, *cells))
    return made


def _files(folder: Path) -> list[dict[str, str]]:
    """What lies beside the page, as far as it is there."""
    named = {INDEX: "index (markdown)", MATRIX_PAGE: "matrix (markdown)", MATRIX: "matrix (CSV)"}
    named |= {f"{page}/{INDEX}": words.split("]")[0].strip("[").lower() for page, words in PAGES.items()}
    return [{"href": href, "title": title} for href, title in named.items() if (folder / href).is_file()]
