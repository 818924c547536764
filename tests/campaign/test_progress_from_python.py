"""The line that tells how a comparison gets on."""

from __future__ import annotations

import io
import sys
from types import SimpleNamespace

import pytest

from henon_ref.campaign import progress
from henon_ref.campaign.progress import ProgressLine, is_seen


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def clock(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def shown(stream: io.StringIO, clock: list[float]) -> str:
    with ProgressLine(stream, "belt") as line:
        line.truths(0)
        line.runs(12, 3)
        line.begun("belt", "default henon at 1e-9, a long name")
        clock[0] = 6.0
        line.row(SimpleNamespace())
        line.begun("belt", "\x1b[31mred")
        clock[0] = 6.1
        line.tick()
    return stream.getvalue()


def test_a_terminal_s_line_is_written_over_and_stays_at_the_end(clock):
    lines = shown(Terminal(), clock).split("\r")
    assert [line.rstrip() for line in lines] == [
        "",
        "belt: 3 of 12 rows, 0 s; at work: default henon at 1e-9, a long name",
        "belt: 4 of 12 rows, 6 s; at work: [31mred",
        "belt: 4 of 12 rows, 6.1 s",
    ]
    assert len(lines[2]) == len(lines[1])  # what was longer is written over
    assert lines[-1].endswith("\n")


def test_elsewhere_there_are_a_few_lines(clock):
    assert shown(io.StringIO(), clock).splitlines() == [
        "belt: 3 of 12 rows, 0 s; at work: default henon at 1e-9, a long name",
        "belt: 4 of 12 rows, 6 s; at work: [31mred",
        "belt: 4 of 12 rows, 6.1 s",
    ]


def test_what_is_watched_is_a_terminal_or_a_notebook(monkeypatch):
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    assert is_seen(Terminal())
    assert not is_seen(io.StringIO())
    assert not is_seen(None)
    for shell, seen in ((None, False), (SimpleNamespace(), False), (SimpleNamespace(kernel=object()), True)):
        monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda shell=shell: shell))
        assert is_seen(io.StringIO()) == seen
