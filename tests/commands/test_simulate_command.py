"""The command: one run of a case, its transitions printed."""

from __future__ import annotations

import csv
import errno
import io
import os
import sys
from pathlib import Path

import pytest

import henon_ref as hr
from henon_ref.commands import status_line
from henon_ref.commands.simulate import command

CASES = Path(__file__).parents[2] / "cases"


def test_it_prints_the_transitions_as_csv(capsys: pytest.CaptureFixture[str]) -> None:
    assert command([str(CASES / "stribeck_belt.yaml"), "--rtol", "1e-9", "--csv", "-"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    case = hr.System.from_case(CASES / "stribeck_belt.yaml")
    table = hr.simulate(case, case.initial, until=case.until, rtol=1e-9).transitions
    assert [float(row["time_s"]) for row in rows] == table.time_s.tolist()
    assert [row["to_mode"] for row in rows] == table.to_mode.tolist()
    assert list(rows[0]) == list(table.columns)


def test_it_prints_a_table_of_the_reading_that_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert command([str(CASES / "fig8.yaml"), "--reading", "listing_limit"]) == 0
    shown = capsys.readouterr()
    assert "from_mode" in shown.out.splitlines()[0]
    assert "Solution(ok; t = 0 to " in shown.err


def test_a_run_that_ends_early_says_so_and_is_no_failure(capsys: pytest.CaptureFixture[str]) -> None:
    assert command([str(CASES / "hard" / "repelling.yaml"), "--csv", "-"]) == 0
    assert "not unique" in capsys.readouterr().err


def test_parameters_starts_and_the_horizon_are_set_and_files_are_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--until", "12.5", "--set", "vp=1/2", "--set", "x1=1.25"]
    files = [tmp_path / name for name in ("belt.csv", "belt.svg")]
    given = [*words, "--csv", str(files[0]), "--plot", str(files[1])]
    assert command([str(CASES / "stribeck_belt.yaml"), *given]) == 0
    shown = capsys.readouterr()
    assert shown.out == ""
    assert [line.split(": ")[0] for line in shown.err.splitlines()[:2]] == ["written", "written"]
    assert "t = 0 to 12.5" in shown.err
    case = hr.System.from_case(CASES / "stribeck_belt.yaml")  # whose block starts with the belt: x2 is vp
    run = hr.simulate(case, {"x1": 1.25, "x2": 0.5}, until=12.5, parameters={"vp": 0.5})
    assert files[0].read_text() == run.transitions.to_csv(index=False)
    assert "<svg" in files[1].read_text()


def test_a_terminal_shows_the_horizon_while_the_run_lasts(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[str] = []
    monkeypatch.setattr(status_line, "show", shown.append)
    assert command([str(CASES / "stribeck_belt.yaml"), "--until", "12.5", "--csv", "-"]) == 0
    assert command([str(CASES / "stribeck_belt.yaml"), "--csv", "-"]) == 0
    assert shown == [f"simulating to t = {end} s; Ctrl-C interrupts" for end in ("12.5", "62")]


def test_the_case_file_is_not_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    case = tmp_path / "my.yaml"
    case.write_text((CASES / "leaving_slide.yaml").read_text())
    monkeypatch.chdir(tmp_path)
    assert command([str(case), "--csv", "my.yaml"]) == 2
    assert capsys.readouterr().err == "error: --csv my.yaml: this is the file of the case; name another one\n"
    assert case.read_text() == (CASES / "leaving_slide.yaml").read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.yaml"], "none.yaml: there is no such file"),
        ([str(CASES / "fig8.yaml"), "--reading", "q"], "no reading 'q'"),
        ([str(CASES / "fig8.yaml"), "--rtol", "0"], "a tolerance is a number from 1e-16"),
        ([str(CASES / "fig8.yaml"), "--rtol", "x"], "--rtol"),
        ([str(CASES / "stribeck_belt.yaml"), "--set", "G=1"], "'G' is neither a parameter nor a state; names: "),
        ([str(CASES / "stribeck_belt.yaml"), "--set", "vp"], "--set vp: wanted NAME=VALUE"),
        ([str(CASES / "stribeck_belt.yaml"), "--set", "vp=x"], "vp"),
        ([str(CASES / "stribeck_belt.yaml"), "--set", "vp=1", "--set", "vp=2"], "--set vp=2: 'vp' is set twice"),
        ([str(CASES / "stribeck_belt.yaml"), "--until", "-1"], "until"),
        ([str(CASES / "stribeck_belt.yaml"), "--plot", "a.bmp"], "must end with one of .png, .svg, .pdf"),
        ([str(CASES / "stribeck_belt.yaml"), "--plot", "none/a.png"], "the folder none does not exist"),
        ([str(CASES / "stribeck_belt.yaml"), "--csv", "none/a.csv"], "cannot write none/a.csv"),
        ([str(CASES / "fig8.yaml"), "--csv", "a.svg", "--plot", "./a.svg"], "--csv a.svg: this is the file of --plot"),
        ([], "Missing argument"),
    ],
)
def test_what_cannot_be_meant_is_one_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(words) == 2
    shown = capsys.readouterr()
    assert said in shown.err
    assert (shown.out, shown.err.count("\n")) == ("", 1)


@pytest.mark.skipif(sys.platform == "win32", reason="links need a privilege there")
@pytest.mark.parametrize(("option", "name"), [("--csv", "belt.csv"), ("--plot", "belt.svg")])
def test_a_file_that_cannot_be_written_whole_leaves_the_earlier_one(
    option: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a full disk, and also through a link."""
    (tmp_path / name).write_text("earlier")
    (tmp_path / f"link_{name}").symlink_to(tmp_path / name)

    def full(file: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    given = [str(CASES / "stribeck_belt.yaml"), "--until", "1", option]
    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        for place in (name, f"link_{name}"):
            assert command([*given, str(tmp_path / place)]) == 2
            assert "No space left on device" in capsys.readouterr().err
    assert {path.name for path in tmp_path.iterdir()} == {name, f"link_{name}"}
    assert (tmp_path / name).read_text() == "earlier"
    assert command([*given, str(tmp_path / f"link_{name}")]) == 0
    assert (tmp_path / f"link_{name}").is_symlink()
    assert (tmp_path / name).read_text() != "earlier"
