"""The command that makes the atlas alone, of the solvers that are asked for."""

from __future__ import annotations

from pathlib import Path

from henon_ref.harness.campaign.journal import FILE
from henon_ref.harness.cli import atlas
from henon_ref.harness.rows import RunRow, read_rows
from henon_ref.harness.studies.atlas.family import TOLERANCES

FAMILY = Path(__file__).parents[3] / "cases/hard/grazing_ballistic.yaml"


def test_the_atlas_is_of_the_solvers_asked_for(tmp_path, capsys):
    journal = tmp_path / "grazing_ballistic" / FILE
    journal.parent.mkdir()
    journal.write_text("of a comparison that was interrupted")
    assert atlas.command([str(FAMILY), "--solvers", "henon", "--jobs", "1", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.strip().endswith("atlas/README.md")
    rows = read_rows(RunRow, tmp_path / "atlas/runs.csv")
    assert {(row.solver, row.verdict) for row in rows} == {("henon", "right")}
    assert {row.rtol for row in rows} == set(TOLERANCES)
    assert f"henon-ref atlas {FAMILY} --solvers henon" in (tmp_path / "atlas/README.md").read_text()
    assert sorted(path.name for path in (tmp_path / "atlas").iterdir() if path.is_dir()) == []
    assert journal.exists()


def test_what_cannot_be_run_is_said_and_nothing_is_written(tmp_path, capsys):
    assert atlas.command([str(FAMILY), "--solvers", "heyokka", "--out", str(tmp_path / "out")]) == 2
    assert "did you mean 'heyoka'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_case_that_is_no_family_has_no_atlas(tmp_path, capsys):
    plain = FAMILY.parents[1] / "free_coulomb.yaml"
    assert atlas.command([str(plain), "--solvers", "henon", "--out", str(tmp_path)]) == 0
    assert "no case whose readings differ in a distance alone" in capsys.readouterr().out
