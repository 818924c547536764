"""Case files that a command is given: paths of files or folders, or names of shipped cases."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

from henon_ref.casefile.case import Case, load_case
from henon_ref.casefile.shipped import SUFFIXES, located, yaml_files
from henon_ref.errors import CaseError


def read_cases(
    paths: Sequence[Path],
    *,
    solvers: Collection[str] | None = None,
    fixed_step: Callable[[str], bool] | None = None,
) -> list[Case]:
    """Read the case files; a folder means all case files in it, except those in a folder ``truth``.

    Parameters
    ----------
    paths : sequence of Path
    solvers, fixed_step : optional
        See :func:`henon_ref.casefile.case.load_case`.

    Raises
    ------
    CaseError
        If a file is not a case, a folder contains no case, or two cases have the same name.
    """
    cases: dict[str, Case] = {}
    # Several paths may lead to the same file; it is read once, under its first path.
    files: dict[str, Path] = {}
    for path in paths:
        for found in case_files(path):
            files.setdefault(os.path.realpath(found), found)
    for file in files.values():
        case = load_case(file, solvers=solvers, fixed_step=fixed_step)
        if case.name in cases:
            raise CaseError(f"the name '{case.name}' is also that of {cases[case.name].path}", file=str(file))
        cases[case.name] = case
    return list(cases.values())


def case_files(path: Path) -> list[Path]:
    """Return the case files that a path, or the name of shipped cases, denotes, in order.

    Raises
    ------
    CaseError
        If a folder contains no case file, or the name is unknown.
    """
    path = located(path)
    if not path.is_dir():
        return [path]
    found = yaml_files(path)
    if not found:
        raise CaseError(f"no case file (*{SUFFIXES[0]}) in this folder", file=str(path))
    return found
