"""Errors are computed in double-double, and no status or digit is claimed that the truth does not support."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from fakes import TIMES, expected, found, reference, trajectory

from henon_ref.harness.score.reference import HALF_ULP, NearGraze
from henon_ref.harness.score.scoring import digits, score, time_error


def test_a_time_error_below_the_last_bit_of_the_time_is_seen():
    truth = replace(reference()[0], time=70.0, time_low=3e-15)
    run = replace(found()[0], time=70.0, time_low=1e-15)
    assert time_error(run, truth) == pytest.approx(-2e-15, rel=1e-12, abs=0.0)


def test_worst_and_root_mean_square_errors():
    run = list(found())
    run[1] = replace(run[1], time=run[1].time + 4e-6)
    run[2] = replace(run[2], time=run[2].time - 3e-6)
    result = score(trajectory(tuple(run)), expected(), tolerance=1e-6)
    assert result.max_time_error == pytest.approx(4e-6)
    assert result.rms_time_error == pytest.approx(math.sqrt(25e-12 / len(TIMES)))
    assert (result.status, result.verdict.word) == ("ok", "right")


def test_state_error_is_the_worst_over_matched_transitions():
    run = list(found())
    run[3] = replace(run[3], state=(0.26,))
    assert score(trajectory(tuple(run)), expected(), tolerance=1e-6).max_state_error == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("error", "radius", "claimed"),
    [(1e-6, 1e-30, 6.0), (1e-40, 1e-12, 12.0), (0.0, 1e-30, -math.log10(HALF_ULP))],
)
def test_digits_never_exceed_the_truth_or_the_format(error, radius, claimed):
    truth = expected(transitions=tuple(replace(e, radius=radius) for e in reference()))
    assert digits(error, truth) == pytest.approx(claimed)


def test_digits_are_counted_from_the_time_scale_of_the_case():
    small = expected(tuple(t * 1e-9 for t in TIMES), until=5e-9, end_time=5e-9)
    assert small.time_unit == pytest.approx(1e-9)
    assert digits(1e-15, small) == pytest.approx(6.0)
    assert expected().time_unit == 1.0


def test_a_missed_transition_is_wrong_and_the_solver_s_fault():
    result = score(trajectory(found()[:2] + found()[3:]), expected(), tolerance=1e-6)
    assert (result.status, result.verdict.word) == ("wrong", "solver defect")
    assert "1 missed, 0 spurious" in result.reason
    assert "crossing at t = 2" in result.reason


def test_a_missed_transition_that_the_tolerance_cannot_see_is_ill_conditioned():
    shaky = tuple(replace(e, conditioning=1e7 if i == 2 else 1.0) for i, e in enumerate(reference()))
    run = trajectory(found()[:2] + found()[3:])
    assert score(run, expected(transitions=shaky), tolerance=1e-6).verdict.word == "ill-conditioned"
    assert score(run, expected(transitions=shaky), tolerance=1e-12).verdict.word == "solver defect"


def test_a_near_touch_within_the_tolerance_is_ill_conditioned():
    truth = expected(near_grazes=(NearGraze(1.5, 0, 1e-8),))
    extra = replace(found()[2], kind="crossing", from_mode=(1,), to_mode=(-1,), time=1.5)
    run = trajectory((*found()[:2], extra, *found()[2:]))
    assert score(run, truth, tolerance=1e-6).verdict.word == "ill-conditioned"
    assert score(run, truth, tolerance=1e-12).verdict.word == "solver defect"


def test_nothing_is_claimed_where_nothing_was_matched():
    result = score(trajectory((), "failed", reason="no"), expected(), tolerance=1e-6)
    assert (result.max_time_error, result.rms_time_error, result.digits, result.max_state_error) == (None,) * 4
    assert (result.status, result.reason) == ("failed", "no")


@pytest.mark.parametrize("status", ["diverged", "nonunique", "invalid"])
def test_a_run_that_ends_as_the_exact_one_does_is_right(status):
    truth = expected(TIMES[:3], status=status, end_time=2.7)
    run = trajectory(found(TIMES[:3]), status, end_time=2.7001)
    assert score(run, truth, tolerance=1e-6).verdict.word == "right"
    late = score(run._replace(end_time=4.0), truth, tolerance=1e-6)
    assert late.status == "wrong"
    assert "not at 2.7" in late.reason


def test_a_run_that_goes_on_past_the_end_is_wrong_and_what_follows_is_not_scored():
    truth = expected(TIMES[:3], status="nonunique", end_time=2.7)
    result = score(trajectory(found()), truth, tolerance=1e-6)
    assert (result.status, result.verdict.word) == ("wrong", "not unique")
    assert result.matching.spurious == ()
    assert "nonunique" in result.reason


def test_transitions_that_accumulate_may_be_told_as_far_as_a_solver_can_tell_them_apart():
    crowd = tuple(2.0 - 0.5**k for k in range(1, 50))
    truth = expected(crowd, status="failed", end_time=2.0)
    whole = trajectory(found(crowd), "failed", end_time=2.0)
    assert score(whole, truth, tolerance=1e-6).verdict.word == "right"
    near = trajectory(found(crowd[:25]), "failed", end_time=2.0 - 0.5**25, reason="too many")
    result = score(near, truth, tolerance=1e-6)
    assert (result.status, result.verdict.word, result.matching.missed) == ("failed", "right", ())
    assert len(result.matching.cut_reference) == 24
    more = trajectory(found((*crowd, 2.0 - 2**-50, 2.0 - 2**-51, 2.0 - 2**-52)), "failed", end_time=2.0)
    assert score(more, truth, tolerance=1e-6).verdict.word == "right"
    early = score(trajectory(found(crowd[:5]), "failed", end_time=1.97, reason="too many"), truth, tolerance=1e-6)
    assert (early.status, early.verdict.word) == ("failed", "solver defect")
    assert early.reason.startswith("too many; 12 missed")


def test_a_run_that_gives_up_too_early_keeps_its_status():
    result = score(trajectory(found()[:2], "diverged", end_time=1.5), expected(), tolerance=1e-6)
    assert (result.status, result.verdict.word) == ("diverged", "solver defect")
    assert len(result.matching.missed) == 3


def test_where_the_truth_ends_the_score_ends():
    truth = expected(TIMES[:3], end_time=2.7, partial=True)
    assert score(trajectory(found()), truth, tolerance=1e-6).verdict.word == "right"
    diverged = trajectory(found()[:4], "diverged", end_time=3.6)
    assert score(diverged, truth, tolerance=1e-6).verdict.word == "right"
    assert score(trajectory(found()[:2] + found()[3:]), truth, tolerance=1e-6).status == "wrong"
    early = trajectory(found()[:3], "timeout", end_time=2.6)
    assert (score(early, truth, tolerance=1e-6).status, score(early, truth, tolerance=1e-6).verdict.word) == (
        "timeout",
        "not judged",
    )


@pytest.mark.parametrize("status", ["nonunique", "failed", "diverged", "timeout"])
def test_a_run_that_ends_beside_the_end_of_the_truth_is_not_judged_by_its_end(status):
    truth = expected(TIMES[:3], end_time=2.7, partial=True)

    def verdict(end_time, tolerance, transitions=None):
        run = trajectory(found()[:3] if transitions is None else transitions, status, end_time=end_time)
        return score(run, truth, tolerance=tolerance).verdict.word

    beyond = "not judged" if status == "timeout" else "solver defect"
    for end_time, tolerance in ((math.nextafter(2.7, 0), 1e-12), (2.7, 1e-12), (2.7 - 1e-6, 1e-6)):
        assert verdict(end_time, tolerance) == "right"
        assert verdict(end_time, tolerance, found()[:2]) == "solver defect"
    assert verdict(2.7 - 1e-6, 1e-9) == beyond
    extra = (*found()[:3], replace(found()[3], time=2.7 - 1e-13))
    assert verdict(2.7 - 1e-13, 1e-12, extra) == "right"


@pytest.mark.parametrize(("roundings", "status", "word"), [(1, "ok", "not judged"), (16, "wrong", "ill-conditioned")])
def test_a_run_that_takes_no_step_is_not_right_where_doubles_do_not_resolve_its_times(roundings, status, word):
    start, until = 1e17, 1e17 + 16 * roundings
    truth = expected(tuple(start + time for time in TIMES), start=start, until=until, end_time=until)
    stands = score(trajectory((), end_time=start), truth, tolerance=1e-6)
    assert (stands.status, stands.verdict.word) == (status, word)
    runs = score(trajectory(found(tuple(start + time for time in TIMES))), truth, tolerance=1e-6)
    assert runs.verdict.word == "right"


def test_the_nearest_transition_of_a_surface_is_found():
    events = tuple(replace(e, surface=i % 2) for i, e in enumerate(reference()))
    truth = expected(transitions=events)
    for surface in (0, 1):
        own = [i for i, e in enumerate(events) if e.surface == surface]
        for time in (-1.0, 0.5, 1.0, 2.4, 2.9, 3.9, 9.0):
            assert truth.nearest(surface, time) == min(own, key=lambda i: abs(events[i].time - time))
    assert truth.nearest(2, 1.0) is None


@pytest.mark.parametrize("status", ["ok", "failed", "timeout", "diverged"])
def test_where_nothing_is_known_after_the_start_no_run_is_judged(status):
    truth = expected((), end_time=0.0, partial=True)
    for run in (trajectory((), status, end_time=0.0), trajectory(found(), status)):
        result = score(run, truth, tolerance=1e-6)
        assert (result.status, result.verdict.word) == (status, "not judged")
        assert result.verdict.basis == "nothing is known of the exact run after its start"


def test_a_transition_beside_the_horizon_is_left_to_the_tolerance():
    truth = expected(TIMES[:4])
    extra = replace(found()[4], time=5.0 - 1e-7)
    run = trajectory((*found()[:4], extra))
    assert score(run, truth, tolerance=1e-6).verdict.word == "right"
    assert score(run, truth, tolerance=1e-9).status == "wrong"
