"""The command ``prune``, which removes all files of reports except those to be read."""

from __future__ import annotations

import os
import shutil
import sys

import pytest
from commands import run
from fakes import CASE

from henon_ref.harness.cli.prune import command
from henon_ref.harness.report.folder import dead_links
from henon_ref.harness.report.matrix import read_matrix

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="made-up solvers reach workers by fork"),
    pytest.mark.usefixtures("made_up_solvers"),
]


@pytest.fixture
def reports(made_up, tmp_path):
    """Two reports, and pages that lead to them."""
    other = tmp_path / "other.yaml"
    other.write_text(CASE.format(name="other"))
    assert run(made_up, other, "--out", "out") == 0
    folder = tmp_path / "out"
    (folder / "rivals").mkdir()
    page = "# Rivals in turn\n\n[a](../made_up/report.md) [b](../other/report.md#x) `[c](no)`\n"
    (folder / "rivals" / "README.md").write_text(page)
    (folder / "atlas").mkdir()
    for name in ("README.md", "runs.csv"):
        (folder / "atlas" / name).write_text("# Atlas of grazes\n\n[every run](runs.csv)\n")
    (folder / "mine").mkdir()
    (folder / "mine" / "notes.txt").write_text("kept")
    return folder


def test_files_of_somebody_else_stay_as_they_are(reports, tmp_path):
    """A web application's manifest beside a file of that name, a page with links, notes in a report's folder."""
    mine = {
        "mine/manifest.json": '{"name": "a web application"}', "mine/runs.csv": "miles\n3\n",
        "mine/README.md": "[a](../other/report.md)\n", "price/price.csv": "euros\n3\n",
        "other/notes.txt": "precious", "made_up/notes.md": "[a](../other/report.md)\n",
    }  # fmt: skip
    for name, text in mine.items():
        (reports / name).parent.mkdir(exist_ok=True)
        (reports / name).write_text(text)
    assert command([str(tmp_path / "made_up.yaml"), "--reports", str(reports)]) == 0
    assert {name: (reports / name).read_text() for name in mine} == mine
    assert os.listdir(reports / "other") == ["notes.txt"]


def test_named_cases_stay_and_all_others_live_on_in_the_matrix(reports, tmp_path, capsys):
    before = read_matrix(reports)
    kept = sorted(set(os.listdir(reports / "made_up")) - {"transitions.csv", "samples.csv"})
    assert command([str(tmp_path / "made_up.yaml"), "--reports", str(reports)]) == 0
    assert "MB are left" in capsys.readouterr().err
    assert sorted(os.listdir(reports / "made_up")) == kept
    assert not (reports / "other").exists()
    assert not (reports / "atlas" / "runs.csv").exists()
    assert (reports / "mine" / "notes.txt").read_text() == "kept"
    assert read_matrix(reports) == before
    assert {row.case for row in before} == {"made_up", "other"}
    assert (reports / "rivals" / "README.md").read_text().endswith("[a](../made_up/report.md) b `[c](no)`\n")
    assert (reports / "atlas" / "README.md").read_text() == "# Atlas of grazes\n\nevery run\n"
    for page in (reports / "README.md", reports / "made_up" / "report.md"):
        assert list(dead_links(page.read_text(), page.parent)) == []


def test_a_second_time_changes_nothing(reports, tmp_path):
    def content():
        return {path: path.read_bytes() for path in reports.rglob("*") if path.is_file()}

    arguments = [str(tmp_path / "made_up.yaml"), "--reports", str(reports)]
    assert command(arguments) == 0
    before = content()
    assert command(arguments) == 0
    assert content() == before


def test_a_bad_case_or_an_index_of_somebody_else_removes_nothing(reports, tmp_path, capsys):
    assert command([str(tmp_path / "gone.yaml"), "--reports", str(reports)]) == 2
    (reports / "README.md").write_text("# Mine\n")
    assert command([str(tmp_path / "made_up.yaml"), "--reports", str(reports)]) == 2
    assert "was not written by henon_ref" in capsys.readouterr().err
    assert (reports / "other" / "report.md").exists()
    assert (reports / "atlas" / "runs.csv").exists()


def test_a_fresh_comparison_of_one_case_by_one_solver_keeps_all_other_rows(reports, tmp_path):
    before = {(r.case, r.solver): r for r in read_matrix(reports)}
    assert command([str(tmp_path / "made_up.yaml"), "--reports", str(reports)]) == 0
    shutil.rmtree(reports / "made_up")
    assert run(tmp_path / "made_up.yaml", "--out", "out", "--solvers", "henon", "--tolerances", "1e-9") == 0
    after = {(r.case, r.solver): r for r in read_matrix(reports)}
    assert set(after) == set(before)
    own = ("made_up", "henon")
    assert {key: row for key, row in after.items() if key != own} == {k: row for k, row in before.items() if k != own}
    assert (before[own].settings, after[own].settings) == (2, 1)
