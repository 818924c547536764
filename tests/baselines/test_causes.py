"""Causes of failures: every claim holds for the library that is installed, and explains what it should."""

from __future__ import annotations

import dataclasses
import importlib.util
from dataclasses import replace
from itertools import pairwise

import pytest

from henon_ref.baselines.causes import CAUSES, Cause, ClaimError
from henon_ref.baselines.programs.cvode_c import compiler
from henon_ref.harness.campaign.causes import PATTERNS, cause_of
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.registry import program_versions
from henon_ref.harness.report.manifest import provenance
from henon_ref.harness.rows import RunRow, TransitionRow
from henon_ref.harness.studies import causes as page
from henon_ref.harness.studies.study import Asked

MODULES = {"heyoka": "heyoka"} | dict.fromkeys(("cvode", "ida", "sundials", "sundae"), "sksundae")
MODULES |= {"diffrax": "diffrax", "diffsol": "pydiffsol", "nosnoc": "nosnoc"}
"""First word of a cause's name -> what it is shown by, where that is not SciPy."""


SLOW = {name for name in CAUSES if name.startswith(("diffrax", "nosnoc"))} - {"diffrax-pair", "nosnoc-infeasible"}
"""Each compiles for half a minute, or solves hundreds of problems, in a process of its own; daily: one a library."""


@pytest.mark.parametrize(
    "cause",
    [pytest.param(cause, id=name, marks=[pytest.mark.slow] if name in SLOW else []) for name, cause in CAUSES.items()],
)
def test_the_library_alone_does_what_is_claimed(cause: Cause) -> None:
    if cause.package in (programs := program_versions()):
        if not programs[cause.package] or (cause.package == "sundials" and not compiler()):
            pytest.skip(f"{cause.package} is not installed")
    # Not imported here: processes that fork must not have jax's threads.
    elif importlib.util.find_spec(MODULES.get(cause.name.split("-")[0], "scipy")) is None:
        pytest.skip(f"{cause.package} is not installed")
    assert cause.check()


def test_every_pattern_names_a_cause() -> None:
    assert {pattern.cause for pattern in PATTERNS} <= set(CAUSES)


def run_row(**values: object) -> RunRow:
    names = {"case": "made_up", "reading": "default", "solver": "scipy-rk45", "rtol": 1e-6, "atol": 1e-6}
    return RunRow(**names | {"status": "wrong", "verdict": "solver defect", "missed": 2, "spurious": 0} | values)


def missed(source: str, target: str, **values: object) -> TransitionRow:
    own = {"from_mode": source, "to_mode": target, "surface": "h", "kind": "crossing", "outcome": "missed"}
    return TransitionRow("made_up", "default", "", None, None, 0, **own | {"graze_distance": 1e-4} | values)


PAIR = [missed("-", "+"), missed("+", "-")]


def test_a_missed_pair_is_explained_by_signs_at_the_ends_of_a_step() -> None:
    assert cause_of(run_row(), PAIR) == "scipy-pair"
    assert cause_of(run_row(solver="cvode-bdf"), PAIR) == "cvode-pair"
    assert cause_of(run_row(solver="ida@offset"), PAIR) == "ida-pair"


def test_pairs_of_two_surfaces_may_lie_in_one_step() -> None:
    """Both surfaces are crossed, and then both crossed back."""
    modes = ("--", "+-", "++", "-+", "--")
    four = [missed(*own, surface=surface) for *own, surface in zip(modes, modes[1:], "huhu", strict=False)]
    assert cause_of(run_row(solver="diffsol-bdf", missed=4), four) == "diffsol-pair"
    odd = [replace(row, surface=surface) for row, surface in zip(four, "huuu", strict=True)]
    assert cause_of(run_row(solver="diffsol-bdf", missed=4), odd) is None


def test_what_follows_a_missed_pair_or_a_missed_impact_follows_from_it() -> None:
    run = run_row(status_reason="3 missed, 1 spurious, first missed", missed=3, spurious=1, end_time_s=8.0, steps=40.0)
    before = missed("+", "0", outcome="matched", reference_time_s=1.0)
    pair = [missed("0", "+", reference_time_s=1.5), missed("+", "0", reference_time_s=1.51)]
    after = [missed("0", "-", outcome="spurious"), missed("0", "-", reference_time_s=4.0)]
    assert cause_of(run, [before, *pair, *after]) == "scipy-pair"
    impact = missed("+", "+", kind="reset", reference_time_s=1.5)
    assert cause_of(replace(run, solver="octave-ode45"), [impact, *after]) == "octave-pair"
    # Another thing is wrong first; the mode does not come back; a restart is near; the run broke off.
    assert cause_of(run, [after[0], *pair]) is None
    assert cause_of(run, [before, pair[0], *after]) is None
    assert cause_of(run, [replace(before, reference_time_s=1.4), *pair, *after]) is None
    assert cause_of(replace(run, status="failed"), [before, *pair, *after]) is None


def test_nothing_is_explained_that_is_not_certain() -> None:
    assert cause_of(run_row(), PAIR[:1]) is None
    assert cause_of(run_row(spurious=1), PAIR) is None
    assert cause_of(run_row(verdict="ill-conditioned"), PAIR) is None
    assert cause_of(run_row(solver="heyoka"), PAIR) is None


def test_a_run_that_was_too_slow_is_explained_by_the_order_of_its_method() -> None:
    slow = run_row(
        solver="scipy-radau", status="timeout", verdict="not judged", missed=0, rtol=1e-12, steps=30000, matched=4
    )
    assert cause_of(slow, []) == "scipy-radau-order"


def test_heyoka_loses_a_pair_only_where_rounding_makes_it_one_root() -> None:
    shallow = [missed("-", "+", graze_distance=1e-17), missed("+", "-", graze_distance=1e-17)]
    assert cause_of(run_row(solver="heyoka"), shallow) == "heyoka-double-root"


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


def test_two_roots_around_another_surface_s_event_cancel_in_one_step() -> None:
    run = {"status": "failed", "status_reason": "a root of h was stepped over: it is -2.5e-19 at t = 1"}
    run |= {"missed": 3, "end_time_s": 1.0, "steps": 4.0}
    pair = [
        missed("++", "-+", reference_time_s=1 - 5e-10, graze_distance=2.5e-19),
        missed("-+", "--", surface="u", reference_time_s=1.0),
        missed("--", "+-", reference_time_s=1 + 5e-10, graze_distance=2.5e-19),
    ]
    assert cause_of(run_row(solver="scipy-dop853", **run), pair) == "scipy-pair"
    assert cause_of(run_row(solver="heyoka", **run), pair) == "heyoka-double-root"
    deep = [replace(row, graze_distance=1e-3) for row in pair]
    assert cause_of(run_row(solver="heyoka", **run), deep) is None
    far = [pair[0], pair[1], replace(pair[2], reference_time_s=9.0)]
    assert cause_of(run_row(solver="scipy-dop853", **run), far) is None


def test_programs_in_other_languages_have_causes_of_their_own() -> None:
    assert cause_of(run_row(solver="cvode-c-adams"), PAIR) == "cvode-c-pair"
    assert cause_of(run_row(solver="octave-ode45"), PAIR) == "octave-pair"
    assert cause_of(run_row(solver="siconos"), PAIR) == "siconos-step"
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


def test_a_time_is_off_by_the_location_where_the_errors_of_all_steps_cannot_move_it_so_far() -> None:
    """500 steps of 1e-9 move a transition of conditioning 20 by 1e-5 at most."""
    wrong = run_row(solver="octave-ode45", missed=0, spurious=2, rtol=1e-9, atol=1e-9, steps=500)
    off = missed("+", "-", outcome="matched", time_error_s=1.1e-5, conditioning=20.0, reference_time_s=3.0)
    assert cause_of(wrong, [off]) == "octave-line"
    assert cause_of(wrong, [replace(off, time_error_s=0.9e-5)]) is None
    assert cause_of(replace(wrong, steps=600), [off]) is None
    assert cause_of(replace(wrong, steps=None), [off]) is None
    held = replace(off, conditioning=0.0)  # nothing before it moves it
    assert cause_of(wrong, [replace(held, time_error_s=-1e-12)]) == "octave-line"
    assert cause_of(wrong, [replace(held, time_error_s=1e-15)]) is None


def test_ode45_takes_a_state_without_a_value_and_excuses_events_of_a_first_step() -> None:
    lost = {"status": "failed", "status_reason": "the state is not finite after t = 0.9", "missed": 0}
    assert cause_of(run_row(solver="octave-ode45", **lost), []) == "octave-nan-state"
    assert cause_of(run_row(solver="octave-ode45", **lost | {"spurious": 1}), []) is None
    row = run_row(solver="octave-ode45", missed=1, end_time_s=2.0)
    early, found = missed("0", "+", reference_time_s=1e-9), missed("+", "0", outcome="matched", reference_time_s=1.0)
    assert cause_of(row, [early]) == "octave-first-step"
    assert cause_of(row, [replace(early, reference_time_s=1e-8)]) is None
    assert cause_of(row, [found, replace(early, reference_time_s=1.0 + 1e-9)]) == "octave-first-step"
    assert cause_of(row, [found, replace(early, reference_time_s=1.1)]) is None


def test_a_root_that_no_second_one_follows_is_lost_with_one_that_a_slide_does_not_meet() -> None:
    past = {"status_reason": "went on past t = 1, where the exact run is nonunique", "missed": 1}
    lone = run_row(solver="cvode-c-adams", found_transitions=0, **past)
    assert cause_of(lone, [missed("+", "0", kind="stick")]) == "cvode-c-pair"
    assert cause_of(lone, [missed("+", "-")]) is None
    assert cause_of(replace(lone, found_transitions=1), [missed("+", "0", kind="stick")]) is None


def test_a_spurious_pair_on_the_surface_is_the_error_of_the_run() -> None:
    extra = [missed("+", "-", outcome="spurious"), missed("-", "+", outcome="spurious")]
    wrong = run_row(solver="cvode-c-bdf", missed=0, spurious=2, max_surface_drift=1e-20)
    assert cause_of(wrong, extra) == "cvode-c-error"
    assert cause_of(wrong, extra[:1]) is None
    assert cause_of(replace(wrong, max_surface_drift=1e-3), extra) is None
    assert cause_of(replace(wrong, missed=1), extra) is None


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


def test_a_motion_that_steps_damp_runs_away_from_the_exact_one() -> None:
    row = run_row(solver="siconos", missed=0, spurious=1, step_s=1e-3, rtol=None, expected_status="ok")
    there = [missed("+", "-", outcome="matched", time_error_s=error) for error in (-1e-3, -2e-2, -1e-1)]
    more = missed("-", "+", outcome="spurious", time_s=5.0)
    assert cause_of(row, [*there, more]) == "siconos-damping"
    assert cause_of(row, [*there[1:], more]) is None
    assert cause_of(replace(row, missed=1), [*there, more]) is None


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


def test_time_stepping_misses_all_that_lies_within_a_step() -> None:
    row = run_row(solver="siconos", missed=3, step_s=1e-3, rtol=None, expected_status="ok", end_time_s=1.0)
    modes = ("-", "+", "-", "0")
    within = [missed(*own, reference_time_s=k * 1e-4) for k, own in enumerate(pairwise(modes))]
    assert cause_of(row, within) == "siconos-step"
    assert cause_of(row, [*within[:2], replace(within[2], reference_time_s=2e-3)]) is None
    assert cause_of(replace(row, spurious=1), within) is None


def test_time_stepping_finds_before_the_horizon_what_is_a_step_behind_it() -> None:
    row = run_row(solver="siconos", missed=0, spurious=1, step_s=1e-3, rtol=None, expected_status="ok", end_time_s=1.0)
    assert cause_of(row, [missed("+", "-", outcome="spurious", time_s=0.998)]) == "siconos-step"
    assert cause_of(row, [missed("+", "-", outcome="spurious", time_s=0.99)]) is None
    assert cause_of(replace(row, missed=1), [missed("+", "-", outcome="spurious", time_s=0.998)]) is None


def test_bisection_without_a_sign_change_is_a_zero_at_the_start() -> None:
    said = {"status": "failed", "status_reason": "diffrax: The root is not contained in [lower, upper]", "missed": 3}
    assert cause_of(run_row(solver="diffrax-dopri8@none", **said), []) == "diffrax-start"
    assert cause_of(run_row(solver="diffrax-dopri8", **said), []) is None


def test_what_peers_do_is_explained_by_peers() -> None:
    for solver in ("diffrax-dopri8", "diffrax-kvaerno5@none", "diffsol-bdf", "nosnoc"):
        assert cause_of(run_row(solver=solver), PAIR) == {"diffrax": "diffrax-pair", "diffsol": "diffsol-pair"}.get(
            solver.split("-")[0], "nosnoc-grid"
        )
    lost = {"status": "failed", "status_reason": "the state is not finite after t = 0.9; 1 missed", "missed": 1}
    assert cause_of(run_row(solver="diffsol-tsit45", **lost), []) == "diffsol-nan"
    assert cause_of(run_row(solver="diffsol-bdf", **lost), []) is None
    ended = {"status": "failed", "status_reason": "IPOPT finds no step from t = 3", "missed": 1}
    assert cause_of(run_row(solver="nosnoc", **ended), []) == "nosnoc-infeasible"
    assert cause_of(run_row(solver="nosnoc", **ended | {"spurious": 1}), []) is None
    slow = run_row(solver="nosnoc", status="timeout", verdict="not judged", missed=0)
    assert cause_of(slow, []) == "nosnoc-cost"
    assert cause_of(replace(slow, missed=None, spurious=None), []) == "nosnoc-cost"  # stopped from outside


def test_switches_at_one_node_are_those_of_two_surfaces_where_one_is_missed() -> None:
    row = run_row(solver="nosnoc", missed=2, spurious=2, rtol=1e-9)
    first, second = (missed("-", "0", reference_time_s=time) for time in (1.0, 1.0 + 1e-9))
    both = [missed("-", "0", outcome="spurious", time_s=1.0 + 1e-10, surface=surface) for surface in "hu"]
    assert cause_of(row, [first, *both, second]) == "nosnoc-node"
    assert cause_of(row, [first, both[0], replace(both[1], time_s=1.1), second]) is None
    assert cause_of(row, [first, both[0], both[0], second]) is None
    assert cause_of(row, [replace(first, reference_time_s=0.9), *both, second]) is None
    assert cause_of(replace(row, solver="cvode-c-bdf"), [first, *both, second]) is None


def test_the_page_says_so_where_a_claim_does_not_hold(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    def fails() -> str:
        raise ClaimError("it found both")

    broken = dataclasses.replace(CAUSES["scipy-pair"], check=fails)
    monkeypatch.setattr(page, "CAUSES", {"scipy-pair": broken})
    text = page.run_causes(Asked([], Options(), provenance("x"), tmp_path)).page.read_text(encoding="utf-8")
    assert "**not as claimed with this version**: it found both." in text
    assert '<a id="scipy-pair"></a>' in text


def test_what_smoothing_cannot_tell_apart_is_within_its_band() -> None:
    """Two blocks at 1e-6 cross and stick at once, the smoothed ones stick; the band is 2e-3 there."""
    wrong = run_row(solver="scipy-smoothed", missed=2, spurious=1, steps=100)
    shallow = [missed("-", "+", graze_distance=0.02), missed("+", "0", kind="stick", graze_distance=5e-4)]
    one = missed("-", "0", outcome="spurious", kind="stick", graze_distance=None)
    right = missed("0", "-", outcome="matched", kind="release", graze_distance=0.2)
    assert cause_of(wrong, [one, *shallow, right]) == "smoothed-creep"
    assert cause_of(replace(wrong, solver="scipy-sign"), [one, *shallow, right]) is None  # 4e-4
    assert cause_of(replace(wrong, solver="scipy-sign", atol=2e-6), [one, *shallow, right]) == "sign-hops"
    deep = [replace(row, graze_distance=0.02) for row in shallow]
    assert cause_of(wrong, [one, *deep, right]) is None
    # The guard of a release is not the surface function: its distance has another unit.
    let_go = missed("0", "-", kind="release", graze_distance=1e-4, conditioning=2.0, transversality=1e-3)
    assert cause_of(wrong, [let_go]) is None


def test_an_error_as_large_as_the_band_moves_transitions_past_each_other() -> None:
    wrong = run_row(solver="scipy-smoothed", missed=2, spurious=1, steps=100)
    row = missed("-", "+", graze_distance=0.02, conditioning=20.0, transversality=1.0)
    assert cause_of(wrong, [row]) == "smoothed-creep"
    assert cause_of(wrong, [replace(row, conditioning=5.0)]) is None
    # Off before by more than 100 steps of 1e-6 make of it; a release is late anyway.
    far = missed("-", "+", graze_distance=0.2)
    before = missed("+", "-", outcome="matched", kind="stick", graze_distance=0.2, conditioning=3.0,
                    reference_time_s=1.0, time_error_s=1e-3)  # fmt: skip
    assert cause_of(wrong, [before, far]) == "smoothed-creep"
    assert cause_of(wrong, [replace(before, time_error_s=1e-4), far]) is None
    assert cause_of(wrong, [replace(before, kind="release"), far]) is None


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


def test_a_stick_within_an_element_is_lost_between_its_ends() -> None:
    run = run_row(
        solver="nosnoc", status_reason="12 missed, 4 spurious", missed=12, spurious=4, steps=400, end_time_s=12.0
    )
    before = missed("0", "+", kind="release", outcome="matched", reference_time_s=4.93)
    short = [
        missed("+", "0", kind="stick", reference_time_s=5.1817),
        missed("0", "+", kind="release", reference_time_s=5.1839),
    ]
    later = missed("0", "+", kind="release", outcome="spurious", time_s=6.49)
    assert cause_of(run, [before, *short, later]) == "nosnoc-grid"
    assert cause_of(run, [before, short[0], later]) is None


def test_late_releases_come_behind_what_they_come_before() -> None:
    """Eight blocks at 1e-6: every surface has its transitions, those of others come first."""
    wrong = run_row(solver="scipy-smoothed", missed=2, spurious=2)
    far = {"graze_distance": 1.0}
    exact = [
        missed("0-", "--", kind="release", surface="a", reference_time_s=3.06, **far),
        missed("--", "-+", surface="b", reference_time_s=3.092, **far),
    ]
    found = [
        missed("0-", "0+", outcome="spurious", surface="b", time_s=3.0919, **far),
        missed("0+", "-+", outcome="spurious", kind="release", surface="a", time_s=3.14, **far),
    ]
    assert cause_of(wrong, [*exact, *found]) == "smoothed-late"
    early = replace(found[1], time_s=3.05)
    assert cause_of(wrong, [*exact, found[0], early]) is None
    assert cause_of(wrong, [*exact, found[1]]) is None
    assert cause_of(wrong, [*exact, replace(found[0], time_s=3.3), found[1]]) is None
    assert cause_of(replace(wrong, solver="scipy-sign"), [*exact, *found]) is None
