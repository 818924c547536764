"""The progress line of a comparison."""

from __future__ import annotations

import io
import sys
from types import SimpleNamespace

import pytest

from henon_ref.harness.campaign import progress
from henon_ref.harness.campaign.progress import ProgressLine, is_seen
from henon_ref.harness.campaign.rows import Record
from henon_ref.harness.rows import RunRow
from henon_ref.sweeps.sweep import progress as sweep_progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch):
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("TERM", "xterm")
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


RUN = RunRow("belt", "default", "henon", rtol=1e-9, verdict="right", digits=11.27)


def shown(stream: io.StringIO | None, clock: list[float], name: str | None) -> str | None:
    with ProgressLine(stream, name) as line:
        line.stage("truths", 0)
        line.stage("rows", 12, 3)
        line.begun("belt", "default henon rtol 1e-09")
        clock[0] = 6.0
        line.row(Record(RUN))
        line.begun("belt", "\x1b[31mred")
        clock[0] = 6.1
        line.tick()
    return stream and stream.getvalue()


ERASED = "\r\x1b[2K"
LINES = [
    "3 of 12 rows, 0 s; running: belt default henon rtol 1e-09 (0 s)",
    "4 of 12 rows, 6 s; running: belt [31mred (0 s)",
]


def test_a_terminal_s_line_is_written_over_and_stays_at_the_end(clock):
    lines = shown(Terminal(), clock, "belt").split(ERASED)
    assert lines == [*(f"belt: {line}" for line in LINES), "belt: 4 of 12 rows, 6.1 s\n"]


def test_a_command_s_line_is_taken_back(clock):
    assert shown(Terminal(), clock, None).split(ERASED) == [*LINES, ""]


def test_elsewhere_there_are_a_few_lines_and_of_a_command_none(clock):
    text = shown(io.StringIO(), clock, "belt")
    clock[0] = 0.0
    assert text.splitlines() == [*(f"belt: {line}" for line in LINES), "belt: 4 of 12 rows, 6.1 s"]
    assert shown(io.StringIO(), clock, None) == "4 of 12: belt default henon rtol 1e-09: right, 11.2 digits\n"


def test_what_is_watched_is_a_terminal_or_a_notebook(monkeypatch):
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    assert is_seen(Terminal())
    assert not is_seen(io.StringIO())
    assert not is_seen(None)
    for shell, seen in ((None, False), (SimpleNamespace(), False), (SimpleNamespace(kernel=object()), True)):
        monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda shell=shell: shell))
        assert is_seen(io.StringIO()) == seen


def test_a_notebook_s_line_is_its_own_output_not_standard_error(clock, monkeypatch, capsys):
    """Which notebooks colour as if something were wrong; no widgets are needed for it."""
    told: list[str] = []

    class Handle:
        def update(self, content: dict[str, str], raw: bool) -> None:
            told.append(content["text/plain"])

    def display(content: dict[str, str], raw: bool, display_id: bool) -> Handle:
        told.append(content["text/plain"])
        return Handle()

    shell = SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=display))
    stream = io.StringIO()
    assert shown(stream, clock, "belt") == ""
    assert told == [*(f"belt: {line}" for line in LINES), "belt: 4 of 12 rows, 6.1 s"]
    told.clear()
    shown(None, clock, "belt")  # as without progress
    shown(None, clock, None)
    assert told == []
    assert capsys.readouterr() == ("", "")
    with sweep_progress(20) as advance:
        advance(5, False)
        advance(15, False)
    assert told == ["5 of 20 points, 5,000,000,000 runs/s, 0 s left", "20 of 20 points in 0.0 s"]
