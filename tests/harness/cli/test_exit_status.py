"""Exit statuses: 3 and a log for an unforeseen error; a closed output stream does not change the status."""

from __future__ import annotations

import errno
import importlib
import os
import re
import signal
import stat
import subprocess
import sys
import tempfile
from importlib import metadata
from pathlib import Path

import pytest

from henon_ref.commands import exit_status
from henon_ref.errors import CaseError
from henon_ref.harness.cli import compare_cases, stored
from henon_ref.harness.report import folder

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="made-up solvers reach workers by fork")
COMMAND = [sys.executable, "-m", "henon_ref.compare"]
CASE = Path(__file__).parents[3] / "cases" / "leaving_slide.yaml"
"""Its truth is stored."""


def broken(*arguments: object, **options: object) -> None:
    raise KeyError("nobody\nforesaw this")


@pytest.fixture
def logs(monkeypatch, tmp_path_factory) -> Path:
    """The user's folder of logs."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
    handler = signal.getsignal(signal.SIGTERM)
    yield Path(os.environ["XDG_STATE_HOME"]) / "henon_ref" / "log"
    signal.signal(signal.SIGTERM, handler)


COMMANDS = {
    "compare": (importlib.import_module("henon_ref.harness.cli.compare").command, compare_cases, "load_cases"),
    "truth": (stored.truth_command, stored, "load_cases"),
    "study": (importlib.import_module("henon_ref.harness.cli.study").command, folder, "check_writable"),
    "check": (stored.check_command, stored, "load_cases"),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_what_nobody_foresaw_is_status_3_and_one_message_with_the_path_of_a_log(
    logs, tmp_path, monkeypatch, capsys, name
):
    program, place, function = COMMANDS[name]
    monkeypatch.setattr(place, function, broken)
    arguments = ["paper"] if name == "study" else ["some case.yaml"]
    monkeypatch.chdir(tmp_path)
    assert program(arguments) == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: unforeseen: KeyError: ")
    log = Path(re.search(r"the log is (\S+)$", line)[1])
    assert log.parent == logs
    assert stat.S_IMODE(logs.stat().st_mode) == stat.S_IMODE(logs.parent.stat().st_mode) == 0o700
    text = log.read_text()
    assert f"python -m henon_ref.{name} 'some case.yaml'" in text or name == "study"
    assert "Traceback (most recent call last)" in text
    assert "in broken" in text
    assert re.search(r"^numpy \d", text, re.MULTILINE)


@pytest.mark.parametrize("error", [EOFError("no answer"), BrokenPipeError(errno.EPIPE, "broken pipe")], ids=repr)
def test_an_error_that_typer_takes_for_an_end_of_the_user_s_input_or_output_is_reported(
    logs, monkeypatch, capsys, error
):
    def raised(*arguments: object, **options: object) -> None:
        raise error

    monkeypatch.setattr(compare_cases, "load_cases", raised)
    assert COMMANDS["compare"][0](["some case.yaml"]) == 3
    assert capsys.readouterr().err.strip().startswith(f"error: unforeseen: {type(error).__name__}: ")
    (log,) = logs.iterdir()
    assert "in raised" in log.read_text()


@pytest.mark.parametrize("fault", ["a file in its place", "others can write there"])
def test_a_log_that_cannot_lie_in_the_user_s_folder_lies_in_a_temporary_one(logs, tmp_path, monkeypatch, fault):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    if fault == "a file in its place":
        logs.parent.write_text("")
    else:
        logs.mkdir(parents=True)
        logs.chmod(0o777)
    log = exit_status.write_log(ValueError("it"), "compare", [])
    assert log.parent.parent == tmp_path
    assert stat.S_IMODE(log.parent.stat().st_mode) == 0o700
    assert "ValueError: it" in log.read_text()


def test_what_cannot_even_say_what_is_wrong_is_logged(logs, tmp_path, monkeypatch, capsys):
    class MuteError(Exception):
        def __str__(self) -> str:
            raise RuntimeError

    def act() -> int:
        raise MuteError

    monkeypatch.setattr(metadata, "distributions", broken)
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert exit_status.exit_status(act, name="compare", arguments=[]) == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert Path(line.rpartition("the log is ")[2]).parent == logs


def test_a_library_that_wants_to_exit_is_nothing_foreseen(logs, capsys):
    def act() -> int:
        sys.exit(0)

    assert exit_status.exit_status(act, name="compare", arguments=[]) == 3
    assert "unforeseen: SystemExit" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (OSError(errno.ENOSPC, "full"), 2),
        (PermissionError(errno.EACCES, "not allowed", "out/report.md"), 2),
        (PermissionError(errno.EACCES, "not allowed", "/etc/elsewhere"), 3),
        (OSError(errno.EMFILE, "too many open files"), 3),
        (BrokenPipeError(errno.EPIPE, "broken pipe"), 3),
        (KeyboardInterrupt(), 130),
        (CaseError("no", file="a.yaml", line=3, column=4), 2),
    ],
)
def test_what_is_wrong_with_the_folder_is_a_bad_argument_and_nothing_else_is(logs, capsys, error, status):
    def act() -> int:
        with exit_status.writing_into(Path("out")):
            raise error

    assert exit_status.exit_status(act, name="compare", arguments=[]) == status
    assert capsys.readouterr().err.count("\n") == 1


def test_a_message_is_one_line_that_a_terminal_can_be_shown(capsys):
    exit_status.say("a\x1b[31m\nb\r" + "c" * 60_000)
    line = capsys.readouterr().err
    assert line.startswith("a [31m b ccc")
    assert len(line) <= 2001


def test_closed_streams_are_no_failure_in_a_folder_with_spaces_and_unicode_without_a_locale(tmp_path):
    folder = tmp_path / "Reibung und Stöße – µ"
    folder.mkdir()
    (folder / "Mein Fall.yaml").write_text(CASE.read_text(encoding="utf-8"), encoding="utf-8")
    options = ["--solvers", "scipy-dop853", "--tolerances", "1e-6", "--repeats", "1", "--no-figures", "--out", "Erg 1"]
    shell = ["/bin/sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", *COMMAND, "Mein Fall.yaml", *options]
    environment = {**os.environ, "LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0"}
    del environment["HOME"]
    assert subprocess.run(shell, cwd=folder, env=environment, timeout=600).returncode == 0
    assert (folder / "Erg 1" / "leaving_slide" / "runs.csv").stat().st_size > 0
    assert (folder / "Erg 1" / "README.md").exists()


EXPLAINED = [*COMMAND, str(CASE), "--check"]


def test_a_full_disk_behind_the_standard_output_is_an_error(tmp_path):
    shell = ["/bin/sh", "-c", 'exec "$@" >/dev/full', "sh", *EXPLAINED]
    done = subprocess.run(shell, cwd=tmp_path, timeout=600, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2
    assert done.stderr == "error: cannot write the standard output: No space left on device\n"


def test_a_reader_that_has_gone_is_no_failure(tmp_path):
    reader, writer = os.pipe()
    os.close(reader)
    for arguments, status in (EXPLAINED, 0), ([*COMMAND, "nowhere.yaml"], 2):
        done = subprocess.run(arguments, cwd=tmp_path, stdout=writer, stderr=writer, timeout=600)
        assert done.returncode == status
    os.close(writer)


def test_what_a_terminal_has_no_characters_for_is_written_another_way():
    call = "exit_status.exit_status(lambda: print(chr(233)), name='', arguments=[])"
    script = f"import sys; from henon_ref.commands import exit_status; sys.exit({call})"
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "\\xe9\n", "")
