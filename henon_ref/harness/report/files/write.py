"""Files of reports, each written whole or not at all, into folders that may be written into."""

from __future__ import annotations

import json
import os
import re
import tempfile
from pathlib import Path

from henon_ref.errors import CaseError

REPORT, RUNS, TRANSITIONS, STICKS, MANIFEST = (
    "report.md",
    "runs.csv",
    "transitions.csv",
    "sticks.csv",
    "manifest.json",
)
INDEX = "README.md"
SAMPLES = "samples.csv"
"""Raw timing samples of a report's runs."""
ROWS = (TRANSITIONS, SAMPLES)
"""Files of a report that are too long to be kept in a repository."""
MATRIX, MATRIX_PAGE = "matrix.csv", "matrix.md"
"""The matrix of all reports in a folder, and its page in markdown."""
PAGE = "index.html"
"""The page to click through, of a folder of reports or of a sweep."""
PAGE_BEGINNING = "<!doctype html>\n<!-- henon_ref "
_OWN = re.compile(
    r"# (Reports\n\n(\| solver \| right in \| run on \||\d+ readings? of \d+ cases?\.)"
    r"|(What accuracy costs in time|Atlas of grazes|What the libraries do by themselves|The paper, computed again)\n"
    r"|(Restart habits|How a library is restarted after an event)\n"
    r"|(Rivals in turn|Times of henon and of other solvers, run in turn)\n)"
)
"""How the pages begin that this package writes as the README.md of a folder: the index (of earlier versions, too) and
the further pages."""
_BEGINNINGS = {
    INDEX: (re.compile("# Reports\n\nWhich solver to take"), _OWN),
    MATRIX: (re.compile("case,title,reading,kind,solver,"),),
    MATRIX_PAGE: (re.compile("# Digits reached\n"),),
    PAGE: (re.compile(PAGE_BEGINNING),),
}
"""How the present version's index, its matrix and the pages of both begin, and any of the above."""


def remove_if_empty(folder: Path) -> None:
    """Remove a folder that is there and has nothing in it."""
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def check_writable(folder: Path) -> None:
    """See that reports can be written into a folder, without leaving anything there.

    Raises
    ------
    CaseError
        Where they cannot, or where the folder has a README.md that is not this package's own.
    """
    check_folder(folder)
    check_index(folder)


def check_folder(folder: Path) -> None:
    """See that files can be written into a folder, without leaving anything there.

    Raises
    ------
    CaseError
        Where they cannot.
    """
    nearest = next((path for path in (folder, *folder.absolute().parents) if path.exists()), Path("/"))
    if not nearest.is_dir():
        raise CaseError(f"{nearest} is a file; --out needs a folder", file=None)
    try:
        with tempfile.TemporaryFile(dir=nearest, prefix=".henon_ref."):
            pass
    except OSError as error:
        raise CaseError(
            f"cannot write into {nearest}: {error.strerror}; give --out a folder that can be written"
        ) from error


def own_files(folder: Path) -> set[str]:
    """The files of a case's report that are in its folder, as its manifest lists them; of any other folder, none."""
    try:
        content = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError, RecursionError, ValueError):
        return set()
    if not isinstance(content, dict) or content.get("case") != folder.name:
        return set()
    names = content.get("files")
    return {name for name in names if _is_beside(folder, name)} if isinstance(names, list) else set()


def _is_beside(folder: Path, name: object) -> bool:
    return isinstance(name, str) and Path(name).name == name and os.path.isfile(folder / name)


def is_page(path: Path) -> bool:
    """Whether this package wrote a page in markdown: of a report, or the README.md of a folder of further pages."""
    if path.name in own_files(path.parent):
        return True
    try:
        return path.name == INDEX and _OWN.match(path.read_text(encoding="utf-8")) is not None
    except (OSError, ValueError):
        return False


def check_index(folder: Path) -> None:
    """See that a folder's README.md, matrix and page may be replaced: there is none, or this package wrote it.

    Raises
    ------
    CaseError
        Where somebody else wrote it.
    """
    for name, beginnings in _BEGINNINGS.items():
        path = folder / name
        try:
            text = path.read_text(encoding="utf-8")
            own = any(beginning.match(text) for beginning in beginnings)
        except (FileNotFoundError, NotADirectoryError):
            continue
        except (OSError, ValueError):
            own = False
        if not own:
            raise CaseError(
                "was not written by henon_ref, so it is not replaced; give --out another folder", file=str(path)
            )
