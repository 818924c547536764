"""Timing: number of samples, and the statistics. No test asserts a time."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from fakes import case, found, trajectory

from henon_ref.errors import ContractError
from henon_ref.harness.campaign.jobs import run_once
from henon_ref.harness.campaign.timing import SAMPLES, median_interval, repeat, summarise, timed, turn_times
from henon_ref.workers.worker import WorkerState


class Counting:
    def __init__(self) -> None:
        self.calls = 0

    def __call__(self) -> None:
        self.calls += 1


def test_a_slow_run_is_not_repeated():
    run = Counting()
    for first in (9.0, 0.31):  # a second sample alone would tell no more than the first
        assert repeat(run, first=first, repeats=None, budget=0.3) == (first,)
    assert run.calls == 0
    assert len(repeat(run, first=0.29, repeats=None, budget=0.3)) >= 3
    run.calls = 0
    assert 9.0 not in repeat(run, first=9.0, repeats=None, budget=0.0, cold=True)
    assert run.calls == 1
    assert len(repeat(run, first=9.0, repeats=None, budget=10.0, cold=True)) == SAMPLES  # what it loaded took so long


def test_a_quick_run_is_repeated_up_to_the_limit_and_its_warm_up_left_out():
    samples = repeat(Counting(), first=123.0 / 1e3, repeats=None, budget=1e3)
    assert len(samples) == SAMPLES
    assert 0.123 not in samples


def test_the_garbage_collector_is_as_it_was():
    assert gc.isenabled()
    timed(lambda: None)
    assert gc.isenabled()
    gc.disable()
    try:
        timed(lambda: None)
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_the_interval_covers_the_median_as_often_as_it_says():
    rng = np.random.default_rng(1)
    hits = 0
    for _ in range(200):
        low, high = median_interval(rng.lognormal(size=40))
        hits += low <= 1.0 <= high
    assert 180 <= hits <= 199


def test_the_same_samples_give_the_same_interval():
    samples = np.random.default_rng(2).exponential(size=20)
    assert median_interval(samples) == median_interval(samples)


def test_summary_of_few_samples_claims_no_spread():
    assert summarise([]) == {}
    assert summarise([1.0, 3.0]) == {"wall_s": 2.0, "timed_runs": 2}
    five = summarise([1.0, 2.0, 3.0, 4.0, 5.0])
    assert (five["wall_s"], five["wall_s_iqr"], five["timed_runs"]) == (3.0, pytest.approx(2.0), 5)
    assert five["wall_s_low"] <= 3.0 <= five["wall_s_high"]


class SelfTimed(Counting):
    """A run whose own clock says 0.25 s."""

    wall_s = 0.25

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[int] = []

    def times(self, count: int) -> tuple[float, ...]:
        self.asked.append(count)
        return (self.wall_s,) * count


def test_a_run_with_a_clock_of_its_own_is_timed_by_that_in_one_go():
    run = SelfTimed()
    assert timed(run) == 0.25
    assert repeat(run, first=0.25, repeats=4, budget=1e-9) == (0.25,) * 4
    assert repeat(run, first=0.25, repeats=None, budget=1.3) == (0.25,) * 5
    assert repeat(run, first=0.25, repeats=None, budget=0.4) == (0.25,) * 3
    assert repeat(run, first=0.25, repeats=None, budget=0.1) == (0.25,)
    assert repeat(run, first=1e-9, repeats=None, budget=1.0) == (0.25,) * SAMPLES
    assert repeat(run, first=9.0, repeats=None, budget=0.3) == (9.0,)
    assert run.asked == [1, 4, 5, 3, SAMPLES]
    assert run.calls == 0


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (None, r"times\(3\) is None \(NoneType\), wanted 3 positive numbers"),
        ((0.25,) * 4, r"wanted 3 positive numbers"),
        ((0.25, 0.25, "0.25"), r"times\(3\) is '0.25' \(str\), wanted a positive number"),
        ((0.25, np.nan, 0.25), r"nan \(float\), wanted a positive number"),
        ((0.25, 0.25, -0.25), r"-0.25 \(float\), wanted a positive number"),
        ((0.25, 0.25, np.inf), r"inf \(float\), wanted a positive number"),
        (np.full((3, 2), 0.25), r"\(ndarray\), wanted a positive number"),
    ],
)
def test_times_of_a_clock_of_its_own_that_are_none_are_refused(monkeypatch, times, words):
    run = SelfTimed()
    monkeypatch.setattr(run, "times", lambda count: times)
    with pytest.raises(ContractError, match=words):
        repeat(run, first=0.25, repeats=3, budget=1.0)
    monkeypatch.setattr(run, "times", lambda count: np.full(count, 0.25))
    samples = repeat(run, first=0.25, repeats=3, budget=1.0)
    assert samples == (0.25,) * 3
    assert {type(sample) for sample in samples} == {float}


@pytest.mark.parametrize("wall", [None, "0.25", -0.25, 0.0, np.inf])
def test_a_first_time_of_a_clock_of_its_own_that_is_none_is_refused(monkeypatch, wall):
    class Run(SelfTimed):
        wall_s = np.nan

        def __call__(self):
            return trajectory(found())

    state = WorkerState(lambda kind, value: None)
    state.kept["run"] = Run(), case().readings[0].problem
    assert run_once(state, 100)[1] > 0  # NaN: unknown
    monkeypatch.setattr(Run, "wall_s", wall)
    with pytest.raises(ContractError, match=r"the run's wall_s is .*, wanted a positive number"):
        run_once(state, 100)


def test_a_turn_of_such_a_run_is_one_more_exchange_at_most():
    run = SelfTimed()
    assert turn_times(run, 1.0) == [0.25] * 4
    assert turn_times(run, 0.1) == [0.25]
    assert turn_times(run, 100.0) == [0.25] * 20
    assert run.asked == [1, 4, 1, 1, 20]
    slow = Counting()
    assert len(turn_times(slow, 0.0)) == slow.calls == 1
