"""What a solver returns can be changed by the same call, whatever part of it."""

from __future__ import annotations

import dataclasses

import pytest

from henon_ref import Counts, Trajectory, Transition

EVENT = Transition("stick", 0, (1,), (0,), 2.0, (0.5,))
RUN = Trajectory("ok", (EVENT,), 3.0, (0.5,), (0,))


@pytest.mark.parametrize(
    ("part", "changes"), [(EVENT, {"time": 2.5}), (RUN, {"status": "failed"}), (Counts(), {"steps": 3})]
)
def test_every_part_of_a_trajectory_has_replace(part, changes):
    changed = part._replace(**changes)
    assert type(changed) is type(part)
    assert all(getattr(changed, name) == value for name, value in changes.items())
    assert changed != part


def test_a_transition_can_be_changed_as_the_data_class_that_it_is():
    assert dataclasses.replace(EVENT, time=2.5) == EVENT._replace(time=2.5)
