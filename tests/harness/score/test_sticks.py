"""Sticks: only complete ones, within the measured window, compared with printed durations."""

from __future__ import annotations

import pytest
from fakes import reference

from henon_ref.harness.score.scoring import published_partners
from henon_ref.trajectory import sticks


def test_a_stick_lasts_from_its_start_to_its_release():
    (stick,) = sticks(reference((0.5, 1.25, 2.0)), start=0.0, after=0.0)
    assert (stick.begin, stick.end, stick.start, stick.duration) == (0, 1, 0.5, 0.75)


def test_a_stick_that_ends_before_the_window_is_left_out_and_one_that_ends_in_it_counts():
    events = reference((0.5, 1.25, 2.0, 3.5, 4.0))
    assert [s.begin for s in sticks(events, start=0.0, after=1.3)] == [3]
    assert [s.begin for s in sticks(events, start=0.0, after=1.25)] == [0, 3]


def test_a_stick_that_the_horizon_cuts_off_is_left_out():
    assert sticks(reference((0.5, 1.25, 2.0, 3.5)), start=0.0, after=0.0)[-1].end == 1


def test_a_run_that_starts_in_a_stick_has_it_from_its_start():
    (stick,) = sticks(reference((0.5, 1.25))[1:], start=0.25, after=0.0)
    assert (stick.begin, stick.start, stick.duration) == (None, 0.25, 1.0)


def test_durations_keep_digits_that_the_times_alone_do_not_hold():
    from dataclasses import replace

    first, second = reference((1e9, 1e9 + 1))
    (stick,) = sticks([replace(first, time_low=2e-9), replace(second, time_low=-3e-9)], start=0.0, after=0.0)
    assert stick.duration == pytest.approx(1 - 5e-9, abs=1e-16)


def test_published_durations_repeat_from_where_they_fit_best():
    assert published_partners([0.42, 1.17, 0.41, 1.18], [1.1746, 0.4161]) == (0.4161, 1.1746, 0.4161, 1.1746)
    assert published_partners([1.17, None, 1.18], [1.1746, 0.4161]) == (1.1746, None, 1.1746)
    assert published_partners([1.0, 2.0], []) == (None, None)
