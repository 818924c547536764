"""The command that times the reference in turn with those that reports name."""

from __future__ import annotations

from pathlib import Path

from henon_ref.casefile.case import load_case
from henon_ref.harness.campaign.comparison import compare
from henon_ref.harness.cli import rivals
from henon_ref.harness.report.text.paired_times import PairRow
from henon_ref.harness.rows import RunRow, read_rows, rows_text

CASE = Path(__file__).parents[3] / "cases/leaving_slide.yaml"


def test_rows_of_one_folder_tell_who_is_timed_for_another(tmp_path, capsys):
    rows, out = tmp_path / "rows/leaving_slide", tmp_path / "out"
    rows.mkdir(parents=True)
    found = compare(load_case(CASE), solvers=["henon", "scipy-dop853"], tolerances=[1e-6], repeats=1)
    (rows / "runs.csv").write_text(rows_text(RunRow, found.run_rows), encoding="utf-8")
    assert rivals.command([str(CASE), "--rows", str(rows.parent), "--out", str(out)]) == 0
    assert capsys.readouterr().out.strip().endswith("rivals/README.md")
    assert {row.rival for row in read_rows(PairRow, out / "rivals/ratios.csv")} >= {"scipy-dop853"}
    assert "--rows FOLDER" in (out / "rivals/README.md").read_text(encoding="utf-8")
    assert [path.name for path in out.iterdir() if path.is_dir()] == ["rivals"]


def test_a_folder_without_rows_is_refused_and_nothing_is_written(tmp_path, capsys):
    assert rivals.command([str(CASE), "--rows", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert "leaving_slide/runs.csv is not there: henon-ref compare CASES --out" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
