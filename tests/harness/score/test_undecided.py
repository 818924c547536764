"""A run that may lack transitions of a surface from a time on is compared with the truth up to this time."""

from __future__ import annotations

from dataclasses import replace

import pytest
from fakes import case, expected, found, trajectory

from henon_ref.harness.campaign.options import Setting
from henon_ref.harness.campaign.rows import Outcome, record, scored
from henon_ref.harness.score.gate import Bounds
from henon_ref.harness.score.reference import NearGraze
from henon_ref.harness.score.scoring import score


def test_what_a_run_leaves_open_is_neither_missed_nor_right() -> None:
    """A transition of the truth behind it is no fault of the run, and a gate does not pass."""
    truth, events = expected(), found()
    last = truth.transitions[-1].time
    run = trajectory(events[:-1])._replace(undecided_after=((events[-1].surface, last - 1e-3),))
    result = score(run, truth, tolerance=1e-9)
    assert (result.status, result.matching.missed, result.verdict.word) == ("ok", (), "not judged")
    reading = case().readings[0]
    outcome = Outcome("made_up", reading, "henon", Setting(rtol=min(reading.tolerances)), trajectory=run)
    row = record(scored(outcome, truth), truth).run
    assert row.undecided_after_s == last - 1e-3
    (complaint,) = Bounds("made_up", reading.name, "henon", 1e-9, "ok").unmet(row)
    assert "decided until t = " in complaint


def test_a_run_that_is_open_behind_the_last_transition_is_right() -> None:
    truth, events = expected(), found()
    run = trajectory(events)._replace(undecided_after=((0, truth.transitions[-1].time + 1e-3),))
    assert score(run, truth, tolerance=1e-9).verdict.word == "right"


@pytest.mark.parametrize(("begins", "word"), [(1.0, "ill-conditioned"), (3.0, "solver defect")])
def test_what_is_invented_on_a_surface_that_is_approached_for_good_is_ill_conditioned(begins: float, word: str) -> None:
    truth = expected((), near_grazes=(NearGraze(begins, 0, 1e-8, lasts=True),), start_size=1.0)
    invented = replace(found()[0], time=2.0)
    assert score(trajectory((invented,)), truth, tolerance=1e-6).verdict.word == word


@pytest.mark.parametrize(("tolerance", "word"), [(1e-7, "ill-conditioned"), (1e-9, "solver defect")])
def test_between_two_instants_a_surface_is_approached_exponentially(tolerance: float, word: str) -> None:
    """It is 1e-6 away at t = 1, 1e-10 at t = 3, 1e-8 at t = 2."""
    approached = (NearGraze(1.0, 0, 1e-6, lasts=True), NearGraze(3.0, 0, 1e-10, lasts=True))
    truth = expected((), near_grazes=approached, start_size=1.0)
    invented = replace(found()[0], time=2.0)
    assert score(trajectory((invented,)), truth, tolerance=tolerance).verdict.word == word
