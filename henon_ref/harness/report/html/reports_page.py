"""The page of a folder of reports, ``index.html``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from henon_ref.harness.report.folder import INDEX, MATRIX
from henon_ref.harness.report.html.choice_content import FIRST, HEADINGS, SIDES
from henon_ref.harness.report.html.content import content
from henon_ref.harness.report.html.rendering import rendered, source
from henon_ref.harness.report.text.choice import commits, coverage_words
from henon_ref.harness.report.text.index import PAGES
from henon_ref.harness.report.text.matrix import MatrixRow
from henon_ref.harness.score.kinds import CLOSE
from henon_ref.harness.table import count

SCRIPTS = (
    "dom.js", "numbers.js", "axes.js", "portrait.js", "data.js", "choice.js", "matrix.js", "run.js", "reports.js",
)  # fmt: skip


def page_text(folder: Path, rows: Sequence[MatrixRow]) -> str:
    """The page as HTML.

    Parameters
    ----------
    folder : Path
        Of reports.
    rows : sequence of MatrixRow
        Of its matrix.
    """
    data = content(folder, rows)
    cases, readings = len({row.case for row in rows}), len({row.problem for row in rows})
    solvers = len({row.solver for row in rows})
    return rendered(
        "reports.html",
        source("reports.css") + _colours(data["solvers"]),
        SCRIPTS,
        data,
        summary=f"{count(readings, 'reading')} of {count(cases, 'case')}, {count(solvers, 'solver')}; {commits(rows)}.",
        choice=next(level for level in data["choice"] if level["digits"] == FIRST),
        headings=list(zip(HEADINGS, SIDES, strict=True)),
        mean_parts=round(1 / CLOSE),
        coverage=coverage_words(rows),
        files=_files(folder),
    )


def _colours(solvers: Sequence[dict[str, Any]]) -> str:
    """A custom property a solver; the colours come from the figures' style."""
    lines = (f"--s{k}: light-dark({own['light']}, {own['dark']});" for k, own in enumerate(solvers))
    return f":root {{ {' '.join(lines)} }}\n"


def _files(folder: Path) -> list[dict[str, str]]:
    """What lies beside the page: index and matrix, and the pages of the studies that are there."""
    named = {INDEX: "index (markdown)", MATRIX: "matrix (CSV)"}
    studies = {f"{page}/{INDEX}": words.split("]")[0].strip("[").lower() for page, words in PAGES.items()}
    named |= {href: title for href, title in studies.items() if (folder / href).is_file()}
    return [{"href": href, "title": title} for href, title in named.items()]
