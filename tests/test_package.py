"""The package itself: importing it is cheap, and its names are there on first use."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path
from textwrap import dedent
from typing import Any

import pytest

import henon_ref
from henon_ref.casefile.case import parse_case
from henon_ref.henon.solver import HENON_SOLVER

ROOT = Path(__file__).parent.parent

HEAVY = ("numpy", "sympy", "pandas", "numba", "pydantic", "ruamel.yaml", "matplotlib", "heyoka", "typer")


def fresh(code: str) -> str:
    """What a new interpreter prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.mark.parametrize("module", ["henon_ref", "henon_ref.jit.cache_folder"])
def test_importing_the_package_loads_nothing_heavy(module: str) -> None:
    """Nor does settling which folder is the cache, which a command does first."""
    assert fresh(f"import sys, {module}; print([m for m in {HEAVY} if m in sys.modules])") == "[]"


def test_reading_a_truth_does_not_load_what_proves_it() -> None:
    code = "import sys, henon_ref.truth; print([m for m in sys.modules if m.startswith('henon_ref.truth.validated')])"
    assert fresh(code) == "[]"


@pytest.mark.parametrize("name", henon_ref.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert callable(getattr(henon_ref, name))
    assert name in dir(henon_ref)


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = henon_ref.no_such_name


def test_compare_is_a_function_although_the_command_has_the_same_name() -> None:
    """``python -m henon_ref.compare`` is a file that nobody imports: it would take the function's place."""
    assert inspect.isfunction(henon_ref.compare)
    assert "case" in inspect.signature(henon_ref.compare).parameters
    code = "import henon_ref.cli.compare, henon_ref, inspect; print(inspect.isfunction(henon_ref.compare))"
    assert fresh(code) == "True"


def test_importing_the_library_sets_no_environment_variable() -> None:
    code = (
        "import os; before = dict(os.environ); import henon_ref; henon_ref.compare; print(dict(os.environ) == before)"
    )
    assert fresh(code) == "True"


def test_the_case_that_readme_shows_runs_and_sticks() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = text[text.index("    schema: 1\n") : text.index("    .venv/bin/python -m henon_ref.compare my_belt.yaml")]
    case = parse_case(dedent(shown))
    run = HENON_SOLVER.prepare(case.readings[0].problem, rtol=1e-12)()
    assert run.status == "ok"
    assert {"stick", "release"} <= {t.kind for t in run.transitions}


def test_the_run_and_the_sweep_that_readme_shows_run() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    section = text[text.index("## One run, or a million") : text.index("A system is compiled once")]
    found: dict[str, Any] = {}
    exec(dedent(section.partition("\n")[2]), found)
    assert found["run"].status == "ok"
    assert len(found["run"].sticks) > 0
    assert list(found["table"]["status"]) == ["ok"] * 1000
