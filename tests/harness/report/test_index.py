"""The index: which solver to take, made from the matrix alone, whose rows are those of the reports."""

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
from henon_ref.harness.report.text.choice import case_table, choice_table
from henon_ref.harness.report.text.index import FIGURE, commits, counted, index_text, is_drawn, updated, write_index
from henon_ref.harness.report.text.kinds_figure import draw_kinds
from henon_ref.harness.report.text.matrix import (
    MatrixRow,
    coverage_table,
    read_matrix,
    reading_table,
    rows_of_report,
    solver_table,
    summary,
)
from henon_ref.harness.rows import RunRow, read_rows, rows_text


def named(name: str, comparison: Comparison | None = None) -> Comparison:
    """The usual comparison, or another one, as that of a case of another name."""
    comparison = comparison or usual()
    records = [changed(own, case=name) for own in comparison.records]
    return replace(comparison, case=replace(comparison.case, name=name), records=records)


def row(solver: str, reading: str = "default", case: str = "one", **values: object) -> MatrixRow:
    right = {"settings": 1, "judged": 1, "right": 1, "status": "ok", "verdict": "right", "digits": 9.0}
    names = {"case": case, "title": case, "reading": reading, "kind": "crossings", "solver": solver, "commit": "a"}
    return MatrixRow(**names | right | values)


def timed(solver: str, reading: str = "default", wall: float = 1.0, case: str = "one", **values: object) -> MatrixRow:
    walls = dict.fromkeys(("wall_s", "wall_3_s", "wall_6_s", "wall_9_s"), wall)
    return row(solver, reading, case, **walls, **values)


WRONG = {"right": 0, "verdict": "solver defect", "status": "wrong", "digits": None}


def test_a_row_a_solver_sums_up_its_settings(tmp_path):
    write_report(usual(), ORIGIN, tmp_path)
    rows = {own.solver: own for own in rows_of_report(tmp_path / "made_up" / "manifest.json")}
    assert list(rows) == ["henon", "heyoka", "scipy-rk45", "scipy-sign", "ida"]
    counts = {solver: [own.settings, own.judged, own.right] for solver, own in rows.items()}
    assert counts == {
        "henon": [2, 2, 2], "heyoka": [2, 2, 2], "scipy-rk45": [2, 2, 1], "scipy-sign": [1, 1, 0], "ida": [1, 0, 0],
    }  # fmt: skip
    own = rows["heyoka"]
    assert (own.digits, own.wall_s, own.wall_6_s, own.wall_9_s) == (12.004, 9e-4, 9e-4, 9e-4)
    assert rows["henon"].wall_6_s == 2e-4  # the loose setting gets there, and is faster
    assert rows["henon"].wall_9_s == 3e-4
    assert rows["henon"].values(("title", "reading", "kind", "commit")) == [
        "A made-up system", "default", "stick-slip", "0123456789ab",
    ]  # fmt: skip


def test_the_matrix_keeps_the_rows_of_cases_whose_folders_are_gone(tmp_path):
    for name in ("first", "second"):
        write_report(named(name), ORIGIN, tmp_path)
    write_index(tmp_path)
    whole = read_matrix(tmp_path)
    shutil.rmtree(tmp_path / "second")
    text = write_index(tmp_path).read_text()
    assert read_matrix(tmp_path) == whole
    assert "| [first](first/report.md) |" in text
    assert "| second |" not in text
    page = (tmp_path / "matrix.md").read_text()
    assert "| second |" in page
    assert "second/report.md" not in page


def test_fresh_reports_replace_the_rows_of_their_case_and_leave_the_others(tmp_path):
    for name in ("first", "second"):
        write_report(named(name), ORIGIN, tmp_path)
    write_index(tmp_path)
    shutil.rmtree(tmp_path / "first")
    write_report(named("second", compared(made("henon", 1e-6, 1e-4))), replace(ORIGIN, commit="f" * 40), tmp_path)
    text = write_index(tmp_path).read_text()
    rows = read_matrix(tmp_path)
    assert {own.commit for own in rows if own.case == "first"} == {"0123456789ab"}
    fresh = {own.solver for own in rows if own.commit == "f" * 12}
    assert fresh == {"henon"}
    assert "2 commits of the program" in " ".join(text.split())


def test_a_comparison_of_some_solvers_leaves_the_rows_of_the_others(tmp_path):
    write_report(usual(), ORIGIN, tmp_path)
    write_index(tmp_path)
    before = {own.solver: own for own in read_matrix(tmp_path)}
    shutil.rmtree(tmp_path / "made_up")
    write_report(compared(made("octave-ode45", 1e-6, 1e-4)), replace(ORIGIN, commit="f" * 40), tmp_path)
    text = write_index(tmp_path).read_text()
    rows = {own.solver: own for own in read_matrix(tmp_path)}
    assert list(rows) == ["henon", "heyoka", "ida", "scipy-rk45", "octave-ode45", "scipy-sign"]
    assert {solver: own for solver, own in rows.items() if solver in before} == before
    assert rows["octave-ode45"].kind == "stick-slip"
    matrix, *_ = tables((tmp_path / "matrix.md").read_text())
    assert matrix.rows[0][2] == "0123456, fffffff"
    assert "Not every solver was run on every reading" not in text
    write_index(tmp_path)
    assert {own.solver: own for own in read_matrix(tmp_path)} == rows


def test_rows_of_readings_that_a_case_has_no_more_go():
    earlier = [row("henon"), row("henon", "gone"), row("heyoka", title="of old")]
    fresh = [row("henon", commit="b", title="new")]
    assert updated(earlier, fresh, ["default", "other"]) == [fresh[0], row("heyoka", title="new")]
    assert updated([row("henon", "other")], fresh, ["other", "default"])[0].reading == "other"


def test_a_solver_that_was_run_on_a_part_is_not_wrong_elsewhere(tmp_path):
    rows = [timed("henon", reading) for reading in ("a", "b", "c")] + [timed("octave-ode45", "a", 0.5)]
    (whole, part) = coverage_table(rows).rows
    assert (whole, part) == (("3 of 3", "`henon`"), ("1 of 3", "`octave-ode45`"))
    assert coverage_table(rows[:3]).rows == []
    (line,) = choice_table(rows).rows
    assert line[2] == "`henon` 3; `octave-ode45` 1 (×0.5)"
    assert [line[-1] for line in reading_table(rows).rows] == ["9", "", ""]
    counts = cells(solver_table(rows, {}))["`octave-ode45`"]
    assert (counts["right in"], counts["judged in"], counts["run on"]) == ("1", "1", "1")
    text = index_text(rows, tmp_path)
    assert "| 1 of 3 | `octave-ode45` |" in text


def test_a_report_of_an_earlier_version_keeps_the_kind_that_the_matrix_has(tmp_path):
    write_report(usual(), ORIGIN, tmp_path)
    write_index(tmp_path)
    manifest = tmp_path / "made_up" / "manifest.json"
    content = json.loads(manifest.read_text())
    del content["readings"]["default"]["kind"]
    manifest.write_text(json.dumps(content))
    write_index(tmp_path)
    assert {own.kind for own in read_matrix(tmp_path)} == {"stick-slip"}


def test_the_index_has_four_columns_for_the_cases_and_none_for_solvers(tmp_path):
    write_report(usual(), ORIGIN, tmp_path)
    choice, cases = tables(write_index(tmp_path).read_text())
    assert cases.headings == ("case", "right of judged", "best digits", "cheapest right solver")
    assert cases.rows == [("[made_up](made_up/report.md)", "3/4", "12", "`henon`, 0.2 ms")]
    assert choice.headings == ("kind of case", "readings", "right", "3 digits", "6 digits", "9 digits", "12 digits")
    assert choice.rows[0][:3] == ("stick-slip", "1", "`henon` 1; `heyoka` 1 (×4.5)")
    assert not (tmp_path / FIGURE).exists()


def test_the_index_leads_only_to_pages_that_are_there(tmp_path):
    (tmp_path / "atlas").mkdir()
    (tmp_path / "atlas" / "README.md").touch()
    text = write_index(tmp_path).read_text()
    assert re.findall(r"\]\(([^)]*)\)", text) == ["matrix.md", "matrix.md", "matrix.csv", "atlas/README.md"]


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


def test_it_is_said_why_fewer_readings_are_judged_than_there_are():
    rows = [
        row("henon", "a"), row("henon", "b"), row("heyoka", "b"), row("henon-listing", "c"),
        row("henon", "d", judged=0, right=0, status="unsupported", verdict=None),
        row("henon", "e", judged=0, right=0, status="timeout", verdict="not judged"),
    ]  # fmt: skip
    assert counted(rows) == (
        "`henon` is right in 2 of the 2 readings that it is judged in; of all 5 that leaves "
        "1 run only by other solvers, 1 that it cannot do, 1 without a verdict."
    )
    assert counted(rows[:2]) == "`henon` is right in 2 of the 2 readings that it is judged in."
    assert counted([]) == "No solver is right in any of no readings."


def test_the_matrix_page_has_a_column_a_solver_and_counts_per_solver(tmp_path):
    write_report(usual(), ORIGIN, tmp_path)
    write_index(tmp_path)
    matrix, solvers, cases = tables((tmp_path / "matrix.md").read_text())
    assert cases.rows == [("[made_up](made_up/report.md)", "3/4", "12", "`henon`, 0.2 ms")]
    assert matrix.rows == [
        ("[made_up](made_up/report.md)", "stick-slip", "0123456", "12", "12", "·", "12 *", "wrong"),
    ]  # fmt: skip
    table = cells(solvers)
    assert list(table["`henon`"].values()) == ["`henon`", "1", "1", "1", "1", "1", "1", "1"]
    counts = [(table[f"`{solver}`"]["right in"], table[f"`{solver}`"]["judged in"]) for solver in ("scipy-sign", "ida")]
    assert counts == [("0", "1"), ("0", "0")]
    assert "- [made_up](made_up/report.md): A made-up system" in (tmp_path / "matrix.md").read_text()


def test_times_in_turn_decide_who_is_the_cheapest():
    rows = [timed("henon", wall=1.0), timed("heyoka", wall=2.0)]
    assert cells(solver_table(rows, {}))["`henon`"]["cheapest for 3 digits"] == "1"
    in_turn = cells(solver_table(rows, {("one", "default", 3): "heyoka"}))
    assert in_turn["`heyoka`"]["cheapest for 3 digits"] == "1"
    assert in_turn["`henon`"]["cheapest for 3 digits"] == ""


def test_the_figure_has_a_panel_a_kind_and_is_the_same_where_only_times_differ(tmp_path):
    rows = [timed(solver, case=f"case{k}", wall=1.0) for k in range(4) for solver in ("henon", "heyoka")]
    rows.append(row("henon", case="idle", kind="no transition", digits=None))
    assert is_drawn(rows)
    assert not is_drawn(rows[:6])
    figure = draw_kinds(rows)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["crossings\n(4)", "no transition\n(1)"]
    assert [text.get_text() for text in figure.axes[0].texts] == 2 * ["100", "100", "100", "100", "0"]
    slower = [replace(own, wall_s=7.0) if own.wall_s else own for own in rows]
    again = draw_kinds(slower)
    assert [text.get_text() for text in again.axes[0].texts] == [text.get_text() for text in figure.axes[0].texts]


def test_a_matrix_that_is_none_is_named(tmp_path):
    (tmp_path / "matrix.csv").write_text("case,title,reading,kind,settings\na,b,c,d,1\n")
    with pytest.raises(CaseError, match="is no matrix of this package: there is no column 'solver'"):
        read_matrix(tmp_path)


def test_names_that_look_like_numbers_stay_names(tmp_path):
    file = tmp_path / "runs.csv"
    row = RunRow("1", "1e5", "nan", rtol=1e-6, library_version="7.10", status_reason="3")
    file.write_text(rows_text(RunRow, [row]))
    assert read_rows(RunRow, file) == [row]


def test_rows_of_a_changed_program_say_so(tmp_path):
    write_report(usual(), replace(ORIGIN, commit="0123456789abcdef+"), tmp_path)
    write_index(tmp_path)
    assert {own.commit for own in read_matrix(tmp_path)} == {"0123456789ab+"}
    assert "| 0123456+ |" in (tmp_path / "matrix.md").read_text()


def test_commits_are_counted():
    assert commits([row("henon"), row("ida"), row("ida", commit="b")]) == "2 commits of the program"
    assert commits([row("henon", commit=None)]) == "a program of no known commit"


def test_a_summary_of_untimed_rows_has_no_time():
    whole = compared(made("henon", 1e-6, 1e-4, what="fails later"))
    assert summary([own.run for own in whole.records]).wall_s is None
    assert case().name == "made_up"
