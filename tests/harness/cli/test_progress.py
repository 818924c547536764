"""Status line in a terminal during a comparison."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest
from problems import LEAVING_SLIDE

from henon_ref import terminal
from henon_ref.commands import status_line

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="a terminal is a pseudo-terminal here")
QUICK = ["--solvers", "scipy-dop853", "--tolerances", "1e-6", "--repeats", "1", "--no-figures", "--out", "out"]
ERASED = "\x1b[2K"


def on_a_terminal(folder: Path, *arguments: str, **variables: str) -> tuple[int, str]:
    """The exit status of the program on a terminal of its own, and all that it has written there."""
    terminal, its_own = pty.openpty()
    program = subprocess.Popen(
        [sys.executable, "-m", "henon_ref", *arguments],
        cwd=folder,
        env={**os.environ, "TERM": "xterm-256color", "COLUMNS": "100", **variables},
        stdin=its_own,
        stdout=its_own,
        stderr=its_own,
        start_new_session=True,
    )
    os.close(its_own)
    written = b""
    while True:
        try:
            piece = os.read(terminal, 65536)
        except OSError:  # what a pseudo-terminal says once its other side is closed
            break
        if not piece:
            break
        written += piece
    os.close(terminal)
    return program.wait(), written.decode()


@pytest.fixture
def case(tmp_path, monkeypatch) -> Path:
    monkeypatch.delenv("NO_COLOR", raising=False)
    (tmp_path / "leaving_slide.yaml").write_text(LEAVING_SLIDE)
    return tmp_path


def test_a_terminal_is_shown_what_is_read_then_the_runs_at_work_then_the_table(case):
    status, written = on_a_terminal(case, "compare", "leaving_slide.yaml", *QUICK)
    assert status == 0
    assert written.startswith("reading leaving_slide.yaml")
    assert re.search(r"K[01] of 1 rows, .*running: leaving_slide default scipy-dop853 rtol 1e-06 \(\d+ s\)", written)
    end = written.split("\r")
    assert re.search(r"scipy-dop853 +1 of 1 ", written)
    assert end[-2].endswith("out/leaving_slide/report.md")
    assert "1 row, 1 right" not in written
    assert "\x1b[3" not in written  # no colours


def test_a_bad_file_on_a_terminal_leaves_its_message_alone(case):
    status, written = on_a_terminal(case, "compare", "nowhere.yaml")
    assert status == 2
    assert written.split(ERASED)[-1] == "error: nowhere.yaml: there is no such file\r\n"


def test_a_line_too_long_for_the_terminal_is_cut_and_holds_no_control_characters(monkeypatch, capsys):
    monkeypatch.setattr(terminal, "is_terminal", lambda stream: True)
    monkeypatch.setenv("COLUMNS", "40")
    status_line.show("reading \x1b[31m" + "x" * 100)
    shown = capsys.readouterr().err
    assert shown == ("reading [31m" + "x" * 100)[:39]
    status_line.clear()
    assert capsys.readouterr().err == f"\r{ERASED}"
    status_line.clear()
    assert capsys.readouterr().err == ""


def test_without_a_terminal_nothing_is_shown(capsys):
    status_line.show("reading")
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", "")
