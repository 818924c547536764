"""Slides on which the force equals the friction all along: they hold, whatever rounding makes of it."""

from __future__ import annotations

import numpy as np
import pytest
from problems import make_problem, read_problem
from runs import kinds, run

import henon_ref as hr
from henon_ref.baselines.henon import HENON_SOLVER

FINE = pytest.mark.parametrize("rtol", [1e-12, 1e-15])
"""Tolerances at which no step moves a state by 1e-13 of the friction."""

TWIN = """\
scene:
  bodies: {block: {mass: 1}, belt: {velocity: 2*sin(t)}, wall: fixed}
  connections:
    - spring: {between: [block, wall], stiffness: 1}
    - friction: {between: [block, belt], law: coulomb, force: 1, static: 2}
initial: {t: 0, x_block: 0, v_block: 0}
until: 20
"""
"""A belt that swings with the spring's own frequency."""


@FINE
@pytest.mark.parametrize(("belt", "amplitude"), [("sin(t)", 1.0), ("-sin(t)", -1.0)])
def test_a_spring_that_takes_all_of_the_friction_holds(belt: str, amplitude: float, rtol: float) -> None:
    """On the belt x = 1 - cos t, and x'' + x is the friction."""
    result = run(make_problem("x v", ["v", "-x - s"], {"s": f"v - ({belt})"}, [0, 0], 20), rtol)
    assert (result.status, kinds(result), result.end_mode) == ("ok", [], (0,))
    assert result.end_state == pytest.approx((amplitude * (1 - np.cos(20)), amplitude * np.sin(20)), abs=1e-12)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12, 1e-15])
def test_a_load_that_equals_the_friction_by_an_identity_holds(rtol: float) -> None:
    result = run(make_problem("x", ["sin(t)**2 + cos(t)**2 - s"], {"s": "x"}, [0], 5), rtol)
    assert (result.status, kinds(result), result.end_mode) == ("ok", [], (0,))


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12, 1e-15])
def test_a_hold_zone_s_end_that_is_kept_to_holds(rtol: float) -> None:
    result = HENON_SOLVER.prepare(read_problem(TWIN), rtol=rtol, deadline=20.0)()
    assert (result.status, kinds(result), result.end_mode) == ("ok", [], (0,))


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15])
@pytest.mark.parametrize("until", ["1", "1 + 1/10**14", "2"])
def test_a_load_that_passes_the_friction_slowly_is_let_go(until: str, rtol: float) -> None:
    """Whatever is left of the run there."""
    result = run(make_problem("x", ["1 + (t - 1)/10**9 - s"], {"s": "x"}, [0], until), rtol)
    assert [(q.kind, q.time) for q in result.transitions] == [("release", pytest.approx(1, abs=1e-6))]


@pytest.mark.parametrize(("rtol", "excess"), [(1e-10, 5e-10), (1e-12, 6e-12), (1e-13, 1.2e-12)])
def test_a_held_load_that_creeps_past_its_limit_is_released(rtol: float, excess: float) -> None:
    """It passes 2 at t = 1000 by 1e-13 a second; no step moves it by 1e-13 of the friction."""
    scene = hr.Scene()
    floor = scene.prescribed("floor", velocity="0.1*sin(t)")
    block = scene.body("block", mass=1)
    scene.friction(block, floor, law="coulomb", force=1, static=2)
    scene.force(block, value="2 - 1/10**10 + t/10**13 + 0.1*cos(t)")
    run = hr.simulate(scene.system(), {"x_block": 0, "v_block": 0}, until=9000, rtol=rtol)
    assert run.transitions["kind"].iloc[0] == "release"
    assert 1000 <= run.transitions["time_s"].iloc[0] <= 1000 + excess / 1e-13
