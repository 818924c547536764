"""The index: recommended solvers, made from the matrix alone, whose rows are those of the reports."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace

import pytest
from fakes import case
from made_reports import ORIGIN, cells, changed, compared, made, tables, usual

from henon_ref.errors import CaseError
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.report.case_report import write_report
from henon_ref.harness.report.choice import case_table, choice_table, commits, coverage_sentence, frequency_table
from henon_ref.harness.report.folder_report import write_folder_report
from henon_ref.harness.report.matrix import MatrixRow, read_matrix, rows_of_report, summary, updated
from henon_ref.harness.result_files import read_rows, rows_text
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.ranking import LEVELS


def named(name: str, comparison: Comparison | None = None) -> Comparison:
    """The usual comparison, or another one, as that of a case of another name."""
    comparison = comparison or usual()
    records = [changed(own, case=name) for own in comparison.records]
    return replace(comparison, case=replace(comparison.case, name=name), records=records)


def row(solver: str, reading: str = "default", case: str = "one", **values: object) -> MatrixRow:
    right = {"settings": 1, "judged": 1, "right": 1, "status": "ok", "verdict": "right", "digits": 9.0}
    names = {"case": case, "reading": reading, "kind": "crossings", "solver": solver, "commit": "a"}
    return MatrixRow(**names | right | values)


def timed(solver: str, reading: str = "default", wall: float = 1.0, case: str = "one", **values: object) -> MatrixRow:
    walls = dict.fromkeys(("wall_s", "wall_3_s", "wall_6_s", "wall_9_s"), wall)
    return row(solver, reading, case, **walls, **values)


WRONG = {"right": 0, "verdict": "solver defect", "status": "wrong", "digits": None}


def test_a_row_a_solver_sums_up_its_settings(tmp_path):
    write_report(usual(), ORIGIN, tmp_path)
    rows = {own.solver: own for own in rows_of_report(tmp_path / "made_up")[0]}
    assert list(rows) == ["henon", "heyoka", "scipy-rk45", "scipy-sign", "ida"]
    counts = {solver: [own.settings, own.judged, own.right] for solver, own in rows.items()}
    assert counts == {
        "henon": [2, 2, 2], "heyoka": [2, 2, 2], "scipy-rk45": [2, 2, 1], "scipy-sign": [1, 1, 0], "ida": [1, 0, 0],
    }  # fmt: skip
    own = rows["heyoka"]
    assert (own.digits, own.wall_s, own.wall_6_s, own.wall_9_s) == (12.004, 9e-4, 9e-4, 9e-4)
    assert rows["henon"].wall_6_s == 2e-4  # the loose setting gets there, and is faster
    assert rows["henon"].wall_9_s == 3e-4
    assert rows["henon"].values(("reading", "kind", "commit")) == ["default", "stick-slip", "0123456789ab"]


def test_the_matrix_keeps_the_rows_of_cases_whose_folders_are_gone(tmp_path):
    for name in ("first", "second"):
        write_report(named(name), ORIGIN, tmp_path)
    write_folder_report(tmp_path)
    whole = read_matrix(tmp_path)
    shutil.rmtree(tmp_path / "second")
    text = write_folder_report(tmp_path).read_text()
    assert read_matrix(tmp_path) == whole
    assert "| [first](first/report.md) |" in text
    assert "second" not in text


def test_fresh_reports_replace_the_rows_of_their_case_and_leave_the_others(tmp_path):
    for name in ("first", "second"):
        write_report(named(name), ORIGIN, tmp_path)
    write_folder_report(tmp_path)
    shutil.rmtree(tmp_path / "first")
    write_report(named("second", compared(made("henon", 1e-6, 1e-4))), replace(ORIGIN, commit="f" * 40), tmp_path)
    text = write_folder_report(tmp_path).read_text()
    rows = read_matrix(tmp_path)
    assert {own.commit for own in rows if own.case == "first"} == {"0123456789ab"}
    fresh = {own.solver for own in rows if own.commit == "f" * 12}
    assert fresh == {"henon"}
    assert "2 commits of the program" in " ".join(text.split())


def test_a_comparison_of_some_solvers_leaves_the_rows_of_the_others(tmp_path):
    write_report(usual(), ORIGIN, tmp_path)
    write_folder_report(tmp_path)
    before = {own.solver: own for own in read_matrix(tmp_path)}
    shutil.rmtree(tmp_path / "made_up")
    write_report(compared(made("octave-ode45", 1e-6, 1e-4)), replace(ORIGIN, commit="f" * 40), tmp_path)
    text = write_folder_report(tmp_path).read_text()
    rows = {own.solver: own for own in read_matrix(tmp_path)}
    assert list(rows) == ["henon", "heyoka", "ida", "scipy-rk45", "octave-ode45", "scipy-sign"]
    assert {solver: own for solver, own in rows.items() if solver in before} == before
    assert rows["octave-ode45"].kind == "stick-slip"
    assert "2 commits of the program" in " ".join(text.split())
    write_folder_report(tmp_path)
    assert {own.solver: own for own in read_matrix(tmp_path)} == rows


def test_rows_of_readings_that_a_case_has_no_more_go():
    earlier = [row("henon"), row("henon", "gone"), row("heyoka")]
    fresh = [row("henon", commit="b")]
    assert updated(earlier, fresh, ["default", "other"]) == [fresh[0], row("heyoka")]
    assert updated([row("henon", "other")], fresh, ["other", "default"])[0].reading == "other"


def test_a_solver_that_was_run_on_a_part_is_not_wrong_elsewhere():
    rows = [timed("henon", reading) for reading in ("a", "b", "c")] + [timed("octave-ode45", "a", 0.5)]
    assert coverage_sentence(rows) == "Of 3 readings the solvers were run on 3: henon; 1: octave-ode45."
    assert coverage_sentence(rows[:3]) == ""
    (line,) = choice_table(rows).rows
    assert line[2] == "`henon` 3; `octave-ode45` 1 (×0.5)"
    counts = cells(frequency_table(rows))["`octave-ode45`"]
    assert (counts["right in"], counts["judged in"], counts["run on"]) == ("1", "1", "1")


def test_a_report_of_an_earlier_version_keeps_the_kind_that_the_matrix_has(tmp_path):
    write_report(usual(), ORIGIN, tmp_path)
    write_folder_report(tmp_path)
    manifest = tmp_path / "made_up" / "manifest.json"
    content = json.loads(manifest.read_text())
    del content["readings"]["default"]["kind"]
    manifest.write_text(json.dumps(content))
    write_folder_report(tmp_path)
    assert {own.kind for own in read_matrix(tmp_path)} == {"stick-slip"}


def test_the_index_says_whom_to_take_who_is_right_how_often_and_in_which_case(tmp_path):
    write_report(usual(), ORIGIN, tmp_path)
    choice, often, cases = tables(write_folder_report(tmp_path).read_text())
    assert cases.headings == ("case", "right of judged", "best digits", "cheapest right solver")
    assert cases.rows == [("[made_up](made_up/report.md)", "3/4", "12", "`henon`, 0.2 ms")]
    assert choice.headings == ("kind of case", "readings", "right", "3 digits", "6 digits", "9 digits", "12 digits")
    assert choice.rows[0][:3] == ("stick-slip", "1", "`henon` 1; `heyoka` 1 (×4.5)")
    counts = cells(often)
    assert list(counts["`henon`"].values()) == ["`henon`", "1", "1", "1", "1", "1", "1", "1"]
    assert [tuple(counts[f"`{solver}`"].values())[1:4] for solver in ("scipy-sign", "ida")] == [
        ("0", "1", "1"), ("0", "0", "1"),
    ]  # fmt: skip


def test_the_readings_that_one_solver_alone_gets_are_told_apart():
    """Who is the cheapest how often adds up to all readings; where nobody else gets so far, there is no contest."""
    alone = row("henon", "alone", **dict.fromkeys(("wall_s", "wall_3_s", "wall_6_s"), 1.0))
    counts = cells(frequency_table([timed("henon", "both", 2.0), timed("heyoka", "both", 1.0), alone]))
    won = {name: [own[f"cheapest for {level} digits"] for level in LEVELS] for name, own in counts.items()}
    assert won["`henon`"] == ["1", "1", "", ""]
    assert won["`heyoka`"] == ["1", "1", "1", ""]
    assert won["all readings"] == ["2", "2", "1", "0"]
    assert won["of these, reached by another solver, too"] == ["1", "1", "1", "0"]


def test_the_index_leads_only_to_pages_that_are_there(tmp_path):
    (tmp_path / "atlas").mkdir()
    (tmp_path / "atlas" / "README.md").touch()
    text = write_folder_report(tmp_path).read_text()
    links = ["index.html", "matrix.csv", "index.html", "matrix.csv", "atlas/README.md"]
    assert re.findall(r"\]\(([^)]*)\)", text) == links


def test_a_case_folds_its_readings():
    rows = [
        timed("henon", "a", 1.0), timed("henon", "b", 2.0, digits=6.5),
        timed("heyoka", "a", 0.1), timed("heyoka", "b", **WRONG),
        timed("ida", "a", 0.2), row("ida", "b", judged=0, right=0, status="unsupported"),
        timed("scipy-rk45", "a", 4.0), timed("scipy-rk45", "b", 4.0, digits=8.0),
    ]  # fmt: skip
    # `ida` is right in all that it was judged in, which is one reading less: it is no solver for the whole case.
    assert case_table(rows).rows == [("[one](one/report.md)", "3/4", "8", "`henon`, 3 s")]
    assert case_table([timed("henon", **WRONG)]).rows == [("[one](one/report.md)", "0/1", "", "none")]


def test_the_choice_is_the_fastest_of_those_that_get_there_most_often():
    readings = [f"r{k}" for k in range(20)]
    rows = [timed("henon", reading, 2.0) for reading in readings]
    rows += [timed("heyoka", reading, 1.0) for reading in readings[:18]]
    rows += [timed("ida", reading, 0.1) for reading in readings[:17]]
    assert choice_table(rows).rows[0][3] == "`heyoka` 18; `henon` 20 (×2)"
    rows = [own for own in rows if own.solver != "heyoka"]
    assert choice_table(rows).rows[0][3] == "`henon` 20; `ida` 17 (×0.05)"
    assert choice_table(rows).rows[0][6] == ""  # nobody gets to 12 digits


def test_solvers_of_one_package_are_not_set_against_each_other():
    rows = [timed("scipy-rk45", wall=1.0), timed("scipy-bdf", wall=2.0), timed("heyoka", wall=3.0)]
    assert choice_table(rows).rows[0][2] == "`scipy-rk45` 1; `heyoka` 1 (×3)"


def test_a_matrix_that_is_none_is_named(tmp_path):
    (tmp_path / "matrix.csv").write_text("case,title,reading,kind,settings\na,b,c,d,1\n")
    with pytest.raises(CaseError, match="is not a matrix of this package: there is no column 'solver'"):
        read_matrix(tmp_path)


def test_names_that_look_like_numbers_stay_names(tmp_path):
    file = tmp_path / "runs.csv"
    row = RunRow("1", "1e5", "nan", rtol=1e-6, library_version="7.10", status_reason="3")
    file.write_text(rows_text(RunRow, [row]))
    assert read_rows(RunRow, file) == [row]


def test_rows_of_a_changed_program_say_so(tmp_path):
    write_report(usual(), replace(ORIGIN, commit="0123456789abcdef+"), tmp_path)
    write_folder_report(tmp_path)
    assert {own.commit for own in read_matrix(tmp_path)} == {"0123456789ab+"}


def test_commits_are_counted():
    assert commits([row("henon"), row("ida"), row("ida", commit="b")]) == "2 commits of the program"
    assert commits([row("henon", commit=None)]) == "a program of no known commit"


def test_a_summary_of_untimed_rows_has_no_time():
    whole = compared(made("henon", 1e-6, 1e-4, what="fails later"))
    assert summary([own.run for own in whole.records]).wall_s is None
    assert case().name == "made_up"
