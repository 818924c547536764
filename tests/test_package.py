"""The package itself: importing it is cheap, and its names are there on first use."""

from __future__ import annotations

import inspect
import re
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from doc_pages import blocks

import henon_ref
from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import parse_case

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"

HEAVY = ("numpy", "scipy", "sympy", "pandas", "numba", "pydantic", "ruamel.yaml", "matplotlib", "heyoka", "typer")


def fresh(code: str) -> str:
    """What a new interpreter prints."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.mark.parametrize("module", ["henon_ref", "henon_ref.jit.cache_folder"])
def test_importing_the_package_loads_nothing_heavy(module: str) -> None:
    """Nor does settling which folder is the cache, which a command does first."""
    assert fresh(f"import sys, {module}; print([m for m in {HEAVY} if m in sys.modules])") == "[]"


def test_the_library_runs_without_numba() -> None:
    """Single runs, sweeps and runs at exact numbers: what is compiled is C, and machine code of modes by llvmlite."""
    code = (
        "import sys; sys.modules['numba'] = None; import henon_ref as hr\n"
        "belt = hr.System(['x', 'v'], {'F': 1}, {'s': 'v - 1/5'}, ['v', '-x - F*s'])\n"
        "one = hr.simulate(belt, {'x': 2, 'v': 0}, until=9)\n"
        "seen = [hr.observe.final_state()]\n"
        "many = hr.sweep(belt, {'x': 2, 'v': 0}, until=9, grid={'F': [1, 2]}, observe=seen, jobs=1)\n"
        "print(one.status, len(many))"
    )
    assert fresh(code) == "ok 2"


def test_reading_a_truth_does_not_load_what_proves_it() -> None:
    code = (
        "import sys, henon_ref.harness.truth; print([m for m in sys.modules if m.startswith('henon_ref.enclosure.')])"
    )
    assert fresh(code) == "[]"


@pytest.mark.parametrize("name", henon_ref.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert callable(getattr(henon_ref, name))
    assert name in dir(henon_ref)


def test_a_name_that_is_not_there_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = henon_ref.no_such_name


def test_the_command_s_module_is_not_imported_and_takes_no_function_s_place() -> None:
    """``python -m henon_ref.compare`` is a file that nobody imports: it would take the function's place."""
    assert inspect.isfunction(henon_ref.compare)
    assert "case" in inspect.signature(henon_ref.compare).parameters
    code = (
        "import os; before = dict(os.environ)\n"
        "import henon_ref.harness.cli.compare, henon_ref.sweeps.sweep, henon_ref as hr\n"
        "try:\n    import henon_ref.compare\n"
        "except ImportError as error:\n    print(error)\n"
        "print(type(hr.sweep).__name__, type(hr.compare).__name__, hr.observe.__name__, dict(os.environ) == before)"
    )
    command, kinds = fresh(code).split("\n")
    assert "python -m henon_ref.compare" in command
    assert kinds == "function function henon_ref.sweeps.observe True"


def test_workers_that_are_spawned_may_import_the_command_s_module() -> None:
    """They import it as ``__mp_main__``: if it refused that, every worker would end."""
    assert runpy.run_module("henon_ref.compare", run_name="__mp_main__")["__name__"] == "__mp_main__"


def shown(language: str) -> str:
    """The one block of README in a language."""
    (found,) = [block.code for block in blocks(README.read_text(encoding="utf-8")) if block.language == language]
    return found


def test_the_case_that_readme_shows_runs_and_sticks() -> None:
    case = parse_case(shown("yaml"))
    run = HENON_SOLVER.prepare(case.readings[0].problem, rtol=1e-12)()
    assert run.status == "ok"
    assert {"stick", "release"} <= {t.kind for t in run.transitions}


def test_the_run_and_the_sweep_that_readme_shows_run() -> None:
    found: dict[str, Any] = {}
    exec(shown("python"), found)
    assert found["run"].status == "ok"
    assert len(found["run"].sticks) > 0
    assert list(found["table"]["status"]) == ["ok"] * 1000


def test_readme_is_short_and_has_the_lines_that_ci_and_a_reader_take_from_it() -> None:
    text = README.read_text(encoding="utf-8")
    assert len(text.split()) <= 900
    lines = [line for line in text.splitlines() if line.startswith("python3 -m venv ")]
    assert [line.rpartition("python -m ")[2] for line in lines] == [
        "henon_ref.compare cases/fig8.yaml", "pytest -q -n 2",
    ]  # fmt: skip
    report = (ROOT / "reports/fig8/report.md").read_text(encoding="utf-8")
    begin = text.index("| digits | cheapest")
    table = text[begin : text.index("\n\n", begin)]
    assert table in report, "README shows a table that is no longer that of reports/fig8"


def test_files_that_comments_in_c_and_the_architecture_page_name_are_there() -> None:
    sources = [*ROOT.glob("henon_ref/kernel/*.[ch]"), *ROOT.glob("baselines/paper/*.[ch]")]
    named = {name for path in sources for name in re.findall(r"\w+(?:/\w+)+\.(?:py|c|h)\b", path.read_text("utf-8"))}
    page = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    named |= set(re.findall(r"`(\w+(?:/[\w.]+)+)`", page))
    assert len(named) > 100
    places = [ROOT, ROOT / "henon_ref", ROOT / "henon_ref" / "harness"]
    known = {name for name in named for place in places for end in ("", ".py") if (place / f"{name}{end}").exists()}
    assert named - known == set()
