"""Check of a solver's result: plain numbers are unchanged, NumPy's are converted, anything else is an error."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
from fakes import case, found, trajectory

from henon_ref.baselines.record import Transitions
from henon_ref.errors import ContractError
from henon_ref.harness.campaign.contract_check import check_prepared, check_trajectory
from henon_ref.text import LONGEST_REASON, short_line
from henon_ref.trajectory import Counts, Trajectory, Transition
from henon_ref.workers.worker import failure_of

PROBLEM = case().readings[0].problem
MOST = 1000
EVENT = found()[1]


def check(returned: object) -> Trajectory:
    return check_trajectory(returned, PROBLEM, most=MOST)


def test_what_is_plain_stays_the_same_and_a_view_becomes_a_tuple():
    given = trajectory(found())
    assert check(given) == given
    event = ("stick", 0, (1,), (0,), 0.5, (0.25,), 0.0, "theirs")
    assert check(trajectory(Transitions([event] * 3))).transitions == (Transition(*event),) * 3


class Text(str):
    """A str that is taken out of a pickle by running something."""

    def __reduce__(self):
        return exec, ("raise SystemExit",)

    def __eq__(self, other):
        return True

    def __hash__(self):
        return 0


class Number(float):
    def __reduce__(self):
        return exec, ("raise SystemExit",)


class Changing(list):
    """A sequence that is another one at the second look."""

    def __iter__(self):
        yield from list.copy(self)
        self.append(None)


def test_objects_of_a_solver_s_own_classes_become_plain_ones():
    own = replace(
        EVENT,
        kind=Text("release"),
        time=Number(1.25),
        state=Changing([Number(0.25)]),
        from_mode=Changing([0]),
        landing=Text("fake"),
    )
    given = trajectory(
        Changing([own]), Text("ok"), end_time=Number(5), end_state=Changing([Number(0)]), reason=Text("why")
    )
    plain = check(given)
    assert plain == trajectory((EVENT,), reason="why")
    assert pickle.loads(pickle.dumps(plain)) == plain
    assert {type(value) for value in (plain.status, plain.reason, plain.transitions[0].kind)} == {str}
    assert check_prepared(print, landing=Text("a"), version=Text("1")) == ("a", "1")
    assert {type(word) for word in check_prepared(print, landing=Text("a"), version=Text("1"))} == {str}
    with pytest.raises(ContractError, match="status is 'done'"):
        check(trajectory((), Text("done")))


def test_words_become_one_line_that_files_can_hold():
    assert short_line("no\r\n\tconvergence\x1b\x00 at \udcff\u2028.") == "no convergence at \ufffd ."
    assert short_line("\N{GREEK SMALL LETTER MU} = 0.5") == "\N{GREEK SMALL LETTER MU} = 0.5"
    assert len(short_line("x" * 3_000_000)) == LONGEST_REASON
    assert short_line("x" * 501).endswith("x...")
    given = trajectory((replace(EVENT, landing="a\nb"),), "failed", reason="a\n| b" * 200)
    plain = check(given)
    assert plain.transitions[0].landing == "a b"
    assert (len(plain.reason), plain.reason[:9]) == (LONGEST_REASON, "a | ba | ")


def test_more_transitions_than_can_be_scored_are_refused():
    assert len(check(trajectory((EVENT,) * MOST)).transitions) == MOST
    with pytest.raises(ContractError, match="the solver returned more than 1000 transitions"):
        check(trajectory((EVENT,) * (MOST + 1)))


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
    plain = check(given)
    assert plain == Trajectory("ok", (EVENT,), 5.0, (0.0,), (1,), counts=Counts(3))
    first = plain.transitions[0]
    json.dumps([first.surface, first.from_mode, first.to_mode, first.time, first.time_low, first.state, plain.counts])


def test_samples_that_nobody_asked_for_are_left_out():
    given = trajectory(found(), samples=np.zeros((2, 1)), sample_modes=((1,), (1,)))
    assert check(given) == trajectory(found())


def test_a_state_that_is_not_finite_is_a_run_s_own_affair():
    assert np.isnan(check(trajectory((), "diverged", end_state=(np.nan,))).end_state[0])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"status": "wrong"}, "status is 'wrong' (str), wanted one of ok, "),
        ({"status": "done"}, "status is 'done' (str), wanted one of ok, "),
        ({"transitions": None}, "transitions is None (NoneType), wanted a sequence of Transition"),
        ({"end_time": None}, "end_time is None (NoneType), wanted a number"),
        ({"end_time": np.nan}, "end_time is nan (float), wanted a finite number"),
        ({"end_time": -0.1}, "end_time is -0.1 (float), wanted a time from 0 to 5"),
        ({"end_time": 5.1}, "end_time is 5.1 (float), wanted a time from 0 to 5"),
        ({"end_time": 4.0}, "end_time is 4.0 (float), wanted the horizon, 5, if the status is ok"),
        ({"end_state": (np.nan,)}, "end_state is (nan,) (tuple), wanted finite numbers if the status is ok"),
        ({"end_state": (1.0, 2.0)}, "end_state is (1.0, 2.0) (tuple), wanted 1 numbers"),
        ({"end_mode": ()}, "end_mode is () (tuple), wanted 1 entries, each -1, 0 or +1"),
        ({"reason": None}, "reason is None (NoneType), wanted a str"),
        ({"counts": None}, "counts is None (NoneType), wanted a Counts"),
        ({"counts": Counts(0, -1)}, "counts.rhs_evaluations is -1 (int), wanted a whole number from 0 to 2**63 - 1"),
        ({"counts": Counts(2**63)}, "counts.steps is 9223372036854775808 (int), wanted a whole number from 0 to"),
        ({"max_surface_drift": -1.0}, "max_surface_drift is -1.0 (float), wanted a finite number from 0 on, or NaN"),
        ({"max_surface_drift": np.inf}, "max_surface_drift is inf (float), wanted a finite number from 0 on, or NaN"),
        ({"counts": Counts(1.5)}, "counts.steps is 1.5 (float), wanted a whole number"),
        ({"max_surface_drift": "small"}, "max_surface_drift is 'small' (str), wanted a number"),
    ],
)
def test_a_trajectory_that_cannot_be_scored_is_refused_by_what_is_wrong_with_it(changes, words):
    with pytest.raises(ContractError) as refused:
        check(trajectory(found())._replace(**changes))
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
        ({"time": -1e-6}, "time is -1e-06 (float), wanted a time from 0 to 5"),
        ({"time": 5.1}, "time is 5.1 (float), wanted a time from 0 to 5"),
        ({"time": 1.0}, "time is 1.0 (float), wanted a time not before 1.25, the latest so far"),
        ({"time_low": 1e-9}, "time_low is 1e-09 (float), wanted a rounding error of at most 7.1e-14"),
        ({"state": (np.inf,)}, "state is (inf,) (tuple), wanted finite numbers if the status is ok"),
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
        check(trajectory(events))
    assert str(refused.value).startswith(f"the solver returned a Trajectory whose transitions[2].{words}")


def test_times_are_held_against_the_problem_s_up_to_rounding():
    last, early = np.nextafter(5.0, 6.0), replace(EVENT, time=np.nextafter(1.25, 0.0), time_low=1e-16)
    events = (replace(EVENT, time=-1e-17), EVENT, EVENT, early, replace(EVENT, time=last))
    assert check(trajectory(events, end_time=5.0 - 1e-12)).transitions == events


def test_a_run_that_ends_early_is_held_to_its_times_alone():
    events = (replace(EVENT, state=(np.nan,)),)
    assert check(trajectory(events, "diverged", end_time=2.0)).end_time == 2.0
    with pytest.raises(ContractError, match="wanted a time from 0 to 5"):
        check(trajectory((replace(EVENT, time=6.0),), "diverged", end_time=2.0))


def test_what_is_no_transition_is_refused():
    with pytest.raises(ContractError, match=r"transitions\[0\] is 0.5 \(float\), wanted a Transition"):
        check(trajectory((0.5,)))


def test_words_of_a_solver_that_are_none_are_refused():
    check_prepared(print, landing="theirs", version="")
    with pytest.raises(ContractError, match=r"landing is None \(NoneType\), wanted a str"):
        check_prepared(print, landing=None, version="")
    with pytest.raises(ContractError, match=r"version is 1.0 \(float\), wanted a str"):
        check_prepared(print, landing="theirs", version=1.0)


def test_exceptions_whose_words_cannot_be_had_are_told_by_their_name():
    class MuteError(Exception):
        def __str__(self):
            raise ValueError

    class LoudError(Exception):
        def __str__(self):
            return Text("a\nb" * 1000)

    assert failure_of(MuteError()).reason == "MuteError"
    loud = failure_of(LoudError()).reason
    assert (type(loud), len(loud), loud[:14]) == (str, LONGEST_REASON, "LoudError: a b")


def test_the_reason_of_a_row_is_the_message_alone():
    assert failure_of(ContractError("the solver returned 42")).reason == "the solver returned 42"
