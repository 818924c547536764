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

from henon_ref import registry
from henon_ref.casefile.files import case_files
from henon_ref.cli import arguments
from henon_ref.cli.ci_files import KNOWN_COLUMNS, read_known

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
    (line,) = [step["run"] for step in steps if "henon_ref.compare" in step.get("run", "")]
    words = shlex.split(line)
    assert words[:3] == ["python", "-m", "henon_ref.compare"]
    request = typer.main.get_command(arguments.app).main(words[3:], standalone_mode=False)
    assert request.required == request.solvers == ("my-solver",)
    assert (request.junit, request.baseline, request.known) == (
        Path("results/henon_ref.xml"), Path("ci/runs"), Path("ci/known.csv"),
    )  # fmt: skip
    assert request.junit.parent == request.out
    (upload,) = [step["with"]["path"] for step in steps if "upload" in step.get("uses", "")]
    assert Path(upload) == request.out
    (clone,) = [shlex.split(step["run"])[-1] for step in steps if "git clone" in step.get("run", "")]
    (cases,) = request.cases
    assert case_files(ROOT / cases.relative_to(clone))


def test_every_option_on_the_page_is_one(capsys):
    options = {name for parameter in typer.main.get_command(arguments.app).params for name in parameter.opts}
    named = set(re.findall(r"--[a-z][a-z-]+", PAGE)) - {"--depth"}
    assert {"--require", "--gate", "--baseline", "--known", "--junit"} <= named
    flags = {f"--no-{name[2:]}" for name in options}
    assert named <= options | flags


def test_the_known_failures_on_the_page_are_read_and_reported_as_it_says(
    tmp_path, made_up_solvers, made_up, monkeypatch, capsys
):
    path = tmp_path / "known.csv"
    path.write_text(block("csv"))
    first, _ = read_known(path)
    assert (first.case, first.solver, first.rtol, first.status) == ("two_roots", "my-solver", 1e-3, "wrong")
    assert all(f"`{column}`" in PAGE for column in KNOWN_COLUMNS)
    monkeypatch.setattr(registry, "solver", {"henon": Fake("henon"), "heyoka": Fake("heyoka", "misses")}.__getitem__)
    text = block("csv").replace("my-solver", "heyoka").replace("two_roots", "made_up")
    path.write_text(text.replace("sawtooth,,heyoka", "made_up,,henon"))
    assert run(made_up, "--tolerances", "1e-3", "--known", "known.csv") == 0
    told = capsys.readouterr().err.splitlines()
    for line, example in zip(told, re.findall(r"^    (known: .*)", PAGE, re.MULTILINE), strict=True):
        own = example.replace("ci/", "").replace("two_roots", "made_up").replace("my-solver", "heyoka")
        assert line.startswith(own.split(" (2 missed")[0])


def test_what_a_worse_row_is_reported_by_is_as_on_the_page(tmp_path, made_up_solvers, made_up, monkeypatch, capsys):
    given = [made_up, "--solvers", "heyoka", "--tolerances", "1e-6"]
    monkeypatch.setattr(registry, "solver", {"heyoka": Fake("heyoka")}.__getitem__)
    assert run(*given, "--out", "before") == 0
    monkeypatch.setattr(registry, "solver", {"heyoka": Fake("heyoka", "misses")}.__getitem__)
    assert run(*given, "--baseline", "before") == 1
    (example,) = re.findall(r"^    (baseline: .*): release at", PAGE, re.MULTILINE)
    own = example.replace("leaving_slide", "made_up").replace("my-solver", "heyoka")
    assert capsys.readouterr().err.splitlines()[-1].startswith(own)
