"""``docs/solvers.md`` says of each library what the code does."""

from __future__ import annotations

import re
from pathlib import Path

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
