"""The command ``gate``: reports are checked against bounds, required solvers and an earlier comparison, for CI."""

from __future__ import annotations

import json
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from fakes import case
from made_reports import ORIGIN, changed, compared, made

from henon_ref.errors import CaseError
from henon_ref.harness.cli.gate import command, read_known
from henon_ref.harness.report.case_report import write_report
from henon_ref.harness.result_files import read_rows, rows_text
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.gate import KnownFailure

GATE = {"henon": replace(case().readings[0].gate["henon"], at=1e-6, max_time_error=1e-5)}
FAILS = "scipy-sign"
WRONG = "made_up: default: scipy-sign (rtol 1e-06): wrong (1 missed, 0 spurious, first missed: crossing at t = 2)"


@pytest.fixture
def out(monkeypatch, tmp_path) -> Path:
    """A folder with the report of a solver that is right and one that is wrong, where nobody else's CI is set up."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)
    records = [made("henon", 1e-6, 2e-4), made("henon", 1e-9, 3e-4), made(FAILS, 1e-6, 1e-5, what="misses")]
    reported(tmp_path / "out", records)
    return Path("out")


def reported(folder: Path, records) -> None:
    comparison = compared(*records)
    readings = tuple(replace(reading, gate=GATE) for reading in comparison.case.readings)
    write_report(replace(comparison, case=replace(comparison.case, readings=readings)), ORIGIN, folder)


def earlier(out: Path, solver: str, **values: object) -> Path:
    """A baseline in which the rows of a solver were otherwise."""
    rows = read_rows(RunRow, out / "made_up/runs.csv")
    rows = [replace(row, **values) if row.solver == solver else row for row in rows]
    Path("baseline.csv").write_text(rows_text(RunRow, rows))
    return Path("baseline.csv")


def known(*lines: str) -> Path:
    Path("known.csv").write_text("\n".join(["case,reading,solver,rtol,status,reason", *lines, ""]))
    return Path("known.csv")


def gate(*arguments: object) -> int:
    return command([str(argument) for argument in arguments])


def test_a_report_that_meets_its_gate_passes(out, capsys):
    assert gate(out) == gate(out / "made_up") == gate(out / "made_up/runs.csv") == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines()[0] == "out: 3 rows; gate met"
    assert captured.err == ""


def test_a_bound_that_is_not_met_decides_the_exit_status(out, capsys):
    reported(out, [changed(made("henon", 1e-6, 2e-4), max_time_error_s=2e-5)])
    assert gate(out, "--junit", "results/junit.xml") == 1
    words = "henon (rtol 1e-06): worst time error 2e-05 s, wanted <= 1e-05 s"
    captured = capsys.readouterr()
    assert captured.err == f"gate: made_up: default: {words}\n"
    assert captured.out == "out: 1 row; gate not met\n"
    (failure,) = ElementTree.parse("results/junit.xml").getroot().iter("failure")
    assert failure.text == f"gate: default: {words}"
    assert gate(out, "--known", known("made_up,,henon,1e-6,,slow")) == 0
    words = "known: case made_up, solver henon, rtol 1e-06: fails as expected (slow): made_up: default: henon"
    assert capsys.readouterr().err.startswith(words)


def test_bounds_on_what_did_not_run_are_left_out_and_none_at_all_does_not_pass(out, capsys):
    reported(out, [made("heyoka", 1e-6, 1e-3)])
    assert gate(out) == 1
    assert capsys.readouterr().err.splitlines() == [
        "gate: bounds are skipped for runs that did not take place: henon",
        "gate: all 2 bounds are for solvers that were not run",
    ]


def test_a_report_without_its_manifest_is_told(out, capsys):
    (out / "made_up/manifest.json").unlink()
    assert gate(out) == 0
    assert capsys.readouterr().err == (
        "gate: the bounds of these reports are unknown, since there is no out/made_up/manifest.json\n"
    )


def test_a_report_of_an_earlier_version_has_no_bounds(out, capsys):
    manifest = out / "made_up/manifest.json"
    content = json.loads(manifest.read_text())
    del content["gate"]
    manifest.write_text(json.dumps(content))
    assert gate(out) == 0
    assert capsys.readouterr().out == "out: 3 rows\n"
    manifest.write_text('{"gate": [{"case": "c"}]}')
    assert gate(out) == 2
    assert "manifest.json: cannot be read: " in capsys.readouterr().err


def test_a_required_solver_that_is_wrong_decides_the_exit_status(out, capsys):
    shutil.copytree(out / "made_up", out / "other")
    assert gate(out, "--require", "henon") == 0
    assert capsys.readouterr().out == "out: 6 rows; gate met; henon right in 1 of 1 judged\n"
    assert gate(out, "--require", f"{FAILS},ida") == 1
    assert capsys.readouterr().err.splitlines() == [
        f"required: {WRONG}", "required: there is no reading in which ida can be judged",
    ]  # fmt: skip


def test_the_same_again_is_no_worse(out, capsys):
    assert gate(out, "--baseline", out) == 0
    assert capsys.readouterr().err == "baseline: 3 rows compared, none worse\n"


def test_a_row_whose_status_got_worse_decides_the_exit_status(out, capsys):
    before = earlier(out, FAILS, status="ok", verdict="right", status_reason=None)
    assert gate(out, "--baseline", before, "--junit", "junit.xml") == 1
    first, worse = capsys.readouterr().err.splitlines()
    assert first == "baseline: 3 rows compared, 1 worse"
    assert worse.startswith(f"baseline: made_up: default: {FAILS} (rtol 1e-06): was ok, is wrong (1 missed")
    assert "worse than the baseline: was ok, is wrong" in Path("junit.xml").read_text()


@pytest.mark.parametrize(("factor", "status"), [(1.25, 0), (10.0, 1), (0.01, 0)])
def test_a_row_that_lost_digits_decides_the_exit_status(out, capsys, factor, status):
    before = earlier(out, "henon", max_time_error_s=0.99e-6 / factor, rtol=1e-6)
    assert gate(out, "--baseline", before) == status
    assert ("1.00 digits fewer" in capsys.readouterr().err) == bool(status)


def test_rows_that_did_not_run_are_named_and_decide_nothing(out, capsys):
    assert gate(out, "--baseline", earlier(out, FAILS, rtol=1e-4)) == 0
    assert capsys.readouterr().err.splitlines() == [
        "baseline: 2 rows compared, none worse, 1 new row",
        f"baseline: 1 row of it did not run this time: made_up: default: {FAILS} (rtol 0.0001)",
    ]
    lines = earlier(out, "henon", case="another").read_text().splitlines()
    Path("baseline.csv").write_text("\n".join(lines[:3]) + "\n")
    assert gate(out, "--baseline", "baseline.csv") == 1
    assert capsys.readouterr().err.splitlines()[-1] == "baseline: none of its rows ran this time"


def test_the_columns_of_the_contract_are_enough_for_a_baseline(out):
    """A file of an earlier version, which has less than a report of now, and of another's, which has more."""
    Path("few.csv").write_text("case,reading,solver,rtol,step_s,status,max_time_error_s,note\n"
                               "made_up,default,henon,1e-6,,ok,1e-9,mine\n")  # fmt: skip
    assert gate(out, "--baseline", "few.csv") == 1


def test_a_known_failure_is_told_and_not_counted(out, capsys):
    before = earlier(out, FAILS, status="ok", verdict="right")
    options = ["--require", FAILS, "--baseline", before, "--junit", "junit.xml"]
    assert gate(out, *options, "--known", known(f"made_up,,{FAILS},,wrong,no events")) == 0
    line = capsys.readouterr().err.splitlines()[-1]
    assert line == f"known: case made_up, solver {FAILS}, status wrong: fails as expected (no events): {WRONG}"
    root = ElementTree.parse("junit.xml").getroot()
    assert (root.get("failures"), root[0].get("skipped")) == ("0", "1")
    assert gate(out, *options, "--known", known(f"made_up,,{FAILS},,failed,")) == 1
    assert gate(out, *options, "--known", known(f"made_up,,{FAILS},1e-3,,")) == 1


def test_a_failure_that_is_fixed_is_reported(out, capsys):
    lines = ["made_up,default,henon,1e-6,wrong,", f",,{FAILS},,,", "another,,,,,"]
    assert gate(out, "--known", known(*lines)) == 0
    fixed, failing, nowhere = capsys.readouterr().err.splitlines()
    assert fixed.startswith("known: case made_up, reading default, solver henon, rtol 1e-06, status wrong: fixed: ")
    assert failing.startswith(f"known: solver {FAILS}: fails as expected: ")
    assert nowhere == "known: case another: no row matches it"


def test_junit_has_a_test_case_a_row(out, capsys):
    assert gate(out, "--junit", "results/junit.xml") == 0
    root = ElementTree.parse("results/junit.xml").getroot()
    assert [root.get(name) for name in ("tests", "failures", "errors")] == ["3", "1", "0"]
    rows = read_rows(RunRow, out / "made_up/runs.csv")
    for row, own in zip(rows, root.iter("testcase"), strict=True):
        assert (own.get("classname"), own.get("name")) == ("made_up.default", row.label)
        assert (own.find("failure") is None) == (row.verdict == "right")
    assert gate(out, "--junit", ".") == 2
    assert "--junit needs the name of a file" in capsys.readouterr().err


def test_a_step_of_a_workflow_gets_a_summary(out, monkeypatch, capsys):
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    Path("summary.md").write_text("# Mine\n")
    assert gate(out, "--require", FAILS) == 1
    text = Path("summary.md").read_text()
    assert text.startswith("# Mine\n\n## henon_ref\n\n| solver |")
    assert re.search(r"^\| `henon` \| 2 \| 0 \| 0 \| 0 \| 9 \|$", text, re.MULTILINE)
    assert f"| `made_up` | `default` | `{FAILS}` | 1e-6 | wrong (" in text
    assert "- required: made_up: default: " in text
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "none/summary.md")
    capsys.readouterr()
    assert gate(out) == 0
    words = "cannot write the step summary: none/summary.md: No such file or directory\n"
    assert capsys.readouterr().err == words


def test_a_known_failure_is_a_line(tmp_path):
    path = tmp_path / "known.csv"
    lines = ["\ufeffcase,solver,rtol,step_s,status,reason", 'fig8,"ida",1e-6,,wrong,"slow, ""as"" known"', ""]
    path.write_text("\r\n".join([*lines, ",rk4,,0.1,,", ""]))
    first, second = read_known(path)
    assert first == KnownFailure("fig8", None, "ida", 1e-6, None, "wrong", 'slow, "as" known')
    assert second == KnownFailure(solver="rk4", step_s=0.1)
    path.write_text("case,reading,solver,library_version,rtol,status,verdict\nfig8,default,ida,1.1,1e-06,wrong,x\n")
    assert read_known(path) == [KnownFailure("fig8", "default", "ida", 1e-6, None, "wrong")]  # lines of a runs.csv do


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("case,slover\nx,y\n", "1:1: unknown column 'slover'; allowed: case, reading, solver, rtol, step_s, "),
        ("case;solver\nfig8;ida\n", "1:1: unknown column 'case;solver'; allowed: case, reading, "),
        ("case,solver\nfig8,ida\nfig8\n", "3:1: 1 fields; there are 2 columns"),
        ("case,rtol\nfig8,tight\n", "2:6: 'tight' is no number: the field takes a number or nothing"),
        ("case,step_s\nfig8,nan\n", "2:6: 'nan' is no number"),
        ("case,status\nfig8,wrog\n", "2:1: 'wrog' is no status; there are ok, wrong, diverged, nonunique, invalid, "),
        ("case,status\nfig8,ok\n", "2:1: 'ok' is no failure"),
        ("case,rtol\n,1e-6\n", "2:1: the line would match every row: name a case, a reading or a solver"),
        ('case,solver\n"fig8,ida\n', "2:1: unexpected end of data"),
    ],
)
def test_a_bad_file_of_known_failures_is_told_with_its_place(tmp_path, text, words):
    (tmp_path / "known.csv").write_text(text)
    with pytest.raises(CaseError) as raised:
        read_known(tmp_path / "known.csv")
    assert str(raised.value).startswith(f"{tmp_path / 'known.csv'}:{words}")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "1:1: there is no column 'case'"),
        ("case,reading,solver\nc,d,ida\n", ": c: d: ida: '' is no status; there are ok, wrong"),
        ("case,reading,solver,status\nc,d,ida,fine\n", ": c: d: ida: 'fine' is no status"),
        ("case,reading,solver,rtol\nc,d,ida,small\n", "2:9: 'small' is no number"),
        ("case\n\xff\n", ": cannot be read: it is not UTF-8; save the file as UTF-8"),
    ],
)
def test_a_bad_baseline_is_told_with_its_place(out, capsys, text, words):
    Path("bad.csv").write_bytes(text.encode("latin-1"))
    assert gate(out, "--baseline", "bad.csv") == 2
    captured = capsys.readouterr()
    assert captured.err.startswith(f"error: bad.csv:{words.removeprefix(':')}")
    assert (captured.err.count("\n"), captured.out) == (1, "")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
def test_known_failures_from_a_pipe_are_an_error(out, capsys):
    """A pipe can be read only once: its lines would be lost without a word."""
    os.mkfifo("pipe")
    assert gate(out, "--known", "pipe") == 2
    assert capsys.readouterr().err == "error: pipe: this is not a regular file\n"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
@pytest.mark.parametrize("name", ["manifest.json", "runs.csv"])
def test_a_report_in_a_pipe_is_an_error_and_not_waited_for(out, capsys, name):
    (out / "made_up" / name).unlink()
    os.mkfifo(out / "made_up" / name)
    assert gate(out) == 2
    assert capsys.readouterr().err == f"error: out/made_up/{name}: cannot be read: this is a named pipe\n"


def test_a_file_of_known_failures_that_is_not_there_is_named_once(out, capsys):
    assert gate(out, "--known", "gone.csv") == 2
    assert capsys.readouterr().err == "error: gone.csv: cannot be read: No such file or directory\n"


def test_what_is_no_report_is_said(out, capsys):
    Path("empty").mkdir()
    known = {
        "gone": "there is no such file",
        "empty": "the folder has no report",
        "/dev/null": "this is not a regular file",
    }
    for path, words in known.items():
        assert gate(path) == 2
        assert capsys.readouterr().err == f"error: {path}: {words}; expected a runs.csv, or a folder of reports\n"


def test_an_empty_path_is_not_the_current_folder(out, monkeypatch, capsys):
    monkeypatch.chdir(out)
    for arguments in ([""], [".", "--baseline", ""]):
        assert gate(*arguments) == 2
        assert "the path is empty" in capsys.readouterr().err
