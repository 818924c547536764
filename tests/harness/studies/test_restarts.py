"""Restarts: results and defaults over the suite, the tables of the page, and the runs of the study."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest
from made_reports import study_request

from henon_ref.casefile.case import load_case
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.cli import study
from henon_ref.harness.result_files import earlier_rows, read_rows
from henon_ref.harness.rows import NOT_RUN, RunRow
from henon_ref.harness.studies import restarts
from henon_ref.harness.studies.restarts import (
    ENDINGS,
    SUITE,
    Merit,
    SuiteRow,
    beaten_table,
    best_restart,
    default_table,
    ending,
    merged,
    merits,
    option_rows,
    option_table,
    options_of,
    suite_rows,
    summary_table,
    wrong_defaults,
)
from henon_ref.trajectory import Status

REPORTS = Path(__file__).parents[3] / "reports"
CASES = Path(__file__).parents[3] / "cases"
LIBRARIES = (
    "heyoka", "cvode-adams", "cvode-bdf", "ida",
    "scipy-rk45", "scipy-dop853", "scipy-radau", "scipy-bdf", "scipy-lsoda",
)  # fmt: skip
"""Those that the study must have; of further ones that it has the defaults are held against it, too."""


def of(restart: str, right: int, *, case: str = "a", solver: str = "heyoka", digits: float = 9.0) -> SuiteRow:
    """A row of the suite: of six runs so many right."""
    names = {"case": case, "solver": solver, "restart": restart, "runs": 6, "right": right}
    ends = {"wrong": 0, "ended_early": 0, "failed": 6 - right, "missed": 6 - right, "spurious": 0, "elsewhere": 0}
    return SuiteRow(**names | ends, digits=digits, wall_s=1.0)


def run(solver: str, status: str = "ok", **own: object) -> RunRow:
    """A run; right where it is ok."""
    verdict = "right" if status == "ok" else "solver defect"
    names = {"case": "a", "reading": "default", "solver": solver, "rtol": 1e-6, "status": status, "verdict": verdict}
    return RunRow(**names | {"missed": 0, "spurious": 0, "digits": 9.0} | own)


def test_no_restart_beats_its_library_s_default_over_the_suite() -> None:
    """The defaults are what the last run over the whole suite says: ``henon-ref restarts cases --out reports``."""
    suite = read_rows(SuiteRow, REPORTS / "restarts" / SUITE)
    assert {row.solver for row in suite} >= set(LIBRARIES)
    assert {row.restart for row in suite} == set(registry.RESTARTS)
    assert wrong_defaults(suite) == []


def test_a_library_with_compiled_callbacks_has_the_default_of_its_plain_one() -> None:
    for name in registry.names():
        base, compiled, _ = name.partition("+")
        if compiled:
            assert registry.restart_of(name) == registry.restart_of(base)


@pytest.mark.parametrize("library", LIBRARIES)
def test_a_wrong_default_is_found(library: str) -> None:
    default = registry.restart_of(library)
    rows = [of(restart, 5 + (restart != default), solver=library) for restart in registry.RESTARTS]
    (words,) = wrong_defaults(rows)
    assert re.match(rf"{library}: its default is {default} \(right in 5, \d+ digits in all, ", words)
    assert "better is " in words
    assert wrong_defaults([of(restart, 5, solver=library) for restart in registry.RESTARTS]) == []
    (words,) = wrong_defaults([row for row in rows if row.restart != default])
    assert "(not run)" in words


@pytest.mark.parametrize(
    ("better", "worse"),
    [
        (Merit(6, 1.0, 9.0), Merit(5, 70.0, 1.0)),
        (Merit(5, 61.0, 9.0), Merit(5, 60.0, 1.0)),
        (Merit(5, 60.0, 0.7), Merit(5, 60.0, 1.0)),
    ],
)
def test_right_runs_count_before_digits_and_digits_before_time(better: Merit, worse: Merit) -> None:
    assert better.beats(worse)
    assert not worse.beats(better)


def test_what_the_machine_may_do_to_a_time_makes_no_restart_better() -> None:
    first, second = Merit(5, 60.0, 0.9), Merit(5, 60.2, 1.0)
    assert not first.beats(second)
    assert not second.beats(first)
    assert best_restart({"offset": second, "none": first}) == "offset"


def test_the_suite_sums_up_a_case_s_runs() -> None:
    """Digits beyond 12 are rounding; a run that was not made is none; what another restart gets right is told."""
    rows = [
        run("heyoka@none", digits=15.0, wall_s=2.0),
        run("heyoka@none", digits=7.5, wall_s=1.0, rtol=1e-9),
        run("heyoka@none", digits=None, wall_s=1.0, rtol=1e-12),
        run("heyoka@none", "failed", missed=2, reading="b"),
        run("heyoka@none", "wrong", missed=1, spurious=3, reading="c"),
        run("heyoka@offset", "wrong"),
        run("heyoka@offset", reading="c", wall_s=1.0),
        run("ida@none", "unavailable"),
        run("ida@offset", reading="b", wall_s=1.0),
    ]
    none, offset, ida = suite_rows(rows)
    assert tuple(vars(none).values()) == ("a", "heyoka", "none", 5, 3, 1, 0, 1, 3, 3, 1, 19.5, 4.0)
    assert tuple(vars(offset).values())[3:] == (2, 1, 1, 0, 0, 0, 0, 1, 9.0, 1.0)
    assert ida.elsewhere == 0


def test_every_status_of_the_contract_ends_a_run_in_one_way() -> None:
    """A run that ends by a status of its own has missed what comes after; it is neither wrong nor failed."""
    statuses = [status for status in get_args(Status) if status not in NOT_RUN]
    found = {status: ending(run("heyoka@none", status, missed=1)) for status in statuses}
    assert set(found.values()) == set(ENDINGS)
    assert {status for status, end in found.items() if end == "ended_early"} == {"nonunique", "invalid", "diverged"}
    assert {status for status, end in found.items() if end == "failed"} == {"failed", "timeout"}


def test_rows_of_libraries_and_cases_that_did_not_run_are_kept() -> None:
    earlier = [of("none", 1, solver="scipy-rk45"), of("none", 1), of("offset", 1, case="b")]
    fresh = [of("none", 2)]
    assert merged(fresh, earlier) == [fresh[0], earlier[0], earlier[2]]
    assert merged([], earlier) == [earlier[1], earlier[0], earlier[2]]


def test_default_and_best_stand_side_by_side_where_another_one_is_right_more_often() -> None:
    default = registry.restart_of("heyoka")
    first, second, third = (restart for restart in registry.RESTARTS if restart != default)
    rows = [
        of(default, 4), of(first, 6), of(second, 6), of(third, 3),
        of(default, 6, case="b"), of(first, 6, case="b", digits=60.0),
    ]  # fmt: skip
    (line,) = beaten_table(rows).rows
    best = ", ".join(f"`{restart}`" for restart in registry.RESTARTS if restart in (first, second))
    assert line == ("[a](../a/report.md)", "`heyoka`", f"`{default}`", "4 of 6", best, "6 of 6", "2 failed, 2 missed")
    assert set(merits(rows, "heyoka")) == set(registry.RESTARTS)


@pytest.mark.parametrize("content", ["", "case,solver\na,b\n", "case\n1,2,3\n"])
def test_another_file_of_that_name_is_no_suite(tmp_path: Path, content: str) -> None:
    (tmp_path / SUITE).write_text(content, encoding="utf-8")
    assert earlier_rows(SuiteRow, tmp_path / SUITE) == []


def test_every_run_is_counted_once_however_it_ends() -> None:
    rows = [
        run("heyoka@none"),
        run("heyoka@none", "wrong", missed=1),
        run("heyoka@none", "nonunique", missed=110),
        run("heyoka@none", "diverged", missed=2),
        run("heyoka@none", "failed", missed=4),
        run("heyoka@none", "timeout", missed=8),
        run("heyoka@none", "unavailable"),
    ]
    table = summary_table(suite_rows(rows))
    assert table.rows[-1][:7] == ("`heyoka`", "`none`", "1", "1", "2", "2", "125")
    bold = [line[1] for line in table.rows if line[1].startswith("**")]
    assert bold == [f"**`{registry.restart_of('heyoka')}`**"]


def test_runs_that_another_restart_gets_right_are_counted() -> None:
    rows = [
        run("heyoka@none", "wrong"),
        run("heyoka@none", "failed", reading="by none"),
        run("heyoka@none", reading="by both"),
        run("heyoka@offset"),
        run("heyoka@offset", "wrong", reading="by none"),
        run("heyoka@offset", reading="by both"),
        run("ida@none", "wrong"),
    ]
    table = summary_table(suite_rows(rows))
    assert table.headings[-1] == "right by another restart"
    assert {line[:2]: line[-1] for line in table.rows if line[-1]} == {("`heyoka`", "`none`"): "1"}


def test_a_default_is_set_against_the_best_other_restart() -> None:
    """Right runs, and the digits of these: rounding is no digit."""
    default, other = registry.restart_of("heyoka"), "none"
    rows = [
        *(run(f"heyoka@{default}", "failed", reading=f"late{k}") for k in range(2)),
        *(run(f"heyoka@{other}", reading=f"late{k}") for k in range(2)),
        run(f"heyoka@{default}", reading="gained"),
        run(f"heyoka@{other}", "wrong", reading="gained"),
        run(f"heyoka@{default}", reading="rounding", digits=13.0),
        run(f"heyoka@{other}", reading="rounding", digits=15.9),
        run(f"heyoka@{default}", reading="idle", digits=None),
        run(f"heyoka@{other}", reading="idle", digits=None),
        run("heyoka@direction", "failed", reading="gained"),
    ]
    (line,) = default_table(suite_rows(rows)).rows
    assert line[:5] == ("`heyoka`", "1", f"`{default}`", "3", "21")
    assert line[6:9] == ("`none`", "4", "30")


def test_an_option_is_set_beside_the_library_as_it_is() -> None:
    """Of runs that were made with and without it, by the library in its default restart."""
    assert [library for library, *_ in options_of(["heyoka", "ida"])] == ["heyoka"]
    (option,) = options_of(["scipy-rk45"])
    without, with_it = registry.with_restart("scipy-rk45", registry.restart_of("scipy-rk45")), option[2].name
    assert without != with_it
    rows = [
        run(without),
        run(with_it, digits=9.5),
        run(without, "wrong", reading="gained"),
        run(with_it, reading="gained"),
        run(without, reading="alone"),
        run(without, reading="idle", digits=None),
        run(with_it, reading="idle", digits=None),
    ]
    (line,) = option_table(option_rows([option], rows)).rows
    assert line[0] == "`scipy-rk45`"
    assert line[2:] == ("3", "2", "3", "0", "1", "9", "9.5")


def request(folder: Path):
    options = Options(solvers=("heyoka",), processes=1)
    return study_request([load_case(CASES / "free_coulomb.yaml")], options, folder)


def test_every_restart_runs_on_every_reading_at_its_tolerances(tmp_path: Path) -> None:
    """heyoka restarted at an exact zero, with roots of either direction, never gets away from it."""
    pytest.importorskip("heyoka")
    own = request(tmp_path)
    page = restarts.run_restarts(own).page
    assert page is not None
    rows = read_rows(RunRow, page.with_name("runs.csv"))
    assert {(row.solver, row.rtol) for row in rows} == {
        (f"heyoka@{restart}", rtol) for restart in registry.RESTARTS for rtol in own.cases[0].readings[0].tolerances
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
    monkeypatch.setattr(restarts, "stored_truth", lambda case, reading: None)
    assert restarts.run_restarts(request(tmp_path)).page is None
