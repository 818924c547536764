"""The command ``sweep``: exit statuses, its files, an interrupt and its resumption."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pandas as pd
import pytest
from processes import wait_until
from sweep_systems import SWEEP, parquet_files

from henon_ref.harness.cli.main import sweep_program as program

MANY = SWEEP.replace("chunk: 4", "chunk: 1")
INTERRUPTED = """
import os, signal, sys
from henon_ref.harness.cli.main import sweep_program as program
from henon_ref.sweeps.storage import SweepFolder

write, written = SweepFolder.write, []

def write_and_interrupt(folder, number, tables):
    write(folder, number, tables)
    written.append(number)
    if len(written) == 3:
        os.killpg(0, signal.SIGINT)  # as a terminal does

SweepFolder.write = write_and_interrupt
sys.exit(program(["belts.yaml", "--jobs", "2"]))
"""
PATIENCE = 600
"""Seconds that anything may take on a busy machine."""


@pytest.fixture
def belts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A sweep file, alone in the folder that the command is run in."""
    monkeypatch.chdir(tmp_path)
    handler = signal.getsignal(signal.SIGTERM)
    path = tmp_path / "belts.yaml"
    path.write_text(SWEEP)
    yield path
    signal.signal(signal.SIGTERM, handler)


def test_a_sweep_is_written_and_summed_up(belts: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert program([str(belts), "--jobs", "1"]) == 0
    assert capsys.readouterr().out == "out/belts: 15 points, 15 ok\n"
    points = pd.read_parquet("out/belts/points")
    assert list(points.columns[:4]) == ["point", "vb", "x", "status"]
    assert points["point"].tolist() == list(range(15))
    assert {p.name for p in Path("out/belts").iterdir()} == {
        "index.html", "manifest.json", "points", "section", "sweep.yaml",
    }  # fmt: skip


def test_what_it_wrote_runs_again_from_its_own_folder(belts: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert program([str(belts), "--jobs", "1", "--quiet"]) == 0
    monkeypatch.chdir("out/belts")
    assert program(["sweep.yaml", "--out", "again", "--jobs", "1"]) == 0
    assert parquet_files(Path("again/belts")) == {
        name: content for name, content in parquet_files(Path()).items() if not name.startswith("again")
    }


@pytest.mark.parametrize(
    ("change", "place"), [(("vb: {from", "speed: {from"), "14:5"), (("[-1, 0, 1.5]", "[.nan]"), "15:9")]
)
def test_an_error_in_the_file_has_its_place_and_nothing_is_written(
    belts: Path, change: tuple[str, str], place: str, capsys: pytest.CaptureFixture[str]
) -> None:
    belts.write_text(SWEEP.replace(*change))
    assert program([str(belts)]) == 2
    said = capsys.readouterr().err
    assert f"{belts}:{place}: " in said
    assert said.count("\n") == 1
    assert [p.name for p in belts.parent.iterdir()] == ["belts.yaml"]


@pytest.mark.parametrize(
    "arguments", [["--jobs", "0"], ["--no-such-option"], ["missing.yaml"], ["--dask", "nowhere"], ["--out", ""]]
)
def test_bad_arguments_are_status_2(belts: Path, arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    given = arguments if arguments[0].endswith(".yaml") else [str(belts), *arguments]
    assert program(given) == 2
    assert "error: " in capsys.readouterr().err
    assert [path.name for path in belts.parent.iterdir()] == ["belts.yaml"]


def test_a_folder_that_cannot_be_written_is_status_2(belts: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("taken").write_text("a file")
    assert program([str(belts), "--out", "taken"]) == 2
    assert "taken" in capsys.readouterr().err


def test_an_interrupt_leaves_whole_files_and_no_workers_and_can_be_resumed(belts: Path) -> None:
    belts.write_text(MANY)
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED],
        stderr=subprocess.PIPE,
        text=True,
        process_group=0,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell's jobs in the background ignore it
    )
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "interrupted; finished chunks are kept, --resume continues from them" in said
    assert "Traceback" not in said
    finished = parquet_files(Path("out"))
    assert sum("points" in name for name in finished) == 3
    for file in Path("out").rglob("*.parquet"):
        pd.read_parquet(file)
    wait_until(lambda: not _at_work(process.pid))
    assert program(["belts.yaml", "--jobs", "1", "--resume", "--quiet"]) == 0
    assert program(["belts.yaml", "--jobs", "1", "--out", "whole", "--quiet"]) == 0
    assert parquet_files(Path("out")) == parquet_files(Path("whole"))
    assert {name: parquet_files(Path("out"))[name] for name in finished} == finished


def _at_work(group: int) -> list[str]:
    """Processes of a group that have not ended (one that nobody has asked for its status has)."""
    found = []
    for file in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, own = file.read_text().rsplit(")", 1)[1].split()[:3]
        except OSError:  # gone meanwhile
            continue
        if int(own) == group and state != "Z":
            found.append((file.parent / "cmdline").read_text())
    return found


def on_a_cluster(belts: Path, place: Path) -> int:
    """Run in a process of its own: a cluster leaves threads behind, beside which no worker is forked."""
    import distributed

    os.chdir(place)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, protocol="tcp"
    ) as cluster:
        return program([str(belts), "--dask", cluster.scheduler_address, "--out", "dask", "--quiet"])


@pytest.mark.slow  # daily: a cluster in workers/test_executors.py, and an address where none answers, above
def test_a_dask_cluster_is_an_address(belts: Path) -> None:
    assert program([str(belts), "--jobs", "1", "--quiet"]) == 0
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert pool.submit(on_a_cluster, belts, Path.cwd()).result() == 0
    assert parquet_files(Path("dask")) == parquet_files(Path("out"))
