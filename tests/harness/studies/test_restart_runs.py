"""The runs behind the study of restarts: a worker a reading, what is cut, and a library that takes its worker along."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from fakes import Fake, case, expected, statement

from henon_ref.casefile.case import load_case
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options, Silent
from henon_ref.harness.campaign.settings import Setting
from henon_ref.harness.campaign.worker import WorkerState
from henon_ref.harness.cli import study
from henon_ref.harness.report.manifest import provenance
from henon_ref.harness.report.text.restarts import SUITE, SuiteRow
from henon_ref.harness.rows import RunRow, read_rows
from henon_ref.harness.studies.restarts import runs
from henon_ref.harness.studies.restarts.page import run_restarts
from henon_ref.harness.studies.restarts.runs import LIMIT, LONGER, Restarted, run_all
from henon_ref.harness.studies.study import Asked

CASES = Path(__file__).parents[3] / "cases"
OPTIONS = Options(processes=1)


def test_every_restart_runs_on_every_reading_at_its_tolerances(tmp_path: Path) -> None:
    """heyoka restarted at an exact zero, with roots of either direction, never gets away from it."""
    pytest.importorskip("heyoka")
    case = load_case(CASES / "free_coulomb.yaml")
    options = replace(OPTIONS, solvers=("heyoka",))
    page = run_restarts(Asked([case], options, provenance("x"), tmp_path)).page
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


@pytest.mark.parametrize("tolerances", [None, (1e-4,)])
def test_a_run_is_the_campaign_s_own(tolerances: tuple[float, ...] | None) -> None:
    """Equations that all libraries share change nothing: the same transitions, steps and digits as a run alone."""
    case = load_case(CASES / "free_coulomb.yaml")
    names = ("scipy-rk45@offset", "cvode-adams@offset")
    made = run_all([case], [(name,) for name in names], replace(OPTIONS, tolerances=tolerances), Silent())
    problem = case.readings[0].problem
    assert len(made.rows) == 2 * len(tolerances or case.readings[0].tolerances)
    for row in made.rows:
        alone = registry.solver(row.solver).prepare(problem, rtol=row.rtol, atol=row.atol)()
        assert (alone.counts.steps, len(alone.transitions)) == (row.steps, row.found_transitions)
        assert alone.end_time == row.end_time_s


@dataclass(frozen=True)
class Slow(Fake):
    """Out of time under a limit, or always."""

    needs: float = 0.0

    def prepare(self, problem, *, deadline=None, **options):
        run = super().prepare(problem, **options)
        return run if deadline >= self.needs else lambda: run()._replace(status="timeout", transitions=())


def job(*solvers: Fake) -> list[str]:
    """Statuses of the rows of a job."""
    made_up = case()
    own = Restarted(made_up.name, made_up.readings[0], expected(), Setting(1e-6, 1e-6), solvers)
    return [row.status for row in own.run(WorkerState(lambda kind, value: None))]


def test_a_slow_restart_gets_more_time_where_another_one_is_right() -> None:
    slow, slower = Slow("slow", needs=LONGER * LIMIT), Slow("slower", needs=LONGER * LIMIT + 1)
    assert job(slow, slower, Fake()) == ["ok", "timeout", "ok"]
    assert job(slow, slower) == ["timeout", "timeout"]
    assert job(slow, Fake(what="misses")) == ["timeout", "wrong"]


def test_what_a_library_raises_is_a_row() -> None:
    assert job(Fake("a", "raises"), Fake("b", "unsupported")) == ["failed", "unsupported"]


def outcome(monkeypatch: pytest.MonkeyPatch, *group: Fake) -> runs.Study:
    """The study of one group on the made-up case, whose tolerances are 1e-3 and 1e-6."""
    monkeypatch.setattr(registry, "base_name", lambda name: "heyoka")  # one of those that the case is for
    monkeypatch.setattr(runs, "stored_statement", statement)
    return run_all([case()], [group], OPTIONS, Silent())


def test_a_tolerance_is_cut_for_all_where_none_is_right_and_one_is_late(monkeypatch: pytest.MonkeyPatch) -> None:
    late = Slow("a", needs=1e9)
    cut = outcome(monkeypatch, late, Fake("b", "misses"))
    assert cut.cut == 1
    assert [(row.solver, row.rtol) for row in cut.rows] == [("a", 1e-3), ("b", 1e-3)]
    whole = outcome(monkeypatch, late, Fake("b"))
    assert whole.cut == 0
    assert [(row.solver, row.rtol) for row in whole.rows] == [("a", 1e-3), ("b", 1e-3), ("a", 1e-6), ("b", 1e-6)]


def test_a_library_that_ends_its_worker_takes_no_other_one_along(monkeypatch: pytest.MonkeyPatch) -> None:
    """Then each runs in a worker of its own."""
    found = outcome(monkeypatch, Fake("a"), Fake("b", "crashes"))
    assert [(row.solver, row.status) for row in found.rows] == 2 * [("a", "ok"), ("b", "failed")]
    assert all("SIGSEGV" in row.status_reason for row in found.rows if row.solver == "b")


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


def test_a_reading_without_a_truth_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runs, "stored_statement", lambda case, reading: None)
    assert run_all([case()], [("heyoka",)], OPTIONS, Silent()).rows == []
