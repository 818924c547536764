"""Where a run may start: folders with spaces and Unicode, no locale, no home, nothing that can be written, no fork.

A comparison in such a folder: harness/cli/test_exit_status.py.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import henon_ref as hr

def main():
    belt = hr.System(state=["x", "v"], parameters={"vb": 0.5}, surfaces={"s": "v - vb"},
                     field=["v", "-x - s/(1 + 3*s*(v - vb))"])
    run = hr.simulate(belt, {"x": 1.5, "v": 0}, until=20)
    table = hr.sweep(belt, {"x": 1.5, "v": 0}, until=20, grid={"vb": [0.25, 0.5]}, observe=[hr.observe.final_state()],
                     jobs=2, chunk=1)
    print([float(v).hex() for v in run.y[:, -1]] == [float(v).hex() for v in table[["final_x", "final_v"]].iloc[1]])

if __name__ == "__main__":
    main()
"""
CHECKOUT = Path(__file__).parents[1]


def python(tmp_path: Path, *arguments: str, cwd: Path | None = None, **environment: str | None) -> str:
    """What a program prints in a process with nothing in its environment but what it is given."""
    given = {"PATH": os.environ["PATH"], "PYTHONPATH": str(CHECKOUT), "HENON_REF_CACHE_DIR": str(tmp_path / "cache")}
    given |= environment  # type: ignore[arg-type]
    given = {name: value for name, value in given.items() if value is not None}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=cwd or tmp_path, env=given, capture_output=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr.decode(errors="replace")
    return done.stdout.decode()


@pytest.fixture
def program(tmp_path: Path) -> Path:
    folder = tmp_path / "Reibung und Stöße – µ"
    folder.mkdir()
    file = folder / "mein Lauf.py"
    file.write_text(PROGRAM, encoding="utf-8")
    return file


def test_a_run_and_a_sweep_without_home_and_locale_in_a_folder_that_cannot_be_written(
    program: Path, tmp_path: Path
) -> None:
    # Nobody can write below /proc, the superuser neither; HENON_REF_CACHE_DIR is unset: the cache finds its own place.
    environment = {"LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0", "HENON_REF_CACHE_DIR": None}
    assert python(tmp_path, str(program), cwd=Path("/proc"), **environment) == "True\n"


def test_a_sweep_whose_workers_are_spawned(program: Path, tmp_path: Path) -> None:
    assert python(tmp_path, str(program), HENON_REF_START="spawn") == "True\n"


def test_a_comparison_whose_workers_are_spawned(tmp_path: Path) -> None:
    """As on Windows, where there is no fork; the figures are drawn by a worker, too."""
    case = CHECKOUT / "cases" / "leaving_slide.yaml"
    line = ["-m", "henon_ref.compare", str(case), "--solvers", "henon,scipy-dop853", "--tolerances", "1e-6"]
    python(tmp_path, *line, "--repeats", "1", "--out", "out", HENON_REF_START="spawn")
    text = (tmp_path / "out" / "leaving_slide" / "runs.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    assert [row["verdict"] for row in rows] == ["right", "right"]
    assert list((tmp_path / "out" / "leaving_slide").glob("*.svg"))


def test_a_case_insensitive_folder_has_no_two_files_of_one_name() -> None:
    """As on macOS and Windows: a clone there would lose one of them."""
    names = subprocess.run(["git", "ls-files"], cwd=CHECKOUT, capture_output=True, text=True, check=False).stdout.split(
        "\n"
    )
    folded = [name.casefold() for name in names]
    assert len(set(folded)) == len(folded)
