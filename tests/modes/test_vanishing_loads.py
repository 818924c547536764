"""Static friction whose normal force passes or touches zero: what holds is held, without a row of its contact."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from multiprecision import multiprecision
from problems import read_problem

from henon_ref.harness.registry import solver
from henon_ref.modes.problem import Problem

ROUTES = pytest.mark.parametrize(
    "route", ["henon 1e-4", "henon 1e-6", "henon 1e-12", "scipy-dop853 1e-9", "multiprecision"]
)


def block(normal: str, force: str = "0", v: float = 0, until: float = 12) -> Problem:
    """A block on the floor, with coefficients of friction 0.3, and 0.5 at rest."""
    return read_problem(f"""\
scene:
  bodies: {{a: {{mass: 1}}, floor: fixed}}
  connections:
    - friction: {{between: [a, floor], law: coulomb, force: 0.3, static: 0.5, normal: "{normal}"}}
    - force: {{on: a, value: "{force}"}}
initial: {{x_a: 0, v_a: {v}}}
until: {until}
""")


def stack(floor: str, between: str, force: str = "0", until: float = 12) -> Problem:
    """Two blocks, one on the other: the normal forces on the floor and between them."""
    return read_problem(f"""\
scene:
  bodies: {{a: {{mass: 1}}, b: {{mass: 2}}, floor: fixed}}
  connections:
    - friction: {{between: [a, floor], law: coulomb, force: 0.3, static: 0.5, normal: "{floor}"}}
    - friction: {{between: [a, b], law: coulomb, force: 0.3, static: 0.5, normal: "{between}"}}
    - force: {{on: a, value: "{force}"}}
initial: {{x_a: 0, v_a: 0, x_b: 0, v_b: 0}}
until: {until}
""")


def changes(route: str, problem: Problem) -> list[tuple[str, str, float]]:
    """Kind, surface and time of what the contacts do, grazes apart, and of the whole run only that it is right."""
    name, _, rtol = route.partition(" ")
    found = multiprecision(problem) if name == "multiprecision" else solver(name).prepare(problem, rtol=float(rtol))()
    assert (found.status, found.reason) == ("ok", "")
    names: Sequence[str] = problem.system.sign_names
    own = [(t.kind, names[t.surface], float(t.time)) for t in found.transitions if t.kind != "graze"]
    return [change for change in own if not change[1].startswith("kink")]


RETURNING = ["cos(t)", "max(0, sin(t - pi/7)/10)", "abs(2.7*cos(1.3*t - 0.3))", "2.7*(sin(pi/3*t) - 1/2)"]


@ROUTES
@pytest.mark.parametrize("normal", RETURNING)
def test_a_block_without_a_force_rests_whatever_presses_it(route: str, normal: str) -> None:
    assert changes(route, block(normal)) == []


@ROUTES
@pytest.mark.parametrize(
    ("floor", "between"),
    [("cos(t)", "1"), ("cos(t)", "cos(t)"), ("2.7*cos(t - 1)", "max(0, 2.7*sin(t - 1))"), ("t - 1", "abs(t - 1)")],
)
def test_two_blocks_without_a_force_rest_on_each_other(route: str, floor: str, between: str) -> None:
    """In the second and the fourth case both normal forces vanish at one instant."""
    assert changes(route, stack(floor, between)) == []


@ROUTES
@pytest.mark.parametrize(
    "problem",
    [
        pytest.param(block("cos(t)^2", "0.4*cos(t)^2"), id="both touch zero"),
        pytest.param(block("abs(cos(2*t))", "-0.45*max(0, cos(2*t))"), id="both return at one instant"),
        pytest.param(block("abs(t - 1)", "0.1*(t - 1)"), id="the force reverses at the instant"),
        pytest.param(stack("max(0, (t - 1)^2)", "abs((t - 1)*(2 - t))", "0.4*(t - 1)^2", 1.5), id="two contacts"),
    ],
)
def test_a_force_that_vanishes_with_the_normal_force_is_held(route: str, problem: Problem) -> None:
    assert changes(route, problem) == []


@ROUTES
@pytest.mark.parametrize(
    ("problem", "expected"),
    [
        # v = -(t - t^2/2)/10 up to t = 1, then -1/20 + (t - 1)^2/5.
        pytest.param(block("t - 1", "(t - 1)/10", until=3), [("stick", 3 / 2)], id="pressed from then on"),
        pytest.param(block("1 - t", "(t - 1)/10", until=3), [("release", 1)], id="free from then on"),
        # v = 1 - 0.3 (t - 1)^2/2 after t = 1.
        pytest.param(block("max(0, t - 1)", v=1, until=6), [("stick", 1 + math.sqrt(20 / 3))], id="it moves"),
    ],
)
def test_what_is_not_held_slips(route: str, problem: Problem, expected: list[tuple[str, float]]) -> None:
    rtol = 1e-30 if route == "multiprecision" else float(route.partition(" ")[2])
    found = [(kind, time) for kind, _, time in changes(route, problem)]
    assert found == [(kind, pytest.approx(time, abs=max(1e-9, 10 * rtol))) for kind, time in expected]


@pytest.mark.parametrize("name", ["henon", "scipy-dop853", "multiprecision"])
@pytest.mark.parametrize(
    ("normal", "force", "end"),
    [
        pytest.param("1 - t", "0", 1.0, id="negative from an instant on"),
        pytest.param("-5", "0", 0.0, id="negative from the start"),
        pytest.param("-5", "1", 0.0, id="the friction exceeds the force"),
        pytest.param("-5", "2", None, id="the force exceeds the friction"),
    ],
)
def test_friction_that_pushes_its_body_along_leaves_both_sides_open(
    name: str, normal: str, force: str, end: float | None
) -> None:
    """A system written without max(0, ...): x'' = force - 0.3 normal s, and s = -1 and s = +1 both lead away from 0."""
    ends = (f"{force} - ({normal})/2", f"{force} + ({normal})/2")
    problem = read_problem(f"""\
system:
  state: [v]
  surfaces: {{s: v}}
  field: ["{force} - 0.3*({normal})*s"]
sliding:
  s:
    field: ["0"]
    entry: inside
    release: [{{when: "{ends[0]}", direction: rising, to: 1}}, {{when: "{ends[1]}", direction: falling, to: -1}}]
initial: {{v: 0}}
until: 2
""")
    found = multiprecision(problem) if name == "multiprecision" else solver(name).prepare(problem, rtol=1e-9)()
    status, time = ("ok", 2.0) if end is None else ("nonunique", end)
    last = float(found.end_digits) if name == "multiprecision" else found.end_time
    assert (found.status, last) == (status, pytest.approx(time, abs=1e-9))
