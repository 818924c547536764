"""Whatever state the cache is in, the command gives the same row, and a line tells of a folder that is refused."""

from __future__ import annotations

import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from problems import LEAVING_SLIDE

from henon_ref.jit.cache_folder import read

pytestmark = pytest.mark.slow
"""Each compiles all that there is. Daily: test_native_module.py and test_cache_folder.py, with one module."""
SAME = ("status", "status_reason", "found_transitions", "matched", "max_time_error_s", "steps", "rhs_evaluations")
PROGRESS = ("1 of 1: ", "computing what is not stored: ")
"""How lines begin that tell of the run, and of the truth where the machine has other things to do."""
COMMAND = [sys.executable, "-m", "henon_ref.compare"]

Seen = tuple[dict[str, str], list[str]]
"""The row of the case, and the lines on standard error but for :data:`PROGRESS`."""


@pytest.fixture(scope="module")
def warm(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """A folder with a case and with a cache in which everything is compiled; the row of the case."""
    place = tmp_path_factory.mktemp("warm")
    (place / "leaving.yaml").write_text(LEAVING_SLIDE)
    row, told = compared(place)
    assert row["status"] == "ok"
    assert told == []
    return place, row


@pytest.fixture
def place(warm: tuple[Path, dict[str, str]], tmp_path: Path) -> Path:
    """A copy of it."""
    shutil.copytree(warm[0], tmp_path, dirs_exist_ok=True)
    return tmp_path


@pytest.fixture
def before(warm: tuple[Path, dict[str, str]]) -> dict[str, str]:
    """The row as it was."""
    return warm[1]


def compared(place: Path) -> Seen:
    """Run the command."""
    environment = {key: value for key, value in os.environ.items() if key != "HENON_REF_CACHE_DIR"}
    done = subprocess.run(
        [*COMMAND, "leaving.yaml", "--solvers", "henon", "--tolerances", "1e-6", "--repeats", "1", "--no-figures"],
        env={**environment, "XDG_CACHE_HOME": str(place / "cache")},
        cwd=place,
        capture_output=True,
        text=True,
        check=True,
    )
    with (place / "out" / "leaving_slide" / "runs.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    told = [line for line in done.stderr.splitlines() if not line.startswith(PROGRESS)]
    return {key: row[key] for key in SAME}, told


def flip_every_file(cache: Path) -> None:
    for file in (cache / "henon_ref" / "objects").iterdir():
        found = bytearray(file.read_bytes())
        found[len(found) // 2] ^= 255
        file.write_bytes(found)


def test_what_is_damaged_is_compiled_anew_and_kept(place: Path, before: dict[str, str]) -> None:
    flip_every_file(place / "cache")
    assert compared(place) == (before, [])
    assert all(read(file) is not None for file in (place / "cache/henon_ref/objects").iterdir())


def test_a_file_in_the_place_of_the_folder_is_no_failure(place: Path, before: dict[str, str]) -> None:
    shutil.rmtree(place / "cache")
    (place / "cache").write_text("")
    row, told = compared(place)
    assert row == before
    (line,) = told
    assert str(place / "cache" / "henon_ref") in line
