"""Two runs at once: one per folder; the second names the first and changes nothing; a killed run leaves no lock."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from commands import run
from fakes import CASE
from processes import wait_until

from henon_ref.errors import CaseError
from henon_ref.harness.campaign import journal
from henon_ref.harness.cli import study
from henon_ref.harness.report import folder as report_folder
from henon_ref.harness.report.folder import LOCK, FolderLock, locked
from henon_ref.harness.studies.study import STUDIES

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="made-up solvers reach workers by fork"),
    pytest.mark.usefixtures("made_up_solvers"),
]
SECONDS = 600
"""What is waited for at most."""


def begun(folder: Path, case: str, behaviour: str) -> subprocess.Popen[str]:
    """The command at work on a case, in a process of its own; ``behaviour``: of all its solvers but henon."""
    script = folder / f"run_{case}.py"
    script.write_text(
        textwrap.dedent(f"""
        import sys
        sys.path.insert(0, {str(Path(__file__).parents[2] / "support")!r})
        from fakes import Fake, truth
        from henon_ref.harness import registry
        from henon_ref.harness.cli import compare
        from henon_ref.harness.truth import compute
        compute.truth_for = truth
        registry.solver = lambda name: Fake(name, "right" if name == "henon" else {behaviour!r})
        sys.exit(compare.command(["{case}.yaml", "--out", "out", "--timeout", "600", "--no-figures"]))
        """)
    )
    environment = {
        **os.environ,
        "XDG_CACHE_HOME": str(folder / "cache"),
    }  # no truth of the user's
    return subprocess.Popen(
        [sys.executable, str(script)], cwd=folder, env=environment, text=True, stderr=subprocess.PIPE
    )


def snapshot(folder: Path) -> dict[str, tuple[int, bytes]]:
    """Time of the last change and content of everything in a folder."""
    paths = [folder, *folder.rglob("*")]
    return {str(path): (path.stat().st_mtime_ns, b"" if path.is_dir() else path.read_bytes()) for path in paths}


def test_the_second_run_on_a_case_names_the_first_and_changes_nothing(made_up, tmp_path, capsys):
    first = begun(tmp_path, "made_up", "hangs")
    partial = tmp_path / "out" / "made_up" / journal.FILE
    try:
        wait_until(lambda: len(journal.read(partial)) == 2)
        before = snapshot(tmp_path / "out")
        for further in ([], ["--resume"]):
            assert run(made_up, "--out", "out", *further) == 2
            captured = capsys.readouterr()
            assert captured.out == ""
            assert captured.err.startswith(f"error: out/made_up is being written by another run, process {first.pid};")
            assert captured.err.count("\n") == 1
        assert snapshot(tmp_path / "out") == before
    finally:
        first.send_signal(signal.SIGKILL)
        first.communicate(timeout=SECONDS)
    assert run(made_up, "--out", "out", "--resume") == 0
    assert not list((tmp_path / "out").rglob(LOCK))


@pytest.mark.slow  # daily: a report is put in place while nobody reads for the index, the next test
def test_different_cases_side_by_side_end_with_a_right_index(tmp_path):
    names = ("first", "second")
    for name in names:
        (tmp_path / f"{name}.yaml").write_text(CASE.format(name=name))
    processes = [begun(tmp_path, name, "right") for name in names]
    for process in processes:
        _, errors = process.communicate(timeout=SECONDS)
        assert process.returncode == 0
        assert [line.split(":")[0] for line in errors.splitlines()] == [f"{row} of 4" for row in (1, 2, 3, 4)]
    index = (tmp_path / "out" / "README.md").read_text()
    assert all(f"[{name}]({name}/report.md)" in index for name in names)
    assert not list((tmp_path / "out").rglob(LOCK))


def test_a_report_is_put_in_place_while_nobody_reads_for_the_index(made_up, tmp_path):
    with locked([tmp_path / "out"]):
        process = begun(tmp_path, "made_up", "right")
        wait_until(lambda: len(list((tmp_path / "out").glob(".made_up.*/manifest.json"))) == 1)
        assert process.poll() is None
        assert not (tmp_path / "out" / "made_up" / "report.md").exists()
    assert process.wait(timeout=SECONDS) == 0
    process.communicate()
    assert (tmp_path / "out" / "made_up" / "report.md").exists()


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_has_its_folder_to_itself(made_up, tmp_path, capsys, name):
    own = STUDIES[name]
    words = [name, *([str(made_up)] if "cases" in own.takes else []), *(["--rows", "."] if "rows" in own.takes else [])]
    with locked([Path("out") / own.folder]):
        before = snapshot(tmp_path)
        assert study.command([*words, "--out", "out"]) == 2
        assert snapshot(tmp_path) == before
    assert f"out/{own.folder} is being written by another run, process {os.getpid()};" in capsys.readouterr().err


def test_a_lock_leaves_nothing_behind(tmp_path):
    with locked([tmp_path / "a" / "b", tmp_path / "c", tmp_path / "c"]):
        assert (tmp_path / "a" / "b" / LOCK).read_text() == f"{os.getpid()}\n"
        (tmp_path / "c" / "kept").write_text("")
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["c", "kept"]


def test_locks_that_were_taken_are_given_back_where_one_is_held(tmp_path):
    with locked([tmp_path / "b"]):
        with pytest.raises(CaseError, match=f"b is being written by another run, process {os.getpid()}"):
            locked([tmp_path / "a", tmp_path / "b"]).__enter__()
        assert not (tmp_path / "a").exists()
        with locked([tmp_path / "a"]):
            pass


def test_a_lock_that_is_held_for_too_long_is_not_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr(report_folder, "LOCK_SECONDS", 0.1)
    with locked([tmp_path]), pytest.raises(CaseError, match=f"another run, process {os.getpid()}"):
        locked([tmp_path], wait=True).__enter__()


def test_what_a_killed_run_has_forked_does_not_hold_its_locks(tmp_path):
    script = f"""
import os, time
from pathlib import Path
from henon_ref.harness.report.folder import FolderLock
lock = FolderLock(Path({str(tmp_path)!r}))
if not os.fork():
    print("forked", flush=True)
time.sleep({SECONDS})
"""
    holder = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, start_new_session=True)
    try:
        assert holder.stdout.readline() == "forked\n"
        with pytest.raises(CaseError, match=f"process {holder.pid}"), locked([tmp_path]):
            pass
        holder.kill()
        holder.wait(timeout=SECONDS)
        FolderLock(tmp_path).release()
    finally:
        os.killpg(holder.pid, signal.SIGKILL)
        holder.stdout.close()


def test_a_link_in_the_place_of_the_lock_is_not_followed(made_up, tmp_path, capsys):
    (tmp_path / "out" / "made_up").mkdir(parents=True)
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "out" / "made_up" / LOCK).symlink_to(tmp_path / "mine")
    assert run(made_up, "--out", "out") == 2
    assert f"out/made_up/{LOCK}" in capsys.readouterr().err
    assert (tmp_path / "mine").read_text() == "mine"
