"""What follows an event."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
import sympy as sp
from flint import ctx
from problems import make_problem
from runs import kinds, run

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.expressions.bounds import exact_sign
from henon_ref.harness import registry
from henon_ref.harness.truth.multiprecision.points import SeriesEvaluation
from henon_ref.modes import mode_evaluation
from henon_ref.modes.arithmetic import DOUBLES
from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import CLEAR, sign_after
from henon_ref.modes.mode_evaluation import in_doubles
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import after_event, contact_orders, initial_mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.series import expand

X, S = sp.symbols("x s", real=True)


def decide(field: list[str], initial: list[str | int], states: str = "x", surfaces: dict[str, str] | None = None):
    return decided(make_problem(states, field, surfaces or {"s": "x"}, initial, 1))


def decided(problem: Problem) -> Decision:
    """In doubles; in balls it is the same."""
    decision = initial_mode(in_doubles(problem.system).at_start(problem), problem)
    with ctx.workprec(160):
        in_balls = initial_mode(SeriesEvaluation(problem.system, 128).at_start(problem), problem)
    assert (in_balls.status, in_balls.mode) == (decision.status, decision.mode)
    return decision


def test_attracting_repelling_and_crossing() -> None:
    assert decide(["-s"], [0]).mode == (0,)
    assert decide(["s"], [0]).status == "nonunique"
    assert decide(["2 + s"], [0]).mode == (1,)
    assert decide(["-2 + s"], [0]).mode == (-1,)


def test_a_tangency_is_decided_by_the_next_derivative() -> None:
    """At x = 0, t = 0 one field is tangent: visible (it leaves) or invisible (it slides)."""
    assert decide(["t + 1 - s"], [0]).mode == (1,)
    assert decide(["-t + 1 - s"], [0]).mode == (0,)
    assert decide(["-t**3 + 1 - s"], [0]).mode == (0,)


def test_where_the_gradient_vanishes_fields_that_lead_through_the_surface_cross() -> None:
    """x' = 2 + s runs on at x = 1, however the surface is written; a slide would have the sign -2 (0/0 here)."""
    for surface in ("x - 1", "(x - 1)**3", "(x - 1)**5*(1 + x)"):
        assert decide(["2 + s"], [1], surfaces={"s": surface}).mode == (1,)
        assert decide(["-s"], [1], surfaces={"s": surface}).mode == (0,)


def test_off_the_surface_the_sign_is_exact() -> None:
    assert decide(["-s"], ["10**(-40)"]).mode == (1,)
    assert decide(["-s"], ["-10**(-200)"]).mode == (-1,)
    assert decide(["-s"], ["sqrt(2)**2 - 2"]).mode == (0,)
    assert exact_sign(sp.sqrt(3) / 9 - sp.Rational(1, 3) / sp.sqrt(3)) == 0


def test_all_contacts_rest_or_some_move() -> None:
    field = ["v1", "v2", "-2*q1 + q2 - 3*s/10", "q1 - 2*q2 - 3*u/10"]
    surfaces = {"s": "v1", "u": "v2"}
    assert decide(field, ["1/20", 0, 0, 0], "q1 q2 v1 v2", surfaces).mode == (0, 0)
    assert decide(field, [1, 0, 0, 0], "q1 q2 v1 v2", surfaces).mode == (-1, 1)


def test_a_surface_that_no_sign_acts_on_does_not_keep_the_others_from_being_searched() -> None:
    """Five at once: sliding on all of them has no equations, for nothing holds z."""
    names = "x y z p q"
    field = ["(3 + s)/2", "(3 + u)/2", "1", "(3 + r)/2", "(1 - 3*k)/4"]
    system = make_problem(names, field, dict(zip("suwrk", names.split(), strict=True)), [-1] * 5, 2).system
    hits = [g for g in system.equations((-1,) * 5).guards if g.kind == "surface"]
    decision = after_event(in_doubles(system).at(1.0, [0.0] * 5), (-1,) * 5, hits)
    assert decision.mode == (1, 1, 1, 1, 0)


def test_many_contacts_at_rest_are_searched_not_enumerated() -> None:
    n = 9
    field = [f"v{i}" for i in range(n)] + [("1" if i == 3 else "0") + f" - s{i}/2" for i in range(n)]
    states = " ".join([f"q{i}" for i in range(n)] + [f"v{i}" for i in range(n)])
    decision = decide(field, [0] * (2 * n), states, {f"s{i}": f"v{i}" for i in range(n)})
    assert decision.mode == tuple(1 if i == 3 else 0 for i in range(n))


def test_a_given_mode_settles_an_open_start_and_a_wrong_one_is_refused() -> None:
    problem = make_problem("x", ["s"], {"s": "x"}, [0], 1)
    given = replace(problem, initial_mode={0: 1})
    wrong = replace(problem, initial=(sp.Integer(2),), initial_mode={0: -1})
    right, refused = decided(given), decided(wrong)
    assert (right.mode, refused.status) == ((1,), "invalid")


def test_contact_orders_count_the_zeros_of_h() -> None:
    problem = make_problem("x v", ["v", "t - 1 + s"], {"s": "x"}, [0, 0], 1)
    at = in_doubles(problem.system).at
    assert contact_orders(at(0.0, [0.0, 1.0]), (1,), [0]) == [1]
    assert contact_orders(at(0.5, [0.0, 0.0]), (1,), [0]) == [2]
    assert contact_orders(at(0.5, [0.0, 1e-17]), (1,), [0]) == [2]  # a speed that rounding has left
    assert contact_orders(at(0.0, [0.0, 0.0]), (1,), [0]) == [3]
    assert contact_orders(at(0.0, [0.0, 0.0]), (1,), []) == [0]


def test_a_run_does_not_live_on_what_an_earlier_one_worked_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two surfaces are met at once, at the same point in every run: each run makes the expansions it needs.

    Their signs multiply each other, so that no machine code decides the mode.
    """
    problem = make_problem("x y", ["(3 + s*u)/2", "(3 + s*u)/2 + y - x"], {"s": "x", "u": "y"}, [-1, -1], 2)
    made = 0

    def counted(*arguments: Any) -> Any:
        nonlocal made
        made += 1
        return expand(*arguments)

    monkeypatch.setattr(mode_evaluation, "expand", counted)
    for solver in (HENON_SOLVER, registry.solver("scipy-dop853")):
        run = solver.prepare(problem, rtol=1e-9)
        counts = []
        for _ in range(3):
            made = 0
            run()
            counts.append(made)
        assert counts[0] > 0
        assert len(set(counts[1:])) == 1
        assert counts[1] > 0


def test_a_rate_that_has_no_powers_makes_no_number_overflow() -> None:
    assert DOUBLES.leading([1e-78, 0.0, 3.0, -0.27, -1.2, 0.068, 0.17, -0.0068, -0.013], 1, 1e39, 0.0, 1e-11) == 2


def test_a_slope_that_rounding_has_left_is_no_scale() -> None:
    """At rest where the force vanishes, too."""
    states = [[1.0, -1e-78, 0.0, 1.0, 0.1, 0.0, 0.0, 0.0, 0.1], [-1e-78, 0.0, 3.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.8]]
    assert 0.1 < DOUBLES.rate(states) < 10
    guard = [1e-78, 0.0, 3.0, -0.27, -1.2, 0.068, 0.17, -0.0068, -0.013]
    assert DOUBLES.leading(guard, 1, DOUBLES.rate(states), 0.0, 1e-11) == 2
    fast = [[0.0, 1e-3, 0.0, -1.7e8, 0.0, 8.3e18, 0.0, -2e29, 0.0]]
    assert DOUBLES.rate(fast) == pytest.approx(4.1e5, rel=0.1)


@pytest.mark.parametrize("time", [3.0, math.pi, 3.2, 3 * math.pi, 9 * math.pi])
def test_a_load_that_pulsates_down_to_nothing_holds(time: float) -> None:
    """At pi rounding leaves a force of 1e-16 of either slip, with the sign of the rounding."""
    system = make_problem("x v", ["v", "-(1 + cos(t))*s"], {"s": "v"}, [0, 0], 12).system
    held = after_event(in_doubles(system).at(time, [0.0, 0.0]), (0,), list(system.equations((0,)).guards))
    assert held.mode == (0,)


@pytest.mark.parametrize("excess", ["1e-10", "1e-12"])
def test_a_force_barely_above_friction_is_no_stick(excess: str) -> None:
    result = run(make_problem("v", [f"1 - (1 - {excess})*s"], {"s": "v"}, ["-1"], 2), rtol=1e-9)
    assert kinds(result) == ["crossing"]


@pytest.mark.parametrize("below", [-2, 1, sp.Rational(1, 10**6)])
@pytest.mark.parametrize("above", [-1, 3, -sp.Rational(1, 10**6)])
def test_the_signs_say_what_the_search_of_modes_finds(below, above):
    field = (below * (1 - S) + above * (1 + S)) / 2
    system = FilippovSystem((X,), (S,), (X,), (field,))
    sign = sign_after(float(below), float(above))
    assert (sign is None) == (below < 0 < above)
    if sign is None:
        return
    for mode in ((-1,), (1,)):
        (hit,) = (g for g in system.equations(mode).guards if g.kind == "surface")
        assert isinstance(hit, Guard)
        assert after_event(in_doubles(system).at(0.0, (0.0,)), mode, [hit]).mode == (sign,)


@pytest.mark.parametrize("velocity", [0.0, 0.5 * CLEAR, -0.5 * CLEAR, math.nan])
def test_a_velocity_near_zero_decides_nothing(velocity):
    for other in (-1.0, 1.0):
        assert sign_after(velocity, other) is sign_after(other, velocity) is None
