"""The time to score a run grows with the number of its transitions, not with the square."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from fakes import TIMES, Reference, case, expected, found, trajectory
from random_scenes import deadline

from henon_ref.harness.campaign.options import Setting
from henon_ref.harness.campaign.rows import Outcome, record
from henon_ref.harness.result_files import rows_text
from henon_ref.harness.rows import StickRow, TransitionRow
from henon_ref.harness.score.matching import match
from henon_ref.harness.score.reference import Expected, NearGraze
from henon_ref.harness.score.scoring import score
from henon_ref.trajectory import Transition

MANY = 10_030
SPREAD = tuple(np.linspace(0.01, 4.99, MANY).tolist())
PATIENCE = 40
"""Seconds of processor time for what takes one to two; pair by pair it would be minutes."""


@pytest.mark.parametrize(
    "made",
    [
        lambda: (expected(), found() + found((5.0,) * MANY)),
        lambda: (expected(), found(SPREAD)),
        lambda: (expected(SPREAD), found((5.0,) * MANY)),
        lambda: (expected(SPREAD), found(SPREAD[: MANY // 2] + SPREAD[MANY // 2 + 1 :], error=1e-6)),
        lambda: (replace(expected(), near_grazes=[NearGraze(time, 0, 1.0) for time in SPREAD[::4]]), found(SPREAD)),
    ],
    ids=[
        "few and a crowd at the horizon", "few and a crowd everywhere", "many and a crowd at the horizon",
        "many and all but one", "many near touches",
    ],
)  # fmt: skip
def test_a_crowd_of_transitions_is_scored_soon(made: Callable[[], tuple[Expected, tuple[Transition, ...]]]) -> None:
    exact, transitions = made()
    with deadline(PATIENCE):
        run = trajectory(transitions)
        own = score(run, exact, tolerance=1e-9)
        outcome = Outcome("made_up", case().readings[0], "crowd", Setting(1e-9, 1e-12), trajectory=run, score=own)
        done = record(outcome, exact)
        rows_text(TransitionRow, done.transitions, ["x"])
        rows_text(StickRow, done.sticks)
    assert done.run.status == "wrong"


def test_many_pairs_at_one_instant_are_matched_soon() -> None:
    signs = (1, 1), (-1, -1)
    both = [
        Reference("crossing", surface, *ends, time + later)
        for time in SPREAD[::2]
        for later, ends in ((0, signs), (1e-6, signs[::-1]))
        for surface in (0, 1)
    ]
    with deadline(PATIENCE):
        assert match(dict(enumerate(both)), dict(enumerate(both)), start=0.0, until=5.0).exact


@pytest.mark.parametrize("right", [True, False])
def test_a_crowd_at_the_horizon_is_not_cut_off_by_it(right):
    crowd = found((5.0,) * 30)
    scored = score(trajectory(found() + crowd if right else crowd), expected(), tolerance=1e-9)
    assert (scored.status, scored.verdict.word) == ("wrong", "solver defect")
    assert len(scored.matching.spurious) >= 28


def test_as_many_as_the_exact_run_has_together_may_lie_beyond_the_horizon():
    cluster = tuple(3.0 + 1e-12 * k for k in range(6))
    exact = expected((*TIMES[:3], *cluster))
    beyond = tuple(5.0 - 1e-12 * k for k in reversed(range(6)))
    scored = score(trajectory(found((*TIMES[:3], *cluster, *beyond))), exact, tolerance=1e-9)
    assert scored.status == "ok"
    assert len(scored.matching.cut_found) == 6
