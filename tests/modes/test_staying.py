"""Rest exactly on a kink: the motion that both sides agree in, by closed forms, the same on every route."""

from __future__ import annotations

import math

import pytest
from multiprecision import multiprecision
from problems import HEAD, read_problem

import henon_ref as hr
from henon_ref.casefile.case import parse_case
from henon_ref.harness.registry import solver
from henon_ref.harness.truth.compute import compute

SOLVERS = pytest.mark.parametrize("name", ["henon", "henon-rk4", "scipy-dop853", "cvode-bdf@offset"])
"""CVODE by itself takes a guard that begins at zero, and stays there, out of play: it is lifted."""


def system(rate: str, others: str = "") -> str:
    return f'system: {{state: [x, v], field: [v, "{rate}"]{others}}}\ninitial: {{x: 0, v: 0}}\nuntil: 2\n'


def scene(connections: str) -> str:
    return f"""\
scene:
  bodies: {{a: {{mass: 1}}, wall: fixed}}
  connections: [{connections}]
initial: {{x_a: 0, v_a: 0}}
until: 2
"""


STOP = "stop: {between: [a, wall], gap: 0, stiffness: 1}"
AT_REST = [
    pytest.param(system("-abs(x)"), id="abs"),
    pytest.param(system("-100*max(0, x)"), id="a spring on one side"),
    pytest.param(scene(STOP), id="at the gap of a stop"),
    pytest.param(scene(STOP.replace("1}", "1, damping: 3}")), id="at the gap of a damped stop"),
    pytest.param(scene(f"{STOP}, stop: {{between: [wall, a], gap: 0, stiffness: 1}}"), id="between two stops"),
    pytest.param(scene("friction: {between: [a, wall], law: coulomb, force: 1, normal: x_a}"), id="without a load"),
]
LEFT = [
    pytest.param(system("-abs(x) + max(0, t - 1)"), 1 - math.sin(1), 1 - math.cos(1), [1], id="above, slowly"),
    pytest.param(system("-abs(x) + piecewise(0, t < 1, 1)"), 1 - math.cos(1), math.sin(1), [1], id="above"),
    pytest.param(system("-abs(x) - piecewise(0, t < 1, 1)"), 1 - math.cosh(1), -math.sinh(1), [0, 1], id="below"),
    pytest.param(scene(f"{STOP}, force: {{on: a, value: 'max(0, t - 1)'}}"), 1 / 6, 1 / 2, [1], id="off a stop"),
    pytest.param(
        scene(f"{STOP}, force: {{on: a, value: '-max(0, t - 1)'}}"),
        math.sin(1) - 1,
        math.cos(1) - 1,
        [0, 1],
        id="into a stop",
    ),
]


def settings(name: str) -> dict[str, float]:
    return {"step": 1e-3} if name == "henon-rk4" else {"rtol": 1e-11, "atol": 1e-12}


@SOLVERS
@pytest.mark.parametrize("text", AT_REST)
def test_rest_on_a_kink_is_no_event(name: str, text: str) -> None:
    run = solver(name).prepare(read_problem(text), **settings(name))()
    assert (run.status, len(run.transitions), run.end_time) == ("ok", 0, 2)
    assert run.end_state == (0, 0)


@SOLVERS
@pytest.mark.parametrize(("text", "x", "v", "surfaces"), LEFT)
def test_a_kink_is_left_as_soon_as_something_pushes(
    name: str, text: str, x: float, v: float, surfaces: list[int]
) -> None:
    """The kink is crossed where it is left to the other side than that of the sign +1, which it rests with."""
    run = solver(name).prepare(read_problem(text), **settings(name))()
    assert run.status == "ok"
    assert sorted(t.surface for t in run.transitions) == surfaces
    assert {t.kind for t in run.transitions} == {"crossing"}
    assert [float(t.time) for t in run.transitions] == pytest.approx([1] * len(surfaces), abs=1e-11)
    assert run.end_state == pytest.approx((x, v), abs=1e-8)


@pytest.mark.parametrize("text", AT_REST)
def test_the_truth_rests_too(text: str) -> None:
    pytest.importorskip("heyoka")  # the proof alone goes no further than it can certify
    own = parse_case(HEAD + text)
    found = compute(own, own.readings[0])
    assert (found.status, found.transitions, float(found.end_digits)) == ("ok", (), 2)


@pytest.mark.parametrize(("text", "x", "v", "surfaces"), LEFT)
def test_the_multiprecision_route_leaves_as_the_solvers_do(text: str, x: float, v: float, surfaces: list[int]) -> None:
    found = multiprecision(read_problem(text))
    assert found.status == "ok"
    assert sorted(t.surface for t in found.transitions) == surfaces
    assert all(float(t.time_digits) == 1 for t in found.transitions)


MOVING = "t + 1/10 - x"


@SOLVERS
def test_what_moves_along_a_kink_goes_on(name: str) -> None:
    """x = t + 1/10 stays where it is pulled to from both sides, at different rates.

    Rounding puts other methods' steps on either side of it; the reference tells it from a root.
    """
    rate = f"1 + 2*max(0, {MOVING}) - max(0, -({MOVING}))"
    text = f'system: {{state: [x], field: ["{rate}"]}}\ninitial: {{x: 1/10}}\nuntil: 2\n'
    run = solver(name).prepare(read_problem(text), **settings(name))()
    assert run.status == "ok"
    assert run.end_state == pytest.approx((2.1,), abs=1e-9)
    assert name != "henon" or not run.transitions


JUMP = 'system: {state: [x, y], field: ["0", "piecewise(1, x > 0, 2)"]}\ninitial: {x: 0, y: 0}\nuntil: 2\n'
"""Along x = 0 y may rise at 1, at 2, and at every speed between."""


@SOLVERS
def test_where_the_field_jumps_along_the_motion_the_future_is_not_unique(name: str) -> None:
    run = solver(name).prepare(read_problem(JUMP), **settings(name))()
    assert run.status == "nonunique"
    assert run.reason.startswith("the future is not unique at t = 0: kink1=-1 or kink1=+1")


def test_the_truth_says_so_too() -> None:
    pytest.importorskip("heyoka")  # the proof alone goes no further than it can certify
    own = parse_case(HEAD + JUMP)
    found = compute(own, own.readings[0])
    assert (found.status, found.reason) == ("nonunique", "the future is not unique at t = 0: kink1=-1 or kink1=+1")


def test_runs_from_python_and_sweeps_rest_too() -> None:
    """The second run starts by the quick way, a sweep's in one compiled call."""
    spring = hr.System(["x", "v"], {"k": 100}, {}, ["v", "-k*max(0, x)"])
    for _ in range(2):
        run = hr.simulate(spring, {"x": 0, "v": 0}, until=2)
        assert (run.success, len(run.transitions)) == (True, 0)
    assert list(hr.stream(spring, {"x": 0, "v": 0}, until=2)) == []
    table = hr.sweep(
        spring, {"x": 0, "v": 0}, until=2, grid={"k": [1, 100]}, observe=[hr.observe.final_state()], jobs=1
    )
    assert table["status"].tolist() == ["ok"] * 2
    assert table["final_x"].tolist() == [0, 0]


HARD = "stop: {between: [a, wall], gap: 0, restitution: 0.5}"
SOFT = "stop: {between: [a, wall], gap: 0, stiffness: 1, name: soft}"
RISING = "force: {on: a, value: t - 1}"
LATER = "force: {on: a, value: 'max(0, t - 1)'}"


@pytest.mark.parametrize("name", ["henon", "scipy-dop853", "multiprecision"])
@pytest.mark.parametrize(
    ("connections", "lifts"),
    [
        pytest.param(f"{HARD}, {SOFT}, {RISING}", True, id="pressed on a stop at the gap of an elastic one"),
        pytest.param(f"{HARD}, {SOFT}, {LATER}", True, id="without a load"),
        pytest.param(f"{HARD}, {SOFT}", False, id="for ever"),
    ],
)
def test_a_body_at_rest_on_a_stop_beside_a_kink_rests_until_it_is_lifted(
    name: str, connections: str, lifts: bool
) -> None:
    own = read_problem(scene(connections))
    found = multiprecision(own) if name == "multiprecision" else solver(name).prepare(own, rtol=1e-10)()
    told = [(t.kind, t.time) for t in found.transitions if t.surface == 0]
    assert (found.status, found.reason) == ("ok", "")
    assert told == ([("release", pytest.approx(1, abs=1e-9))] if lifts else [])


@pytest.mark.parametrize("name", ["henon", "scipy-dop853"])
def test_a_body_comes_to_rest_on_a_stop_while_another_one_rests_on_a_kink(name: str) -> None:
    text = scene(f"{HARD}, force: {{on: a, value: -1}}, {STOP.replace('[a,', '[b,')}").replace("until: 2", "until: 6")
    text = text.replace("a: {mass: 1}", "a: {mass: 1}, b: {mass: 1}").replace(
        "{x_a: 0, v_a: 0}", "{x_a: 1, v_a: 0, x_b: 0, v_b: 0}"
    )
    found = solver(name).prepare(read_problem(text), rtol=1e-10)()
    last = found.transitions[-1]
    assert (found.status, last.kind, last.surface, found.end_mode[0]) == ("ok", "stick", 0, 0)
    assert last.time == pytest.approx(3 * math.sqrt(2), abs=1e-8)
