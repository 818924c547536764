"""Two surfaces, four states: solvers of different families agree with each other and with the stored truth."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import pytest

from henon_ref.casefile.case import load_case
from henon_ref.harness.registry import solver
from henon_ref.harness.truth.compute import stored_truth
from henon_ref.harness.truth.store import folder_of
from henon_ref.trajectory import Trajectory

FILE = Path(__file__).parents[2] / "cases" / "two_blocks.yaml"
TOLERANCES = {"henon": 1e-13, "heyoka": 1e-15, "scipy-dop853": 1e-13, "cvode-adams": 1e-15, "ida": 3e-15}
UNTIL = 15
"""Horizon [s]: both surfaces are slid on, each alone and both at once."""
CLOSE = 1e-9
"""Largest difference of a transition time [s], and of a state at a transition."""


@pytest.fixture(scope="module")
def runs() -> dict[str, Trajectory]:
    pytest.importorskip("heyoka")
    pytest.importorskip("sksundae")
    problem = replace(load_case(FILE).readings[0].problem, until=UNTIL)
    return {
        name: solver(name).prepare(problem, rtol=rtol, atol=rtol, deadline=60)() for name, rtol in TOLERANCES.items()
    }


def test_five_libraries_agree_on_every_transition_of_two_blocks(runs: dict[str, Trajectory]) -> None:
    assert {run.status for run in runs.values()} == {"ok"}
    for a, b in combinations(runs.values(), 2):
        assert [(t.kind, t.surface, t.to_mode) for t in a.transitions] == [
            (t.kind, t.surface, t.to_mode) for t in b.transitions
        ]
        for mine, other in zip(a.transitions, b.transitions, strict=True):
            assert mine.time == pytest.approx(other.time, abs=CLOSE, rel=0)
            assert mine.state == pytest.approx(other.state, abs=CLOSE, rel=0)


def test_they_agree_with_the_truth_which_visits_both_surfaces(runs: dict[str, Trajectory]) -> None:
    case = load_case(FILE)
    truth = stored_truth(case, case.readings[0], folder_of(FILE))
    assert truth is not None
    assert truth.certified
    expected = [t for t in truth.transitions if t.time < UNTIL]
    assert {t.surface for t in expected} == {0, 1}
    assert len(expected) == 10
    for run in runs.values():
        assert [t.to_mode for t in run.transitions] == [t.to_mode for t in expected]
        for ours, theirs in zip(run.transitions, expected, strict=True):
            assert abs((ours.time - theirs.time) + (ours.time_low - theirs.time_low)) <= CLOSE
