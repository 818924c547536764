"""The command: exit status, one message for what is wrong, nothing half-written, nothing lost."""

from __future__ import annotations

import csv
import errno
import importlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import dataclass
from pathlib import Path

import pytest
from fakes import CASE, Fake, statement

from henon_ref import registry
from henon_ref.errors import CaseError
from henon_ref.report import command as report_command
from henon_ref.report.command import case_files, load_cases
from henon_ref.report.index import Entry, entries, index_text, write_index
from henon_ref.report.write import check_index
from henon_ref.score import journal, runjob, truthjob
from henon_ref.score.columns import JUDGED_COLUMNS, RUN_COLUMNS, STICK_COLUMNS, TRANSITION_COLUMNS

compare = importlib.import_module("henon_ref.compare")
paper = importlib.import_module("henon_ref.paper.__main__")
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="made-up solvers reach workers by fork")
SOLVERS = {"henon": Fake("henon"), "heyoka": Fake("heyoka", "misses"), "scipy-dop853": Fake("scipy-dop853")}


@dataclass(frozen=True)
class Drawing:
    """Takes the place of the figures, which take longer than all the rest."""

    reading: str
    seconds: float = 20.0

    def stages(self):
        yield "drawn", {f"{self.reading}_cost.svg": b"<svg/>"}


@pytest.fixture(autouse=True)
def _made_up(monkeypatch, tmp_path):
    monkeypatch.setattr(report_command, "figure_job", lambda result, records: Drawing(result.reading.name))
    monkeypatch.setattr(report_command, "preload", lambda: None)
    monkeypatch.setattr(truthjob, "statement_of", statement)
    monkeypatch.setattr(registry, "solver", SOLVERS.__getitem__)
    monkeypatch.chdir(tmp_path)
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)


@pytest.fixture
def made_up(tmp_path) -> Path:
    path = tmp_path / "made_up.yaml"
    path.write_text(CASE.format(name="made_up"))
    return path


def run(*arguments: object) -> int:
    return compare.command([str(argument) for argument in arguments])


def test_a_report_holds_what_the_contract_says(made_up, tmp_path, capsys):
    assert run(made_up, "--out", "out", "--repeats", 2) == 0
    folder = tmp_path / "out" / "made_up"
    assert {"report.md", "runs.csv", "transitions.csv", "sticks.csv", "manifest.json"} <= set(os.listdir(folder))
    with (folder / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == RUN_COLUMNS
    assert [row["solver"] for row in rows] == ["henon", "henon", "heyoka", "heyoka"]
    assert [row["step_s"] for row in rows] == [""] * 4
    columns = (*TRANSITION_COLUMNS, "x", *JUDGED_COLUMNS)
    assert (folder / "transitions.csv").read_text().splitlines()[0] == ",".join(columns)
    assert (folder / "sticks.csv").read_text().splitlines()[0] == ",".join(STICK_COLUMNS)
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["rerun"] == "python -m henon_ref.compare made_up.yaml --repeats 2"
    assert manifest["readings"]["default"]["parameters"]["F"] == {"exact": "1", "value": 1.0}
    assert len(manifest["samples"][0]["samples_ns"]) == 2
    assert sorted(manifest["files"]) == sorted(os.listdir(folder))
    captured = capsys.readouterr()
    assert captured.err == ""
    assert captured.out.splitlines() == ["out/made_up/report.md; gate met"]


def test_the_report_opens_with_the_answer(made_up, tmp_path):
    run(made_up, "--out", "out")
    lines = (tmp_path / "out/made_up/report.md").read_text().splitlines()
    assert lines[0] == "# A made-up system"
    assert lines[2].startswith("1 of 2 solvers find all 5 transitions in order. **`henon` is right to 6 digits**")
    assert "Wrong at every setting: `heyoka` (1 missed, 0 spurious)." in lines
    assert (tmp_path / "out/README.md").read_text().startswith("# Reports")


def test_the_gate_decides_the_exit_status_only_where_asked(made_up, monkeypatch, capsys):
    monkeypatch.setattr(registry, "solver", {**SOLVERS, "henon": Fake("henon", "misses")}.__getitem__)
    assert run(made_up) == 0
    assert run(made_up, "--gate") == 1
    assert "gate: made_up: default: henon" in capsys.readouterr().err


def test_a_gate_that_checked_nothing_does_not_pass(made_up, capsys):
    words = "none of the 2 bounds of the gate is on a solver that ran"
    assert run(made_up, "--solvers", "heyoka") == 0
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == (f"reports/made_up/report.md; gate not checked: {words}\n", "")
    assert run(made_up, "--solvers", "heyoka", "--gate") == 1
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == (
        f"reports/made_up/report.md; gate not checked: {words}\n", f"gate: {words}\n"
    )  # fmt: skip


def test_a_gate_that_is_checked_in_part_says_so(made_up, tmp_path, capsys):
    other = CASE.format(name="other").replace("gate: {henon:", "gate: {heyoka:")
    (tmp_path / "other.yaml").write_text(other)
    assert run(made_up, "other.yaml", "--solvers", "henon", "--gate") == 0
    assert capsys.readouterr().out.splitlines() == ["reports/README.md; gate met (2 of 4 bounds checked)"]


def test_a_case_without_a_gate_says_so_where_the_gate_is_asked_for(tmp_path, capsys):
    (tmp_path / "plain.yaml").write_text(re.sub("gate: .*", "", CASE.format(name="plain")))
    assert run("plain.yaml", "--gate") == 0
    assert capsys.readouterr().out == "reports/plain/report.md; gate not checked: there is no bound\n"
    assert run("plain.yaml") == 0
    assert capsys.readouterr().out == "reports/plain/report.md\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--solvers", "henn"], "did you mean 'henon'"),
        (["--solvers", "ida"], "none of the solvers asked for"),
        (["--solvers", ","], "empty list"),
        (["--tolerances", "1e-3,abc"], "not 'abc'"),
        (["--tolerances", "nan"], "between 1e-16 and 1"),
        (["--repeats", "0"], "repeats"),
        (["--timeout", "soon"], "timeout"),
        (["--timeout", "nan"], "timeout"),
        (["--timeout", "inf"], "timeout"),
        (["--timeout", "2e6"], "timeout"),
        (["--out", ""], "an empty path"),
        (["--out", " "], "an empty path"),
        (["--out", "."], "README.md: was not written by henon_ref"),
        (["--out", "headed"], "headed/README.md: was not written by henon_ref"),
        (["--out", "bytes"], "bytes/README.md: was not written by henon_ref"),
        (["--out", "nested"], "nested/README.md: was not written by henon_ref"),
        (["--out", "made_up.yaml"], "is a file"),
        (["--bogus"], "--bogus"),
        (["nowhere.yaml"], "nowhere.yaml"),
        (["made_up.yaml", "copy.yaml"], "the name 'made_up' is also that of"),
        (["empty"], "no case file"),
    ],
)
def test_a_bad_argument_is_one_message_and_nothing_is_written(made_up, tmp_path, capsys, arguments, words):
    (tmp_path / "copy.yaml").write_text(made_up.read_text())
    (tmp_path / "empty").mkdir()
    (tmp_path / "README.md").write_text("# My project\n")
    for name, content in (("headed", b"# Reports\n\nThose of 2012.\n"), ("bytes", b"\xff")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "README.md").write_bytes(content)
    (tmp_path / "nested" / "README.md").mkdir(parents=True)
    before = sorted(tmp_path.rglob("*"))
    assert run(made_up, *arguments) == 2
    captured = capsys.readouterr()
    assert words in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""
    assert sorted(tmp_path.rglob("*")) == before


def test_a_bad_case_is_named_with_line_and_column(tmp_path, capsys):
    (tmp_path / "bad.yaml").write_text(CASE.format(name="bad").replace("until: 5", "until: soon"))
    assert run("bad.yaml") == 2
    assert "bad.yaml:" in capsys.readouterr().err
    assert not (tmp_path / "reports").exists()


def test_an_index_of_ours_is_replaced_and_that_of_somebody_else_is_not(made_up, tmp_path, capsys):
    index = tmp_path / "README.md"
    assert run(made_up, "--out", ".") == 0
    first = index.read_text()
    assert run(made_up, "--out", ".", "--solvers", "henon") == 0
    assert index.read_text() != first
    index.write_text("# Mine\n")
    with pytest.raises(CaseError, match="was not written by henon_ref"):
        write_index(tmp_path)
    assert index.read_text() == "# Mine\n"


@pytest.mark.parametrize("page", ["atlas", "restarts", "causes"])
def test_a_further_page_of_somebody_else_is_not_replaced(made_up, tmp_path, capsys, page):
    (tmp_path / "out" / page).mkdir(parents=True)
    (tmp_path / "out" / page / "README.md").write_text("# Mine\n")
    before = sorted(tmp_path.rglob("*"))
    assert run(tmp_path, "--out", "out") == 2
    assert f"out/{page}/README.md: was not written by henon_ref" in capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before


def test_the_paper_s_page_does_not_replace_one_of_somebody_else(tmp_path, capsys):
    (tmp_path / "README.md").write_text("# Mine\n")
    assert paper.command(["--out", "."]) == 2
    assert capsys.readouterr().err.startswith("error: README.md: was not written by henon_ref")
    assert [path.name for path in tmp_path.iterdir()] == ["README.md"]


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("manifest.json", "{", "cannot be read"),
        ("manifest.json", "[1]", "it names no title"),
        ("manifest.json", '{"name": "an app"}', "it names no title"),
        ("runs.csv", "run,value\n1,2\n", "it has no column case"),
        ("runs.csv", "\xff", "cannot be read"),
        ("runs.csv", "run,value\n1,2,3\n", "more fields than there are columns"),
    ],
)
def test_a_report_that_cannot_be_read_is_left_out_of_the_index(made_up, tmp_path, capsys, name, content, words):
    assert run(made_up, "--out", "out") == 0
    shutil.copytree(tmp_path / "out/made_up", tmp_path / "out/other")
    assert [entry.case for entry in entries(tmp_path / "out")] == ["made_up", "other"]
    (tmp_path / "out/other" / name).write_bytes(content.encode("latin-1"))
    capsys.readouterr()
    assert run(made_up, "--out", "out") == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"left out of the index: out/other/{name}: ")
    assert words in line
    assert "other/report.md" not in (tmp_path / "out/README.md").read_text()


@pytest.mark.parametrize("folder", ["", "price", "atlas", "restarts", "causes", "paper"])
def test_the_committed_index_and_pages_may_be_made_again(folder):
    check_index(Path(__file__).parents[1] / "reports" / folder)


def test_an_index_of_nothing_and_of_one_reading_is_known_again(tmp_path):
    for found in ([], [Entry("made_up", "Made up", "default", [])]):
        (tmp_path / "README.md").write_text(index_text(found))
        check_index(tmp_path)


def test_one_file_by_several_paths_is_one_case(made_up, tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "link.yaml").symlink_to(made_up)
    paths = [Path("made_up.yaml"), Path("other/../made_up.yaml"), Path("link.yaml"), made_up, tmp_path]
    (case,) = load_cases(paths)
    assert case.path == Path("made_up.yaml")


def test_the_help_tells_the_limits_of_what_is_not_a_run(capsys):
    assert compare.command(["--help"]) == 0
    words = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for seconds in (runjob.PREPARE_SECONDS, truthjob.TRUTH_SECONDS):
        assert f" {seconds:.0f}" in words


def test_no_case_at_all_is_a_bad_argument(capsys):
    assert compare.command([]) == 2
    assert "Missing argument" in capsys.readouterr().err


@pytest.mark.skipif(os.geteuid() == 0 if hasattr(os, "geteuid") else True, reason="root writes anywhere")
def test_a_folder_that_cannot_be_written_is_refused_at_once(made_up, tmp_path, capsys):
    (tmp_path / "locked").mkdir(mode=0o500)
    assert run(made_up, "--out", "locked") == 2
    assert "cannot write into" in capsys.readouterr().err


def test_a_folder_below_a_file_system_without_files_is_refused(made_up, capsys):
    assert run(made_up, "--out", "/proc/reports") == 2
    assert "cannot write into /proc" in capsys.readouterr().err


def test_a_folder_stands_for_all_its_cases_but_not_for_truths(tmp_path):
    for name in ("b.yaml", "a/c.yml", "truth/x.yaml", "a/truth/y.yaml"):
        (tmp_path / "cases" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "cases" / name).write_text("")
    assert [path.name for path in case_files(tmp_path / "cases")] == ["c.yml", "b.yaml"]
    (tmp_path / "empty").mkdir()
    with pytest.raises(CaseError, match="no case file"):
        case_files(tmp_path / "empty")


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
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert "No space left" in captured.err
    assert len(journal.read(tmp_path / "out" / "made_up" / journal.FILE)) >= 2
    assert not (tmp_path / "out" / "made_up" / "report.md").exists()
    monkeypatch.setattr(os, "fsync", real)
    assert run(made_up, "--out", "out", "--resume") == 0


def test_a_report_that_cannot_be_finished_leaves_the_old_one(made_up, tmp_path, monkeypatch):
    assert run(made_up, "--out", "out") == 0
    report = tmp_path / "out/made_up/report.md"
    before, entries = report.read_text(), sorted(os.listdir(tmp_path / "out"))
    from henon_ref.report import write

    def full(path: Path, content: bytes) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(write, "write_through", full)
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
        '{"files": 3}',
        '{"files": {"mine.txt": 1}}',
        '{"files": ["..", ".", "", "folder", "../escape", "a\\u0000b", "\\ud800", null, 3, ["mine.txt"]]}',
        json.dumps({"files": ["a" * 10_000]}),
    ],
)
def test_a_manifest_that_is_not_ours_takes_nothing_with_it(made_up, tmp_path, capsys, manifest):
    folder = tmp_path / "out" / "made_up"
    (folder / "folder").mkdir(parents=True)
    (folder / "mine.txt").write_text("kept")
    (tmp_path / "out" / "escape").write_text("kept")
    (folder / "manifest.json").write_text(manifest)
    assert run(made_up, "--out", "out", "--solvers", "henon") == 0
    assert capsys.readouterr().err == ""
    assert (folder / "folder").is_dir()
    assert (folder / "mine.txt").exists()
    assert (tmp_path / "out" / "escape").exists()
    assert json.loads((folder / "manifest.json").read_text())["case"] == "made_up"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_an_interrupt_keeps_finished_rows_and_says_how_to_go_on(made_up, tmp_path, number):
    script = tmp_path / "run.py"
    script.write_text(
        textwrap.dedent(f"""
        import signal
        import sys
        signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in what a shell runs in the background
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from fakes import Fake, statement
        from henon_ref import compare, registry
        from henon_ref.score import truthjob
        truthjob.statement_of = statement
        from henon_ref.report import command
        command.preload = lambda: None
        registry.solver = lambda name: Fake(name, "right" if name == "henon" else "hangs")
        sys.exit(compare.command(["made_up.yaml", "--out", "out", "--timeout", "60"]))
        """)
    )
    process = subprocess.Popen([sys.executable, str(script)], stderr=subprocess.PIPE, text=True, cwd=tmp_path)
    partial = tmp_path / "out" / "made_up" / journal.FILE
    deadline = time.monotonic() + 20
    while len(journal.read(partial)) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(number)
    _, errors = process.communicate(timeout=20)
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
    (folder / journal.FILE).write_text('{"key": "a"}\n')
    assert run(made_up, "--out", "out", "--solvers", "henon") == 0
    assert "--resume would keep 1 rows of made_up" in capsys.readouterr().err


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


def test_restarts_are_a_column_of_solvers(made_up, tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "solver", lambda name: Fake(name))
    assert run(made_up, "--out", "out", "--repeats", 1, "--restart", "none,offset") == 0
    with (tmp_path / "out" / "made_up" / "runs.csv").open() as file:
        names = [row["solver"] for row in csv.DictReader(file)]
    # The case lists henon, which restarts nothing, and heyoka.
    assert list(dict.fromkeys(names)) == ["henon", "heyoka@none", "heyoka@offset"]
    assert "--restart none,offset" in (tmp_path / "out" / "made_up" / "report.md").read_text()


def test_an_unknown_restart_is_refused_before_anything_runs(made_up, tmp_path, capsys):
    assert run(made_up, "--out", "out", "--restart", "fresh") == 2
    assert "unknown restart 'fresh'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_figures_can_be_left_out(made_up, tmp_path):
    out = tmp_path / "out"
    assert compare.command([str(made_up), "--no-figures", "--out", str(out)]) == 0
    assert not list(out.rglob("*.svg"))
    text = (out / "made_up" / "report.md").read_text(encoding="utf-8")
    assert "![" not in text
    assert "--no-figures" in text
