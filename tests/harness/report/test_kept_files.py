"""Files of others are not replaced, no file is half-written, and no finished report is lost."""

from __future__ import annotations

import csv
import errno
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from commands import run
from often import daily
from processes import wait_until

from henon_ref.errors import CaseError
from henon_ref.harness.campaign import journal
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.cli import compare_cases, study
from henon_ref.harness.report import case_report
from henon_ref.harness.report.folder import check_index
from henon_ref.harness.report.folder_report import index_text, write_folder_report
from henon_ref.harness.report.matrix import MatrixRow, merged
from henon_ref.harness.result_files import csv_text, rows_text
from henon_ref.harness.rows import RunRow

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="made-up solvers reach workers by fork"),
    pytest.mark.usefixtures("made_up_solvers"),
]

PATIENCE = 600
"""Seconds that anything may take on a busy machine."""


def messages(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """What a command said, but for the rows that it told as they were finished."""
    return [line for line in capsys.readouterr().err.splitlines() if not re.match(r"\d+ of \d+: ", line)]


def test_an_index_of_ours_is_replaced_and_that_of_somebody_else_is_not(made_up, tmp_path):
    index = tmp_path / "README.md"
    assert run(made_up, "--out", ".") == 0
    with index.open("a") as file:
        file.write("\nA line of an earlier version.\n")
    assert run(made_up, "--out", ".", "--solvers", "henon") == 0
    assert "an earlier version" not in index.read_text()
    index.write_text("# Mine\n")
    with pytest.raises(CaseError, match="was not written by henon_ref"):
        write_folder_report(tmp_path)
    assert index.read_text() == "# Mine\n"


@pytest.mark.parametrize("page", ["paper", "causes"])
def test_a_study_does_not_replace_a_page_of_somebody_else(tmp_path, capsys, page):
    (tmp_path / "out" / page).mkdir(parents=True)
    (tmp_path / "out" / page / "README.md").write_text("# Mine\n")
    before = sorted(tmp_path.rglob("*"))
    assert study.command([page, "--out", str(tmp_path / "out")]) == 2
    assert f"out/{page}/README.md: was not written by henon_ref" in capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("manifest.json", "{", "cannot be read"),
        ("manifest.json", "[1]", "it has no title"),
        ("manifest.json", '{"name": "an app"}', "it has no title"),
        ("runs.csv", "run,value\n1,2\n", "there is no column 'case'"),
        ("runs.csv", "\xff", "cannot be read"),
    ],
)
def test_a_report_that_cannot_be_read_is_left_out_of_the_index(made_up, tmp_path, capsys, name, content, words):
    assert run(made_up, "--out", "out") == 0
    shutil.copytree(tmp_path / "out/made_up", tmp_path / "out/other")
    assert {row.case for row in merged(tmp_path / "out")} == {"made_up", "other"}
    (tmp_path / "out/other" / name).write_bytes(content.encode("latin-1"))
    capsys.readouterr()
    assert run(made_up, "--out", "out") == 0
    (line,) = messages(capsys)
    assert line.startswith(f"left out of the index: out/other/{name}: ")
    assert words in line
    assert "other/report.md" not in (tmp_path / "out/README.md").read_text()


@pytest.mark.parametrize("folder", ["", "price", "atlas", "restarts", "causes", "rivals", "paper"])
def test_the_committed_index_and_pages_may_be_made_again(folder, tmp_path):
    """Unless somebody has written there."""
    shown = Path(__file__).parents[3] / "reports" / folder
    check_index(shown)
    (tmp_path / "README.md").write_text("Mine.\n" + (shown / "README.md").read_text())
    with pytest.raises(CaseError, match="was not written by henon_ref"):
        check_index(tmp_path)


def test_an_index_of_nothing_and_of_one_reading_is_known_again(tmp_path):
    row = MatrixRow("made_up", "default", None, "a")
    for rows in ([], [row]):
        (tmp_path / "README.md").write_text(index_text(rows, tmp_path))
        (tmp_path / "matrix.csv").write_text(rows_text(MatrixRow, rows))
        check_index(tmp_path)
        (tmp_path / "matrix.csv").write_text(csv_text(MatrixRow.columns()[1:], []))
        with pytest.raises(CaseError, match=r"matrix\.csv: was not written by henon_ref"):
            check_index(tmp_path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
@pytest.mark.parametrize("name", ["matrix.csv", "index.html", "README.md", "made_up/manifest.json", "made_up/runs.csv"])
def test_a_named_pipe_in_place_of_a_file_is_not_waited_for(made_up, tmp_path, capsys, name):
    (tmp_path / "out/made_up").mkdir(parents=True)
    os.mkfifo(tmp_path / "out" / name)
    assert run(made_up, "--out", "out") == 2
    assert f"out/{name}: was not written by henon_ref" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["report.md", "runs.csv", "samples.csv", "default_cost.svg"])
def test_a_report_of_somebody_else_is_not_replaced(made_up, tmp_path, capsys, name):
    (tmp_path / "out/made_up").mkdir(parents=True)
    (tmp_path / "out/made_up" / name).write_text("Mine.\n")
    assert run(made_up, "--out", "out") == 2
    assert f"out/made_up/{name}: was not written by henon_ref" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").rglob("*") if path.is_file()] == [name]
    assert (tmp_path / "out/made_up" / name).read_text() == "Mine.\n"


def test_a_file_in_place_of_the_folder_of_a_report_is_named(made_up, tmp_path, capsys):
    (tmp_path / "made_up").write_text("Mine.\n")
    assert run(made_up, "--out", ".") == 2
    assert "made_up is a file; --out requires a folder" in capsys.readouterr().err


@pytest.mark.parametrize(("name", "left"), [("matrix.csv", -20), ("index.html", 2000)])
def test_a_damaged_matrix_or_page_is_an_error_before_anything_runs(made_up, tmp_path, capsys, name, left):
    """It may be the only copy of the runs of a case."""
    assert run(made_up, "--out", "out") == 0
    file = tmp_path / "out" / name
    file.write_text(file.read_text()[:left])
    capsys.readouterr()
    assert run(made_up, "--out", "out") == 2
    assert re.fullmatch(rf"error: out/{name}: (is not a matrix|its data, .* cannot be).*\n", capsys.readouterr().err)


@pytest.mark.parametrize("name", ["matrix.csv", "index.html"])
def test_a_matrix_of_somebody_else_is_not_replaced(made_up, tmp_path, capsys, name):
    (tmp_path / name).write_text("1,2\n")
    assert run(made_up, "--out", ".") == 2
    assert f"{name}: was not written by henon_ref" in capsys.readouterr().err
    assert (tmp_path / name).read_text() == "1,2\n"
    assert not (tmp_path / "made_up").exists()


@pytest.mark.skipif(os.geteuid() == 0 if hasattr(os, "geteuid") else True, reason="root writes anywhere")
def test_a_folder_that_cannot_be_written_is_refused_at_once(made_up, tmp_path, capsys):
    (tmp_path / "locked").mkdir(mode=0o500)
    assert run(made_up, "--out", "locked") == 2
    assert "cannot write into" in capsys.readouterr().err


def test_a_folder_below_a_file_system_without_files_is_refused(made_up, capsys):
    assert run(made_up, "--out", "/proc/reports") == 2
    assert "cannot write into /proc" in capsys.readouterr().err


def test_a_full_disk_is_one_message_and_loses_no_finished_row(made_up, tmp_path, monkeypatch, capsys):
    written = []
    real = os.fsync

    def full(descriptor: int) -> None:
        written.append(descriptor)
        if len(written) == 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(descriptor)

    monkeypatch.setattr(os, "fsync", full)
    assert run(made_up, "--out", "out", "--jobs", 1) == 2
    (line,) = messages(capsys)
    assert line.startswith("error: cannot write out/made_up/.partial: No space left")
    assert len(journal.read(tmp_path / "out" / "made_up" / journal.FILE)) >= 2
    assert not (tmp_path / "out" / "made_up" / "report.md").exists()
    monkeypatch.setattr(os, "fsync", real)
    assert run(made_up, "--out", "out", "--resume") == 0


def test_a_report_that_cannot_be_finished_leaves_the_old_one(made_up, tmp_path, monkeypatch):
    assert run(made_up, "--out", "out") == 0
    report = tmp_path / "out/made_up/report.md"
    before, entries = report.read_text(), sorted(os.listdir(tmp_path / "out"))

    def full(path: Path, content: bytes) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(case_report, "write_through", full)
    assert run(made_up, "--out", "out", "--solvers", "henon") == 2
    assert report.read_text() == before
    assert sorted(os.listdir(tmp_path / "out")) == entries


def test_files_of_an_earlier_report_that_this_one_lacks_are_removed(made_up, tmp_path):
    assert run(made_up, "--out", "out") == 0
    folder = tmp_path / "out" / "made_up"
    (folder / "mine.txt").write_text("kept")
    manifest = json.loads((folder / "manifest.json").read_text())
    (folder / "old.svg").write_text("stale")
    manifest["files"] += ["old.svg", "../escape"]
    (tmp_path / "out" / "escape").write_text("kept")
    (folder / "manifest.json").write_text(json.dumps(manifest))
    assert run(made_up, "--out", "out") == 0
    assert not (folder / "old.svg").exists()
    assert (folder / "mine.txt").exists()
    assert (tmp_path / "out" / "escape").exists()


@pytest.mark.parametrize(
    "manifest",
    [
        "[]",
        "7",
        "not JSON",
        "[" * 100_000,
        '{"files": ["manifest.json"]}',
        '{"case": "made_up", "files": 3}',
        '{"case": "made_up", "files": {"manifest.json": 1}}',
        '{"case": "other", "files": ["manifest.json"]}',
    ],
)
def test_a_manifest_of_somebody_else_is_not_replaced(made_up, tmp_path, capsys, manifest):
    file = tmp_path / "out/made_up/manifest.json"
    file.parent.mkdir(parents=True)
    file.write_text(manifest)
    assert run(made_up, "--out", "out", "--solvers", "henon") == 2
    assert "out/made_up/manifest.json: was not written by henon_ref" in capsys.readouterr().err
    assert [path for path in (tmp_path / "out").rglob("*") if path.is_file()] == [file]
    assert file.read_text() == manifest


@pytest.mark.parametrize(
    "files",
    [
        ["..", ".", "", "folder", "../escape", "a\0b", "\ud800", None, 3, ["mine.txt"]],
        ["a" * 10_000],
    ],
)
def test_a_manifest_that_lists_no_file_of_a_report_takes_nothing_with_it(made_up, tmp_path, capsys, files):
    folder = tmp_path / "out" / "made_up"
    (folder / "folder").mkdir(parents=True)
    (folder / "mine.txt").write_text("kept")
    (tmp_path / "out" / "escape").write_text("kept")
    (folder / "manifest.json").write_text(json.dumps({"case": "made_up", "files": [*files, "manifest.json"]}))
    assert run(made_up, "--out", "out", "--solvers", "henon") == 0
    assert messages(capsys) == []
    assert (folder / "folder").is_dir()
    assert (folder / "mine.txt").exists()
    assert (tmp_path / "out" / "escape").exists()
    assert len(json.loads((folder / "manifest.json").read_text())["files"]) > 6


@pytest.mark.parametrize(
    "number", daily([signal.SIGINT, signal.SIGTERM, signal.SIGKILL], some=[signal.SIGINT, signal.SIGKILL])
)
def test_an_interrupt_keeps_finished_rows_and_says_how_to_go_on(made_up, tmp_path, number):
    script = tmp_path / "run.py"
    script.write_text(
        textwrap.dedent(f"""
        import signal
        import sys
        signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in what a shell runs in the background
        sys.path.insert(0, {str(Path(__file__).parents[2] / "support")!r})
        from fakes import Fake, truth
        from henon_ref.harness import registry
        from henon_ref.harness.cli import compare
        from henon_ref.harness.truth import compute
        compute.truth_for = truth
        registry.solver = lambda name: Fake(name, "right" if name == "henon" else "hangs")
        sys.exit(compare.command(["made_up.yaml", "--out", "out", "--timeout", "600"]))
        """)
    )
    process = subprocess.Popen([sys.executable, str(script)], stderr=subprocess.PIPE, text=True, cwd=tmp_path)
    partial = tmp_path / "out" / "made_up" / journal.FILE
    wait_until(lambda: len(journal.read(partial)) >= 2)
    process.send_signal(number)
    _, errors = process.communicate(timeout=PATIENCE)
    if number == signal.SIGKILL:  # nothing can be said any more, and nothing is lost
        assert process.returncode == -signal.SIGKILL
    else:
        assert process.returncode == 130
        assert "interrupted" in errors
        assert "--resume" in errors
    assert len(journal.read(partial)) == 2
    assert not (tmp_path / "out" / "made_up" / "report.md").exists()


def test_rows_that_could_have_been_kept_are_mentioned(made_up, tmp_path, capsys):
    folder = tmp_path / "out" / "made_up"
    folder.mkdir(parents=True)
    (folder / journal.FILE).write_bytes(journal.line_of("a", Record(RunRow("made_up", "default", "a"))))
    assert run(made_up, "--out", "out", "--solvers", "henon") == 0
    assert "--resume would keep 1 rows of made_up" in capsys.readouterr().err


def test_a_damaged_journal_is_told_in_one_line_and_the_comparison_ends_with_all_rows(
    made_up, tmp_path, monkeypatch, capsys
):
    def interrupted(*arguments: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(compare_cases, "write_report", interrupted)
        assert run(made_up, "--out", "out") == 130
    partial = tmp_path / "out" / "made_up" / journal.FILE
    first, second, third, last = partial.read_bytes().splitlines(keepends=True)
    partial.write_bytes(first + second.replace(b'"steps":10', b'"steps":11') + b"\xff\n[]\n" + third + last[:-40])
    capsys.readouterr()
    assert run(made_up, "--out", "out", "--resume") == 0
    (line,) = messages(capsys)
    assert line.startswith("out/made_up/.partial: line 2 is damaged (its checksum is wrong) and 3 more; set aside in")
    with (tmp_path / "out" / "made_up" / "runs.csv").open() as file:
        rows = [(row["solver"], row["rtol"], row["matched"]) for row in csv.DictReader(file)]
    assert rows == [
        (name, rtol, matched) for name, matched in (("henon", "5"), ("heyoka", "4")) for rtol in ("0.001", "1e-06")
    ]
    assert not partial.exists()
    assert len((partial.parent / journal.SET_ASIDE).read_bytes().splitlines()) == 4


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can mount")
def test_a_small_file_system_that_fills_up(made_up, tmp_path, capsys):
    small = tmp_path / "small"
    small.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=24k", "tmpfs", small], capture_output=True)
    if mounted.returncode:
        pytest.skip("no tmpfs can be mounted here")
    try:
        assert run(made_up, "--out", small, "--repeats", 1) == 2
        assert capsys.readouterr().err.count("No space left") == 1
        kept = len(journal.read(small / "made_up" / journal.FILE))
        assert kept > 0
        assert sorted(os.listdir(small / "made_up")) == [journal.FILE]
        subprocess.run(["mount", "-o", "remount,size=4m", small], check=True)
        assert run(made_up, "--out", small, "--repeats", 1, "--resume") == 0
    finally:
        subprocess.run(["umount", small], check=True)
