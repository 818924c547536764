"""The result of a run is made when it is read, from numbers that no later run changes."""

from __future__ import annotations

import pickle

import pytest
from problems import make_problem

from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.run import run_to_horizon
from henon_ref.trajectory import Trajectory


def results(*begun: int) -> list[Trajectory]:
    """Return unread results of runs from these states to t = 3, one after the other in the same memory."""
    problems = [make_problem("x", ["t - s"], {"s": "x"}, [x], 3) for x in begun]
    integrator = Integrator(problems[0].system, 12)
    found = [run_to_horizon(integrator, integrator.start(each, tolerance=1e-9)) for each in problems]
    assert len(integrator.free) == 1
    return found


def test_a_later_run_in_the_same_memory_does_not_change_it() -> None:
    unread, other = results(0, -1)
    assert [event.kind for event in unread.transitions] == ["release"]
    assert [event.kind for event in other.transitions] == ["stick", "release"]
    assert unread.end_state == pytest.approx((2.0,))  # (t - 1)^2 / 2 after the release at 1


def test_a_pickle_has_the_fields_alone() -> None:
    (unread,) = results(0)
    copy = pickle.loads(pickle.dumps(unread))
    assert type(copy) is Trajectory
    assert copy.end_state == unread.end_state
    assert list(copy.transitions) == list(unread.transitions)


def test_an_unknown_attribute_is_an_error() -> None:
    (unread,) = results(0)
    with pytest.raises(AttributeError, match="no attribute 'end_times'"):
        _ = unread.end_times  # type: ignore[attr-defined]
