"""Final output of a comparison: the table, the runs that are not right, one JSON document."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest
from commands import SOLVERS, run
from fakes import CASE, Fake

from henon_ref.harness import registry
from henon_ref.harness.cli.compare_cases import Failing, case_line, document, failing, failing_line, print_end
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.ranking import standings, tightest
from henon_ref.text import LONGEST_LINE

HOSTILE = "[red]hot[/red] :smile:\n\x1b[31m\x9b1m" + "x" * 5000


def row(solver: str, rtol: float, reading: str = "default", **values: object) -> RunRow:
    right = {"status": "ok", "verdict": "right", "digits": 9.0, "wall_s": 1e-3, "status_reason": None}
    known = {"case": "made_up", "reading": reading, "solver": solver, "rtol": rtol}
    return RunRow(**known | right | values)


def test_the_row_at_the_tightest_setting_speaks_for_a_solver():
    rows = [row("a", 1e-3), row("a", 1e-9), row("a", 1e-6), row("b", 1e-3), row("a", 1e-3, "other")]
    rows += [replace(row("c", 0.0), rtol=None, step_s=step) for step in (1e-2, 1e-4)]
    found = [(own.solver, own.reading, own.rtol or own.step_s) for own in tightest(rows)]
    assert found == [("a", "default", 1e-9), ("b", "default", 1e-3), ("a", "other", 1e-3), ("c", "default", 1e-4)]


def test_times_are_set_against_the_fastest_right_run_of_the_same_reading():
    rows = [
        row("quick", 1e-9, "one", wall_s=1.0, digits=8.0),
        row("quick", 1e-9, "two", wall_s=8.0, digits=12.0),
        row("slow", 1e-9, "one", wall_s=2.0),
        row("slow", 1e-9, "two", wall_s=64.0),
        row("wrong", 1e-9, "one", wall_s=0.001, status="wrong", verdict="solver defect", digits=None),
    ]
    lines = standings(rows)
    assert [line.solver for line in lines] == ["quick", "slow", "wrong"]
    assert [(line.right, line.judged) for line in lines] == [(2, 2), (2, 2), (0, 1)]
    assert [line.digits for line in lines] == [8.0, 9.0, None]
    assert [line.time_s for line in lines] == [4.5, 33.0, None]
    assert lines[0].times_as_long == pytest.approx(1.0)
    assert lines[1].times_as_long == pytest.approx((2.0 * 8.0) ** 0.5)
    assert lines[2].times_as_long is None


def test_what_has_no_answer_is_told_and_not_judged():
    gone = {"status": "unavailable", "status_reason": "x is not installed", "verdict": "not run", "wall_s": None}
    late = {"status": "timeout", "status_reason": "late", "verdict": "not judged", "wall_s": None}
    made = [
        row("gone", 1e-9, "one", **gone),
        row("gone", 1e-9, "two", **gone),
        row("late", 1e-9, "one", **late),
        row("hidden", 1e-9, "one", status="wrong", verdict="ill-conditioned"),
    ]
    assert all(not line.judged for line in standings(made))
    assert failing(made) == [
        Failing("gone", "unavailable", "x is not installed", ("made_up one at 1e-9", "made_up two at 1e-9")),
        Failing("late", "timeout", "late", ("made_up one at 1e-9",)),
    ]


def test_without_a_terminal_the_table_is_plain_columns(capsys):
    print_end([row("henon", 1e-9), row("b", 1e-9, wall_s=2e-3, digits=7.26)], readings=1)
    assert capsys.readouterr().out.splitlines() == [
        "solver  right of judged  digits  time  times as long",
        "henon            1 of 1       9  1 ms              1",
        "b                1 of 1     7.2  2 ms              2",
    ]


def test_one_line_installs_the_libraries_that_are_missing(capsys, monkeypatch):
    monkeypatch.setattr(registry, "version", lambda package: "1" if package == "scipy" else missing())
    gone = {"status": "unavailable", "status_reason": "it is not installed", "verdict": "not run", "wall_s": None}
    named = ["heyoka@direction", "cvode-adams", "ida", "nosnoc", "diffrax-dopri8", "scipy-bdf+numba", "somebody's"]
    print_end([row(solver, 1e-9, **gone) for solver in named], readings=1)
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1] == "to install missing packages: pip install 'henon-ref[peers]' heyoka scikit-sundae"
    print_end([row("heyoka", 1e-9)], readings=1)
    assert "install" not in capsys.readouterr().out


def missing():
    raise PackageNotFoundError


def test_a_strangers_words_are_text_in_one_line(capsys):
    hostile = row("a" + HOSTILE, 1e-9, status="failed", status_reason=HOSTILE, verdict="solver defect", wall_s=None)
    print_end([hostile], readings=1)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3
    assert all(line.isprintable() and len(line) <= 2 * LONGEST_LINE for line in lines)
    assert "a[red]hot[/red] :smile: [31m 1mxxx" in lines[1]
    assert failing_line(Failing("a", "failed", HOSTILE, ("here",))).startswith("a: failed ([red]hot[/red] :smile: [31m")
    assert case_line("made_up", [hostile], Path("\x1b[1mout")).isprintable()
    assert json.loads(document([hostile], Path("out")))["failing"][0]["reason"] == HOSTILE


command = pytest.mark.skipif(sys.platform != "linux", reason="made-up solvers reach workers by fork")


@command
@pytest.mark.usefixtures("made_up_solvers")
def test_plain_lines_are_one_a_case_then_the_table_then_the_path(made_up, tmp_path, capsys):
    (tmp_path / "other.yaml").write_text(CASE.format(name="other"))
    assert run(made_up, "other.yaml", "--repeats", 1) == 0
    captured = capsys.readouterr()
    lines = captured.out.splitlines()
    assert captured.err.count(" of 8: ") == captured.err.count("\n") == 8
    assert sorted(lines[:2]) == [
        "made_up: 4 rows, 2 right: out/made_up/report.md",
        "other: 4 rows, 2 right: out/other/report.md",
    ]
    assert lines[2].split() == ["solver", "right", "of", "judged", "digits", "time", "times", "as", "long"]
    assert lines[3].split()[:4] == ["henon", "2", "of", "2"]
    assert lines[4].split() == ["heyoka", "0", "of", "2"]
    assert lines[5].startswith("Each solver at its tightest setting")
    where = "made_up default at 1e-6, other default at 1e-6"
    assert lines[6].startswith("heyoka: wrong (1 missed, 0 spurious, first missed: crossing at t = 2): ")
    assert sorted(lines[6].split("): ")[1].split(", ")) == where.split(", ")
    assert lines[7:] == ["out/README.md; gate met"]
    assert "\x1b" not in captured.out


@command
@pytest.mark.usefixtures("made_up_solvers")
def test_json_is_one_document_and_nothing_else(made_up, capsys):
    assert run(made_up, "--json", "--gate", "--require", "heyoka") == 1
    captured = capsys.readouterr()
    found = json.loads(captured.out)
    assert found["report"] == "out/made_up/report.md"
    assert found["gate"] == "gate met"
    henon, heyoka = found["solvers"]
    assert (henon["solver"], henon["right"], henon["judged"], henon["times_as_long"]) == ("henon", 1, 1, 1.0)
    assert henon["time_s"] > 0
    assert (heyoka["solver"], heyoka["right"], heyoka["digits"], heyoka["time_s"]) == ("heyoka", 0, None, None)
    assert [(own["solver"], own["status"], own["where"]) for own in found["failing"]] == [
        ("heyoka", "wrong", ["made_up default at 1e-6"])
    ]
    assert captured.err.splitlines()[4].startswith("required: made_up: default: heyoka")


@command
@pytest.mark.usefixtures("made_up_solvers")
def test_json_of_a_bad_argument_is_nothing_on_standard_output(made_up, capsys):
    assert run(made_up, "--json", "--solvers", "henn") == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1


@command
@pytest.mark.usefixtures("made_up_solvers")
def test_a_solver_that_raises_is_told_with_its_reason(made_up, monkeypatch, capsys):
    monkeypatch.setattr(registry, "solver", {**SOLVERS, "heyoka": Fake("heyoka", "raises")}.__getitem__)
    assert run(made_up) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("heyoka: ")]
    assert line.startswith("heyoka: failed (")
    assert line.endswith("made_up default at 1e-6")
