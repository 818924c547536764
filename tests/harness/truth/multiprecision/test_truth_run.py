"""Runs in multiprecision against closed forms, and every way in which a run can end."""

from __future__ import annotations

from typing import Any

import pytest
import sympy as sp
import systems
from flint import arb, ctx
from multiprecision import simulate
from problems import make_problem

from henon_ref.harness.truth.reference import exact_ball
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem

BITS = 256
DIGITS = 1e-70


def times_apart(run: Any, exact: list[sp.Expr]) -> list[float]:
    assert len(run.instants) >= len(exact)
    with ctx.workprec(BITS + 32):
        return [abs(float(e.time - exact_ball(t, BITS))) for (e, *_), t in zip(run.instants, exact, strict=False)]


@pytest.mark.parametrize(
    ("problem", "exact", "modes"),
    [
        pytest.param(systems.leaving_slide(), [sp.Integer(1)], [(1,)], id="leaving a slide"),
        pytest.param(
            systems.free_coulomb(), [k * sp.pi for k in range(1, 5)], [(1,), (-1,), (1,), (0,)], id="free Coulomb"
        ),
        pytest.param(
            systems.static_belt(until="8"),
            [3 * sp.pi / 2, 3 * sp.pi / 2 + 2],
            [(0,), (-1,)],
            id="static above kinetic friction",
        ),
        pytest.param(systems.rotating_crossing(), [sp.Integer(1)], [(1,)], id="crossing on a curved surface"),
    ],
)
def test_closed_forms_come_out_to_70_digits(problem: Problem, exact: list[sp.Expr], modes: list[object]) -> None:
    run = simulate(problem, BITS)
    assert (run.status, run.reason) == ("ok", "")
    assert [e.to_mode for e, *_ in run.instants] == modes
    assert max(times_apart(run, exact)) < DIGITS


def test_a_pair_of_roots_inside_one_step_is_not_stepped_over() -> None:
    """x = (t - 1)^2 - 1e-16 and no mode differs from another: crossings at 1 -+ 1e-8."""
    run = simulate(make_problem("x v", ["v", "2"], {"s": "x"}, ["1 - 10^(-16)".replace("^", "**"), "-2"], 3), BITS)
    assert [e.to_mode for e, *_ in run.instants] == [(-1,), (1,)]
    small = sp.Rational(1, 10**8)
    assert max(times_apart(run, [1 - small, 1 + small])) < 1e-60


def test_an_exact_double_root_is_a_graze_with_all_its_digits() -> None:
    run = simulate(make_problem("x v", ["v", "2"], {"s": "x"}, [1, -2], 3), BITS)
    ((event,),) = run.instants
    assert (event.from_mode, event.to_mode, event.surface, event.rate) == ((1,), (1,), 0, 0)
    assert times_apart(run, [sp.Integer(1)])[0] < DIGITS


def test_a_near_graze_is_told_with_its_distance() -> None:
    run = simulate(make_problem("x v", ["v", "2"], {"s": "x"}, ["1 + 1/10**12", "-2"], 3), BITS)
    assert run.instants == []
    (near,) = run.near_grazes
    assert near.time == pytest.approx(1)
    assert near.distance == pytest.approx(1e-12)


def test_a_start_on_the_surface_does_not_hide_the_next_root() -> None:
    """x = t - t^2 / 2: the root at t = 2, which heyoka misses with a direction (FACTS, section 4)."""
    run = simulate(make_problem("x v", ["v", "-1"], {"s": "x"}, [0, 1], 3), BITS)
    assert [e.to_mode for e, *_ in run.instants] == [(-1,)]
    assert times_apart(run, [sp.Integer(2)])[0] < DIGITS


def test_a_tangential_release_starts_from_a_double_zero() -> None:
    """Slides until t = 1, leaves as (t - 1)^2 / 2 - (t - 1)^3 / 3, returns at t = 5/2."""
    run = simulate(make_problem("x", ["(1 + s)*(t - 1)*(2 - t)/2 - (1 - s)*(t - 2)/2"], {"s": "x"}, [0], 4), BITS)
    assert run.instants[0][0].from_mode == (0,)
    assert run.instants[0][0].to_mode == (1,)
    assert max(times_apart(run, [sp.Integer(1), sp.Rational(5, 2)])) < 1e-60


def test_a_sleeping_drive_is_not_leapt_over() -> None:
    """A pulse at t = 10 whose derivatives at t = 0 are of size exp(-10^4) (scipy#19968)."""
    run = simulate(make_problem("x", ["2*exp(-(10*(t - 10))**2) - s"], {"s": "x"}, [0], 20), BITS)
    assert [e.to_mode for e, *_ in run.instants] == [(1,), (0,)]
    assert times_apart(run, [10 - sp.sqrt(sp.log(2)) / 10])[0] < DIGITS


@pytest.mark.parametrize(("power", "bits"), [(3, 224), (3, 256), (7, 224), (11, 224), (11, 256)])
def test_coefficients_that_are_zero_by_symmetry_limit_no_step(
    power: int,
    bits: int,
) -> None:
    """x'' = -x^n from (0, 1): one coefficient of n + 1 is not zero; the last two are zero, except for n = 3 at 256."""
    run = simulate(make_problem("x v", ["v", f"-x^{power}"], {"s": "v"}, [0, 1], 6), bits)
    part = sp.Rational(1, power + 1)
    quarter = (
        part * (2 * part) ** -part * sp.gamma(part) * sp.gamma(sp.Rational(1, 2)) / sp.gamma(part + sp.Rational(1, 2))
    )
    assert max(times_apart(run, [quarter, 3 * quarter])) < 1e-60


def test_simultaneous_events_are_one_instant() -> None:
    fields = ["-1 + 0*s", "-1/3 + 0*u"]
    run = simulate(make_problem("x y", fields, {"s": "x", "u": "y"}, ["1/3", "1/9"], 1), BITS)
    (instant,) = run.instants
    assert [t.surface for t in instant] == [0, 1]
    assert {(t.from_mode, t.to_mode) for t in instant} == {((1, 1), (-1, -1))}


def test_several_contacts_stick_at_once() -> None:
    run = simulate(systems.three_blocks(), 96)
    assert run.instants[-1][0].to_mode == (0, 0, 0)
    assert len(run.instants) == 8


@pytest.mark.parametrize("until", ["63.3", "1", "0.1"])
def test_a_horizon_between_two_numbers_is_reached(until: str) -> None:
    run = simulate(make_problem("x", ["0*s"], {"s": "x"}, [1], until), 128)
    assert run.status == "ok"
    assert float(run.end_time) == float(until)


@pytest.mark.parametrize("until", ["1", "1/3", "1 + 2**(-52)"])
def test_an_event_at_the_horizon_counts(until: str) -> None:
    run = simulate(make_problem("x", ["(3 + s)/2"], {"s": "x"}, [f"-({until})"], until), BITS)
    assert run.status == "ok"
    assert [e.to_mode for e, *_ in run.instants] == [(1,)]


def test_a_given_mode_that_fails_at_once_changes_at_the_start() -> None:
    run = simulate(make_problem("x", ["-2 + s"], {"s": "x"}, [0], 1, mode={0: 1}), 128)
    ((event,),) = run.instants
    assert (float(event.time), event.from_mode, event.to_mode) == (0.0, (1,), (-1,))


def test_zeno_ends_with_the_accumulation_point() -> None:
    run = simulate(systems.twisting(), 192)
    assert run.status == "failed"
    assert run.accumulates
    assert "accumulate" in run.reason
    q = sp.sqrt(sp.Rational(1, 3))
    exact = sp.Rational(3, 2) * (sp.Rational(1, 3) + 1 / sp.sqrt(3)) / (1 - q)
    assert abs(float(run.end_time) - float(exact)) < 1e-15
    assert len(run.instants) > 100
    assert float(run.instants[-1][0].time - run.instants[-2][0].time) > 0


def test_a_future_that_branches_is_nonunique() -> None:
    run = simulate(systems.spontaneous_switch(), 128)
    assert (run.status, run.instants) == ("nonunique", [])
    assert "not unique" in run.reason


def test_sliding_that_turns_repelling_is_nonunique_from_there() -> None:
    run = simulate(make_problem("x", ["s*(t - 1)"], {"s": "x"}, [0], 2), 128)
    assert run.status == "nonunique"
    assert float(run.end_time) == 1.0


def test_blow_up_ends_at_its_time() -> None:
    run = simulate(systems.blow_up(), 128)
    assert run.status == "diverged"
    assert float(run.end_time) == pytest.approx(1, abs=1e-15)


def test_a_field_that_ends_is_no_blow_up() -> None:
    run = simulate(make_problem("x y", ["-1 + 0*s", "sqrt(x)"], {"s": "x + 1"}, [1, 0], 2), 128)
    assert run.status == "failed"
    assert "singular" in run.reason
    assert float(run.end_time) == pytest.approx(1, abs=1e-15)


def test_the_end_of_the_model_is_invalid() -> None:
    run = simulate(make_problem("x", ["-1 + 0*s"], {"s": "x + 5"}, [1], 3, valid=["x - 1/4"]), BITS)
    assert run.status == "invalid"
    assert abs(run.end_time - arb(0.75)) < DIGITS


def test_a_field_that_is_undefined_at_the_start_has_no_future() -> None:
    x, s = sp.symbols("x s", real=True)
    system = FilippovSystem((x,), (s,), (x - 1,), (s / x,))
    run = simulate(Problem(system, sp.Integer(0), (sp.Integer(0),), sp.Integer(1)), 128)
    assert run.status == "failed"
    assert "not finite" in run.reason


def test_fig8_begins_as_the_paper_says_and_precisions_agree() -> None:
    """126 transitions in 70 s are checked on the stored truth; here the first four."""
    low, high = (simulate(systems.fig8(until="2.3"), bits) for bits in (160, 192))
    assert [e.to_mode for e, *_ in high.instants] == [(-1,), (1,), (0,), (-1,)]
    assert [e.to_mode for e, *_ in low.instants] == [e.to_mode for e, *_ in high.instants]
    assert all(
        abs(float(a.time - b.time)) < 1e-44 for (a, *_), (b, *_) in zip(low.instants, high.instants, strict=True)
    )
