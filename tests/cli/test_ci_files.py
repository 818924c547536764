"""Files that a comparison is held against: what they may say, and where they go wrong."""

from __future__ import annotations

import pytest
from commands import run

from henon_ref.cli.ci_files import read_baseline, read_known
from henon_ref.errors import CaseError
from henon_ref.rows import RunRow
from henon_ref.score.known import KnownFailure

BASELINE = "case,reading,solver,rtol,step_s,status,max_time_error_s\n"


def test_a_known_failure_is_a_line(tmp_path):
    path = tmp_path / "known.csv"
    lines = ["\ufeffcase,solver,rtol,step_s,status,reason", 'fig8,"ida",1e-6,,wrong,"slow, ""as"" known"', ""]
    path.write_text("\r\n".join([*lines, ",rk4,,0.1,,", ""]))
    first, second = read_known(path)
    assert first == KnownFailure("fig8", None, "ida", 1e-6, None, "wrong", reason='slow, "as" known', place=f"{path}:2")
    assert second == KnownFailure(solver="rk4", step_s=0.1, place=f"{path}:4")


def test_lines_of_a_file_of_results_will_do(tmp_path):
    path = tmp_path / "known.csv"
    path.write_text("case,reading,solver,library_version,rtol,status,verdict\nfig8,default,ida,1.1,1e-06,wrong,x\n")
    assert read_known(path) == [KnownFailure("fig8", "default", "ida", 1e-6, None, "wrong", place=f"{path}:2")]


KNOWN_FAULTS = [
    ("", "1:1: the first line names the columns: case,reading,solver,rtol,step_s,status,reason"),
    ("case,slover\nx,y\n", "1:6: 'slover' is no column here; there are case, reading, solver, rtol, step_s, status, "),
    ("case,solver,case\n", "1:13: the column 'case' is there twice"),
    ("case,solver\nfig8,ida\nfig8\n", "3:1: 1 fields; there are 2 columns"),
    ("case,solver\nfig8,ida,1\n", "2:6: 3 fields; there are 2 columns"),
    ("case,rtol\nfig8,tight\n", "2:6: 'tight' is no number; a number, or nothing, stands here"),
    ("case,step_s\nfig8,nan\n", "2:6: 'nan' is no number"),
    ("case,status\nfig8,wrog\n", "2:6: 'wrog' is no status; there are ok, wrong, diverged, nonunique, invalid, "),
    ("case,status\nfig8,ok\n", "2:6: 'ok' is no failure"),
    ("case,rtol\n,1e-6\n", "2:1: such a line would be any failure; name a case, a reading or a solver"),
    ('case,solver\n"fig8,ida\n', "2:1: the quotes do not match"),
]


@pytest.mark.parametrize(("text", "words"), KNOWN_FAULTS)
def test_a_bad_file_of_known_failures_is_reported_with_its_place(tmp_path, text, words):
    path = tmp_path / "known.csv"
    path.write_text(text)
    with pytest.raises(CaseError) as raised:
        read_known(path)
    assert str(raised.value).startswith(f"{path}:{words}")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("case,solver\n", "1:1: there is no column 'reading'; a runs.csv of this program has case, reading, solver, "),
        (BASELINE + "c,d,ida,1e-6,,fine,\n", "2:15: 'fine' is no status"),
        (BASELINE + "c,d,ida,1e-6,,,\n", "2:15: a row has a status"),
        (BASELINE + "c,d,ida,1e-6,,ok,small\n", "2:18: 'small' is no number"),
        (BASELINE + "c,d,ida\n", "2:5: 3 fields; there are 7 columns"),
    ],
)
def test_a_bad_baseline_is_reported_with_its_place(tmp_path, text, words):
    path = tmp_path / "runs.csv"
    path.write_text(text)
    with pytest.raises(CaseError) as raised:
        read_baseline(path)
    assert str(raised.value).startswith(f"{path}:{words}")


def test_a_baseline_is_a_file_or_a_folder_of_reports(tmp_path):
    for name in ("a", "b"):
        (tmp_path / "reports" / name).mkdir(parents=True)
        (tmp_path / "reports" / name / "runs.csv").write_text(f"{BASELINE}{name},default,ida,1e-06,,ok,2e-9\n")
    rows = read_baseline(tmp_path / "reports")
    assert [row.case for row in rows] == ["a", "b"]
    assert read_baseline(tmp_path / "reports/a") == read_baseline(tmp_path / "reports/a/runs.csv") == rows[:1]
    assert rows[0] == RunRow("a", "default", "ida", rtol=1e-6, status="ok", max_time_error_s=2e-9)


@pytest.mark.parametrize("option", ["--known", "--baseline"])
def test_what_cannot_be_read_is_reported_and_nothing_is_run(tmp_path, made_up_solvers, made_up, capsys, option):
    (tmp_path / "bytes.csv").write_bytes(b"case,solver\nfig8,\xff\n")
    (tmp_path / "empty").mkdir()
    before = sorted(tmp_path.rglob("*"))
    for name, words in (
        ("gone.csv", "gone.csv: there is no such file"),
        ("bytes.csv", "bytes.csv:2:6: not UTF-8"),
        ("empty", "empty: "),
        ("/dev/null", "/dev/null: this is no regular file"),
    ):
        assert run(made_up, option, name) == 2
        captured = capsys.readouterr()
        assert captured.err.startswith(f"error: {words}")
        assert captured.err.count("\n") == 1
        assert captured.out == ""
    assert sorted(tmp_path.rglob("*")) == before
