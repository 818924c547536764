"""``docs/solvers.md`` says of each library what the code does; ``docs/which_solver.md`` shows the stored rows."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from henon_ref.harness import registry

PAGE = Path(__file__).parents[1] / "docs" / "solvers.md"


def test_the_page_has_the_default_restart_of_every_library_that_runs_by_default() -> None:
    text = PAGE.read_text(encoding="utf-8")
    told = dict(re.findall(r"^\| `([a-z0-9-]+)` \| `([a-z-]+)` \|$", text, re.MULTILINE))
    defaults = {name: registry.restart_of(name) for name in registry.default_names() if registry.restart_of(name)}
    assert told == defaults


def test_every_section_links_to_the_library_s_own_documentation() -> None:
    sections = PAGE.read_text(encoding="utf-8").split("\n## ")[1:]
    assert len(sections) >= 3
    assert all(re.search(r"\]\(https://", section) for section in sections)


def test_which_solver_shows_the_table_of_the_committed_matrix(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(PAGE.parent))
    page = runpy.run_path(str(PAGE.parent / "which_solver.py"))["page"]
    text = (PAGE.parent / "which_solver.md").read_text(encoding="utf-8")
    assert text.count("| **[") >= 6
    assert text == page(), "run python docs/which_solver.py"
