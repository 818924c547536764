"""A comparison of made-up solvers: every failure is a row, and a run is scored before it is timed."""

from __future__ import annotations

import sys
from dataclasses import replace
from importlib.metadata import EntryPoint

import pytest
from fakes import TIMES, Fake, case, expected, truth, truth_of
from often import daily

from henon_ref.harness import registry
from henon_ref.harness.campaign import jobs
from henon_ref.harness.campaign.campaign import compare, compare_all
from henon_ref.harness.campaign.comparison import Comparison
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.rows import RunRow
from henon_ref.harness.score.gate import Demand, bounds_of, demand, gate
from henon_ref.harness.truth import compute
from henon_ref.workers.worker import Job

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="made-up truths reach workers by fork")


@pytest.fixture(autouse=True)
def _made_up_truth(monkeypatch):
    monkeypatch.setattr(compute, "truth_for", truth)


def run(*solvers: Fake, **options: object) -> Comparison:
    return compare(case(), solvers=solvers, **options)


def test_right_runs_are_scored_against_their_tolerance_and_timed():
    result = run(Fake(), repeats=3)
    assert list(result.runs["rtol"]) == [1e-3, 1e-6]
    assert list(result.runs["status"]) == ["ok", "ok"]
    assert result.runs["max_time_error_s"].to_list() == pytest.approx([1e-3, 1e-6])
    assert result.runs["digits"].to_list() == pytest.approx([3.0, 6.0])
    assert list(result.runs["timed_runs"]) == [3, 3]
    assert (result.runs["matched"] == len(TIMES)).all()
    assert (result.runs["wall_s"] > 0).all()


def test_columns_are_those_of_the_contract_in_their_order():
    result = run(Fake())
    assert " ".join(result.runs.columns[:26]) == (
        "case reading solver library_version rtol atol step_s status landing reference_transitions found_transitions "
        "matched missed spurious max_time_error_s rms_time_error_s max_state_error max_surface_drift stick_count "
        "max_stick_error_s wall_s wall_s_iqr compile_s steps rhs_evaluations event_evaluations"
    )
    assert " ".join(result.transitions.columns) == (
        "case reading solver rtol step_s index kind surface from_mode to_mode reference_time_s reference_radius_s "
        "time_s time_error_s conditioning x transversality graze_distance outcome verdict"
    )
    assert " ".join(result.sticks.columns) == (
        "case reading solver rtol step_s index start_s duration_s reference_s error_s published_s published_error_s "
        "length"
    )


def test_a_fixed_step_solver_has_a_step_and_no_tolerance():
    result = run(Fake(fixed_step=True))
    assert list(result.runs["step_s"]) == [1e-3]
    assert result.runs["rtol"].isna().all()
    assert result.runs["atol"].isna().all()


@pytest.mark.parametrize(
    ("what", "status", "words"),
    [
        ("raises", "failed", "ArithmeticError: the Newton iteration failed"),
        ("unsupported", "unsupported", "it cannot"),
        ("misses", "wrong", "1 missed"),
        ("answers", "failed", "the solver returned 42 (int), wanted a Trajectory"),
        ("prepares nothing", "failed", "the solver's prepare() returned None (NoneType), wanted a function"),
    ],
)
def test_a_failure_is_a_row_with_a_reason_and_the_others_go_on(what, status, words):
    result = run(Fake("bad", what), Fake())
    bad = result.runs[result.runs["solver"] == "bad"]
    assert list(bad["status"]) == [status, status]
    assert words in bad["status_reason"].iloc[0]
    assert list(result.runs[result.runs["solver"] == "fake"]["status"]) == ["ok", "ok"]


@pytest.mark.parametrize("asked", [None, ["sound", "broken"]])
def test_an_entry_point_without_a_solver_is_a_row_that_was_not_run_and_the_others_go_on(monkeypatch, asked):
    held = {"broken": "no_such_module:SOLVER", "sound": "fakes:SOUND"}
    points = {name: EntryPoint(name, value, registry.GROUP) for name, value in held.items()}
    monkeypatch.setattr(registry, "_third_party", lambda: points)
    monkeypatch.setattr(registry, "_BUILT_IN", {})
    loose = replace(case(), readings=tuple(replace(reading, solvers=None) for reading in case().readings))
    runs = compare(loose, solvers=asked, tolerances=[1e-6], repeats=1).runs
    assert list(runs["solver"]) == ["broken", "sound"]
    assert list(runs["status"]) == ["unavailable", "ok"]
    assert list(runs["verdict"]) == ["not run", "right"]
    assert runs["status_reason"][0].startswith("the entry point broken = no_such_module:SOLVER cannot be loaded")


def test_numbers_of_numpy_are_as_good_as_plain_ones_in_rows_and_in_the_journal(tmp_path):
    found: list[Comparison] = []
    for what in ("right", "numpy"):
        compare_all([case()], Options(solvers=(Fake(what=what),), repeats=1, folder=tmp_path), found.append)
    plain, numpy = (comparison.transitions for comparison in found)
    assert plain.equals(numpy)
    assert list(found[1].runs["steps"]) == [10, 10]


def test_a_run_with_too_many_transitions_to_score_is_a_failed_row_that_says_so(monkeypatch):
    monkeypatch.setattr(jobs, "MOST_FOLD", 0)
    monkeypatch.setattr(jobs, "MOST_SPARE", 4)
    row = run(Fake(), tolerances=[1e-6]).records[0].run
    assert (row.status, row.verdict) == ("failed", "solver defect")
    assert row.status_reason.startswith("the solver returned more than 4 transitions")


def test_missing_values_are_missing_and_never_nought():
    result = run(Fake("bad", "raises"))
    empty = ["found_transitions", "matched", "missed", "max_time_error_s", "wall_s", "stick_count", "steps", "digits"]
    assert all(set(record.run.values(empty)) == {None} for record in result.records)


def test_a_run_that_hangs_is_a_timeout_and_is_not_tried_at_tighter_tolerances():
    result = run(Fake("slow-poke", "hangs"), timeout=0.2)
    assert list(result.runs["status"]) == ["timeout", "timeout"]
    assert "stopped from outside" in result.runs["status_reason"][0]
    assert result.runs["status_reason"][1] == "not run: timed out at 0.001"
    assert result.runs["steps"].isna().all()


def test_what_is_demanded_is_run_at_all_its_tolerances_after_a_timeout_too(tmp_path):
    """By the gate of the case, which names henon, or by the caller, in a comparison that goes on too."""
    options = Options(timeout=0.2, repeats=1, folder=tmp_path)
    found: list[list[str]] = []
    for name, how in (("henon", {}), ("heyoka", {}), ("heyoka", {"resume": True, "required": ("heyoka",)})):
        own = replace(options, solvers=(Fake(name, "hangs"),), **how)
        compare_all([case()], own, lambda one: found.append(one.runs["status_reason"].tolist()))
    assert [["stopped from outside" in reason for reason in reasons] for reasons in found] == [
        [True, True], [True, False], [True, True]
    ]  # fmt: skip


def test_a_solver_that_is_not_ready_in_time_is_not_judged(monkeypatch):
    """A library that compiles for minutes answers right all the same: that is a limit of ours."""
    monkeypatch.setattr(jobs, "PREPARE_SECONDS", 0.3)
    runs = run(Fake("compiler", "prepares forever")).runs
    assert list(runs["status"]) == ["timeout", "timeout"]
    assert list(runs["verdict"]) == ["not judged", "not judged"]
    assert list(runs["status_reason"]) == [
        jobs.TOO_LONG_TO_PREPARE,
        f"not run: at 0.001 {jobs.TOO_LONG_TO_PREPARE}",
    ]


def test_a_run_that_is_caught_in_false_transitions_says_nothing_of_tighter_tolerances():
    result = run(Fake("caught", "chatters"), tolerances=[1e-3, 1e-6])
    assert list(result.runs["status"]) == ["timeout", "ok"]
    assert list(result.runs["verdict"]) == ["solver defect", "right"]


@pytest.mark.parametrize(
    ("what", "status", "words"),
    [
        ("hangs", "timeout", "stopped from outside"),
        ("crashes", "failed", "SIGSEGV"),
        ("sends stray bytes", "failed", "the worker sent something that is no reply"),
    ],
)
def test_what_is_hostile_is_the_solver_s_own_defect_and_nobody_else_s(what, status, words):
    found: list[Comparison] = []
    timeout = 0.3 if status == "timeout" else 20.0
    options = Options(solvers=(Fake("bad", what), Fake()), repeats=1, timeout=timeout)
    compare_all([case()], options, found.append)
    runs = found[0].runs.set_index("solver")
    assert list(runs.loc["bad", "status"]) == [status, status]
    assert list(runs.loc["bad", "verdict"]) == ["solver defect"] * 2
    assert words in runs.loc["bad", "status_reason"].iloc[0]
    assert list(runs.loc["fake", "verdict"]) == ["right"] * 2
    assert demand("bad", found[0].run_rows).failures
    assert demand("fake", found[0].run_rows) == Demand(right=1, judged=1)


@pytest.mark.parametrize(
    ("what", "status"),
    daily([("sleeps", "ok"), ("compiles", "ok"), ("burns", "timeout")], some=[("sleeps", "ok"), ("burns", "timeout")]),
)  # daily: test_pool.py, of a job that compiles
def test_a_deadline_is_processor_time_without_what_is_compiled(what, status):
    """Each takes half as long again as it may, of the one or the other."""
    assert run(Fake(what=what), timeout=0.5, tolerances=[1e-6], repeats=1).runs["status"][0] == status


def test_a_run_that_keeps_its_deadline_keeps_what_it_found():
    result = run(Fake("partial", "stops"))
    assert result.runs["status"][0] == "timeout"
    assert (result.runs["matched"][0], result.runs["missed"][0]) == (3, 2)
    assert result.runs["wall_s"].isna().all()


def test_only_a_right_answer_is_timed_again(tmp_path):
    right, wrong = tmp_path / "right", tmp_path / "wrong"
    run(Fake(log=str(right)), Fake("wrong", "misses", str(wrong)), repeats=5)
    assert len(right.read_text().splitlines()) == 2 * (1 + 5)
    assert len(wrong.read_text().splitlines()) == 2


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ("raises later", "failed: ArithmeticError: the Newton iteration failed"),
        ("crashes later", "failed: the library was ended by signal SIGSEGV"),
        ("hangs later", "timeout: stopped from outside"),
        ("sends stray bytes later", "failed: the worker sent something that is no reply"),
        ("misses later", "failed: transitions[2] of a repeated run is not that of the first run"),
        ("stops later", "failed: the status of a repeated run is timeout, that of the first run ok"),
        ("answers later", "failed: the solver returned 42 (int), wanted a Trajectory"),
    ],
)
def test_a_right_run_that_fails_when_it_is_repeated_stays_right_and_says_how_it_failed(monkeypatch, what, words):
    if what == "hangs later":
        monkeypatch.setattr(jobs, "SPARE_SECONDS", 0.0)
    found = run(Fake(what=what))
    runs = found.runs
    (failure,) = demand("fake", found.run_rows).failures  # all the same nobody can rely on it
    assert words in failure
    assert list(runs["verdict"]) == ["right", "right"]
    assert list(runs["status"]) == ["ok", "ok"]
    assert runs["wall_s"].isna().all()
    for reason in runs["status_reason"]:
        assert reason.startswith(f"a repeated run ended otherwise than the first one, {words}")


def test_transitions_are_the_union_of_the_truth_s_and_the_run_s():
    result = run(Fake("misses-one", "misses"), tolerances=[1e-6])
    rows = result.transitions
    assert len(rows) == len(TIMES)
    assert rows["time_s"].isna().to_list() == [False, False, True, False, False]
    assert rows["x"].isna().to_list() == [False, False, True, False, False]
    assert rows["reference_time_s"].to_list() == list(TIMES)
    assert rows["from_mode"][0] == "s=+1"
    assert rows["to_mode"][0] == "s=0"
    assert rows["time_error_s"].dropna().to_list() == pytest.approx([1e-6] * 4, rel=1e-6)


def test_sticks_are_held_against_truth_and_source():
    sticks = run(Fake(), tolerances=[1e-6]).sticks
    assert sticks["reference_s"].to_list() == [0.75, 0.5]
    assert sticks["duration_s"].to_list() == pytest.approx([0.75, 0.5])
    assert sticks["published_error_s"].to_list() == pytest.approx([0.0, -0.25], abs=1e-9)
    assert sticks["length"].to_list() == [0.0, 0.0]


def test_the_gate_names_what_is_not_met():
    assert compare(case(), solvers=[replace(Fake(), name="henon")]).gate_failures() == []
    (words,) = compare(case(), solvers=[Fake("henon", "misses")]).gate_failures()
    assert words.startswith("default: henon (rtol 1e-06): status wrong (1 missed")
    coarse = replace(case(), readings=[replace(case().readings[0], tolerances=(1e-3, 1e-4))])
    (words,) = compare(coarse, solvers=[replace(Fake(), name="henon")]).gate_failures()
    assert "worst time error 0.0001 s, wanted <= 1e-05 s" in words


def test_a_bound_that_bounds_nothing_is_not_met():
    row = RunRow("made_up", "default", "henon", rtol=1e-6, status="ok", reference_transitions=0)
    ((_, words),) = gate(bounds_of(case()), [row]).unmet
    assert words.endswith("worst time error <= 1e-05 s bounds nothing: the exact run has no transition")


def test_without_a_truth_runs_are_kept_and_not_scored(monkeypatch):
    def contradiction(case, reading):
        raise ValueError("the routes disagree")

    monkeypatch.setattr(compute, "truth_for", contradiction)
    result = run(Fake())
    assert list(result.runs["status"]) == ["ok", "ok"]
    assert result.runs["max_time_error_s"].isna().all()
    assert "the routes disagree" in result.readings[0].truth.reason


def test_a_truth_that_ends_at_the_start_makes_no_run_right(monkeypatch):
    nothing = truth_of(expected((), end_time=0.0, partial=True), reason="the field is not finite")
    monkeypatch.setattr(compute, "truth_for", lambda case, reading: nothing)
    rows = run(Fake()).run_rows
    assert {(row.status, row.verdict, row.expected_status) for row in rows} == {("ok", "not judged", None)}
    assert not demand("fake", rows).judged


def test_cases_are_delivered_as_they_are_done():
    done: list[str] = []
    options = Options(solvers=(Fake(),), repeats=1)
    compare_all([case("first"), case("second")], options, lambda comparison: done.append(comparison.case.name))
    assert sorted(done) == ["first", "second"]


def drawn(state, reading):
    return {f"{reading}.svg": b"<svg/>"}


def test_figures_are_drawn_by_a_worker_too(monkeypatch):
    monkeypatch.setattr(registry, "solver", lambda name: Fake(name))
    found: list[Comparison] = []
    compare_all(
        [case()],
        Options(solvers=(Fake(),), repeats=1),
        found.append,
        draw=lambda result, records: Job(drawn, (result.reading.name,), 20.0),
    )
    assert found[0].readings[0].figures == {"default.svg": b"<svg/>"}
