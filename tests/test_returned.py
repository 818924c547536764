"""What a solver hands back: plain numbers pass as they are, NumPy's are made plain, anything else is refused."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from fakes import case, found, trajectory

from baselines.record import Transitions
from henon_ref.score.returned import check_prepared, check_returned
from henon_ref.score.worker import failure_of
from henon_ref.solver import ContractError
from henon_ref.trajectory import Counts, Trajectory

SYSTEM = case().readings[0].problem.system
EVENT = found()[1]


def test_what_is_plain_stays_the_same_and_a_view_stays_a_view():
    given = trajectory(found())
    assert check_returned(given, SYSTEM) == given
    event = ("stick", 0, (1,), (0,), 0.5, (0.25,), 0.0)
    view = Transitions([event] * 3, "theirs")
    assert check_returned(trajectory(view), SYSTEM).transitions is view


def test_numbers_of_numpy_are_made_plain():
    event = replace(
        EVENT,
        surface=np.int32(0),
        from_mode=np.array([0]),
        to_mode=[np.int8(-1)],
        time=np.float32(1.25),
        time_low=0,
        state=np.array([0.25]),
    )
    given = Trajectory("ok", [event], np.float64(5), np.zeros(1), np.array([1]), "", Counts(np.int64(3)), np.float32(0))
    plain = check_returned(given, SYSTEM)
    assert plain == Trajectory("ok", (EVENT,), 5.0, (0.0,), (1,), counts=Counts(3))
    first = plain.transitions[0]
    json.dumps([first.surface, first.from_mode, first.to_mode, first.time, first.time_low, first.state, plain.counts])


def test_samples_that_nobody_asked_for_are_left_out():
    given = trajectory(found(), samples=np.zeros((2, 1)), sample_modes=((1,), (1,)))
    assert check_returned(given, SYSTEM) == trajectory(found())


def test_a_state_that_is_not_finite_is_a_run_s_own_affair():
    assert np.isnan(check_returned(trajectory((), "diverged", end_state=(np.nan,)), SYSTEM).end_state[0])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"status": "wrong"}, "status is 'wrong' (str), wanted one of ok, "),
        ({"status": "done"}, "status is 'done' (str), wanted one of ok, "),
        ({"transitions": None}, "transitions is None (NoneType), wanted a sequence of Transition"),
        ({"end_time": None}, "end_time is None (NoneType), wanted a number"),
        ({"end_time": np.nan}, "end_time is nan (float), wanted a finite number"),
        ({"end_state": (1.0, 2.0)}, "end_state is (1.0, 2.0) (tuple), wanted 1 numbers"),
        ({"end_mode": ()}, "end_mode is () (tuple), wanted 1 entries, each -1, 0 or +1"),
        ({"reason": None}, "reason is None (NoneType), wanted a str"),
        ({"counts": None}, "counts is None (NoneType), wanted a Counts"),
        ({"counts": Counts(1.5)}, "counts.steps is 1.5 (float), wanted a whole number"),
        ({"max_surface_drift": "small"}, "max_surface_drift is 'small' (str), wanted a number"),
    ],
)
def test_a_trajectory_that_cannot_be_scored_is_refused_by_what_is_wrong_with_it(changes, words):
    with pytest.raises(ContractError) as refused:
        check_returned(trajectory(found())._replace(**changes), SYSTEM)
    assert str(refused.value).startswith(f"the solver returned a Trajectory whose {words}")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"kind": "slip"}, "kind is 'slip' (str), wanted one of stick, release, crossing, graze"),
        ({"surface": 1}, "surface is 1 (int), wanted the index of one of 1 surfaces"),
        ({"surface": -1}, "surface is -1 (int), wanted the index of one of 1 surfaces"),
        ({"surface": True}, "surface is True (bool), wanted a whole number"),
        ({"from_mode": (1, 0)}, "from_mode is (1, 0) (tuple), wanted 1 entries"),
        ({"to_mode": (2,)}, "to_mode is (2,) (tuple), wanted 1 entries, each -1, 0 or +1"),
        ({"to_mode": (0.5,)}, "to_mode is 0.5 (float), wanted a whole number"),
        ({"to_mode": 1}, "to_mode is 1 (int), wanted 1 entries"),
        ({"time": "2"}, "time is '2' (str), wanted a number"),
        ({"time": np.nan}, "time is nan (float), wanted a finite number"),
        ({"time_low": None}, "time_low is None (NoneType), wanted a number"),
        ({"state": ()}, "state is () (tuple), wanted 1 numbers"),
        ({"state": 0.25}, "state is 0.25 (float), wanted 1 numbers"),
        ({"state": (None,)}, "state is None (NoneType), wanted a number"),
        ({"landing": None}, "landing is None (NoneType), wanted a str"),
    ],
)
def test_a_transition_that_cannot_be_scored_is_refused_by_its_place(changes, words):
    events = (*found()[:2], replace(EVENT, **changes))
    with pytest.raises(ContractError) as refused:
        check_returned(trajectory(events), SYSTEM)
    assert str(refused.value).startswith(f"the solver returned a Trajectory whose transitions[2].{words}")


def test_what_is_no_transition_is_refused():
    with pytest.raises(ContractError, match=r"transitions\[0\] is 0.5 \(float\), wanted a Transition"):
        check_returned(trajectory((0.5,)), SYSTEM)


def test_words_of_a_solver_that_are_none_are_refused():
    check_prepared(print, landing="theirs", version="")
    with pytest.raises(ContractError, match=r"landing is None \(NoneType\), wanted a str"):
        check_prepared(print, landing=None, version="")
    with pytest.raises(ContractError, match=r"version is 1.0 \(float\), wanted a str"):
        check_prepared(print, landing="theirs", version=1.0)


def test_the_reason_of_a_row_is_the_message_alone():
    assert failure_of(ContractError("the solver returned 42")).reason == "the solver returned 42"
