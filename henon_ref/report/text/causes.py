"""The page of causes: what each library does by itself, shown by a run of it made while the page is written."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

from baselines.causes import CAUSES, Cause, ClaimError
from henon_ref.report.files.write import replace_file
from henon_ref.report.text.markdown import environment

FOLDER = "causes"
PAGE = "README.md"


def write_causes(out: Path) -> Path:
    """Run every cause's check and write what was seen.

    Parameters
    ----------
    out : Path
        Folder of the reports.

    Raises
    ------
    OSError
        Where the page cannot be written.
    """
    folder = out / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    shown = [{"cause": cause, "version": _version(cause.package), "seen": _seen(cause)} for cause in CAUSES.values()]
    text = environment().get_template("causes.md.j2").render(causes=shown)
    replace_file(folder / PAGE, text.strip().encode() + b"\n")
    return folder / PAGE


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _seen(cause: Cause) -> str:
    """What the check saw; said so where the library does not behave as claimed, or is not there."""
    if _version(cause.package) is None:
        return "not installed here: not checked"
    try:
        return cause.check()
    except ClaimError as error:
        return f"**not as claimed with this version**: {error}"
