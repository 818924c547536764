"""The folder: whole files or none, the same bytes after an interrupt, one error where nothing can be written."""

from __future__ import annotations

import errno
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from sweep_systems import assert_same, belt, collected, parquet_files

from henon_ref.errors import ArgumentError, CaseError
from henon_ref.sweeps import observe, storage
from henon_ref.sweeps.points import Points
from henon_ref.sweeps.storage import SweepFolder
from henon_ref.sweeps.sweep import SweepTable, sweep
from henon_ref.sweeps.sweep_file import load_sweep


def swept(out: Path | None, **how: Any) -> SweepTable:
    arguments = {"chunk": 3, "jobs": 1, "grid": {"vb": np.linspace(0.05, 1, 11)}, **how}
    return sweep(
        belt(),
        {"x": 1.5, "v": 0},
        until=50,
        observe=[observe.sticks(after=40), observe.final_state(), observe.section("x", after=40)],
        rtol=1e-9,
        out=out,
        **arguments,
    )


def test_the_files_hold_the_table(tmp_path: Path) -> None:
    table = swept(tmp_path / "out")
    files = sorted((tmp_path / "out" / "points").glob("*.parquet"))
    assert len(files) == 4
    read = pd.read_parquet(tmp_path / "out" / "points")
    assert list(read.columns) == ["point", *table.columns]
    assert read["point"].tolist() == list(range(11))
    assert np.array_equal(read["final_x"], table["final_x"])
    assert read["last_stick_duration"].isna().tolist() == table["last_stick_duration"].isna().tolist()
    section = pd.read_parquet(tmp_path / "out" / "section")
    assert np.array_equal(section["time_s"], table.frames["section"]["time_s"])


def test_resuming_writes_no_finished_chunk_again(tmp_path: Path) -> None:
    whole = swept(tmp_path / "out")
    before = parquet_files(tmp_path / "out")
    lost = tmp_path / "out" / "points" / "000001.parquet"
    lost.unlink()
    broken = tmp_path / "out" / "points" / "000003.parquet"
    broken.write_bytes(b"PAR1")
    kept = {p: p.stat().st_mtime_ns for p in (tmp_path / "out").rglob("*.parquet") if p.stem in ("000000", "000002")}
    assert_same(swept(tmp_path / "out", resume=True), whole)
    assert parquet_files(tmp_path / "out") == before
    assert kept == {p: p.stat().st_mtime_ns for p in kept}


def test_another_sweep_is_not_resumed_but_replaced(tmp_path: Path) -> None:
    swept(tmp_path / "out")
    other = {"vb": np.linspace(0.05, 1, 5)}
    with pytest.raises(CaseError, match="a different sweep"):
        swept(tmp_path / "out", resume=True, grid=other)
    swept(tmp_path / "out", grid=other)
    assert len(pd.read_parquet(tmp_path / "out" / "points")) == 5


def test_only_a_sweep_with_a_folder_is_resumed() -> None:
    with pytest.raises(ArgumentError, match="resume requires out"):
        swept(None, resume=True)


def test_a_folder_of_other_things_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("...")
    with pytest.raises(CaseError, match="but no sweep"):
        swept(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_full_disk_is_one_error_and_the_rest_can_be_resumed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = swept(tmp_path / "whole")
    real, written = storage.os.fsync, []

    def full(descriptor: int) -> None:
        written.append(descriptor)
        if len(written) > 6:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(descriptor)

    monkeypatch.setattr(storage.os, "fsync", full)
    with pytest.raises(CaseError, match="No space left on device; finished chunks are kept"):
        swept(tmp_path / "out")
    for file in (tmp_path / "out").rglob("*.parquet"):
        pd.read_parquet(file)
    assert not list((tmp_path / "out").rglob("*.part"))
    monkeypatch.setattr(storage.os, "fsync", real)
    assert_same(swept(tmp_path / "out", resume=True), whole)
    assert parquet_files(tmp_path / "out") == parquet_files(tmp_path / "whole")


def test_a_chunk_counts_once_its_points_are_there(tmp_path: Path) -> None:
    """They are written last: a table of its own that was written before is written again."""
    swept(tmp_path / "out")
    place = SweepFolder(tmp_path / "out", load_sweep(tmp_path / "out" / "sweep.yaml"))
    assert [number for number, _ in place.finished()] == [0, 1, 2, 3]
    (tmp_path / "out" / "points" / "000002.parquet").unlink()
    assert (tmp_path / "out" / "section" / "000002.parquet").exists()
    assert [number for number, _ in place.finished()] == [0, 1, 3]


def test_what_stands_beside_the_results_runs_the_sweep_again(tmp_path: Path) -> None:
    table = swept(tmp_path / "out")
    again = collected(load_sweep(tmp_path / "out" / "sweep.yaml"))
    assert_same(again, table)
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["rerun"] == "henon-ref sweep sweep.yaml --out again"
    assert manifest["points"] == 11


@pytest.mark.parametrize(
    "grid",
    [
        pd.DataFrame({"vb": [0.1, 0.30000000000000004]}),
        {"vb": np.linspace(0.05, 1, 5001)},
        Points(("vb",), np.array([[0.1], [0.2]])),
    ],
    ids=["frame", "long", "by hand"],
)
def test_a_table_of_points_stands_beside_them(tmp_path: Path, grid: Any) -> None:
    arguments = {"until": 1, "observe": [observe.final_state()], "jobs": 1}
    table = sweep(belt(), {"x": 1.5, "v": 0}, grid=grid, out=tmp_path / "out", **arguments)
    assert (tmp_path / "out" / "points.csv").exists()
    assert_same(collected(load_sweep(tmp_path / "out" / "sweep.yaml")), table)
