"""The page about sweeps: every block of Python runs, and prints what stands below it; the file is a sweep file."""

from __future__ import annotations

import re
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from henon_ref.sweeps.sweep_file import load_sweep

PAGE = Path(__file__).parents[2] / "docs" / "sweep.md"
BLOCK = re.compile(r"```python\n(?P<code>.*?)```\n(?:\n```text\n(?P<shown>.*?)```\n)?", re.DOTALL)


def test_every_block_prints_what_the_page_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text(encoding="utf-8")
    names: dict[str, object] = {}
    blocks = list(BLOCK.finditer(text))
    assert len(blocks) == text.count("```python") >= 5
    for block in blocks:
        printed = StringIO()
        with redirect_stdout(printed):
            exec(compile(block["code"], str(PAGE), "exec"), names)
        assert printed.getvalue() == (block["shown"] or ""), block["code"]
    assert (tmp_path / "bifurcation.png").stat().st_size > 0


def test_the_file_that_the_page_shows_is_read(tmp_path: Path) -> None:
    (shown,) = re.findall(r"```yaml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    path = tmp_path / "belts.yaml"
    path.write_text(shown)
    plan = load_sweep(path).plan
    assert (len(plan.points), plan.chunk) == (40_000, 1000)
