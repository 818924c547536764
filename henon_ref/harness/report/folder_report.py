"""What stands over all reports of a folder: their matrix, the index in markdown, and the page to click through."""

from __future__ import annotations

from pathlib import Path

from henon_ref.atomic_write import replace_file
from henon_ref.harness.report.folder import INDEX, MATRIX, PAGE, check_index
from henon_ref.harness.report.html.reports_page import page_text
from henon_ref.harness.report.text.index import index_text
from henon_ref.harness.report.text.matrix import MatrixRow, merged
from henon_ref.harness.rows import rows_text


def write_folder_report(folder: Path) -> Path:
    """Write the matrix of all reports in a folder, and what is made of it: the index and the page.

    The matrix keeps its rows of solvers and cases that no report there has (:func:`.text.matrix.merged`).

    Returns
    -------
    Path
        The index.

    Raises
    ------
    CaseError
        Where it would replace a file of somebody else's; nothing has been written then.
    """
    check_index(folder)
    rows = merged(folder)
    replace_file(folder / MATRIX, rows_text(MatrixRow, rows).encode())
    replace_file(folder / PAGE, page_text(folder, rows).encode())
    replace_file(folder / INDEX, index_text(rows, folder).encode())  # last: it links to what is there alone
    return folder / INDEX
