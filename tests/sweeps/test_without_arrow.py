"""Without pyarrow a sweep runs in memory; what needs files says in one sentence what to install."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from sweep_systems import belt

import henon_ref as hr


@pytest.fixture(autouse=True)
def _without_arrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)  # type: ignore[arg-type]


def test_a_sweep_in_memory_needs_no_pyarrow() -> None:
    table = hr.sweep(belt(), {"x": 1, "v": 0}, until=5, grid={"vb": [0.1, 0.2]}, observe=[hr.observe.final_state()])
    assert list(table["status"]) == ["ok", "ok"]


def test_a_folder_or_a_table_of_points_names_the_extra_and_nothing_is_written(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with pytest.raises(hr.UnavailableError, match=r"^a sweep with a folder needs pyarrow.*'henon-ref\[sweep\]'$"):
        hr.sweep(belt(), {"x": 1, "v": 0}, until=5, grid={"vb": [0.1]}, observe=[hr.observe.final_state()], out=out)
    assert not out.exists()
    (tmp_path / "points.csv").write_text("vb\n0.1\n")
    with pytest.raises(hr.UnavailableError, match=r"^a table of points needs pyarrow"):
        hr.points.table(tmp_path / "points.csv")
