"""Kinks of a branch that is not in use, where their arguments have no value, have no part in the motion."""

from __future__ import annotations

import math
import random

import pytest
import sympy as sp
from scipy.integrate import solve_ivp

import henon_ref as hr
from henon_ref.casefile.case import parse_case
from henon_ref.expressions.algebra import has_no_value
from henon_ref.harness.registry import solver
from henon_ref.harness.truth.compute import compute

X, V = sp.symbols("x v", real=True)
CASE = """\
schema: 1
name: nested_kink
title: A kink in a branch that is used beyond a surface
source: closed form
system:
  state: [x, v]
  field: ["v", "-1 + {force}"]
initial: {{t: 0, x: 1, v: 0}}
until: {until}
"""
FORCES = [
    "piecewise(0, x > 0, max(sqrt(-x), 1))",
    "piecewise(0, x > 0, abs(log(-x)))",
    "piecewise(0, x > 0, piecewise(1, sqrt(-x) > 2, 3))",
    "piecewise(0, x > 0, min(1, (-x)^(-1/2)))",
    "piecewise(0, x > 0, sign((-2*x)^(3/2) - v))",
    "piecewise(0, x > 0, max(sqrt(-x - 1/2), min(log(-3*x), v)))",
    "max(0, piecewise(-1, x > 0, abs(sqrt(-x) - 1)))",
]
BRANCH = "piecewise(0, x > 0, sqrt(-x))"
"""Without a kink: the branch itself has no value."""
LAND = math.sqrt(2)
"""Free fall from x = 1 with an acceleration of 1 [s]."""


@pytest.mark.parametrize("force", FORCES)
def test_the_fall_is_free_and_the_run_says_why_it_ends(force: str) -> None:
    system = hr.System(["x", "v"], {}, {}, ["v", f"-1 + {force}"])
    before = hr.simulate(system, {"x": 1, "v": 0}, until=1.25)
    assert (before.status, before.y[0, -1]) == ("ok", pytest.approx(1 - 1.25**2 / 2, abs=1e-15))
    assert before.transitions.empty
    behind = hr.simulate(system, {"x": 1, "v": 0}, until=2)
    assert (behind.status, behind.t[-1]) == ("failed", pytest.approx(LAND, abs=1e-15))
    assert "the field uses a kink whose sign is undecided" in behind.message


@pytest.mark.parametrize("force", [FORCES[0], BRANCH])
@pytest.mark.parametrize("name", ["henon", "heyoka", "scipy-dop853", "cvode-adams"])
def test_solvers_fall_freely(name: str, force: str) -> None:
    problem = parse_case(CASE.format(force=force, until=1.25)).readings[0].problem
    found = solver(name).prepare(problem, rtol=1e-12)()
    assert (found.status, tuple(found.transitions)) == ("ok", ())
    assert found.end_state[0] == pytest.approx(1 - 1.25**2 / 2, abs=1e-10)


def test_the_truth_reaches_the_contact_and_says_why_it_ends() -> None:
    case = parse_case(CASE.format(force=FORCES[0], until=1.25))
    assert compute(case, case.readings[0]).certified
    case = parse_case(CASE.format(force=FORCES[0], until=2))
    truth = compute(case, case.readings[0])
    assert (truth.status, truth.transitions) == ("failed", ())
    assert f"the field uses a kink whose sign is undecided: it has no value before t = {str(LAND)[:15]}" in truth.reason
    pytest.importorskip("heyoka")  # the proof alone says it in other words
    case = parse_case(CASE.format(force=BRANCH, until=2))
    truth = compute(case, case.readings[0])
    assert [float(transition.time) for transition in truth.transitions] == pytest.approx([LAND], abs=1e-15)
    assert "not finite" in truth.reason


def unused(rng: random.Random, depth: int) -> str:
    """An expression that has no value where x > 0, with kinks in it."""
    below = f"({rng.choice([-1, -2, -0.5])}*x - {rng.choice([0, 0, 1, 0.25])})"
    root = rng.choice([f"sqrt({below})", f"log({below})", f"({below})^(-1/2)", f"({below})^(5/3)", f"1/log({below})"])
    if depth == 0:
        return f"({root} + {rng.choice(['v', 't', '1', 'cos(v)'])})"
    one, other = unused(rng, depth - 1), rng.choice([unused(rng, depth - 1), "v", "1/2", "x*v"])
    return rng.choice(
        [
            f"max({one}, {other})",
            f"min({other}, {one})",
            f"abs({one})",
            f"sign({one})*v",
            f"piecewise({other}, {one} > v, {root})",
        ]
    )


@pytest.mark.parametrize("seed", range(10))
def test_random_kinks_of_a_branch_that_is_not_in_use(seed: int) -> None:
    """The motion is that of the branch in use, written by hand and integrated by SciPy."""
    rng = random.Random(seed)
    a, b = rng.uniform(0.5, 2), rng.uniform(-0.3, 0.3)
    text = f"piecewise(-{a}*(x - 2) + {b}*v*v, x > 0, {unused(rng, rng.choice([1, 1, 2]))})"
    run = hr.simulate(hr.System(["x", "v"], {}, {}, ["v", text]), {"x": 2.5, "v": 0.25}, until=4)
    own = solve_ivp(
        lambda t, y: [y[1], -a * (y[0] - 2) + b * y[1] ** 2], (0, 4), [2.5, 0.25], "DOP853", rtol=1e-12, atol=1e-12
    )
    assert own.y[0].min() > 0
    assert (run.status, run.transitions.empty) == ("ok", True), run.message
    assert run.y[:, -1] == pytest.approx(own.y[:, -1], abs=1e-9)


@pytest.mark.parametrize(
    ("expression", "positive", "none"),
    [
        (sp.sqrt(-X) - 1, X, True),
        (sp.log(-3 * X - 2) * V, X, True),
        (sp.sqrt(1 - X), X, False),
        (sp.sqrt(X), X, False),
        (sp.sqrt(4 - 4 * X**2 - V), X**2 + V / 4 - 1, True),
        ((-X) ** -2, X, False),
        (sp.Pow(-X, sp.Rational(-1, 2)), X, True),
        (sp.sqrt(-V), X, False),
    ],
)
def test_where_an_expression_has_no_value(expression: sp.Expr, positive: sp.Expr, none: bool) -> None:
    assert has_no_value(expression, [positive]) is none


@pytest.mark.parametrize("start", [-0.5, -4])
def test_a_start_in_the_branch_itself_is_refused_where_it_has_no_value(start: float) -> None:
    system = hr.System(["x"], {}, {}, ["piecewise(0, x > 0, max(sqrt(-x - 1), 1))"])
    if start < -1:
        assert hr.simulate(system, {"x": start}, until=1).status == "ok"
        return
    with pytest.raises(hr.HenonRefError, match="'kink2' has no finite real value at the start"):
        hr.simulate(system, {"x": start}, until=1)


OPEN = [
    ("piecewise(0, x > 0, max(sqrt(-v), 1))", 0.5),
    ("piecewise(0, x > 0, max(sqrt(-v), 1))", 0),
    ("piecewise(0, x > 0, piecewise(1, sqrt(-v) > 2, 3))", 0.25),
    ("piecewise(0, x > 0, abs(log(v) - 1))", -0.5),
    ("piecewise(0, x > 0, min(1, (3/10 - v)^(3/2)))", 0.5),
    ("piecewise(0, x > 0, sign(asin(v + 1) - x))", 0.5),
]
"""What has a value for some states beyond the surface, and none at the start: its form does not show it."""


@pytest.mark.parametrize(("force", "speed"), OPEN)
def test_a_start_without_the_value_of_a_kink_beyond_is_accepted(force: str, speed: float) -> None:
    system = hr.System(["x", "v"], {}, {}, ["v", f"-1 + {force}"])
    land = speed + math.sqrt(speed**2 + 2)
    before, behind = (hr.simulate(system, {"x": 1, "v": speed}, until=until) for until in (0.9 * land, 2 * land))
    assert (before.status, before.transitions.empty) == ("ok", True)
    assert before.y[0, -1] == pytest.approx(1 + speed * 0.9 * land - (0.9 * land) ** 2 / 2, abs=1e-14)
    assert (behind.status, behind.t[-1]) == ("failed", pytest.approx(land, abs=1e-14))
    assert "the field uses a kink whose sign is undecided: it had no value at the start" in behind.message


def test_a_start_with_the_value_goes_on_through_the_surface() -> None:
    """Below -1 the speed's root is above 1: x'' = -1 + sqrt(-v) beyond the surface."""
    system = hr.System(["x", "v"], {}, {}, ["v", f"-1 + {OPEN[0][0]}"])
    run = hr.simulate(system, {"x": 1, "v": -2}, until=2)
    free = hr.simulate(system, {"x": 1, "v": 0.5}, until=1)  # in between, a start without it
    assert (free.status, run.status) == ("ok", "ok")
    again = hr.simulate(system, {"x": 1, "v": -2}, until=2)
    assert run.y.tolist() == again.y.tolist()
    assert run.transitions.kind.tolist() == ["crossing"]


@pytest.mark.parametrize("name", ["henon", "heyoka", "scipy-dop853", "cvode-adams"])
def test_solvers_and_the_truth_accept_such_a_start(name: str) -> None:
    case = parse_case(CASE.format(force=OPEN[0][0], until=1.25).replace("v: 0}", "v: 1/2}"))
    found = solver(name).prepare(case.readings[0].problem, rtol=1e-12)()
    assert (found.status, tuple(found.transitions)) == ("ok", ())
    assert found.end_state[0] == pytest.approx(1 + 1.25 / 2 - 1.25**2 / 2, abs=1e-10)
    if name == "henon":
        assert compute(case, case.readings[0]).certified
