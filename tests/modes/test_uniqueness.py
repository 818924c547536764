"""Uniqueness at a surface, against the closed-form list of Filippov's solutions.

x' = p(t) above x = 0 and q(t) below it. From x = 0 a solution leaves upwards if p > 0 just after the point, downwards
if q < 0, and x = 0 is one if p q <= 0. Each of them counts, also x = 0 beside a solution that leaves.
"""

from __future__ import annotations

from itertools import product

import pytest
import sympy as sp
from flint import ctx
from multiprecision import multiprecision
from problems import make_problem, read_problem

from henon_ref.harness.registry import solver
from henon_ref.harness.truth.multiprecision.points import SeriesEvaluation
from henon_ref.modes.decision import Decision
from henon_ref.modes.mode_evaluation import in_doubles
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import initial_mode
from henon_ref.taylor.tape import TIME as T

SOLVERS = pytest.mark.parametrize("name", ["henon", "scipy-dop853", "multiprecision"])
RATES = [sp.S.Zero, *(way * T**k for k in range(4) for way in (1, -1))]


def decided(problem: Problem) -> Decision:
    """The decision at the start, the same in doubles and in balls."""
    decision = initial_mode(in_doubles(problem.system).at_start(problem), problem)
    with ctx.workprec(160):
        in_balls = initial_mode(SeriesEvaluation(problem.system, 128).at_start(problem), problem)
    assert (in_balls.status, in_balls.mode) == (decision.status, decision.mode)
    return decision


def field_of(p: sp.Expr, q: sp.Expr) -> str:
    return f"{sp.expand((p + q) / 2)} + ({sp.expand((p - q) / 2)})*s"


def solutions(p: sp.Expr, q: sp.Expr) -> list[int]:
    """Sides on which solutions leave the surface, 0 for one that stays; p and q are powers of time."""
    above, below = (sp.sign(rate.subs(T, 1)) for rate in (p, q))
    return [*([1] if above > 0 else []), *([-1] if below < 0 else []), *([0] if above * below <= 0 else [])]


def finished(name: str, problem: Problem) -> tuple[str, float]:
    if name == "multiprecision":
        found = multiprecision(problem)
        return found.status, float(found.end_digits)
    run = solver(name).prepare(problem, rtol=1e-10)()
    return run.status, float(run.end_time)


@pytest.mark.parametrize(("p", "q"), [pair for pair in product(RATES, repeat=2) if pair[0] != pair[1]])
def test_a_start_on_a_surface_counts_all_solutions(p: sp.Expr, q: sp.Expr) -> None:
    first_order = decided(make_problem("x", [field_of(p, q)], {"s": "x"}, [0], 1))
    second_order = decided(make_problem("x v", ["v", field_of(p, q)], {"s": "x"}, [0, 0], 1))
    found = solutions(p, q)
    if len(found) > 1:
        assert first_order.status == second_order.status == "nonunique"
        return
    assert first_order.status == "unique"
    if found != [0]:
        assert first_order.mode == second_order.mode == (found[0],)
    elif p * q != 0:  # no mode of the second-order system slides
        assert (first_order.mode, second_order.status) == ((0,), "none")
    else:  # x = 0 is the motion of the side without force
        assert second_order.mode == ((1,) if p == 0 else (-1,))


@SOLVERS
@pytest.mark.parametrize(
    ("field", "end"),
    [
        pytest.param("1 + s", 0.0, id="from the start"),
        pytest.param("(t - 1)*(1 + s)", 1.0, id="a slide whose upper side begins to lead away"),
        pytest.param("max(0, t - 1)*(1 + s)/2 + max(0, 1 - t)*(1 - s)/2", 1.0, id="both sides change at one instant"),
        pytest.param("(t - 1)*(1 + s)/2 + max(0, 1 - t)*(1 - s)/2", 1.0, id="one side ends in a kink"),
        pytest.param("piecewise(1, x > 0, 0)", 0.0, id="a jump written as such"),
    ],
)
def test_a_solution_that_stays_beside_one_that_leaves_ends_a_run(name: str, field: str, end: float) -> None:
    surfaces = ", surfaces: {s: x}" if "s)" in field or field == "1 + s" else ""
    problem = read_problem(f'system: {{state: [x], field: ["{field}"]{surfaces}}}\ninitial: {{x: 0}}\nuntil: 2\n')
    assert finished(name, problem) == ("nonunique", pytest.approx(end, abs=1e-9))


@SOLVERS
@pytest.mark.parametrize("count", [1, 3, 4, 6])
def test_beside_other_slides_too(name: str, count: int) -> None:
    """Four surfaces and more share their equations."""
    names = [f"x{i}" for i in range(count)]
    field = ["(t - 1)*(1 + s0)/2", *(f"-s{i}" for i in range(1, count))]
    problem = make_problem(" ".join(names), field, {f"s{i}": x for i, x in enumerate(names)}, [0] * count, 2)
    assert finished(name, problem) == ("nonunique", pytest.approx(1, abs=1e-9))


@pytest.mark.parametrize("name", ["henon", "multiprecision"])
@pytest.mark.parametrize(("below", "status"), [("0", "nonunique"), ("1", "ok"), ("(t - 1)^2", "ok")])
def test_a_touch_is_passed_if_the_other_side_leads_back(name: str, below: str, status: str) -> None:
    """x = (t - 1)^2 touches 0; with no velocity below, x = 0 is a solution from there on."""
    field = f"(t - 1)*(1 + s) + ({below})*(1 - s)/2"
    text = f'system: {{state: [x], surfaces: {{s: x}}, field: ["{field}"]}}\ninitial: {{x: 1}}\nuntil: 2\n'
    assert finished(name, read_problem(text)) == (status, pytest.approx(1 if status != "ok" else 2, abs=1e-9))


def test_derivatives_of_high_order_decide() -> None:
    """Below, x' = t^9 leads back to the surface, and -t^9 away from it."""
    above, below = sp.S.One, T**9
    assert decided(make_problem("x", [field_of(above, below)], {"s": "x"}, [0], 1)).mode == (1,)
    assert decided(make_problem("x", [field_of(above, -below)], {"s": "x"}, [0], 1)).status == "nonunique"
    assert decided(make_problem("x", [field_of(3 * below, below)], {"s": "x"}, [0], 1)).mode == (1,)


def test_one_motion_of_several_modes_is_one_solution() -> None:
    """x' = s - 1 stays at 0 in slip above it and in sliding (the sign 1); x' = 0 there stays in all three modes."""
    assert decided(make_problem("x", ["1 - s"], {"s": "x"}, [0], 1)).mode == (0,)
    assert decided(make_problem("x y", ["1 - s", "s"], {"s": "x"}, [0, 0], 1)).mode == (0,)
    assert decided(make_problem("x y", ["0", "s"], {"s": "x"}, [0, 0], 1)).status == "nonunique"


def test_signs_that_no_state_has_are_no_solution() -> None:
    """With s = +1 and u = -1 both fields would stay at 0, but these signs of x and 2 x, x and x - y, never meet."""
    assert decided(make_problem("x", ["3 + s - 2*u"], {"u": "x", "s": "2*x"}, [0], 1)).mode == (1, 1)
    assert decided(make_problem("x", ["1 - s + 2*u + 1"], {"u": "x", "s": "2*x"}, [0], 1)).mode == (1, 1)
    rate = "(3 - s + u + w)"
    surfaces = {"s": "x", "u": "y", "w": "x - y"}
    assert decided(make_problem("x y", [rate, f"2*{rate}"], surfaces, [0, 0], 1)).mode == (1, 1, -1)


def test_two_surfaces_one_of_which_is_left() -> None:
    """x stays at 0 below it (s = -1), and leaves upwards; y slides or leaves whatever x does."""
    for rate, y in (("-u", 0), ("2 + u", 1)):
        found = decided(make_problem("x y", ["1 + s", rate], {"s": "x", "u": "y"}, [0, 0], 1))
        assert found.status == "nonunique"
        assert found.reason.endswith(f"s=-1 u={y:+d} or s=+1 u={y:+d}" if y else "s=-1 u=0 or s=+1 u=0")


def test_a_slide_without_a_gradient_is_no_solution_that_stays() -> None:
    """Both speeds are 3 beyond, at least 1 before: x = y = 1 is passed. A slide on one of (x - 1)^3 and (y - 1)^3 has
    the sign -3, with which the other one would stay."""
    rate = "2 + (s + u)/2"
    surfaces = {"s": "(x - 1)**3", "u": "(y - 1)**3"}
    assert decided(make_problem("x y", [rate, rate], surfaces, [1, 1], 2)).mode == (1, 1)
