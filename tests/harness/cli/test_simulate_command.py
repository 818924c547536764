"""The command: one run of a case, its transitions printed."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest

import henon_ref as hr
from henon_ref.harness.cli.simulate import command

CASES = Path(__file__).parents[3] / "cases"


def test_it_prints_the_transitions_as_csv(capsys: pytest.CaptureFixture[str]) -> None:
    assert command([str(CASES / "stribeck_belt.yaml"), "--rtol", "1e-9", "--csv"]) == 0
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
    assert command([str(CASES / "hard" / "repelling.yaml"), "--csv"]) == 0
    assert "not unique" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.yaml"], "none.yaml: there is no such file"),
        ([str(CASES / "fig8.yaml"), "--reading", "q"], "no reading 'q'"),
        ([str(CASES / "fig8.yaml"), "--rtol", "0"], "a tolerance is a number from 1e-16"),
        ([str(CASES / "fig8.yaml"), "--rtol", "x"], "--rtol"),
        ([], "Missing argument"),
    ],
)
def test_what_cannot_be_meant_is_one_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(words) == 2
    shown = capsys.readouterr()
    assert said in shown.err
    assert (shown.out, shown.err.count("\n")) == ("", 1)
