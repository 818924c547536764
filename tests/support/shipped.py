"""The cases of the suite; each is read once per process, because reading all of them takes seconds.

Tests are named by what stands in the files; a case is built where a test of it runs, not where tests are collected.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from henon_ref.casefile.case import DEFAULT_READING, Case, Reading, load_case
from henon_ref.casefile.files import yaml_files
from henon_ref.harness.campaign.comparison import expected_of
from henon_ref.harness.score.reference import Expected
from henon_ref.harness.truth.compute import stored_truth

CASES = Path(__file__).parents[2] / "cases"


def paths(*folders: str) -> list[Path]:
    """Files of all cases, or of those in some folders (``.``: the first), in order."""
    return [path for path in yaml_files(CASES) if not folders or path.parent.relative_to(CASES).as_posix() in folders]


def shipped(*folders: str) -> tuple[Case, ...]:
    """All cases, or those of some folders."""
    return tuple(map(read, paths(*folders)))


@cache
def read(path: Path) -> Case:
    """A case of the suite."""
    return load_case(path)


def proven(case: Case, reading: Reading) -> Expected:
    """What a run of a reading is scored against, by its stored truth."""
    truth = stored_truth(case, reading)
    assert truth is not None
    return expected_of(reading, truth)


def readings(path: Path) -> tuple[str, ...]:
    """Names of a case's readings, by their lines: reading all files as YAML would take a fifth of collecting tests.

    A test of the suite sees that these are the names.
    """
    _, _, block = path.read_text(encoding="utf-8").partition("\nreadings:\n")
    return tuple(re.findall(r"^  (\w+):", re.split(r"^[^\s#]", block, flags=re.M)[0], re.M)) or (DEFAULT_READING,)
