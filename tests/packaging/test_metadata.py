"""What the package says of itself: dependencies that are used, bounds and machines that are tried, one version."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from ruamel.yaml import YAML

import henon_ref
from build_backend.libraries import installed

ROOT = Path(__file__).parents[2]
WRITTEN: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT: dict[str, Any] = WRITTEN["project"]


def extra(name: str) -> list[Requirement]:
    """What an extra asks for, other extras of this package aside."""
    asked = map(Requirement, PROJECT["optional-dependencies"][name])
    return [requirement for requirement in asked if requirement.name != PROJECT["name"]]


REQUIREMENTS = [Requirement(text) for text in PROJECT["dependencies"]]
EXTRAS = [*extra("sweep"), *extra("numba"), *extra("peers")]
TESTS = extra("test")
LIBRARY = [Requirement(text) for text in WRITTEN["dependency-groups"]["library"]]
ROOMS = [own for own in (ROOT / "henon_ref").iterdir() if own.name not in ("harness", "baselines", "commands")]
"""Rooms and files of the library, the doors to commands among them."""
COMMANDS = {"typer", "jinja2", "pydantic"}
"""What the commands need besides: their arguments, a sweep's page, a comparison's stored truths."""
MODULES = {
    "scikit-sundae": "sksundae",
    "python-flint": "flint",
    "ruamel.yaml": "ruamel",
    "markdown-it-py": "markdown_it",
    "axe-playwright-python": "axe_playwright_python",
}
"""Package -> module, where the names differ."""
PARALLEL = "pytest-xdist"
"""A plugin of pytest that nothing imports: README's test command asks for it."""
DOI = "10.1007/s11071-013-0826-7"


@cache
def imported(*places: str | Path) -> frozenset[str]:
    """Top-level modules that some files, and the code below some folders, import."""
    found: set[str] = set()
    paths = [ROOT / place for place in places]
    for file in (file for path in paths for file in ([path] if path.suffix == ".py" else path.rglob("*.py"))):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {name.name.partition(".")[0] for name in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                found.add(node.module.partition(".")[0])
    return frozenset(found)


@pytest.mark.parametrize("requirement", [*REQUIREMENTS, *EXTRAS], ids=lambda r: r.name)
def test_every_dependency_is_imported(requirement: Requirement) -> None:
    assert MODULES.get(requirement.name, requirement.name) in imported("henon_ref", "baselines")


@pytest.mark.parametrize("requirement", TESTS, ids=lambda r: r.name)
def test_every_dependency_of_the_tests_is_imported(requirement: Requirement) -> None:
    if requirement.name == PARALLEL:
        assert "pytest -q -n 2\n" in (ROOT / "README.md").read_text(encoding="utf-8")
    elif requirement.name != "setuptools":  # a program imports it that a test below writes
        assert MODULES.get(requirement.name, requirement.name) in imported("tests")


@pytest.mark.parametrize("requirement", LIBRARY, ids=lambda r: r.name)
def test_the_group_lists_what_the_library_imports(requirement: Requirement) -> None:
    assert requirement in REQUIREMENTS
    imports = imported(*ROOMS)
    assert requirement.name in COMMANDS or MODULES.get(requirement.name, requirement.name) in imports


def test_the_library_imports_no_more_than_the_group_lists() -> None:
    listed = {MODULES.get(requirement.name, requirement.name) for requirement in LIBRARY}
    needed = imported(*ROOMS) - set(sys.stdlib_module_names) - {"henon_ref"}
    assert needed - listed == {"pyarrow", "IPython"}  # the extra sweep; a notebook has the other


def test_the_lowest_versions_that_are_tried_are_the_bounds() -> None:
    lines = (ROOT / "constraints-lowest.txt").read_text(encoding="utf-8").splitlines()
    tried = dict(line.lower().split("==") for line in lines if line and not line.startswith("#"))
    for requirement in [*REQUIREMENTS, *TESTS, *EXTRAS]:
        assert re.fullmatch(r">=[0-9.]+", str(requirement.specifier))
        bound = str(requirement.specifier).removeprefix(">=")
        assert re.fullmatch(re.escape(bound) + r"(\.0)*", tried.pop(requirement.name.lower())), requirement.name
    assert not tried


@pytest.mark.parametrize(
    ("system", "processor", "asked"),
    [
        ("linux", "x86_64", {"heyoka", "scikit-sundae"}),
        ("linux", "aarch64", {"heyoka"}),
        ("darwin", "arm64", {"scikit-sundae"}),
        ("darwin", "x86_64", {"scikit-sundae"}),
        ("win32", "AMD64", {"scikit-sundae"}),
        ("win32", "ARM64", set()),
        ("linux", "riscv64", set()),
    ],
)
def test_libraries_are_asked_for_where_they_have_wheels(system: str, processor: str, asked: set[str]) -> None:
    machine = {"sys_platform": system, "platform_machine": processor}
    marked = {r.name: r.marker for r in REQUIREMENTS if r.marker is not None}
    assert set(marked) == {"heyoka", "scikit-sundae"}
    for version in ("3.11", "3.14"):
        environment = machine | {"python_version": version}
        assert {name for name, marker in marked.items() if marker.evaluate(environment)} == asked


def test_there_is_one_version() -> None:
    assert PROJECT["version"] == henon_ref.__version__
    assert citation()["version"] == henon_ref.__version__
    assert f"## {henon_ref.__version__}\n" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_conda_recipe_asks_for_the_same() -> None:
    recipe = YAML(typ="safe").load((ROOT / ".ci/conda/recipe.yaml").read_text(encoding="utf-8"))
    assert recipe["context"]["version"] == henon_ref.__version__
    run = [line["then"] if isinstance(line, dict) else line for line in recipe["requirements"]["run"]]
    names = {"heyoka": "heyoka.py", "matplotlib": "matplotlib-base"}
    asked = {f"{names.get(own.name, own.name)} {own.specifier}" for own in REQUIREMENTS}
    assert set(run) == asked | {f"python {PROJECT['requires-python']}"}


def citation() -> dict[str, Any]:
    return dict(YAML(typ="safe").load((ROOT / "CITATION.cff").read_text(encoding="utf-8")))


def test_the_paper_is_cited_by_its_doi() -> None:
    paper = citation()["references"][0]
    assert {key: paper[key] for key in ("doi", "journal", "volume", "start", "end", "year")} == {
        "doi": DOI, "journal": "Nonlinear Dynamics", "volume": 73, "start": 723, "end": 736, "year": 2013,
    }  # fmt: skip
    assert PROJECT["urls"]["Paper"] == f"https://doi.org/{DOI}"


def test_all_folders_of_the_package_and_the_cases_are_in_a_wheel() -> None:
    """setup.py, asked for its packages: every folder with a file that git keeps is one, all inside henon_ref."""
    pytest.importorskip("setuptools.command.bdist_wheel")
    done = subprocess.run(
        [sys.executable, "-c", ASK], cwd=ROOT, capture_output=True, text=True, check=True, timeout=600
    )
    packages = set(done.stdout.split())
    files = [file for top in ("henon_ref", "baselines", "cases") for file in (ROOT / top).rglob("*.*")]
    suffixes = (".py", ".j2", ".html", ".css", ".js", ".yaml", ".json")
    kept = [f.parent.relative_to(ROOT).as_posix() for f in files if f.suffix in suffixes]
    assert {installed(folder).as_posix().replace("/", ".") for folder in kept} <= packages
    assert "henon_ref.cases.truth.fig8" in packages
    assert {package.split(".")[0] for package in packages} == {"henon_ref"}


ASK = """
import setuptools
setuptools.setup = lambda packages, **_: print(*packages)
exec(open("setup.py").read())
"""
