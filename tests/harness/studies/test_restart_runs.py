"""The runs behind the study of restarts, by the command and from Python; readings without a truth are left out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from henon_ref.casefile.case import load_case
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.cli import study
from henon_ref.harness.report.manifest import provenance
from henon_ref.harness.rows import RunRow, read_rows
from henon_ref.harness.studies import restarts
from henon_ref.harness.studies.restart_tables import SUITE, SuiteRow
from henon_ref.harness.studies.study import Asked

CASES = Path(__file__).parents[3] / "cases"
OPTIONS = Options(processes=1)


def test_every_restart_runs_on_every_reading_at_its_tolerances(tmp_path: Path) -> None:
    """heyoka restarted at an exact zero, with roots of either direction, never gets away from it."""
    pytest.importorskip("heyoka")
    case = load_case(CASES / "free_coulomb.yaml")
    options = replace(OPTIONS, solvers=("heyoka",))
    page = restarts.run_restarts(Asked([case], options, provenance("x"), tmp_path)).page
    assert page is not None
    rows = read_rows(RunRow, page.with_name("runs.csv"))
    assert {(row.solver, row.rtol) for row in rows} == {
        (f"heyoka@{restart}", rtol) for restart in registry.RESTARTS for rtol in case.readings[0].tolerances
    }
    verdicts = {row.solver.partition("@")[2]: row.verdict for row in rows}
    assert verdicts["offset"] == verdicts["event-free-step"] == "right"
    assert verdicts["none"] == "solver defect"
    suite = {row.restart: row for row in read_rows(SuiteRow, page.with_name(SUITE))}
    assert [suite[restart].right for restart in registry.RESTARTS] == [3, 3, 3, 0]
    assert (suite["none"].failed, suite["none"].missed, suite["none"].elsewhere) == (3, 12, 3)
    assert "`cooldown`" in page.read_text(encoding="utf-8")


def test_the_command_keeps_the_rows_of_libraries_that_it_did_not_run(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = [str(CASES / "free_coulomb.yaml"), "--out", "out", "--jobs", "1", "--solvers"]
    assert study.command(["restarts", *arguments, "scipy-rk45"]) == 0
    assert study.command(["restarts", *arguments, "cvode-adams"]) == 0
    assert capsys.readouterr().out.splitlines() == 2 * ["out/restarts/README.md"]
    suite = read_rows(SuiteRow, tmp_path / "out/restarts" / SUITE)
    assert {row.solver for row in suite} == {"scipy-rk45", "cvode-adams"}
    assert len(suite) == 2 * len(registry.RESTARTS)
    page = (tmp_path / "out/restarts/README.md").read_text(encoding="utf-8")
    assert "| `scipy-rk45` | the root located again" in page
    assert study.command(["restarts", *arguments, "nobody"]) == 2
    assert "unknown solver 'nobody'" in capsys.readouterr().err


def test_a_reading_without_a_truth_is_left_out(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(restarts, "stored_statement", lambda case, reading: None)
    asked = Asked([load_case(CASES / "free_coulomb.yaml")], OPTIONS, provenance("x"), tmp_path)
    assert restarts.run_restarts(asked).page is None
