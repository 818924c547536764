"""Writing a report: all of it is made before any of it is put in place."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from pathlib import Path

from henon_ref.columns import RUN_COLUMNS, STICK_COLUMNS
from henon_ref.comparison import Comparison
from henon_ref.errors import CaseError
from henon_ref.report.csvfiles import csv_text
from henon_ref.report.figures import READINGS, svg
from henon_ref.report.folder_lock import locked_for_a_moment
from henon_ref.report.manifest import Provenance, manifest_text
from henon_ref.report.markdown import report_text
from henon_ref.report.overview import is_drawn, judged

REPORT, RUNS, TRANSITIONS, STICKS, MANIFEST = (
    "report.md",
    "runs.csv",
    "transitions.csv",
    "sticks.csv",
    "manifest.json",
)
INDEX = "README.md"
_OWN = re.compile(
    r"# (Reports\n\n(\d+|no) readings? of (\d+|no) cases?\."
    r"|(What accuracy costs in time|Atlas of grazes|Restart habits|What the libraries do by themselves)\n"
    r"|(Rivals in turn|The paper, computed again)\n)"
)
"""How the pages begin that this package writes as the README.md of a folder: the index and the further pages."""


def report_files(comparison: Comparison, origin: Provenance) -> dict[str, bytes]:
    """Every file of one case's report, by name."""
    files: dict[str, bytes] = {
        REPORT: report_text(comparison, origin).encode(),
        RUNS: csv_text(RUN_COLUMNS, comparison.run_rows).encode(),
        TRANSITIONS: csv_text(comparison.transition_columns, comparison.transition_rows).encode(),
        STICKS: csv_text(STICK_COLUMNS, comparison.stick_rows).encode(),
    }
    for result in comparison.readings:
        files.update(result.figures)
    if is_drawn(comparison):
        from henon_ref.report.readings_figure import draw_readings

        files[READINGS] = svg(draw_readings(judged(comparison)))
    files[MANIFEST] = manifest_text(comparison, origin, [*files, MANIFEST]).encode()
    return files


def write_report(comparison: Comparison, origin: Provenance, folder: Path) -> Path:
    """Write one case's report into ``folder/<name>``.

    Everything is written into a folder beside it first; only then is each file moved to its place, and are the
    files of an earlier report that this one does not have removed.

    Returns
    -------
    Path
        The report's own file.

    Raises
    ------
    OSError
        Where it cannot be written; what was there is then as it was.
    """
    place = folder / comparison.case.name
    files = report_files(comparison, origin)
    folder.mkdir(parents=True, exist_ok=True)
    waiting = Path(tempfile.mkdtemp(prefix=f".{comparison.case.name}.", dir=folder))
    try:
        for name, content in files.items():
            write_through(waiting / name, content)
        with locked_for_a_moment(folder):  # who writes the index sees the old report or the new one
            place.mkdir(exist_ok=True)
            stale = _listed(place / MANIFEST) - set(files)
            for name in files:
                os.replace(waiting / name, place / name)
            for name in stale:
                (place / name).unlink(missing_ok=True)
    finally:
        shutil.rmtree(waiting, ignore_errors=True)
    return place / REPORT


def write_through(path: Path, content: bytes) -> None:
    """Write a file and wait until it is on the disk."""
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def replace_file(path: Path, content: bytes) -> None:
    """Put a whole file in the place of another, or leave the other as it is."""
    waiting = path.with_name(f".{path.name}.new")
    try:
        write_through(waiting, content)
        os.replace(waiting, path)
    finally:
        waiting.unlink(missing_ok=True)


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
    check_index(folder)


def check_index(folder: Path) -> None:
    """See that a folder's README.md may be replaced: there is none, or this package wrote it.

    Raises
    ------
    CaseError
        Where somebody else wrote it.
    """
    path = folder / INDEX
    try:
        own = _OWN.match(path.read_text(encoding="utf-8")) is not None
    except (FileNotFoundError, NotADirectoryError):
        return
    except (OSError, ValueError):
        own = False
    if not own:
        raise CaseError(
            "was not written by henon_ref, so it is not replaced; give --out another folder", file=str(path)
        )


def _listed(manifest: Path) -> set[str]:
    """The files beside an earlier report's manifest that it lists; whatever else stands in it is not ours."""
    try:
        content = json.loads(manifest.read_text(encoding="utf-8"))
    except (FileNotFoundError, RecursionError, ValueError):
        return set()
    names = content.get("files") if isinstance(content, dict) else None
    return {name for name in names if _is_beside(manifest, name)} if isinstance(names, list) else set()


def _is_beside(manifest: Path, name: object) -> bool:
    return isinstance(name, str) and Path(name).name == name and os.path.isfile(manifest.parent / name)
