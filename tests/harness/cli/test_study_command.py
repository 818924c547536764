"""The command ``study``: options of each study, the place of its page, and errors before anything is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from henon_ref.casefile.case import load_case
from henon_ref.harness.campaign.campaign import compare
from henon_ref.harness.campaign.journal import FILE
from henon_ref.harness.cli import study
from henon_ref.harness.result_files import read_rows, rows_text
from henon_ref.harness.rows import RunRow
from henon_ref.harness.studies.atlas import TOLERANCES
from henon_ref.harness.studies.pairs import PairRow

CASES = Path(__file__).parents[3] / "cases"
FAMILY = CASES / "hard/grazing_ballistic.yaml"
CASE = CASES / "leaving_slide.yaml"


def test_the_atlas_is_of_the_solvers_asked_for(tmp_path, capsys):
    journal = tmp_path / "grazing_ballistic" / FILE
    journal.parent.mkdir()
    journal.write_text("of a comparison that was interrupted")
    assert study.command(["atlas", str(FAMILY), "--solvers", "henon", "--jobs", "1", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.strip().endswith("atlas/README.md")
    rows = read_rows(RunRow, tmp_path / "atlas/runs.csv")
    assert {(row.solver, row.verdict) for row in rows} == {("henon", "right")}
    assert {row.rtol for row in rows} == set(TOLERANCES)
    assert f"henon-ref study atlas {FAMILY} --solvers henon" in (tmp_path / "atlas/README.md").read_text()
    assert sorted(path.name for path in (tmp_path / "atlas").iterdir() if path.is_dir()) == []
    assert journal.exists()


def test_what_cannot_be_run_is_said_and_nothing_is_written(tmp_path, capsys):
    assert study.command(["atlas", str(FAMILY), "--solvers", "heyokka", "--out", str(tmp_path / "out")]) == 2
    assert "did you mean 'heyoka'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_case_that_is_no_family_has_no_atlas(tmp_path, capsys):
    plain = FAMILY.parents[1] / "free_coulomb.yaml"
    assert study.command(["atlas", str(plain), "--solvers", "henon", "--out", str(tmp_path)]) == 0
    assert "no case whose readings differ in a distance alone" in capsys.readouterr().out


def test_rows_of_one_folder_tell_who_is_timed_for_another(tmp_path, capsys):
    rows, out = tmp_path / "rows/leaving_slide", tmp_path / "out"
    rows.mkdir(parents=True)
    found = compare(load_case(CASE), solvers=["henon", "scipy-dop853"], tolerances=[1e-6], repeats=1)
    (rows / "runs.csv").write_text(rows_text(RunRow, found.run_rows), encoding="utf-8")
    assert study.command(["paired-times", str(CASE), "--rows", str(rows.parent), "--out", str(out)]) == 0
    assert capsys.readouterr().out.strip().endswith("rivals/README.md")
    assert {row.rival for row in read_rows(PairRow, out / "rivals/ratios.csv")} >= {"scipy-dop853"}
    assert "--rows FOLDER" in (out / "rivals/README.md").read_text(encoding="utf-8")
    assert [path.name for path in out.iterdir() if path.is_dir()] == ["rivals"]


def test_rows_that_cannot_be_read_are_named(tmp_path, capsys):
    rows = tmp_path / "leaving_slide/runs.csv"
    rows.parent.mkdir()
    rows.write_bytes(b"\xff")
    assert study.command(["paired-times", str(CASE), "--rows", str(tmp_path), "--out", str(tmp_path)]) == 2
    assert f"{rows}: cannot be read: it is not UTF-8" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["paired-times", str(CASE), "--rows", "."], "leaving_slide/runs.csv is not there: henon-ref compare CASES"),
        (["paired-times", str(CASE)], "study paired-times requires --rows"),
        (["price", "no.yaml"], "no.yaml"),
        (["atlas"], "study atlas requires the cases to run"),
        (["paper", str(CASE)], "study paper takes no cases; its options are --out"),
        (
            ["paired-times", str(CASE), "--rows", "x", "--resume"],
            "study paired-times takes no --resume; its options are --rows, --timeout, --jobs, --out",
        ),
        (["nobody"], "unknown study 'nobody'; the studies are price, paired-times, atlas, restarts, causes, paper"),
    ],
)
def test_a_study_is_given_what_it_takes_or_nothing_is_written(tmp_path, monkeypatch, capsys, words, told):
    monkeypatch.chdir(tmp_path)
    assert study.command(words) == 2
    assert told in capsys.readouterr().err
    assert not any(tmp_path.iterdir())
