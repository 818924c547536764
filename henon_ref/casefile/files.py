"""Case files by path or name: files, folders, and the cases that are installed with the package.

The latter are in ``cases/`` at the top of the repository; a wheel contains that folder, stored truths included, as
``henon_ref/cases``.
"""

from __future__ import annotations

import os
from difflib import get_close_matches
from functools import cache
from pathlib import Path

from henon_ref.errors import CaseError
from henon_ref.text import listed

SUFFIXES = (".yaml", ".yml")
_PACKAGE = Path(__file__).resolve().parents[1]


def shipped_folder() -> Path:
    """Return the folder of the shipped cases, in an installed wheel or in a clone of the repository."""
    inside = _PACKAGE / "cases"
    return inside if inside.is_dir() else _PACKAGE.parent / "cases"


@cache
def shipped_names() -> dict[str, Path]:
    """Return the names of all shipped cases and folders of cases, with their paths.

    A case in a folder has two names, such as ``grazing`` and ``hard/grazing``; ``cases`` means all cases.
    """
    top = shipped_folder()
    if not top.is_dir():
        return {}
    files = yaml_files(top)
    names = {"cases": top}
    names |= {folder.relative_to(top).as_posix(): folder for folder in {file.parent for file in files} - {top}}
    names |= {file.stem: file for file in files}
    return names | {file.relative_to(top).with_suffix("").as_posix(): file for file in files}


def yaml_files(folder: Path) -> list[Path]:
    """Return the case files below a folder in order, except those in a folder ``truth``."""
    return sorted(
        file
        for file in folder.rglob("*")
        if file.suffix in SUFFIXES and "truth" not in file.relative_to(folder).parts[:-1] and file.is_file()
    )


def located(path: str | Path) -> Path:
    """Return the file or folder of an existing path, or else of the shipped cases of that name.

    Examples are ``my_case.yaml``, ``my_folder``, ``fig8``, ``hard``, ``hard/grazing``. CaseError if the name is
    neither. (A missing file ``.yaml`` raises an error when it is read.)
    """
    path = Path(path)
    if os.path.lexists(path) or path.is_absolute() or path.suffix in SUFFIXES:
        return path
    names = shipped_names()
    if (name := path.as_posix()) in names:
        return names[name]
    similar = get_close_matches(name, names, n=3, cutoff=0.5)
    hint = f"similar names: {listed(similar)}" if similar else "henon-ref cases lists the names"
    raise CaseError(f"no file, folder or shipped case has this name; {hint}", file=str(path))


def case_files(path: Path) -> list[Path]:
    """Return the case files that a path, or the name of shipped cases, denotes, in order; CaseError if none."""
    path = located(path)
    if not path.is_dir():
        return [path]
    found = yaml_files(path)
    if not found:
        raise CaseError(f"no case file (*{SUFFIXES[0]}) in this folder", file=str(path))
    return found
