"""docs/ci.md: its workflow is one, its commands have options that there are, its examples are read and told so."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import typer
from commands import run
from fakes import Fake
from ruamel.yaml import YAML

from henon_ref.casefile.files import case_files
from henon_ref.harness import registry
from henon_ref.harness.cli import compare as compare_command
from henon_ref.harness.cli import gate
from henon_ref.harness.score.gate import KnownFailure

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "ci.md").read_text()


def block(language: str) -> str:
    (found,) = re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    return found


@pytest.fixture
def steps() -> list[dict[str, object]]:
    workflow = YAML(typ="safe").load(block("yaml"))
    assert set(workflow) == {"name", "on", "jobs"}
    (job,) = workflow["jobs"].values()
    assert set(job) == {"runs-on", "steps"}
    return job["steps"]


def test_the_workflow_has_steps_that_use_or_run_something(steps):
    for step in steps:
        assert ("uses" in step) != ("run" in step)
        assert set(step) <= {"name", "uses", "with", "run", "env", "if"}


def test_the_workflow_runs_the_command_with_options_that_there_are(steps):
    compare, held = [shlex.split(step["run"]) for step in steps if " results" in str(step.get("run", ""))]
    assert compare[:3] == ["python", "-m", "henon_ref.compare"]
    request = typer.main.get_command(compare_command.app).make_context("compare", compare[3:]).params
    assert request["solvers"] == "my-solver"
    assert held[:3] == ["henon-ref", "gate", str(request["out"])]
    given = typer.main.get_command(gate.app).make_context("gate", held[2:]).params
    assert given["require"] == "my-solver"
    assert (given["junit"], given["baseline"], given["known"]) == (
        Path("results/henon_ref.xml"), Path("ci/runs"), Path("ci/known.csv"),
    )  # fmt: skip
    assert given["junit"].parent == request["out"]
    (upload,) = [step["with"]["path"] for step in steps if "upload" in step.get("uses", "")]
    assert Path(upload) == request["out"]
    (clone,) = [shlex.split(step["run"])[-1] for step in steps if "git clone" in step.get("run", "")]
    (cases,) = request["cases"]
    assert case_files(ROOT / cases.relative_to(clone))


def test_every_option_on_the_page_is_one():
    commands = map(typer.main.get_command, (compare_command.app, gate.app))
    options = {name for command in commands for parameter in command.params for name in parameter.opts}
    named = set(re.findall(r"--[a-z][a-z-]+", PAGE)) - {"--depth"}
    assert {"--require", "--gate", "--baseline", "--known", "--junit"} <= named
    flags = {f"--no-{name[2:]}" for name in options}
    assert named <= options | flags


@pytest.fixture
def report(made_up_solvers, made_up, monkeypatch, capsys) -> list[str]:
    """A report of a solver that is wrong, and how the gate is asked about it."""
    monkeypatch.delenv(gate.SUMMARY, raising=False)
    monkeypatch.setattr(registry, "solver", {"henon": Fake("henon"), "heyoka": Fake("heyoka", "misses")}.__getitem__)
    assert run(made_up, "--tolerances", "1e-3") == 0
    capsys.readouterr()
    return ["out/made_up"]


def test_the_known_failures_on_the_page_are_read_and_told_as_it_says(tmp_path, report, capsys):
    path = tmp_path / "known.csv"
    path.write_text(block("csv"))
    first, _ = gate.read_known(path)
    assert (first.case, first.solver, first.rtol, first.status) == ("two_roots", "my-solver", 1e-3, "wrong")
    assert all(f"`{column}`" in PAGE for column in KnownFailure.columns())
    text = block("csv").replace("my-solver", "heyoka").replace("two_roots", "made_up")
    path.write_text(text.replace("sawtooth,,heyoka", "made_up,,henon"))
    gate.command([*report, "--known", "known.csv"])
    told = [line for line in capsys.readouterr().err.splitlines() if line.startswith("known: ")]
    for line, example in zip(told, re.findall(r"^    (known: .*)", PAGE, re.MULTILINE), strict=True):
        own = example.replace("sawtooth, solver my-solver", "made_up, solver henon")
        own = own.replace("two_roots", "made_up").replace("my-solver", "heyoka")
        assert line.startswith(own.split(" (2 missed")[0])


def test_what_a_worse_row_is_told_by_is_as_on_the_page(tmp_path, report, capsys):
    text = (tmp_path / "out/made_up/runs.csv").read_text()
    row = "made_up,default,heyoka,0.001,,ok,1e-9\n"
    (tmp_path / "before.csv").write_text(f"case,reading,solver,rtol,step_s,status,max_time_error_s\n{row}")
    assert "heyoka" in text
    assert gate.command([*report, "--baseline", "before.csv"]) == 1
    (example,) = re.findall(r"^    (baseline: .*): release at", PAGE, re.MULTILINE)
    own = example.replace("leaving_slide", "made_up").replace("my-solver", "heyoka").replace("1e-06", "0.001")
    assert any(line.startswith(own) for line in capsys.readouterr().err.splitlines())
