"""Progress: on a terminal alone, and without a thread of its own."""

from __future__ import annotations

import io
import sys
import threading

import pytest

from henon_ref.sweeps import sweep
from henon_ref.sweeps.sweep import progress


class Terminal(io.StringIO):
    """A stream that says it is one."""

    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_points_rate_and_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Terminal()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sweep, "PERIOD", -1.0)
    before = threading.active_count()
    with progress(10) as advance:
        assert threading.active_count() == before
        advance(4, True)
        advance(3, False)
    assert stream.getvalue().startswith("4 of 10 points")
    assert "runs/s" in stream.getvalue()
    assert "left" in stream.getvalue()


@pytest.mark.parametrize("quiet", [True, False])
def test_elsewhere_nothing_is_shown(monkeypatch: pytest.MonkeyPatch, quiet: bool) -> None:
    stream = Terminal() if quiet else io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    with progress(10, quiet=quiet) as advance:
        advance(4, False)
    assert stream.getvalue() == ""
