"""Causes of runs that end differently from the exact one: by a message, too late, or by a timeout."""

from __future__ import annotations

from dataclasses import replace

import pytest
from wrong_rows import missed, run_row

from henon_ref.harness.campaign.causes import cause_of


def test_a_run_that_was_too_slow_is_explained_by_the_order_of_its_method() -> None:
    slow = run_row(
        solver="scipy-radau", status="timeout", verdict="not judged", missed=0, rtol=1e-12, steps=30000, matched=4
    )
    assert cause_of(slow, []) == "scipy-radau-order"


def test_lsoda_alone_goes_on_with_what_is_no_number() -> None:
    lost = {"status": "failed", "status_reason": "the state is not finite after t = 0.9; 1 missed", "missed": 1}
    assert cause_of(run_row(solver="scipy-lsoda", **lost), []) == "scipy-lsoda-nan"
    assert cause_of(run_row(solver="scipy-smoothed", **lost), []) == "scipy-lsoda-nan"
    assert cause_of(run_row(solver="scipy-dop853", **lost), []) is None
    assert cause_of(run_row(solver="scipy-lsoda", **lost | {"spurious": 1}), []) is None


def test_a_polynomial_goes_past_the_end_of_what_it_stands_for() -> None:
    past = {
        "expected_status": "failed",
        "status_reason": "went on past t = 2, where the exact run is failed",
        "missed": 0,
    }
    assert cause_of(run_row(solver="heyoka", **past), []) == "heyoka-past-end"
    assert cause_of(run_row(solver="scipy-rk45", **past), []) is None
    assert cause_of(run_row(solver="heyoka", **past | {"missed": 1}), []) is None
    assert cause_of(run_row(solver="heyoka", **past | {"expected_status": "diverged"}), []) is None


def test_heyoka_may_be_past_the_end_of_a_field_before_it_stops() -> None:
    past = {"expected_status": "failed", "status": "failed", "missed": 0}
    later = past | {"status_reason": "heyoka: the state is not finite; failed at t = 3.44, not at 2.567"}
    assert cause_of(run_row(solver="heyoka", **later), []) == "heyoka-past-end"
    earlier = past | {"status_reason": "heyoka: the state is not finite; failed at t = 2.44, not at 2.567"}
    assert cause_of(run_row(solver="heyoka", **earlier), []) is None


def test_programs_in_other_languages_have_causes_of_their_own() -> None:
    ended = {"status": "failed", "missed": 0, "matched": 1, "expected_status": "failed"}
    late = ended | {"status_reason": "CVode: CV_REPTD_RHSFUNC_ERR at t = 2.05; failed at t = 2.05, not at 2"}
    assert cause_of(run_row(solver="cvode-c-bdf", **late), []) == "cvode-c-late-end"
    assert cause_of(run_row(solver="cvode-c-bdf", **late | {"missed": 1}), []) is None
    pole = ended | {"expected_status": "diverged", "status_reason": "ode45 ended at t = 0.999"}
    assert cause_of(run_row(solver="octave-ode45", **pole), []) == "octave-blow-up"
    root = missed("+", "-", reference_time_s=0.9990001)
    behind = run_row(solver="octave-ode45", **pole | {"expected_status": "ok", "end_time_s": 0.999, "missed": 1})
    assert cause_of(behind, [root]) == "octave-blow-up"  # a pole behind the surface
    assert cause_of(behind, [replace(root, reference_time_s=1.01)]) is None
    past = ended | {"status": "wrong", "status_reason": "went on past t = 1, where the exact run is failed"}
    assert cause_of(run_row(solver="octave-ode45", **past), []) == "octave-nan"


def test_diffsol_ends_in_words_where_the_exact_run_ends_or_in_front_of_a_pole() -> None:
    small = {
        "status": "failed",
        "status_reason": "diffsol: ODE solver error: Step size is too small at time = 0.9999999",
    }
    for status in ("diverged", "failed", "invalid"):
        assert cause_of(run_row(solver="diffsol-bdf", missed=0, expected_status=status, **small), []) == (
            "diffsol-small-step"
        )
    assert cause_of(run_row(solver="diffsol-bdf", missed=0, expected_status="ok", **small), []) is None
    here, there = (missed("+", "-", reference_time_s=time) for time in (1.0, 2.0))
    row = run_row(solver="diffsol-bdf", missed=1, expected_status="ok", **small)
    assert cause_of(row, [here]) == "diffsol-small-step"
    assert cause_of(row, [there]) is None
    late = {"status": "failed", "missed": 0, "status_reason": "diffsol: Stop time is at the current state time"}
    assert cause_of(run_row(solver="diffsol-tsit45", **late), []) == "diffsol-late"
    past = {"missed": 0, "expected_status": "failed", "status_reason": "went on past t = 1, where the exact run is"}
    assert cause_of(run_row(solver="diffsol-tsit45", **past), []) == "diffsol-stop-nan"


def test_iterations_that_are_used_up_are_those_of_a_flat_root() -> None:
    said = {"status": "failed", "status_reason": "RuntimeError: Failed to converge after 100 iterations."}
    assert cause_of(run_row(solver="scipy-radau", missed=None, **said), []) == "scipy-flat-root"
    assert cause_of(run_row(solver="heyoka", missed=None, **said), []) is None


@pytest.mark.parametrize(
    ("solver", "words", "cause"),
    [
        ("scipy-dop853", "Required step size is less than spacing between numbers.", "scipy-pole"),
        ("diffrax-dopri8", "diffrax does not advance from t = 0.99999999999999944", "diffrax-pole"),
        ("heyoka", "heyoka does not advance from t = 1", None),
    ],
)
def test_steps_that_come_to_a_halt_are_in_front_of_a_pole(solver: str, words: str, cause: str | None) -> None:
    said = {"status": "failed", "status_reason": words, "end_time_s": 1.0 - 1e-15}
    ended = run_row(solver=solver, missed=0, expected_status="invalid", **said)
    assert cause_of(ended, []) == cause
    stopped = run_row(solver=solver, missed=1, expected_status="ok", **said)
    assert cause_of(stopped, [missed("+", "-", reference_time_s=1.0)]) == cause
    assert cause_of(stopped, [missed("+", "-", reference_time_s=1.5)]) is None


def test_time_stepping_goes_on_over_a_blow_up() -> None:
    past = {"status_reason": "went on past t = 1, where the exact run is diverged", "expected_status": "diverged"}
    row = run_row(solver="siconos", missed=0, spurious=1, step_s=1e-3, rtol=None, **past)
    assert cause_of(row, [missed("+", "-", outcome="spurious", time_s=0.995)]) == "siconos-no-solution"
    assert cause_of(row, [missed("+", "-", outcome="spurious", time_s=0.5)]) is None
    assert cause_of(replace(row, missed=1), [missed("+", "-", outcome="spurious", time_s=0.995)]) is None


def test_a_sign_that_is_lost_is_that_of_a_steep_surface() -> None:
    said = {"status": "failed", "status_reason": "the relay's sign is not that of the surface function at t = 1.7"}
    assert cause_of(run_row(solver="siconos", missed=0, **said), []) == "siconos-steep"
    assert cause_of(run_row(solver="octave-ode45", missed=0, **said), []) is None


def test_a_sign_that_rounding_has_turned_is_that_of_a_slide_between_very_different_fields() -> None:
    words = "the relay's sign is not that of the surface function, which the rounding of a step moves as far, at t = 1"
    said = {"status": "failed", "status_reason": words}
    assert cause_of(run_row(solver="siconos", missed=0, **said), []) == "siconos-rounding"


def test_time_stepping_has_no_value_in_the_step_in_which_the_model_ends() -> None:
    said = {
        "status": "failed",
        "missed": 0,
        "spurious": 0,
        "status_reason": "ZeroDivisionError: float division by zero",
    }
    assert cause_of(run_row(solver="siconos", expected_status="invalid", **said), []) == "siconos-step"
    assert cause_of(run_row(solver="siconos", expected_status="ok", **said), []) is None
    assert cause_of(run_row(solver="siconos", expected_status="invalid", **said | {"spurious": 1}), []) is None


def test_bisection_without_a_sign_change_is_a_zero_at_the_start() -> None:
    said = {"status": "failed", "status_reason": "diffrax: The root is not contained in [lower, upper]", "missed": 3}
    assert cause_of(run_row(solver="diffrax-dopri8@none", **said), []) == "diffrax-start"
    assert cause_of(run_row(solver="diffrax-dopri8", **said), []) is None


def test_a_narrow_smoothing_ends_lsoda() -> None:
    said = {"status": "failed", "status_reason": "Unexpected istate in LSODA. lsoda: Repeated convergence failures"}
    assert cause_of(run_row(solver="scipy-smoothed", **said), []) == "smoothed-convergence"
    assert cause_of(run_row(solver="scipy-smoothed", **said | {"spurious": 1}), []) is None
    assert cause_of(run_row(solver="scipy-lsoda", **said), []) is None


def test_events_that_accumulate_within_a_step_are_those_of_the_landing() -> None:
    run = {"status": "failed", "expected_status": "failed", "missed": 0, "spurious": 1, "step_s": 1e-3, "rtol": None}
    run |= {"status_reason": "100 events within one step at t = 3.23; 0 missed, 1 spurious"}
    before = missed("+", "-", outcome="matched", time_s=3.2295)
    extra = missed("-", "+", outcome="spurious", time_s=3.23)
    assert cause_of(run_row(solver="henon-rk4", **run), [before, extra]) == "rk4-landing"
    assert cause_of(run_row(solver="henon-rk4", **run), [replace(before, time_s=3.2), extra]) is None
    assert cause_of(run_row(solver="henon-rk4", **run), [extra]) is None
    assert cause_of(run_row(solver="henon-rk4", **run | {"missed": 1}), [before, extra]) is None
