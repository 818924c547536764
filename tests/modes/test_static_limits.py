"""Static friction at its limit and without work to do: a load that touches the limit, bodies whose motion is given."""

from __future__ import annotations

from math import cos, sin, sqrt

import pytest
import sympy as sp
from multiprecision import simulate, transitions
from problems import read_problem

import henon_ref as hr
from henon_ref.enclosure.run import certify
from henon_ref.errors import CaseError
from henon_ref.harness.registry import solver
from henon_ref.modes.problem import Problem
from henon_ref.simulation.arguments import problem_of


def pulled(force: str) -> Problem:
    """A block at rest on the floor, which holds 2 N."""
    text = f"""scene:
  bodies: {{block: {{mass: 1}}, floor: fixed}}
  connections:
    - friction: {{between: [block, floor], law: coulomb, force: 1, static: 2}}
    - force: {{on: block, value: "{force}"}}
initial: {{x_block: 0, v_block: 0}}
until: 2
"""
    return read_problem(text)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
def test_a_load_that_only_touches_the_limit_is_held_and_a_graze_tells_of_it(rtol: float, side: int) -> None:
    problem = pulled(f"{side}*(2 - (t - 1)**2)")
    run = solver("henon").prepare(problem, rtol=rtol)()
    assert run.status == "ok", run.reason
    (graze,) = run.transitions
    assert (graze.kind, graze.surface, graze.from_mode, graze.to_mode) == ("graze", 0, (0,), (0,))
    assert graze.time == pytest.approx(1, abs=1e-12)
    assert run.end_mode == (0,)
    assert run.end_state == pytest.approx((0, 0), abs=1e-15)


def test_the_multiprecision_route_tells_of_it_and_the_proof_says_that_it_is_one() -> None:
    problem = pulled("2 - (t - 1)**2")
    second = simulate(problem, 256)
    assert (second.status, [(e.before, e.after, e.surfaces) for e in second.events]) == ("ok", [((0,), (0,), (0,))])
    assert [t.kind for t in transitions(problem, 256)] == ["graze"]
    assert abs(float(second.events[0].time) - 1) < 1e-40
    proof = certify(problem)
    assert proof.status == "not provable"
    assert "touches zero" in proof.reason


def test_a_load_at_the_limit_is_exceeded_when_a_block_beside_it_begins_to_move() -> None:
    # Both blocks hold until t = 2; the spring to a then pulls b, whose load of 1 is already the largest that it holds.
    scene = hr.Scene()
    a, b = scene.body("a", mass=1), scene.body("b", mass=2)
    scene.friction(a, scene.wall, law="coulomb", force=1, static=2)
    scene.friction(b, scene.wall, law="coulomb", force=0.5, static=1)
    scene.spring(a, b, stiffness=2)
    scene.force(a, "t")
    scene.force(b, 1)
    system = scene.system()
    at_rest = dict.fromkeys(map(str, system.state), 0)
    run = hr.simulate(system, at_rest, until=4)
    assert run.transitions[["time_s", "surface"]].values.tolist() == [[2.0, "s_a_wall"], [2.0, "s_b_wall"]]
    w, total = sqrt(3), 2**3 / 6 + 3 * 2**2 / 4  # x_a + 2 x_b at t = 2 + 2
    apart = 2 / 3 + 1 / 4 - cos(2 * w) / 4 - sin(2 * w) / (3 * w)
    assert run["x_b"][-1] == pytest.approx((total - apart) / 3, rel=1e-9)
    assert run["x_a"][-1] == pytest.approx((total + 2 * apart) / 3, rel=1e-9)
    _, problem = problem_of(system, at_rest, until=4, start=0, parameters=None, mode=None)
    assert simulate(problem, 256).events[-1].after == (1, 1)


@pytest.mark.parametrize("lower", [None, "0", "max(0, t - 3)"])
@pytest.mark.parametrize(
    ("force", "released"),
    [("min(t, 4 - t)", None), ("min(t, 2)", None), ("max(t, 2*t - 2)", 2), ("piecewise(t, t < 2, 3)", 2)],
)
def test_a_load_that_reaches_the_limit_at_a_kink_is_held_unless_it_grows_from_there(
    force: str, released: float | None, lower: str | None
) -> None:
    scene = hr.Scene()
    floor, block = scene.wall, scene.body("block", mass=1)
    if lower is not None:  # a stack of two, with more kinks
        floor = scene.body("lower", mass=1)
        scene.friction(floor, scene.wall, law="coulomb", force=2, static=4)
        scene.force(floor, lower)
    scene.friction(block, floor, law="coulomb", force=1, static=2, name="rub")
    scene.force(block, force)
    system = scene.system()
    run = hr.simulate(system, dict.fromkeys(map(str, system.state), 0), until=3)
    found = run.transitions.query("surface == 'rub'")
    assert found[["time_s", "kind"]].values.tolist() == ([] if released is None else [[released, "release"]])
    assert (run["v_block"][-1] > 0) == (released is not None)


@pytest.mark.parametrize(("excess", "kinds"), [("-1/10**9", []), ("1/10**9", ["release"])])
def test_just_below_the_limit_nothing_is_told_and_just_above_it_lets_go(excess: str, kinds: list[str]) -> None:
    problem = pulled(f"2 + {excess} - (t - 1)**2")
    run, second = solver("henon").prepare(problem, rtol=1e-12)(), simulate(problem, 256)
    assert [t.kind for t in run.transitions] == kinds
    assert [e.after for e in second.events] == [(1,)] * len(kinds)
    if kinds:
        assert run.transitions[0].time == pytest.approx(float(1 - sp.sqrt(sp.Rational(1, 10**9))), abs=1e-12)


def given(first: str, second: str, parameters: str = "{a: 0.2, b: 0.2}") -> Problem:
    """A block on a belt that rubs against a plate, the motion of both being given."""
    text = f"""scene:
  parameters: {parameters}
  bodies:
    m: {{mass: 1}}
    belt: {{velocity: {first}}}
    plate: {{velocity: {second}}}
    wall: fixed
  connections:
    - spring: {{between: [m, wall], stiffness: 1}}
    - friction: {{between: [m, belt], law: coulomb, force: 1, static: 1.5}}
    - friction: {{between: [belt, plate], law: coulomb, force: 1, static: 2, name: rub}}
initial: {{x_m: 1.2, v_m: 0.2}}
until: 4
"""
    return read_problem(text)


@pytest.mark.parametrize(
    ("first", "second", "parameters", "rub"),
    [
        pytest.param("a", "b", "{a: 0.2, b: 0.2}", 0, id="one velocity"),
        pytest.param("0.2", "0.2*(sin(t)**2 + cos(t)**2)", "{}", 0, id="one velocity by an identity"),
        pytest.param("a", "b", "{a: 0.2, b: 0.3}", -1, id="two velocities"),
    ],
)
def test_friction_between_bodies_whose_motion_is_given_does_nothing(
    first: str, second: str, parameters: str, rub: int
) -> None:
    """The block lets go at (3/2 - 6/5)/(1/5) = 3/2 all the same."""
    problem = given(first, second, parameters)
    for name, options in [("henon", {"rtol": 1e-13}), ("henon-rk4", {"step": 1e-2}), ("heyoka", {"rtol": 1e-15})]:
        run = solver(name).prepare(problem, **options)()
        assert run.status == "ok", (name, run.reason)
        assert [(t.kind, t.surface, t.to_mode) for t in run.transitions] == [("release", 0, (-1, rub))]
        assert run.transitions[0].time == pytest.approx(1.5, abs=1e-9)
        assert run.end_mode == (-1, rub)
    proof = certify(problem)
    assert (proof.status, [t.to_mode for t in proof.transitions]) == ("certified", [(-1, rub)])
    assert [e.after for e in simulate(problem, 224).events] == [(-1, rub)]


def test_their_velocities_may_cross() -> None:
    """At t = pi/2, whatever static friction there is: nothing makes them stay together."""
    run = solver("henon").prepare(given("0.2 + cos(t)", "0.2"), rtol=1e-13)()
    crossings = [t for t in run.transitions if t.surface == 1]
    assert [t.kind for t in crossings] == ["crossing"]
    assert crossings[0].time == pytest.approx(float(sp.pi / 2), abs=1e-13)


def test_between_two_fixed_bodies_there_is_no_friction() -> None:
    text = """scene:
  bodies: {m: {mass: 1}, floor: fixed, wall: {fixed: 1}}
  connections:
    - friction: {between: [floor, wall], law: coulomb, force: 1}
initial: {x_m: 1.2, v_m: 0.2}
until: 4
"""
    with pytest.raises(CaseError, match="has no effect: both are fixed"):
        read_problem(text)
