"""The cases of the suite, each read once in a process of tests: all of them take seconds.

Tests are named by what stands in the files; a case is built where a test of it runs, not where tests are collected.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from ruamel.yaml import YAML

from henon_ref.casefile.case import DEFAULT_READING, Case, load_case
from henon_ref.casefile.catalogue import case_files

CASES = Path(__file__).parents[2] / "cases"


def paths(*folders: str) -> list[Path]:
    """Files of all cases, or of those in some folders (``.``: the first), in order."""
    return [path for path in case_files(CASES) if not folders or path.parent.relative_to(CASES).as_posix() in folders]


def shipped(*folders: str) -> tuple[Case, ...]:
    """All cases, or those of some folders."""
    return tuple(map(read, paths(*folders)))


@cache
def read(path: Path) -> Case:
    """A case of the suite."""
    return load_case(path)


@cache
def readings(path: Path) -> tuple[str, ...]:
    """Names of a case's readings."""
    return tuple(YAML(typ="safe").load(path.read_text(encoding="utf-8")).get("readings") or [DEFAULT_READING])
