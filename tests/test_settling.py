"""Transitions of several surfaces: the compiled decision is the Python one, and stands back where it is not clear."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from henon_ref.henon import session as session_module
from henon_ref.henon.engine import Engine
from henon_ref.henon.registers import HENON
from henon_ref.henon.solvers import HENON_SOLVER
from henon_ref.model.case import load_case, parse_case
from henon_ref.trajectory import Problem, Trajectory

CASES = Path(__file__).parent.parent / "cases"


def runs(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> tuple[Trajectory, Trajectory, int]:
    """A run decided in machine code and one decided in Python, and how often the first asked Python."""
    asked = 0
    plain = session_module.Session._resolve

    def counted(self: session_module.Session, **options: float) -> object:
        nonlocal asked
        asked += 1
        return plain(self, **options)

    def run(engine: Engine) -> Trajectory:
        return engine.run(engine.start(problem), tolerance=1e-15, landing=HENON)

    engine = Engine(problem.system, 18)
    run(engine)  # modes are compiled on first sight
    with monkeypatch.context() as patch:
        patch.setattr(session_module.Session, "_resolve", counted)
        ours = run(engine)
    slow = Engine(problem.system, 18)
    slow.compiled.rows = np.zeros(0, dtype=np.int64)
    return ours, run(slow), asked


@pytest.mark.parametrize(
    ("path", "reading"),
    [
        ("two_blocks.yaml", "default"),
        ("classic/three_blocks.yaml", "default"),
        ("hard/simultaneous_events.yaml", None),
        ("hard/two_contacts.yaml", None),
    ],
)
def test_clear_decisions_are_those_of_python(path: str, reading: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    case = load_case(CASES / path)
    for each in case.readings if reading is None else [case.reading(reading)]:
        ours, theirs, asked = runs(each.problem, monkeypatch)
        assert ours.status == theirs.status
        assert [(t.kind, t.surface, t.from_mode, t.to_mode) for t in ours.transitions] == [
            (t.kind, t.surface, t.from_mode, t.to_mode) for t in theirs.transitions
        ]
        for t, u in zip(ours.transitions, theirs.transitions, strict=True):
            assert t.time == pytest.approx(u.time, rel=1e-13)
        if reading:
            assert asked == 0


def problem(field: str, start: str = "{x: -1, y: -1}") -> Problem:
    text = f"""
schema: 1
name: corner
title: Both surfaces reached at once
system: {{state: [x, y], surfaces: {{s: x, u: y}}, field: {field}}}
initial: {start}
until: 2
"""
    return parse_case(text).readings[0].problem


@pytest.mark.parametrize(
    ("field", "clear"),
    [
        ('["1.5 - s - 0.25*u", "1.5 - u + 0.25*s"]', True),  # coupled
        ('["0.5 - s", "0.5 - u"]', True),  # both held
        ('["1 - s*u/2", "1 - s*u/2"]', False),  # signs that multiply each other
        ('["1 + s*(1 + u)/8", "1"]', False),
        ('["1 - s", "0.5 - u"]', False),  # an equivalent sign of exactly one
    ],
)
def test_what_is_not_clear_is_left_to_python(field: str, clear: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs, asked = runs(problem(field), monkeypatch)
    assert (asked == 0) == clear
    assert [(t.kind, t.to_mode) for t in ours.transitions] == [(t.kind, t.to_mode) for t in theirs.transitions]
    assert ours.status == theirs.status


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-15])
def test_ever_shorter_slides_end_with_a_word(rtol: float) -> None:
    """Transitions that accumulate at (A + B)/(1 - q): told up to where doubles end, never an endless loop."""
    case = load_case(CASES / "hard" / "shrinking_slides.yaml")
    problem = replace(case.readings[0].problem, until=sp.Integer(4))
    run = HENON_SOLVER.prepare(problem, rtol=rtol, deadline=20)()
    assert run.status == "failed"
    assert "accumulate" in run.reason
    assert run.end_time == pytest.approx(3.2320508075688776, rel=1e-13)
    cycle = [(1, -1, 1), (1, -1, 0), (-1, -1, -1), (-1, -1, -1), (-1, 1, -1), (-1, 1, 0), (1, 1, 1), (1, 1, 1)]
    assert [t.to_mode for t in run.transitions[:96]] == cycle * 12
    gaps = [b.time - a.time for a, b in pairwise(run.transitions[3:80:4])]
    assert all(after / before == pytest.approx(3**-0.5, rel=1e-4) for before, after in pairwise(gaps))
