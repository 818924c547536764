"""The kind of a reading follows from its exact run."""

from __future__ import annotations

from dataclasses import replace

import pytest
from fakes import Reference, expected

from henon_ref.harness.score.reference import CLOSE, KINDS, NearGraze, kind_of


def run(*times: float, kind: str = "crossing", **changes: object):
    events = tuple(Reference(kind, 0, (1,), (-1,), time) for time in times)
    return replace(expected(), transitions=events, **changes)


@pytest.mark.parametrize(
    ("truth", "surfaces", "kind"),
    [
        (run(1.0, 2.0), 1, "crossings"),
        (run(1.0, kind="release"), 1, "stick-slip"),
        (run(1.0, kind="stick"), 2, "several surfaces"),
        (run(), 3, "no transition"),
        (run(1.0, kind="graze"), 2, "graze or close roots"),
        (run(near_grazes=(NearGraze(1.0, 0, 1e-9),)), 1, "graze or close roots"),
        (run(1.0, 2.0, status="nonunique"), 1, "ends early"),
        (run(1.0, partial=True), 1, "ends early"),
        (run(partial=True, end_time=0.0), 1, "no truth"),
        (None, 1, "no truth"),
    ],
)
def test_the_first_kind_that_holds(truth, surfaces, kind):
    truth = truth if truth is None or truth.nothing_known else replace(truth, start=0.0, end_time=4.0)
    assert kind_of(truth, surfaces) == kind
    assert kind in KINDS


def test_roots_are_close_by_the_mean_time_between_transitions():
    """Four transitions in 4 s, 1 s on average: two of them closer than CLOSE of that, or just not."""
    for gap, kind in ((0.9 * CLOSE, "graze or close roots"), (1.1 * CLOSE, "crossings")):
        assert kind_of(run(0.5, 1.5, 1.5 + gap, 3.0, start=0.0, end_time=4.0), 1) == kind


def test_the_kind_does_not_depend_on_the_unit_of_time():
    for unit in (1e-9, 1e9):
        times = [unit * time for time in (0.5, 1.5, 1.51, 3.0)]
        assert kind_of(run(*times, start=0.0, end_time=4 * unit, until=4 * unit), 1) == "crossings"
