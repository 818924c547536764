"""Nothing is removed or replaced but what a sweep has written, as the manifest of its folder says."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from sweep_systems import SWEEP, assert_same, sliding_block

import henon_ref as hr
from henon_ref.errors import HenonRefError
from henon_ref.harness.cli.main import sweep_program as program
from henon_ref.harness.report.folder import FolderLock
from henon_ref.sweeps.storage import KEY, SweepFolder, owned
from henon_ref.sweeps.sweep import assembled
from henon_ref.sweeps.sweep_file import load_sweep


def swept(out: Path, **how: Any) -> Any:
    arguments: dict[str, Any] = {
        "until": 9, "grid": {"F": [0.5, 1, 2]}, "observe": [hr.observe.section("v"), hr.observe.final_state()],
        "chunk": 1, "jobs": 1, **how,
    }  # fmt: skip
    return hr.sweep(sliding_block(), {"x": 0, "v": 1}, out=out, **arguments)


def content(folder: Path) -> dict[str, Any]:
    """Every file below a folder, and where every link leads."""
    return {
        str(path.relative_to(folder)): path.readlink() if path.is_symlink() else path.read_bytes()
        for path in folder.rglob("*")
        if path.is_symlink() or path.is_file()
    }


@pytest.mark.parametrize(
    "manifest",
    [
        '{"name": "a web application"}',
        '{"content": "abc", "points": 3, "chunk": 1}',  # as earlier versions wrote it
        "[1, 2]",
        "[" * 100_000,
        "not JSON",
        b"\xff\xfe",
        json.dumps({KEY: {"content": 1, "chunks": 3, "tables": [], "files": []}}),
        json.dumps({KEY: {"content": "a", "chunks": 3, "tables": ["../customers"], "files": []}}),
        json.dumps({KEY: {"content": "a", "chunks": 3, "tables": [".."], "files": []}}),
        json.dumps({KEY: {"content": "a", "chunks": 3, "tables": "customers", "files": []}}),
        json.dumps({KEY: {"content": "a"}}),
    ],
    ids=repr,
)
def test_a_folder_whose_manifest_is_somebody_elses_is_left_alone(tmp_path: Path, manifest: str | bytes) -> None:
    place = tmp_path / "place"
    (place / "customers").mkdir(parents=True)
    (place / "customers" / "000000.parquet").write_bytes(b"precious")
    (place / "manifest.json").write_bytes(manifest if isinstance(manifest, bytes) else manifest.encode())
    before = content(tmp_path)
    for resume in (False, True):
        with pytest.raises(HenonRefError, match="has files, but no sweep"):
            swept(place, resume=resume)
        assert content(tmp_path) == before


def test_a_manifest_that_leads_out_of_the_folder_is_nobodys(tmp_path: Path) -> None:
    swept(tmp_path / "out")
    manifest = tmp_path / "out" / "manifest.json"
    moved = tmp_path / "manifest.json"
    shutil.move(manifest, moved)
    manifest.symlink_to(moved)
    assert owned(tmp_path / "out") is None


def files_beside(out: Path) -> None:
    """What people put beside results."""
    for name in ("notes.txt", "points.csv", "points/mine.parquet", "points/000003.parquet", "mine/000000.parquet"):
        (out / name).parent.mkdir(exist_ok=True)
        (out / name).write_bytes(b"precious")
    (out / ".git").mkdir()
    (out / ".git" / "000000.parquet").write_bytes(b"precious")


@pytest.mark.parametrize("resume", [False, True])
def test_what_stands_beside_the_results_is_kept(tmp_path: Path, resume: bool) -> None:
    table = swept(tmp_path / "out")
    files_beside(tmp_path / "out")
    before = content(tmp_path / "out")
    again = swept(tmp_path / "out", resume=resume)
    pd.testing.assert_frame_equal(again, table)
    assert content(tmp_path / "out") == before


def test_an_earlier_sweeps_own_files_go(tmp_path: Path) -> None:
    swept(tmp_path / "out")
    files_beside(tmp_path / "out")
    swept(tmp_path / "out", observe=[hr.observe.sticks(each=True)], chunk=3)
    there = set(content(tmp_path / "out"))
    assert {"points/000000.parquet", "sticks/000000.parquet", "notes.txt", "points.csv", "mine/000000.parquet"} < there
    assert not (tmp_path / "out" / "section").exists()
    assert "points/000001.parquet" not in there


@pytest.mark.parametrize(
    ("name", "how"),
    [
        ("points/000003.parquet", {"grid": {"F": [0.5, 1, 2, 3]}}),
        ("points.csv", {"grid": pd.DataFrame({"F": [0.5, 1]})}),
        ("mine/000000.parquet", {"observe": [hr.observe.section("v", name="mine")]}),
    ],
)
def test_a_file_in_the_way_is_not_replaced(tmp_path: Path, name: str, how: dict[str, Any]) -> None:
    swept(tmp_path / "out")
    files_beside(tmp_path / "out")
    before = content(tmp_path / "out")
    with pytest.raises(HenonRefError, match=f"{Path(name).parts[0]}.*was not written by a sweep"):
        swept(tmp_path / "out", **how)
    assert content(tmp_path / "out") == before


@pytest.mark.parametrize("name", ["sweep.yaml", "index.html", "points", "section", "points/000001.parquet"])
def test_nothing_is_written_through_a_link(tmp_path: Path, name: str) -> None:
    swept(tmp_path / "out")
    path, away = tmp_path / "out" / name, tmp_path / "away"
    shutil.move(path, away)
    path.symlink_to(away)
    before = content(tmp_path)
    with pytest.raises(HenonRefError, match="is a link"):
        swept(tmp_path / "out")
    assert content(tmp_path) == before


def test_a_half_written_file_that_is_a_link_is_not_written_through(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("precious")
    for name in (f".{name}.{os.getpid()}.part" for name in ("sweep.yaml", "manifest.json", "index.html")):
        (tmp_path / "out").mkdir(exist_ok=True)
        (tmp_path / "out" / name).symlink_to(tmp_path / "precious")
    swept(tmp_path / "out")
    assert (tmp_path / "precious").read_text() == "precious"


def test_the_command_draws_and_into_no_folder_of_somebody_elses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pyarrow")
    monkeypatch.chdir(tmp_path)
    Path("belts.yaml").write_text(SWEEP)
    arguments = ["belts.yaml", "--jobs", "1", "--quiet"]
    assert program(arguments) == 0
    Path("out/belts/figures").mkdir()
    Path("out/belts/figures/plane_final_x.svg").write_text("mine")
    before = content(tmp_path)
    assert program([*arguments, "--plot"]) == 2
    assert "figures: was not written by a sweep" in capsys.readouterr().err
    assert content(tmp_path) == before
    shutil.rmtree("out/belts/figures")
    assert program([*arguments, "--plot"]) == 0
    assert program(arguments) == 0
    drawn = {path.name for path in Path("out/belts/figures").iterdir()}
    assert {"plane_final_x.svg", "basins_final_mode.svg", "histogram_stick_count.svg"} <= drawn
    assert "figures" in owned(Path("out/belts")).files


def test_a_folder_is_one_sweeps_at_a_time(tmp_path: Path) -> None:
    lock = FolderLock(tmp_path / "out")
    try:
        with pytest.raises(HenonRefError, match="is being written by another run, process"):
            swept(tmp_path / "out")
    finally:
        lock.release()
    swept(tmp_path / "out")
    assert not [path for path in (tmp_path / "out").iterdir() if path.name.startswith(".")]


@pytest.mark.slow  # daily: a folder that another sweep holds, in this file, and harness/report/test_folder_lock.py
def test_two_processes_do_not_mix_their_results(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    code = (
        "import sys, henon_ref as hr\n"
        "block = hr.System(['x', 'v'], {'F': 0.5}, {'s': 'v'}, ['v', '-F*s'])\n"
        "try:\n"
        "    hr.sweep(block, {'x': 0, 'v': 1}, until=9, grid={'F': {'from': 1, 'to': 2, 'count': 24}}, chunk=1,\n"
        "             observe=[hr.observe.final_state()], rtol=float(sys.argv[1]), jobs=1, out='out')\n"
        "except hr.HenonRefError as error:\n"
        "    print(error)\n"
    )
    two = [
        subprocess.Popen([sys.executable, "-c", code, rtol], cwd=tmp_path, stdout=subprocess.PIPE, text=True)
        for rtol in ("1e-4", "1e-12")
    ]
    said = [process.communicate(timeout=600)[0] for process in two]
    assert all(process.returncode == 0 for process in two)
    told = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert told["points"] == 24
    exact = 1 / np.linspace(1, 2, 24) / 2
    found = pd.read_parquet(tmp_path / "out" / "points")
    assert np.abs(found["final_x"] - exact).max() < 1e-3
    rtols = [line for line in (tmp_path / "out" / "sweep.yaml").read_text().splitlines() if line.startswith("rtol")]
    assert len(found) == 24
    assert len(rtols) == 1
    assert sum("is being written by another run" in words for words in said) <= 1


@pytest.mark.parametrize("out", [5, b"out", ["out"]])
def test_a_folder_is_a_path(out: Any) -> None:
    with pytest.raises(HenonRefError, match="wanted the path of a folder"):
        swept(out)


def remove_table(folder: Path) -> None:
    (folder / "section" / "000001.parquet").unlink()


def empty_table(folder: Path) -> None:
    (folder / "section" / "000001.parquet").write_bytes(b"")


def cut_points(folder: Path) -> None:
    file = folder / "points" / "000001.parquet"
    file.write_bytes(file.read_bytes()[:-20])


def turn_a_bit(folder: Path) -> None:
    file = folder / "points" / "000001.parquet"
    found = bytearray(file.read_bytes())
    found[30] ^= 1
    file.write_bytes(found)


def other_points(folder: Path) -> None:
    shutil.copy(folder / "points" / "000002.parquet", folder / "points" / "000001.parquet")


def other_rows(folder: Path) -> None:
    shutil.copy(folder / "section" / "000002.parquet", folder / "section" / "000001.parquet")


def other_values(folder: Path) -> None:
    file = folder / "points" / "000001.parquet"
    pd.read_parquet(file).assign(F=np.nextafter(1, 2)).to_parquet(file, index=False)


def other_columns(folder: Path) -> None:
    file = folder / "points" / "000001.parquet"
    pd.read_parquet(file).rename(columns={"final_x": "final_y"}).to_parquet(file, index=False)


DAMAGES: list[Callable[[Path], None]] = [
    remove_table, empty_table, cut_points, turn_a_bit, other_points, other_rows, other_values, other_columns,
]  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_chunk_is_run_again_and_said(
    tmp_path: Path, damage: Callable[[Path], None], caplog: pytest.LogCaptureFixture
) -> None:
    table = swept(tmp_path / "out")
    before = content(tmp_path / "out")
    damage(tmp_path / "out")
    again = swept(tmp_path / "out", resume=True)
    pd.testing.assert_frame_equal(again, table)
    pd.testing.assert_frame_equal(again.frames["section"], table.frames["section"])
    assert content(tmp_path / "out") == before
    assert [record.getMessage() for record in caplog.records] == [
        f"{tmp_path / 'out'}: a file of chunk 1 is missing or damaged; the chunk is run again"
    ]


def test_whole_chunks_are_not_run_again_and_nothing_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    swept(tmp_path / "out")
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*.parquet")}
    swept(tmp_path / "out", resume=True)
    assert kept == {path: path.stat().st_mtime_ns for path in (tmp_path / "out").rglob("*.parquet")}
    assert not caplog.records


def test_whatever_becomes_of_a_file_it_is_read_as_it_was_or_run_again(tmp_path: Path) -> None:
    """Bytes changed at random: no traceback, and no other number."""
    table = swept(tmp_path)
    plan = load_sweep(tmp_path / "sweep.yaml")
    generator = np.random.default_rng(1)
    for name in ("points/000001.parquet", "section/000000.parquet"):
        before = (tmp_path / name).read_bytes()
        for _ in range(100):
            found = bytearray(before)
            for place in generator.integers(0, len(found), 3):
                found[place] = generator.integers(0, 256)
            (tmp_path / name).write_bytes(found)
            again = dict(SweepFolder(tmp_path, plan).finished())
            if len(again) == 3:
                assert_same(assembled(plan.points, list(again.items())), table)
        (tmp_path / name).write_bytes(before)
    assert len(dict(SweepFolder(tmp_path, plan).finished())) == 3
