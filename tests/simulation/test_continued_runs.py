"""A run continued from a state of another one, in its mode, equals the run that was not interrupted.

Within a stick or a rest the state is off its surface by rounding, or by the error of the steps if the surface moves.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import henon_ref as hr

Made = tuple[hr.System, dict[str, Any], float]


def belt(speed: Any) -> Made:
    field = ["v", "-x - F*s/(1 + 3*s*(v - vb))"]
    return hr.System(["x", "v"], {"F": 1, "vb": speed}, {"s": "v - vb"}, field), {"x": 1.5, "v": 0}, 40


def held_block(velocity: str) -> Made:
    scene = hr.Scene()
    block, moving = scene.body("b", mass=1), scene.prescribed("belt", velocity=velocity)
    scene.spring(block, scene.wall, stiffness=2)
    scene.friction(block, moving, law="coulomb", force=1, static=1.5)
    return scene.system(), {"x_b": 1.5, "v_b": 0}, 40


def stack() -> Made:
    scene = hr.Scene()
    lower, upper, moving = scene.body("a", mass=1.3), scene.body("c", mass=0.7), scene.prescribed("belt", velocity=0.1)
    scene.spring(lower, scene.wall, stiffness=1.1)
    scene.spring(upper, lower, stiffness=0.3)
    scene.friction(lower, upper, law="coulomb", force=0.3, static=0.4)
    scene.friction(lower, moving, law="coulomb", force=1, static=1.2)
    return scene.system(), {"x_a": 3, "v_a": 0, "x_c": 0.2, "v_c": 0.3}, 40


def two_blocks() -> Made:
    field = ["v", "-x - 0.7*s", "u", "0.4*cos(0.7*t) + 0.35*s"]
    return hr.System(["x", "v", "y", "u"], {}, {"s": "v - u"}, field), {"x": 1, "v": 0, "y": 0, "u": 0.3}, 30


def row_of_blocks() -> Made:
    """More than three contacts, which do not act on each other."""
    scene = hr.Scene()
    moving, before = scene.prescribed("belt", velocity=0.3), scene.wall
    for k in range(6):
        block = scene.body(f"b{k}", mass=1)
        scene.friction(block, moving, law="coulomb", force=1, static=1.3)
        scene.spring(block, before, stiffness=1 + 0.2 * k)
        before = block
    system = scene.system()
    return system, {name: 0.4 * i if i % 2 == 0 else 0 for i, name in enumerate(system.state)}, 30


def stopped(gap: Any, restitution: float) -> Made:
    scene = hr.Scene()
    body = scene.body("b", mass=1)
    scene.stop(body, scene.wall, gap=gap, restitution=restitution)
    scene.force(body, "-10*cos(0.3*t)")
    return scene.system(), {"x_b": 1, "v_b": 0}, 20


def stop_on_a_moving_body() -> Made:
    scene = hr.Scene()
    body, carrier = scene.body("b", mass=1), scene.body("c", mass=3)
    scene.stop(body, carrier, gap=0.1, restitution=0.5)
    scene.force(body, "-10*cos(0.3*t)")
    scene.spring(carrier, scene.wall, stiffness=20)
    return scene.system(), {"x_b": 1, "v_b": 0, "x_c": 0, "v_c": 0}, 20


def moving_table() -> Made:
    jump = {"s": {"when": "falling", "map": {"v": "-0.5*(v + 0.1*sin(t)) - 0.1*sin(t)"}}}
    system = hr.System(["x", "v"], {}, {"s": "x - 0.1*cos(t)"}, ["v", "12*sin(0.4*t) - 10"], resets=jump)
    return system, {"x": 1, "v": 0}, 12


def curved() -> Made:
    system = hr.System(["x", "y"], {}, {"s": "x^2 + y^2 - 1"}, ["y - 0.8*x*s", "0.3 - x - 0.8*y*s"])
    return system, {"x": 1.5, "y": 0}, 20


RUNS: dict[str, Callable[[], Made]] = {
    "belt speed 1/3": lambda: belt("1/3"),
    "belt speed sqrt(2)/7": lambda: belt("sqrt(2)/7"),
    "static friction, belt speed 0.2": lambda: held_block("0.2"),
    "static friction, prescribed velocity": lambda: held_block("0.2 + 0.1*sin(2*t)"),
    "stack": stack,
    "two blocks": two_blocks,
    "row of blocks": row_of_blocks,
    "plastic impact": lambda: stopped(0, 0),
    "accumulated impacts": lambda: stopped("1/7", 0.6),
    "stop on a moving body": stop_on_a_moving_body,
    "moving table": moving_table,
    "curved surface": curved,
}


@pytest.mark.parametrize("rtol", [1e-10, 1e-6])
@pytest.mark.parametrize("name", RUNS)
def test_a_continued_run_equals_one_that_is_not_interrupted(name: str, rtol: float) -> None:
    system, initial, until = RUNS[name]()
    whole = hr.simulate(system, initial, until=until, rtol=rtol)
    rows = whole.transitions
    ends = np.array([*rows.time_s, until])
    begins, lengths = ends[:-1], np.diff(ends)
    inside = (begins + 0.4 * lengths)[lengths > 1e-3]
    sticks = [t for t in inside if 0 in whole.mode(t).values()]
    # How many of the impacts that accumulate are listed depends on the length of the run.
    last_impact = max(rows.time_s[rows.kind == "reset"], default=-1.0)
    at_transitions = [t for t in begins[lengths > 1e-3] if t > last_impact]
    assert sticks
    for t in [*sticks[:4], *sticks[-2:], *at_transitions[-3:]]:
        before = hr.simulate(system, initial, until=t, rtol=rtol)
        for state in [whole.sol(t)] if t in begins else [whole.sol(t), before.y[:, -1]]:
            found = hr.simulate(system, state, start=t, until=until, rtol=rtol, mode=whole.mode(t))
            wanted = rows[rows.time_s > t]
            assert found.status == "ok"
            for column in ("kind", "surface", "from_mode", "to_mode"):
                assert found.transitions[column].tolist() == wanted[column].tolist()
            assert found.transitions.time_s.tolist() == pytest.approx(wanted.time_s.tolist(), abs=100 * rtol)
            assert found.y[:, -1] == pytest.approx(whole.y[:, -1], abs=100 * rtol)


def test_static_friction_holds() -> None:
    """From t = 0.9 on the load is between kinetic and static friction: beside its surface the block slips for good."""
    scene = hr.Scene()
    block, table = scene.body("b", mass=1), scene.prescribed("table", velocity="0.3*cos(t)")
    scene.friction(block, table, law="coulomb", force=1, static=2)
    scene.force(block, "1.6*t")
    system = scene.system()
    first = hr.simulate(system, {"x_b": 0, "v_b": 0.3}, until=0.9)
    state = first.y[:, -1] + [0, 1e-14]  # on the side to which the load pulls
    modes = first.mode(0.9), None
    held, beside = (hr.simulate(system, state, start=0.9, until=1.5, mode=mode) for mode in modes)
    whole = hr.simulate(system, {"x_b": 0, "v_b": 0.3}, until=1.5)
    assert whole.transitions.kind.tolist() == held.transitions.kind.tolist() == ["release"]
    assert held.transitions.time_s.tolist() == pytest.approx(whole.transitions.time_s.tolist(), abs=1e-11)
    assert "release" not in beside.transitions.kind.tolist()
    assert beside["v_b"][-1] > whole["v_b"][-1] + 0.05


def test_a_stop_with_more_than_the_error_is_refused_each_time() -> None:
    """The first run of a system starts in another way than later ones, which let a body 'rest' at speed -1."""
    system, _, _ = stopped(0, 0.5)
    for start in ((0, -1), (-1e-6, 0), (0, -1e-6), (1e-6, 0)) * 2:
        with pytest.raises(hr.HenonRefError, match=r"moves into it|not on the surface of 'g_b_wall'"):
            hr.simulate(system, start, until=1, mode={"g_b_wall": 0})
    for start in ((0, -1e-16), (-1e-16, 1e-16), (1e-16, 0)) * 2:
        run = hr.simulate(system, start, until=1, mode={"g_b_wall": 0})
        assert (run.final_mode, len(run.transitions)) == ("g_b_wall=0", 0)


def test_a_state_that_moves_on_a_stop_does_not_rest_there_in_a_given_mode() -> None:
    """At rest in its mode it went through the stop, or away from it, with this speed; now the mode is decided."""
    ball = hr.System(["x", "v"], {}, {"s": "x"}, ["v", "-10"], resets={"s": {"map": {"v": "-v/2"}}})
    scene, _, _ = stopped(0, 0.5)
    for _ in range(2):  # later runs start in another way
        into = hr.simulate(ball, (0, -1), until=1, mode={"s": 0})
        assert (into.status, into.message) == (
            "invalid",
            "at t = 0 the state is on s, which resets it, and moves into it",
        )
        for system, surface in ((ball, "s"), (scene, "g_b_wall")):
            away, decided = (hr.simulate(system, (0, 1), until=1, mode=mode) for mode in ({surface: 0}, None))
            assert len(away.transitions) > 3
            assert away.transitions.equals(decided.transitions)


@pytest.mark.parametrize("speed", [1e-9, -1e-9])
def test_a_body_in_a_given_rest_is_put_at_rest(speed: float) -> None:
    """With the speed, an error of the run before, it drifted off its stop."""
    floor, beside = {"x": 0, "v": speed}, {"y": 0, "w": speed}
    drop = {"map": {"v": "-v/2"}}
    ball = hr.System(["x", "v"], {}, {"s": "x"}, ["v", "-10"], resets={"s": drop})
    two = hr.System(["x", "v", "y", "w"], {}, {"s": "x", "c": "w"}, ["v", "-10", "w", "-c"], resets={"s": drop})
    hit = {"map": {"v": "3/2*cos(t) - v/2"}}
    table = hr.System(["x", "v"], {}, {"s": "x - sin(t)"}, ["v", "-10"], resets={"s": hit})
    for _ in range(2):  # later runs start in another way
        run = hr.simulate(ball, floor, until=1e6, mode={"s": 0})
        assert (run.status, run.final_mode, run.y[:, -1].tolist()) == ("ok", "s=0", [0, 0])
        run = hr.simulate(two, {**floor, **beside}, until=1e6, mode={"s": 0, "c": 0})
        assert (run.final_mode, run.y[:, -1].tolist()) == ("s=0 c=0", [0, 0, 0, speed])  # a stick stays, too
        moved = hr.simulate(table, {"x": 0, "v": 1 + speed}, until=20, mode={"s": 0})
        assert moved.y[:, -1] == pytest.approx([math.sin(20), math.cos(20)], abs=1e-10)


def test_a_state_that_moves_into_a_stop_in_slip_begins_with_the_impact() -> None:
    """As it does where rounding has put it above the stop."""
    scene, _, _ = stopped(0, 0.5)
    for start in ((0, -1), (1e-16, -1), (-1e-16, -1)) * 2:
        run = hr.simulate(scene, start, until=0.1, mode={"g_b_wall": 1})
        assert run.transitions.kind[0] == "reset"
        assert run.transitions.v_b[0] == pytest.approx(0.5, abs=1e-15)


def test_the_error_follows_the_tolerance() -> None:
    system, _, _ = belt("1/3")
    start = {"x": 0.1, "v": 1 / 3 + 1e-8}
    assert hr.simulate(system, start, until=0.1, rtol=1e-6, mode={"s": 0}).final_mode == "s=0"
    with pytest.raises(hr.HenonRefError, match=r"not on the surface of 's', whose sign is \+1 there"):
        hr.simulate(system, start, until=0.1, mode={"s": 0})
    with pytest.raises(hr.HenonRefError, match="not on the surface of 's', whose sign is -1 there"):
        hr.simulate(system, [0.1, 1 / 3], until=0.1, mode={"s": 0}, parameters={"vb": 0.4})


def test_a_load_beyond_the_limit_is_released_at_once() -> None:
    system, initial, _ = belt("1/3")
    first = hr.simulate(system, initial, until=6)
    assert first.final_mode == "s=0"
    state = first.y[:, -1]
    run = hr.simulate(system, state, start=6, until=7, parameters={"F": abs(state[0]) / 2}, mode=first.mode(6))
    assert run.transitions[["time_s", "kind"]].values.tolist()[0] == [6, "release"]


def test_a_kink_that_another_branch_hides_has_no_side() -> None:
    """run.mode has +1 for it, whatever its sign."""
    field = ["v", "piecewise(-x, t < 2, -abs(x + 3) - x)"]
    system = hr.System(["x", "v"], {}, {"s": "v + 9"}, field)
    first = hr.simulate(system, {"x": -4, "v": 0}, until=0.5)
    kinks = {name: entry for name, entry in first.mode(0.5).items() if name != "s"}
    found = hr.simulate(system, first.y[:, -1], start=0.5, until=3, mode=first.mode(0.5))
    whole = hr.simulate(system, {"x": -4, "v": 0}, until=3)
    assert 1 in kinks.values()
    assert first.y[0, -1] < -3
    assert found.transitions.time_s.tolist() == pytest.approx(whole.transitions.time_s.tolist(), abs=1e-9)


def test_a_run_that_has_stopped_on_a_surface_is_continued_beyond_it() -> None:
    """Without the mode the next run begins before the surface again, by rounding, and stops at once."""
    oscillator = hr.System(["x", "v"], {}, {"s": "x - 1/10"}, ["v", "-x"])
    t, state, mode, times = 0.0, np.array([1.0, 0.0]), None, []
    for _ in range(4):
        run = hr.simulate(oscillator, state, start=t, until=100, stop={"s": "falling"}, mode=mode)
        t, state = float(run.t[-1]), run.y[:, -1]
        mode = run.mode(t)
        times.append(t)
    assert times == pytest.approx(np.arccos(0.1) + 2 * np.pi * np.arange(4), abs=1e-8)
