"""A solver is at fault only if an error of the size of its tolerance cannot explain the difference."""

from __future__ import annotations

from dataclasses import replace

import pytest
from fakes import TIMES, case, expected, found, reference, trajectory

from henon_ref.harness.campaign.options import Setting
from henon_ref.harness.campaign.rows import Outcome, record, scored
from henon_ref.harness.score.reference import NearGraze
from henon_ref.harness.score.scoring import graze_distance, score
from henon_ref.trajectory import Transition
from henon_ref.workers.worker import Failure


def crossing(time: float, before: int = 1) -> Transition:
    return Transition("crossing", 0, (before,), (-before,), time, (0.25,))


def pair(depth: float) -> tuple:
    """Two crossings of a parabola of this depth and unit curvature: x = (t - 2)^2 / 2 - depth."""
    half = (2 * depth) ** 0.5
    roots = tuple(replace(e, time=2 + sign * half) for e, sign in zip(reference()[:2], (-1, 1), strict=True))
    return tuple(replace(e, conditioning=1 / half, transversality=half) for e in roots)


def test_the_depth_between_two_roots_of_a_parabola_is_its_distance_from_a_graze():
    truth = expected(transitions=pair(1e-6))
    assert graze_distance(truth, 0) == pytest.approx(1e-6)
    assert graze_distance(truth, 1) == pytest.approx(1e-6)


@pytest.mark.parametrize(("tolerance", "word"), [(1.01e-6, "ill-conditioned"), (0.99e-6, "solver defect")])
def test_a_pair_is_gone_once_an_error_is_as_large_as_its_depth(tolerance, word):
    truth = expected(transitions=pair(1e-6), start_size=1.0)
    result = score(trajectory(()), truth, tolerance=tolerance).verdict
    assert result.word == word
    assert "moves it by" in result.basis
    assert "its neighbour is 2.8e-03 s away" in result.basis


@pytest.mark.parametrize(("tolerance", "word"), [(1e-6, "ill-conditioned"), (1e-9, "solver defect")])
def test_a_touch_invented_within_the_tolerance_is_no_defect_where_the_exact_run_has_no_transition(tolerance, word):
    # The size of the state is that of its start: there is no transition to take it from.
    truth = expected((), near_grazes=(NearGraze(2.0, 0, 1e-8),), start_size=1.0)
    run = trajectory((crossing(1.9999), crossing(2.0001, before=-1)))
    result = score(run, truth, tolerance=tolerance).verdict
    assert result.word == word


def test_an_invented_transition_far_from_any_touch_is_a_defect_that_says_so():
    result = score(trajectory((*found(), crossing(4.5))), expected(), tolerance=1e-6).verdict
    assert result.word == "solver defect"
    assert "crossing at t = 4.5 s is not there" in result.basis


@pytest.mark.parametrize(("conditioning", "word"), [(1e3, "ill-conditioned"), (10.0, "solver defect")])
def test_two_surfaces_may_be_met_in_either_order_within_the_error(conditioning, word):
    impacts = [
        replace(
            e, kind="reset", surface=i, from_mode=(1, 1), to_mode=(1, 1), time=2 + i * 1e-4, conditioning=conditioning
        )
        for i, e in enumerate(reference()[:2])
    ]
    truth = expected(transitions=tuple(impacts), start_size=1.0)
    run = [Transition("reset", i, (1, 1), (1, 1), 2 + (1 - i) * 1e-5, (0.25,)) for i in (1, 0)]
    result = score(trajectory(tuple(run)), truth, tolerance=1e-7).verdict
    assert result.word == word
    assert ("either may be the first" in result.basis) == (word == "ill-conditioned")


def test_what_went_wrong_before_the_run_stops_being_unique_is_the_solver_s():
    truth = expected(TIMES[:3], status="nonunique", end_time=2.7)
    late = score(trajectory(found(TIMES[:3])), truth, tolerance=1e-6).verdict
    assert (late.word, late.basis) == ("not unique", "from t = 2.7 s on there are several futures")
    early = score(trajectory(found(TIMES[:3])[:1]), truth, tolerance=1e-6).verdict
    assert early.word == "solver defect"


def test_a_run_that_stops_early_is_told_where():
    result = score(trajectory(found()[:2], "failed", end_time=1.5, reason="no"), expected(), tolerance=1e-6).verdict
    assert result.word == "solver defect"
    assert result.basis.startswith("right up to its end at t = 1.5 s; then crossing at t = 2 s")


@pytest.mark.parametrize("times", [TIMES[:2], TIMES])
def test_a_run_that_is_right_until_its_time_is_up_is_not_judged(times):
    ended = times[-1] + 0.01
    stopped = trajectory(found(times), "timeout", end_time=ended, reason="stopped after 1 s")
    result = score(stopped, expected(), tolerance=1e-6)
    assert (result.status, result.verdict.word) == ("timeout", "not judged")
    assert result.verdict.basis == f"right up to t = {ended:g} s, where the time limit stopped it"


@pytest.mark.parametrize(("late", "word"), [(0.9e-2, "ill-conditioned"), (1.1e-2, "solver defect")])
def test_an_end_that_comes_with_the_root_of_the_error_is_the_question_s(late, word):
    """By Torricelli's law a level 1e-4 off is off by 1e-2 in the time at which it is zero, in units of the run."""
    truth = replace(expected(), status="failed")
    span, end = truth.until - truth.start, truth.end_time + late * (truth.until - truth.start)
    tolerance = 1e-4 / 200
    stopped = trajectory(found(), "failed", end_time=end, reason="the step is too small")
    result = score(stopped, truth, tolerance=tolerance)
    assert (result.status, result.verdict.word) == ("failed", word)
    assert span > 0


@pytest.mark.parametrize("wrong", [(*found()[:1], *found()[2:4]), (*found()[:3], crossing(3.6))])
def test_what_went_wrong_before_the_time_was_up_is_the_solver_s(wrong):
    stopped = trajectory(tuple(wrong), "timeout", end_time=3.7, reason="stopped after 1 s")
    assert score(stopped, expected(), tolerance=1e-6).verdict.word == "solver defect"


@pytest.mark.parametrize(
    ("status", "word"), [("timeout", "not judged"), ("failed", "solver defect"), ("unsupported", "not run")]
)
def test_a_run_without_an_answer_is_the_solver_s_fault_only_where_it_failed(status, word):
    outcome = Outcome("made_up", case().readings[0], "henon", Setting(rtol=1e-6, atol=1e-6))
    outcome = replace(outcome, failure=Failure(status, "why"))
    assert record(outcome, expected()).run.verdict == word


def test_every_transition_says_what_became_of_it_and_what_the_verdict_rests_on():
    outcome = Outcome("made_up", case().readings[0], "henon", Setting(rtol=1e-6, atol=1e-6))
    outcome = replace(outcome, trajectory=trajectory((*found()[:2], *found()[3:], crossing(4.5))))
    truth = expected()
    outcome = scored(outcome, truth)
    rows = record(outcome, truth).transitions
    assert [row.outcome for row in rows] == ["matched", "matched", "missed", "matched", "matched", "spurious"]
    assert [row.verdict for row in rows] == [None, None, "solver defect", None, None, "solver defect"]
    assert rows[0].transversality == 1.0
    assert rows[0].graze_distance == pytest.approx(0.25 * 0.75)
    assert record(outcome, truth).run.verdict_basis.startswith("crossing at t = 2 s: an error of 2.5e-07")


def test_a_reset_applied_several_times_at_one_instant_has_the_distance_to_the_next_instant():
    rows = [
        replace(event, kind="reset", surface=0, from_mode=(1,), to_mode=(1,), time=time)
        for event, time in zip(reference()[:4], (1.0, 1.0, 1.0, 1.5), strict=True)
    ]
    truth = replace(expected(), transitions=tuple(rows))
    assert truth.gaps == [0.5] * 4
