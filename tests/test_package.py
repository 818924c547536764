"""The package itself: importing it is cheap, and its names are there on first use."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from textwrap import dedent

import pytest

import henon_ref
from henon_ref.henon.solvers import HENON_SOLVER
from henon_ref.model.case import parse_case

ROOT = Path(__file__).parent.parent

HEAVY = ("numpy", "sympy", "pandas", "numba", "pydantic", "ruamel.yaml", "matplotlib", "heyoka", "typer")


def fresh(code: str) -> str:
    """What a new interpreter prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.mark.parametrize("module", ["henon_ref", "henon_ref.cachefolder"])
def test_importing_the_package_loads_nothing_heavy(module: str) -> None:
    """Nor does settling which folder is the cache, which a command does first."""
    assert fresh(f"import sys, {module}; print([m for m in {HEAVY} if m in sys.modules])") == "[]"


def test_compiling_does_without_the_library_of_linear_algebra() -> None:
    """numba looks for a BLAS by importing all of scipy.linalg, which nothing here needs; who does still finds it."""
    code = """
import sys
import numpy as np
from henon_ref.henon import loading
loading.load(None)
before = "scipy.linalg" in sys.modules
import numba
print(before, numba.njit(lambda a: a @ a)(np.eye(2)).trace(), "scipy.linalg" in sys.modules)
"""
    assert fresh(code) == "False 2.0 True"


def test_reading_a_truth_does_not_load_what_proves_it() -> None:
    code = "import sys, henon_ref.truth; print([m for m in sys.modules if m.startswith('henon_ref.truth.certified')])"
    assert fresh(code) == "[]"


@pytest.mark.parametrize("name", henon_ref.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert callable(getattr(henon_ref, name))
    assert name in dir(henon_ref)


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = henon_ref.no_such_name


@pytest.mark.parametrize("before", ["", "from henon_ref.report.arguments import app; import henon_ref.compare; "])
def test_compare_is_the_function_whoever_imported_the_command_first(before: str) -> None:
    """``henon_ref.compare(case)`` works although the command's module has the same name."""
    code = f"{before}import henon_ref\ntry: henon_ref.compare()\nexcept TypeError as e: print(e)"
    assert fresh(code) == "compare() missing 1 required positional argument: 'case'"


def test_the_case_that_readme_shows_runs_and_sticks() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = text[text.index("    schema: 1\n") : text.index("    .venv/bin/python -m henon_ref.compare my_belt.yaml")]
    case = parse_case(dedent(shown))
    run = HENON_SOLVER.prepare(case.readings[0].problem, rtol=1e-12)()
    assert run.status == "ok"
    assert {"stick", "release"} <= {t.kind for t in run.transitions}
