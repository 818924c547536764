"""The cases of the suite, each read once in a process of tests: all of them take seconds."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from henon_ref.casefile.case import Case, load_case
from henon_ref.casefile.catalogue import case_files

CASES = Path(__file__).parents[2] / "cases"


@cache
def shipped(*folders: str) -> tuple[Case, ...]:
    """All cases, or those of some folders (``.``: the first), in order."""
    own = (path for path in case_files(CASES) if not folders or path.parent.relative_to(CASES).as_posix() in folders)
    return tuple(map(_read, own))


@cache
def _read(path: Path) -> Case:
    return load_case(path)
