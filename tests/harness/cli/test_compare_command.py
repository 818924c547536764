"""The command ``compare``: exit status, one message per error, the files that it writes."""

from __future__ import annotations

import csv
import json
import os
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from commands import SOLVERS, compare, run
from fakes import CASE, Fake

from henon_ref.casefile.files import case_files
from henon_ref.errors import CaseError
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options, load_cases
from henon_ref.harness.cli.compare_cases import rerun_command
from henon_ref.harness.rows import RunRow, StickRow, TransitionRow

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="made-up solvers reach workers by fork"),
    pytest.mark.usefixtures("made_up_solvers"),
]


def words_of(errors: str) -> str:
    """What is said on standard error beside a line a finished row."""
    return "".join(line for line in errors.splitlines(keepends=True) if not re.match(r"\d+ of \d+: ", line))


def test_a_report_holds_what_the_contract_says(made_up, tmp_path, capsys):
    assert run(made_up, "--out", "out", "--repeats", 2) == 0
    folder = tmp_path / "out" / "made_up"
    assert {"report.md", "runs.csv", "transitions.csv", "sticks.csv", "manifest.json"} <= set(os.listdir(folder))
    with (folder / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == RunRow.columns()
    assert [row["solver"] for row in rows] == ["henon", "henon", "heyoka", "heyoka"]
    assert [row["step_s"] for row in rows] == [""] * 4
    assert (folder / "transitions.csv").read_text().splitlines()[0] == ",".join(TransitionRow.columns(["x"]))
    assert (folder / "sticks.csv").read_text().splitlines()[0] == ",".join(StickRow.columns())
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["rerun"] == "python -m henon_ref.compare made_up.yaml --repeats 2"
    assert manifest["readings"]["default"]["parameters"]["F"] == {"exact": "1", "value": 1.0}
    with (folder / "samples.csv").open() as file:
        assert len(next(csv.DictReader(file))["samples_ns"].split()) == 2
    assert sorted(manifest["files"]) == sorted(os.listdir(folder))
    captured = capsys.readouterr()
    row = r"\d of 4: made_up default (henon|heyoka) rtol (0\.001|1e-06): (solver defect|right, [\d.]+ digits)"
    assert [bool(re.fullmatch(row, line)) for line in captured.err.splitlines()] == [True] * 4
    assert words_of(captured.err) == ""
    assert captured.out.splitlines()[-1] == "out/made_up/report.md; gate met"
    assert (tmp_path / "out/README.md").read_text().startswith("# Reports")


def test_the_gate_decides_the_exit_status_only_where_asked(made_up, monkeypatch, capsys):
    monkeypatch.setattr(registry, "solver", {**SOLVERS, "henon": Fake("henon", "misses")}.__getitem__)
    assert run(made_up) == 0
    assert run(made_up, "--gate") == 1
    assert "gate: made_up: default: henon" in capsys.readouterr().err


def test_a_gate_that_checked_nothing_does_not_pass(made_up, capsys):
    words = "all 2 bounds are for solvers that were not run"
    last = f"out/made_up/report.md; gate not checked: {words}"
    assert run(made_up, "--solvers", "heyoka") == 0
    captured = capsys.readouterr()
    assert (captured.out.splitlines()[-1], words_of(captured.err)) == (last, "")
    assert run(made_up, "--solvers", "heyoka", "--gate") == 1
    captured = capsys.readouterr()
    assert captured.out.splitlines()[-1] == last
    assert sorted(words_of(captured.err).splitlines()) == [
        f"gate: {words}",
        "gate: bounds are skipped for runs that did not take place: henon",
    ]


def test_a_gate_that_is_checked_in_part_says_so(made_up, tmp_path, capsys):
    other = CASE.format(name="other").replace("gate: {henon:", "gate: {heyoka:")
    (tmp_path / "other.yaml").write_text(other)
    assert run(made_up, "other.yaml", "--solvers", "henon", "--gate") == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines()[-1] == (
        "out/README.md; gate met: 2 of 4 bounds checked, 2 are for solvers that were not run"
    )
    assert words_of(captured.err) == "gate: bounds are skipped for runs that did not take place: heyoka\n"


@pytest.mark.parametrize(
    ("gate", "status", "named"),
    [
        ("{henon: {at: 1e-3, max_time_error: 1e-2}, heyoka: {at: 1e-6, max_time_error: 1e-9}}", 0, "heyoka at 1e-6"),
        ("{henon: {at: 1e-6, max_time_error: 1e-9}}", 1, "henon at 1e-6"),
        ("{henon: {at: 1e-6}, heyoka: {at: 1e-6}}", 1, "henon at 1e-6 and heyoka at 1e-6"),
        ("{henon: {at: 1e-3, max_time_error: 1e-9}, heyoka: {at: 1e-6, max_time_error: 1e-9}}", 1, "heyoka at 1e-6"),
        ("{henon: {max_time_error: 1e-9}}", 1, "henon at 1e-6"),
        ("{henon: {max_time_error: 1e-9}, heyoka: {at: 1e-6, max_time_error: 1e-9}}", 1, "henon at 1e-6"),
    ],
)
def test_a_bound_at_a_tolerance_that_did_not_run_is_left_out_and_named(tmp_path, made_up, capsys, gate, status, named):
    """A bound without one of its own is at the case's tightest; a gate of which none is checked does not pass."""
    (tmp_path / "gated.yaml").write_text(re.sub("gate: .*", f"gate: {gate}", CASE.format(name="gated")))
    assert run("gated.yaml", "--gate", "--tolerances", "1e-3") == status
    captured = capsys.readouterr()
    (line,) = [line for line in captured.err.splitlines() if "are skipped" in line]
    assert named in line
    unchecked = "gate not checked: all " in captured.out, "gate: all " in captured.err
    assert unchecked == ("1e-3" not in gate,) * 2
    report = (tmp_path / "out/gated/report.md").read_text()
    assert "| bounds left out: did not run |" in report
    assert named.replace("henon", "`henon`").replace("heyoka", "`heyoka`").replace(" and ", ", ") in report


def test_a_tighter_tolerance_than_the_case_has_does_not_stand_in_for_its_tightest(tmp_path, made_up):
    (tmp_path / "gated.yaml").write_text(CASE.format(name="gated"))
    assert run("gated.yaml", "--gate", "--tolerances", "1e-9") == 1
    assert run("gated.yaml", "--gate", "--tolerances", "1e-9,1e-6") == 0


def test_a_required_solver_decides_the_exit_status(made_up, capsys):
    assert run(made_up, "--require", "henon") == 0
    assert capsys.readouterr().out.endswith("\nout/made_up/report.md; gate met; henon right in 1 of 1 judged\n")
    assert run(made_up, "--require", "henon,heyoka") == 1
    captured = capsys.readouterr()
    assert captured.out.endswith("; henon right in 1 of 1 judged; heyoka right in 0 of 1 judged\n")
    words = (
        "required: made_up: default: heyoka (rtol 1e-06): wrong (1 missed, 0 spurious, first missed: crossing at t = 2)"
    )
    assert words_of(captured.err) == f"{words}\n"
    assert run(made_up, "--require", "henom") == 2
    said = capsys.readouterr().err
    assert "error: unknown solver 'henom'; did you mean 'henon'?" in said
    assert "a solver of your own becomes available once its package is installed" in said
    assert run(made_up, "--solvers", "heyoka", "--require", "henon") == 2
    words = "error: --require names 'henon', which is not among the solvers that run: heyoka\n"
    assert words_of(capsys.readouterr().err) == words


def test_a_required_solver_that_cannot_be_judged_does_not_pass(made_up, monkeypatch, capsys):
    monkeypatch.setattr(registry, "solver", {**SOLVERS, "henon": Fake("henon", "unsupported")}.__getitem__)
    assert run(made_up, "--require", "henon") == 1
    assert "required: there is no reading in which henon can be judged\n" in capsys.readouterr().err


def test_a_case_without_a_gate_says_so_where_the_gate_is_asked_for(tmp_path, capsys):
    (tmp_path / "plain.yaml").write_text(re.sub("gate: .*", "", CASE.format(name="plain")))
    assert run("plain.yaml", "--gate") == 0
    assert capsys.readouterr().out.endswith("\nout/plain/report.md; gate not checked: there is no bound\n")
    assert run("plain.yaml") == 0
    assert capsys.readouterr().out.endswith("\nout/plain/report.md\n")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--solvers", "henn"], "did you mean 'henon'"),
        (["--solvers", "ida"], "none of the requested solvers"),
        (["--solvers", ","], "--solvers: the list is empty"),
        (["--require", ""], "--require: the list is empty"),
        (["--tolerances", "1e-3,abc"], "not 'abc'"),
        (["--tolerances", "1e-9,1e-400"], "--tolerances: a tolerance lies between 1e-16 and 1, not '1e-400'"),
        (["--repeats", "0"], "repeats"),
        (["--timeout", "soon"], "timeout"),
        (["--timeout", "2e6"], "timeout"),
        (["--out", ""], "the path is empty"),
        (["--out", " "], "the path is empty"),
        ([""], "the path is empty"),
        (["--out", "."], "README.md: was not written by henon_ref"),
        (["--out", "headed"], "headed/README.md: was not written by henon_ref"),
        (["--out", "bytes"], "bytes/README.md: was not written by henon_ref"),
        (["--out", "nested"], "nested/README.md: was not written by henon_ref"),
        (["--out", "made_up.yaml"], "is a file"),
        (["--out", "lost"], "lost is a link without a target; --out requires a folder"),
        (["--bogus"], "--bogus"),
        (["nowhere.yaml"], "nowhere.yaml"),
        (["made_up.yaml", "copy.yaml"], "the name 'made_up' is also that of"),
        (["empty"], "no case file"),
    ],
)
def test_a_bad_argument_is_one_message_and_nothing_is_written(made_up, tmp_path, capsys, arguments, words):
    (tmp_path / "copy.yaml").write_text(made_up.read_text())
    (tmp_path / "empty").mkdir()
    (tmp_path / "README.md").write_text("# My project\n")
    for name, content in (("headed", b"# Reports\n\nThose of 2012.\n"), ("bytes", b"\xff")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "README.md").write_bytes(content)
    (tmp_path / "nested" / "README.md").mkdir(parents=True)
    (tmp_path / "lost").symlink_to(tmp_path / "gone")
    before = sorted(tmp_path.rglob("*"))
    assert run(made_up, *arguments) == 2
    captured = capsys.readouterr()
    assert words in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""
    assert sorted(tmp_path.rglob("*")) == before


def test_a_bad_case_is_named_with_line_and_column(tmp_path, capsys):
    (tmp_path / "bad.yaml").write_text(CASE.format(name="bad").replace("until: 5", "until: soon"))
    assert run("bad.yaml") == 2
    assert "bad.yaml:" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_gate_on_a_fixed_step_solver_at_a_tolerance_is_refused_with_its_line(made_up, capsys):
    text = CASE.format(name="made_up").replace("henon, heyoka", "henon-rk4")
    made_up.write_text(text.replace("{henon: {", "{henon-rk4: {at: 1e-6, "))
    assert run(made_up) == 2
    assert "made_up.yaml:17:20: 'henon-rk4' has steps, not tolerances" in capsys.readouterr().err


def test_the_rerun_command_has_every_digit_that_was_given():
    options = Options(tolerances=(1e-3, 1e-6, 1.23456789e-7), timeout=1234.56789)
    words = "python -m henon_ref.compare a.yaml --tolerances 0.001,1e-06,1.23456789e-07 --timeout 1234.56789"
    assert rerun_command([Path("a.yaml")], options) == words
    assert rerun_command([Path("a.yaml")], replace(options, timeout=5.0)).endswith("--timeout 5")


def test_the_rerun_command_has_the_names_that_the_locale_does_not_decode():
    for given, shown in (("Stöße".encode(), "Stöße"), (b"no \xff text", "no \ufffd text")):
        path = Path(given.decode("ascii", errors="surrogateescape"))  # as under LANG=C
        assert rerun_command([path], Options()) == f"python -m henon_ref.compare '{shown}'"


def test_the_rerun_command_takes_no_file_for_an_option():
    assert rerun_command([Path("-a.yaml")], Options()) == "python -m henon_ref.compare ./-a.yaml"


def test_a_folder_is_compared_and_no_study_is_begun(made_up, tmp_path):
    assert run(tmp_path, "--out", "out", "--solvers", "henon", "--no-figures") == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir() if path.is_dir()) == ["made_up"]


def test_one_file_by_several_paths_is_one_case(made_up, tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "link.yaml").symlink_to(made_up)
    paths = [Path("made_up.yaml"), Path("other/../made_up.yaml"), Path("link.yaml"), made_up, tmp_path]
    (case,) = load_cases(paths)
    assert case.path == Path("made_up.yaml")


def test_no_case_at_all_is_a_bad_argument(capsys):
    assert compare.command([]) == 2
    assert "Missing argument" in capsys.readouterr().err


def test_a_folder_stands_for_all_its_cases_but_not_for_truths(tmp_path):
    for name in ("b.yaml", "a/c.yml", "truth/x.yaml", "a/truth/y.yaml"):
        (tmp_path / "cases" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "cases" / name).write_text("")
    assert [path.name for path in case_files(tmp_path / "cases")] == ["c.yml", "b.yaml"]
    (tmp_path / "empty").mkdir()
    with pytest.raises(CaseError, match="no case file"):
        case_files(tmp_path / "empty")


def test_restarts_are_a_column_of_solvers(made_up, tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "solver", lambda name: Fake(name))
    assert run(made_up, "--out", "out", "--repeats", 1, "--solvers", "henon,heyoka@none,heyoka@offset") == 0
    with (tmp_path / "out" / "made_up" / "runs.csv").open() as file:
        names = [row["solver"] for row in csv.DictReader(file)]
    assert list(dict.fromkeys(names)) == ["henon", "heyoka@none", "heyoka@offset"]


def test_an_unknown_restart_is_refused_before_anything_runs(made_up, tmp_path, capsys):
    assert run(made_up, "--out", "out", "--solvers", "heyoka@fresh") == 2
    assert "unknown restart 'fresh'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
