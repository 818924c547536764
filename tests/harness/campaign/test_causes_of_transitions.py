"""Causes of missed and spurious transitions, and of wrong times."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from wrong_rows import PAIR, missed, run_row

from henon_ref.harness.campaign.causes import cause_of


def test_a_missed_pair_is_explained_by_signs_at_the_ends_of_a_step() -> None:
    assert cause_of(run_row(), PAIR) == "scipy-pair"
    assert cause_of(run_row(solver="cvode-bdf"), PAIR) == "cvode-pair"
    assert cause_of(run_row(solver="ida@offset"), PAIR) == "ida-pair"
    assert cause_of(run_row(solver="cvode-c-adams"), PAIR) == "cvode-c-pair"
    assert cause_of(run_row(solver="octave-ode45"), PAIR) == "octave-pair"
    assert cause_of(run_row(solver="siconos"), PAIR) == "siconos-step"


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


def test_heyoka_loses_a_pair_only_where_rounding_makes_it_one_root() -> None:
    shallow = [missed("-", "+", graze_distance=1e-17), missed("+", "-", graze_distance=1e-17)]
    assert cause_of(run_row(solver="heyoka"), shallow) == "heyoka-double-root"


def test_a_motion_of_heyoka_that_is_wrong_from_the_start_had_too_long_a_step() -> None:
    """Several pairs of a surface are missed, or the first time is off by more than the root of the tolerance."""
    run = run_row(solver="heyoka", missed=4, matched=0, expected_status="ok")
    assert cause_of(run, [*PAIR, *PAIR]) == "heyoka-gap"
    assert cause_of(replace(run, solver="cvode-bdf"), [*PAIR, *PAIR]) == "cvode-pair"
    assert cause_of(run, PAIR) is None
    assert cause_of(run, [*PAIR, *(replace(row, surface="u") for row in PAIR)]) is None
    assert cause_of(replace(run, spurious=1), [*PAIR, *PAIR]) is None
    apart = [*PAIR, missed("+", "-", outcome="matched", conditioning=2.0, time_error_s=0.0), *PAIR[:1], *PAIR]
    assert cause_of(replace(run, matched=1), apart) is None
    first = missed("+", "-", outcome="matched", conditioning=2.0, time_error_s=2.1e-3)
    assert cause_of(replace(run, matched=1), [first, *PAIR[:1]]) == "heyoka-gap"
    assert cause_of(replace(run, matched=1), [replace(first, time_error_s=1.9e-3), *PAIR[:1]]) is None
    assert cause_of(replace(run, matched=1), [missed("+", "-", outcome="matched"), first, *PAIR[:1]]) is None


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


def test_a_motion_that_steps_damp_runs_away_from_the_exact_one() -> None:
    row = run_row(solver="siconos", missed=0, spurious=1, step_s=1e-3, rtol=None, expected_status="ok")
    there = [missed("+", "-", outcome="matched", time_error_s=error) for error in (-1e-3, -2e-2, -1e-1)]
    more = missed("-", "+", outcome="spurious", time_s=5.0)
    assert cause_of(row, [*there, more]) == "siconos-damping"
    assert cause_of(row, [*there[1:], more]) is None
    assert cause_of(replace(row, missed=1), [*there, more]) is None


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
