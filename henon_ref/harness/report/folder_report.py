"""What stands over all reports of a folder: index, matrix and figure in markdown, and the page to click through."""

from __future__ import annotations

from pathlib import Path

from henon_ref.harness.report.html.reports_page import write_page
from henon_ref.harness.report.text.index import write_index
from henon_ref.harness.report.text.matrix_rows import read_matrix


def write_folder_report(folder: Path) -> Path:
    """Write the index of all reports in a folder, its matrix, and the page of both.

    Returns
    -------
    Path
        The index.

    Raises
    ------
    CaseError
        Where it would replace a file of somebody else's; nothing has been written then.
    """
    index = write_index(folder)
    write_page(folder, read_matrix(folder))
    return index
