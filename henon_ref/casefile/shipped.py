"""The cases that come with the package, found by name wherever it is installed.

They lie in ``cases/`` at the top of the repository; a wheel has that folder, stored truths included, as
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
    """The folder of the shipped cases: that of the wheel, or that of the clone which the package lies in."""
    inside = _PACKAGE / "cases"
    return inside if inside.is_dir() else _PACKAGE.parent / "cases"


@cache
def shipped_names() -> dict[str, Path]:
    """Every name of a shipped case or folder of cases, and where it lies.

    A case in a folder has two names, such as ``grazing`` and ``hard/grazing``; ``cases`` are all of them.
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
    """The case files below a folder, in order; what lies in a folder ``truth`` is left out."""
    return sorted(
        file
        for file in folder.rglob("*")
        if file.suffix in SUFFIXES and "truth" not in file.relative_to(folder).parts[:-1] and file.is_file()
    )


def located(path: str | Path) -> Path:
    """The file or folder that is meant: a path where there is one, else the shipped cases of that name.

    Parameters
    ----------
    path : str or Path
        ``my_case.yaml``, ``my_folder``, ``fig8``, ``hard``, ``hard/grazing``.

    Raises
    ------
    CaseError
        For a name that is neither. (A file ``.yaml`` that is missing is left to whoever reads it.)
    """
    path = Path(path)
    if os.path.lexists(path) or path.is_absolute() or path.suffix in SUFFIXES:
        return path
    names = shipped_names()
    if (name := path.as_posix()) in names:
        return names[name]
    similar = get_close_matches(name, names, n=3, cutoff=0.5)
    hint = f"those of similar names: {listed(similar)}" if similar else "henon-ref cases lists those"
    raise CaseError(f"there is no such file or folder, nor a case of this name in henon_ref; {hint}", file=str(path))
