"""The page about sweeps: the file that it shows is a sweep file."""

from __future__ import annotations

import re
from pathlib import Path

from henon_ref.sweeps.sweep_file import load_sweep

PAGE = Path(__file__).parents[2] / "docs" / "sweep.md"


def test_the_file_that_the_page_shows_is_read(tmp_path: Path) -> None:
    (shown,) = re.findall(r"```yaml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    path = tmp_path / "belts.yaml"
    path.write_text(shown)
    plan = load_sweep(path).plan
    assert (len(plan.points), plan.chunk) == (40_000, 1000)
