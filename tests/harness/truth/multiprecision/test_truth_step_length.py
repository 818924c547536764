"""Length of multiprecision steps if a guard is constant."""

from __future__ import annotations

from typing import Any

import pytest
from problems import read_problem

from henon_ref.harness.truth.multiprecision.run import simulate
from henon_ref.harness.truth.multiprecision.stepper import Stepper

MOST = 100
"""Steps: eight are needed; with the guard's derivative enclosed they had 2.5e-7 s each."""
TEXT = """\
scene:
  bodies: {a: {mass: 1}, b: {mass: 1/2}, wall: fixed}
  connections:
    - spring: {between: [a, wall], stiffness: 1}
    - damper: {between: [a, wall], coefficient: 0.1}
    - force: {on: a, value: -3}
    - force: {on: b, value: 3 + cos(2.5*t)}
    - friction: {between: [a, wall], law: coulomb, force: 0.1}
    - stop: {between: [b, a], gap: -0.8, restitution: 1/2}
    - stop: {between: [a, b], gap: 0, restitution: 0}
initial: {t: 0, x_a: 1, v_a: -2, x_b: 0.5, v_b: 1.4}
until: 12
"""
"""Two blocks pressed together, a second stop between them."""


def test_a_guard_that_a_rest_keeps_constant_does_not_cut_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    made, step = [], Stepper.step

    def counted(self: Stepper, limit: Any) -> Any:
        made.append(limit)
        assert len(made) < MOST
        return step(self, limit)

    monkeypatch.setattr(Stepper, "step", counted)
    run = simulate(read_problem(TEXT), 320)
    assert run.status == "ok"
    assert run.instants[1][0].to_mode[2] == 0  # it rests on the second stop
