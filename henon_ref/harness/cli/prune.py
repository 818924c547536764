"""Reduce a folder of reports to the files worth keeping in a repository.

``python -m henon_ref.harness.cli.prune CASE... [--reports DIR]`` keeps the folders of these cases, without their
``transitions.csv`` and raw samples. It removes the folders of all other cases, whose results remain in the matrix from
which the index is made. It also removes the rows of every run from the folders of the studies, replaces links to
removed files by text, and shortens the figures. Files that this package has not written are not changed.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from henon_ref.atomic_write import replace_file
from henon_ref.commands import application
from henon_ref.commands.exit_status import DONE, command_of, say
from henon_ref.harness.campaign.options import load_cases
from henon_ref.harness.report.folder import (
    INDEX,
    MANIFEST,
    ROWS,
    check_index,
    is_study,
    linked,
    locked,
    own_files,
    remove_if_empty,
    without_dead_links,
)
from henon_ref.harness.report.folder_report import write_folder_report
from henon_ref.harness.report.svg import shortened
from henon_ref.harness.studies.study import STUDIES


def prune(folder: Path, kept: Sequence[str]) -> int:
    """Remove all files that index and pages do not require, except the reports of some cases; return the bytes left.

    CaseError if another program wrote README.md or the matrix; nothing is removed then.
    """
    check_index(folder)
    with locked([folder], wait=True):
        write_folder_report(folder)  # before removing a folder, copy its rows to the matrix and the page
        for manifest in folder.glob(f"*/{MANIFEST}"):
            report, own = manifest.parent, own_files(manifest.parent)
            for name in own & set(ROWS) if report.name in kept else own:
                (report / name).unlink()
            remove_if_empty(report)
        for study in STUDIES.values():
            for name in study.every_run if is_study(folder / study.folder) else ():
                (folder / study.folder / name).unlink(missing_ok=True)
        for page in folder.glob("*/*.md"):
            if page.name in own_files(page.parent) or (page.name == INDEX and is_study(page.parent)):
                text = page.read_text(encoding="utf-8")
                _replace(page, without_dead_links(text, page.parent).encode())
                for figure in (page.parent / name for name in linked(text) if name.endswith(".svg")):
                    if figure.parent == page.parent and figure.is_file():
                        _replace(figure, shortened(figure.read_bytes()))
        write_folder_report(folder)
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def _replace(path: Path, content: bytes) -> None:
    if content != path.read_bytes():
        replace_file(path, content)


app = application()


@app.command()
def main(
    cases: Annotated[list[Path], typer.Argument(help="Case files whose reports are kept.", show_default=False)],
    reports: Annotated[Path, typer.Option(help="Folder of the reports.")] = Path("reports"),
) -> int:
    """Reduce a folder of reports to the index, the pages, and the reports of some cases."""
    size = prune(reports, [case.name for case in load_cases(cases)])
    say(f"{reports}: {size / 1e6:.1f} MB are left")
    return DONE


command = command_of(app, "prune")

if __name__ == "__main__":
    sys.exit(command())
