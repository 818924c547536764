"""What takes more than a second is said in one line, where somebody sees it."""

from __future__ import annotations

import threading
import time

import pytest

from henon_ref import terminal


@pytest.mark.parametrize(("watched", "seconds", "lines"), [(True, 0.3, 1), (True, 0.0, 0), (False, 0.3, 0)])
def test_slow_work_is_told_of_once(
    watched: bool, seconds: float, lines: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(terminal, "NOTICE_DELAY", 0.05)
    monkeypatch.setattr(terminal, "is_watched", lambda: watched)
    threads = threading.active_count()
    with terminal.notice_if_slow():
        time.sleep(seconds)
    assert capsys.readouterr().err == "henon_ref: compiling the system, once\n" * lines
    assert threading.active_count() == threads
