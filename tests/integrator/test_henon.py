"""The reference integrator against closed forms and certified digits (FACTS of the classic systems)."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from multiprecision import simulate
from problems import make_problem
from runs import kinds, run, times

from henon_ref.baselines.henon import HENON_BRENT, HENON_NEWTON, HENON_SOLVER
from henon_ref.baselines.scipy_ivp import DOP853
from henon_ref.casefile.case import load_case
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.run import Run

CASES = Path(__file__).parents[2] / "cases"
SOLVERS = [HENON_SOLVER, HENON_NEWTON, HENON_BRENT]


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda s: s.name)
def test_free_coulomb_turns_at_multiples_of_pi_and_sticks_for_good(solver) -> None:
    result = run(make_problem("x v", ["v", "-x - 3*s/5"], {"s": "v"}, ["53/10", 0], 20), solver=solver)
    assert result.status == "ok"
    assert kinds(result) == ["crossing", "crossing", "crossing", "stick"]
    np.testing.assert_allclose(times(result), math.pi * np.arange(1, 5), rtol=3e-16)
    assert result.end_state == pytest.approx((0.5, 0.0), abs=4e-15)


def test_a_slide_is_left_at_its_tangent_point() -> None:
    result = run(make_problem("x", ["t - s"], {"s": "x"}, [0], 3))
    assert kinds(result) == ["release"]
    assert result.transitions[0].time == 1.0
    assert result.end_state == (2.0,)


@pytest.mark.parametrize("rtol", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_a_loose_tolerance_leaves_tangent_points_as_a_tight_one(rtol: float) -> None:
    """Fig. 8: a slide that ended a little beside its tangent point would begin anew at once (210 events, not 126)."""
    case = load_case(CASES / "fig8.yaml")
    (reading,) = [r for r in case.readings if r.name == "listing_limit"]
    found = HENON_SOLVER.prepare(reading.problem, rtol=rtol)()
    exact = HENON_SOLVER.prepare(reading.problem, rtol=1e-13)()
    assert kinds(found) == kinds(exact)
    assert max(abs(a.time - b.time) for a, b in zip(found.transitions, exact.transitions, strict=True)) < rtol


def test_stribeck_belt_periods() -> None:
    field = ["v", "-x - s/(1 + 3*s*(v - 1/5))"]
    result = run(make_problem("x v", field, {"s": "v - 1/5"}, [1, "1/5"], 120))
    assert kinds(result)[:4] == ["stick", "release", "stick", "release"]
    durations = np.diff(times(result))
    np.testing.assert_allclose(durations[0::2], 7.705031769350, atol=1e-12)
    np.testing.assert_allclose(durations[1::2], 4.295999525480, atol=1e-12)


def test_twisting_accumulates_and_ends_with_a_clear_word() -> None:
    result = run(make_problem("a b", ["b", "-2*s - u"], {"s": "a", "u": "b"}, [0, "3/2"], 5))
    assert result.status == "failed"
    assert "accumulate" in result.reason
    assert result.end_time == pytest.approx(3.2320508075688776, rel=4e-16)
    assert len(result.transitions) > 50


@pytest.mark.parametrize(
    ("field", "surface", "words"),
    [
        (["1", "0"], "exp(exp(x)) - 1/2", "the surface of s is not finite there"),
        (["1", "0"], "sqrt(1 - x) + 1", "the surface of s is singular there"),
        (["1", "sqrt(1 - x)"], "x + 1", "the field of y is "),
        (["y", "1 + x**(7/3)"], "x + 1", "the field of y is singular there"),
    ],
)
def test_a_run_that_stalls_says_what_is_not_finite(field: list[str], surface: str, words: str) -> None:
    result = run(make_problem("x y", field, {"s": surface}, [0, 0], 10))
    assert result.status == "failed"
    assert words in result.reason


def test_a_model_that_ends_is_invalid() -> None:
    result = run(make_problem("x", ["1"], {"s": "x - 2"}, [0], 3, valid=["1 - x"]))
    assert result.status == "invalid"
    assert result.end_time == 1.0


@pytest.mark.parametrize("start", [10**9, -(10**9)])
def test_late_times_lose_no_digits(start: int) -> None:
    problem = make_problem("x v", ["v", "-x - 3*s/5"], {"s": "v"}, ["53/10", 0], start + 20, start=start)
    result = run(problem)
    shifted = [(q.time - start) + q.time_low for q in result.transitions]
    np.testing.assert_allclose(shifted, math.pi * np.arange(1, 5), rtol=1e-15)


@pytest.mark.parametrize("length", [-9, 0, 9])
@pytest.mark.parametrize("unit", [-9, 0, 9])
def test_units_do_not_matter(length: int, unit: int) -> None:
    """x in units of 10^length, t in units of 10^unit: the same digits."""
    a, b = f"10**({length})", f"10**({unit})"
    field = ["v", f"-x/({b})**2 - 3*s*({a})/({b})**2/5"]
    problem = make_problem("x v", field, {"s": "v"}, [f"53*({a})/10", 0], f"20*({b})")
    scaled = times(run(problem)) / 10.0**unit
    np.testing.assert_allclose(scaled, math.pi * np.arange(1, 5), rtol=1e-15)


def test_samples_lie_on_the_trajectory() -> None:
    problem = make_problem("x v", ["v", "-x - 3*s/5"], {"s": "v"}, ["53/10", 0], 20)
    wanted = np.linspace(0, 3, 50)
    result = run(problem, sample_times=wanted)
    np.testing.assert_allclose(result.samples[:, 0], 0.6 + 4.7 * np.cos(wanted), rtol=0, atol=1e-14)


@pytest.mark.parametrize("gap", ["10**(-10)", "-10**(-16)", "0"])
def test_samples_before_an_event_that_takes_a_closer_look_are_of_their_own_time(gap: str) -> None:
    problem = make_problem("x v", ["v", "-x"], {"s": f"1 - {gap} - x"}, [0, 1], 3)
    wanted = np.linspace(0, 3, 50)
    result = run(problem, sample_times=wanted)
    np.testing.assert_allclose(result.samples[:, 0], np.sin(wanted), rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("valid", "status", "end"),
    [
        ("t", "ok", 2),
        ("t**2", "ok", 2),
        ("t**2*(1 - t)", "invalid", 1),
        ("-t", "invalid", 0),
        ("-t**2", "invalid", 0),
        ("x - t", "invalid", 0),
    ],
)
def test_a_model_whose_edge_the_start_is_on_holds_if_its_expression_rises(valid: str, status: str, end: float) -> None:
    problem = make_problem("x", ["1"], {"s": "x + 5"}, [0], 2, valid=[valid])
    truth = simulate(problem, 128)
    assert (truth.status, float(truth.end_time)) == (status, end)
    for solver in (HENON_SOLVER, DOP853):
        result = run(problem, 1e-9, solver)
        assert (result.status, result.end_time) == (status, pytest.approx(end, abs=1e-12))


@pytest.mark.parametrize(
    ("states", "field", "surface", "start", "words"),
    [
        ("x v", ["v", "-x - s"], "(v - 1/5)**3", [2, 0], "the surface of s has a repeated factor"),
    ],
)
def test_where_no_mode_is_consistent_the_surface_s_part_in_it_is_told(states, field, surface, start, words) -> None:
    problem = make_problem(states, field, {"s": surface}, start, 20)
    truth, result = simulate(problem, 128), run(problem)
    assert truth.status == "failed"
    assert result.status in ("failed", "nonunique")  # rounding decides which, where the gradient vanishes
    assert words in truth.reason
    assert words in result.reason


def test_a_model_without_a_series_where_it_begins_has_failed() -> None:
    result = run(make_problem("x", ["1"], {"s": "x + 5"}, [0], 2, valid=["sqrt(x)"]))
    assert result.status == "failed"


@pytest.mark.parametrize("valid", ["(t - 1)**2", "(t - 1)**4"])
def test_a_model_ends_where_it_only_just_does(valid: str) -> None:
    result = run(make_problem("x", ["1"], {"s": "x - 5"}, [0], 3, valid=[valid]))
    assert result.status == "invalid"
    assert result.end_time == 1.0


def test_runs_of_one_engine_do_not_disturb_each_other() -> None:
    """They share what the compiled loop works on: here two are stopped at each transition, a third hands out blocks."""
    (reading,) = [r for r in load_case(CASES / "fig8.yaml").readings if r.name == "listing_limit"]
    integrator = Integrator(reading.problem.system, 20)
    tight, loose = (integrator.start(reading.problem, tolerance=error) for error in (1e-12, 1e-8))
    alone = [list(Run(integrator, start).to_horizon().transitions) for start in (tight, loose)]
    assert alone[0] != alone[1]
    runs = [Run(integrator, start, block=1) for start in (tight, loose)]
    in_turn = [[run.next_event() for run in runs] for _ in alone[0]]
    assert [list(found) for found in zip(*in_turn, strict=True)] == alone
    stream = Run(integrator, tight, block=10)
    streamed = []
    for block in stream.stream():
        assert list(Run(integrator, loose).to_horizon().transitions) == alone[1]
        streamed += list(block)
    assert streamed == alone[0]
