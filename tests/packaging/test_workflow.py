"""The hosted workflows: they parse, and call scripts that are there for the Pythons and libraries that there are."""

from __future__ import annotations

import os
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
from often import EVERY_PYTHON
from packaging.requirements import Requirement
from ruamel.yaml import YAML

ROOT = Path(__file__).parents[2]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
WORKFLOWS: list[dict[str, Any]] = [
    YAML(typ="safe").load(file.read_text(encoding="utf-8")) for file in (ROOT / ".github/workflows").iterdir()
]
JOBS: dict[str, Any] = {name: job for workflow in WORKFLOWS for name, job in workflow["jobs"].items()}
SCRIPTS = sorted(path for path in (ROOT / ".ci").iterdir() if path.is_file())


def commands(job: dict[str, Any]) -> list[str]:
    return [step["run"] for step in job["steps"] if "run" in step]


def test_what_must_hold_is_run_on_the_oldest_and_the_newest_python() -> None:
    versions = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if ":: Python :: 3." in c]
    job = JOBS["run"]
    assert job["strategy"]["matrix"] == {"python": [versions[0], versions[-1]]}
    assert PROJECT["requires-python"] == f">={versions[0]}"
    assert commands(job) == ["bash .ci/run"]
    assert "${{ matrix.python }}" in [step.get("with", {}).get("python-version") for step in job["steps"]]


def test_each_library_without_wheels_everywhere_is_left_out_once() -> None:
    marked = {r.name for r in map(Requirement, PROJECT["dependencies"]) if r.marker is not None}
    job = JOBS["without"]
    assert set(job["strategy"]["matrix"]["library"]) == marked
    assert commands(job) == ["bash .ci/without ${{ matrix.library }}"]


def test_the_slow_tests_are_run_by_the_clock() -> None:
    (workflow,) = [own for own in WORKFLOWS if "slow" in own["jobs"]]
    assert workflow["on"]["schedule"]
    assert commands(workflow["jobs"]["slow"]) == ["bash .ci/slow"]
    assert " -m slow" in (ROOT / ".ci/slow").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", EVERY_PYTHON)
def test_what_every_python_runs_is_there(name: str) -> None:
    assert (ROOT / "tests" / name).exists()


@pytest.mark.parametrize("job", JOBS.values(), ids=JOBS.keys())
def test_a_job_calls_scripts_of_the_repository_and_ends(job: dict[str, Any]) -> None:
    assert job["timeout-minutes"] <= 90
    assert job["steps"][0]["uses"].startswith("actions/checkout@")
    for command in commands(job):
        assert ROOT / command.split()[1] in SCRIPTS


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_a_script_can_be_run_and_is_read_by_its_shell(script: Path) -> None:
    assert os.access(script, os.X_OK)
    subprocess.run(["bash", "-n", str(script)], check=True, timeout=600)
