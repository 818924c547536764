"""The command: a picture of a stick-slip orbit, and a line that names it."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from henon_ref.commands.simulate import demo_command as command


def test_it_draws_a_picture_and_says_where(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert command([]) == 0
    shown = capsys.readouterr()
    assert (shown.out.count("\n"), shown.err) == (1, "")
    assert shown.out.startswith("demo.png: a block on a moving belt, 7 transitions, 3 whole sticks")
    with Image.open(tmp_path / "demo.png") as picture:
        assert picture.size[0] > 1000


def test_the_picture_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(["--out", str(tmp_path / "belt.svg")]) == 0
    text = (tmp_path / "belt.svg").read_text()
    assert "<title" in text
    assert command(["--out", str(tmp_path / "belt.doc")]) == 2
    assert "the name of a figure must end with one of .png, .svg, .pdf" in capsys.readouterr().err
