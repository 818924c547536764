"""Write the files that summarise all reports of a folder: the matrix, the index in markdown, and the HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from henon_ref.atomic_write import replace_file
from henon_ref.harness.report.folder import INDEX, MATRIX, PAGE, REPORT, check_index, without_dead_links
from henon_ref.harness.report.html.content import content
from henon_ref.harness.report.html.rendering import rendered
from henon_ref.harness.report.text import choice
from henon_ref.harness.report.text.markdown import environment
from henon_ref.harness.report.text.matrix import MatrixRow, merged
from henon_ref.harness.result_files import rows_text
from henon_ref.harness.score.kinds import CLOSE
from henon_ref.harness.table import count

SCRIPTS = ("page.js", "matrix.js", "run.js")
FIRST = 9
"""Number of digits selected when the page is opened."""
MEAN_PARTS = round(1 / CLOSE)
"""Two roots are close if their distance is below their mean spacing divided by this number."""
PAGES = {
    "price": "[Price list](price/README.md): times for a number of digits, of preparation, of effects and of long runs",
    "rivals": "[Alternating runs](rivals/README.md): times of `henon`, heyoka and the cheapest other solver",
    "atlas": "[Atlas](atlas/README.md): tolerance against distance from a graze, or between two roots of one step",
    "restarts": "[Restarts](restarts/README.md) of the libraries after an event: each restart on all cases",
    "causes": "[Causes](causes/README.md) of failures of the libraries, each shown by a run of the library alone",
    "paper": "[The paper](paper/README.md): every number and equation of the paper, computed again",
}
"""Folder of a study -> its link in the index."""


def write_folder_report(folder: Path) -> Path:
    """Write the matrix of all reports in a folder, the page and the index; return the path of the index.

    The matrix keeps its rows of solvers and cases without a report in the folder (:func:`.text.matrix.merged`). If this
    package has not written a file that it would replace, raise CaseError and write nothing.
    """
    check_index(folder)
    rows = merged(folder)
    replace_file(folder / MATRIX, rows_text(MatrixRow, rows).encode())
    replace_file(folder / PAGE, page_text(rows, folder).encode())
    replace_file(folder / INDEX, index_text(rows, folder).encode())  # last, since it links to existing files only
    return folder / INDEX


def index_text(rows: Sequence[MatrixRow], folder: Path) -> str:
    """Format the index as markdown from the rows of a folder's matrix, with links to existing files only."""
    text = (
        environment()
        .get_template("index.md.j2")
        .render(
            choice=choice.choice_table(rows).markdown,
            often=choice.frequency_table(rows).markdown,
            cases=choice.case_table([row for row in rows if (folder / row.case / REPORT).exists()]).markdown,
            commits=choice.commits(rows),
            mean_parts=MEAN_PARTS,
            pages=[words for page, words in PAGES.items() if (folder / page / INDEX).exists()],
        )
    )
    return without_dead_links(text, folder)


def page_text(rows: Sequence[MatrixRow], folder: Path) -> str:
    """Format the page as HTML from the rows of a folder's matrix."""
    data = content(folder, rows)
    cases, readings = len({row.case for row in rows}), len({row.problem for row in rows})
    files = {INDEX: "index (markdown)", MATRIX: "matrix (CSV)"}
    studies = {f"{page}/{INDEX}": words.split("]")[0].strip("[").lower() for page, words in PAGES.items()}
    return rendered(
        "reports.html",
        SCRIPTS,
        data,
        summary=f"{count(readings, 'reading')} of {count(cases, 'case')}, "
        f"{count(len(data['solvers']), 'solver')}; {choice.commits(rows)}.",
        choice=next(level for level in data["choice"] if level["digits"] == FIRST),
        headings=choice.HEADINGS,
        mean_parts=MEAN_PARTS,
        coverage=choice.coverage_sentence(rows),
        files=files | {address: title for address, title in studies.items() if (folder / address).is_file()},
    )
