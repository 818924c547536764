"""A run of very many transitions is scored in a time that grows with their number, not with its square."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import pytest
from fakes import TIMES, expected, found, trajectory

from henon_ref.score.errors import score

SUPPORT = Path(__file__).parents[1] / "support"
PATIENCE = 60
"""Seconds of processor time for what takes five; pair by pair it would be several minutes."""

BEGIN = """
from dataclasses import dataclass, replace
import numpy as np
from fakes import Reference, case, expected, found, trajectory
from henon_ref.report.files.csv_files import csv_text
from henon_ref.score.matching import match
from henon_ref.score.errors import score
from henon_ref.campaign.rows import Outcome, record
from henon_ref.campaign.settings import Setting

MANY = 100_030
spread = tuple(np.linspace(0.01, 4.99, MANY).tolist())

@dataclass(frozen=True)
class Touch:
    time: float
    distance: float
    lasts: bool = False

def rows(exact, transitions):
    run = trajectory(transitions)
    own = score(run, exact, tolerance=1e-9)
    outcome = Outcome("made_up", case().readings[0], "crowd", Setting(1e-9, 1e-12), trajectory=run, score=own)
    done = record(outcome, exact)
    csv_text(list(done.transitions[0]), done.transitions)
    csv_text(list(done.sticks[0]), done.sticks)
    assert done.run["status"] != "ok", done.run
"""
SCORED = {
    "few and a crowd at the horizon": "rows(expected(), found() + found((5.0,) * MANY))",
    "few and a crowd everywhere": "rows(expected(), found(spread))",
    "many and a crowd at the horizon": "rows(expected(spread), found((5.0,) * MANY))",
    "many and all but one": "rows(expected(spread), found(spread[:MANY // 2] + spread[MANY // 2 + 1 :], error=1e-6))",
    "many near touches": ("rows(replace(expected(), near_grazes=[Touch(t, 1.0) for t in spread[::4]]), found(spread))"),
    "many pairs at one instant": """
both = [
    event
    for t in spread[::2]
    for event in (
        Reference("crossing", 0, (1, 1), (-1, -1), t), Reference("crossing", 1, (1, 1), (-1, -1), t),
        Reference("crossing", 0, (-1, -1), (1, 1), t + 1e-6), Reference("crossing", 1, (-1, -1), (1, 1), t + 1e-6),
    )
]
assert match(both, both, start=0.0, until=5.0).exact
""",
}


@pytest.mark.parametrize("code", SCORED.values(), ids=SCORED)
def test_a_crowd_of_transitions_is_scored_soon(code, tmp_path):
    script = tmp_path / "crowd.py"
    script.write_text(f"import sys\nsys.path.insert(0, {str(SUPPORT)!r})\n{BEGIN}\n{code}\n", encoding="utf-8")
    done = subprocess.run([sys.executable, str(script)], check=False, preexec_fn=_in_time)
    assert done.returncode == 0


def _in_time() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (PATIENCE, PATIENCE))


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
