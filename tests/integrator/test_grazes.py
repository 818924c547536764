"""Guards that touch zero, one alone or several at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from often import daily
from problems import make_problem
from runs import kinds, run

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import load_case
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.run import Run

CASES = Path(__file__).parents[2] / "cases"
X = sp.Symbol("x", real=True)
S = sp.Symbol("s", real=True)


@pytest.mark.parametrize("shape", ["exp(x/3)", "2 + sin(x)", "sqrt(2 + x)", "exp(x)*(3 + sin(5*x))", "exp(-3*x)"])
def test_a_touch_of_a_function_of_a_polynomial_motion_is_not_missed(shape: str) -> None:
    """x = t + t^2 / 2: the motion is a polynomial, the guard is none."""
    problem = make_problem("x v", ["v", "1"], {"s": f"(x - 1)**2*({shape})"}, [0, 1], 2)
    for rtol in (1e-9, 1e-12):
        (graze,) = HENON_SOLVER.prepare(problem, rtol=rtol)().transitions
        assert (graze.kind, graze.time) == ("graze", pytest.approx(np.sqrt(3) - 1, abs=1e-15))


def test_a_touch_at_a_round_time_is_at_that_time() -> None:
    problem = load_case(CASES / "hard" / "grazing_ballistic.yaml").reading("exact").problem
    (graze,) = HENON_SOLVER.prepare(problem, rtol=1e-9)().transitions
    assert (graze.kind, graze.time, graze.time_low, graze.state[2]) == ("graze", 1.0, 0.0, 1.0)


TWO = {"s": "x", "u": "y"}
TOLERANCES = pytest.mark.parametrize("rtol", daily([1e-3, 1e-6, 1e-9, 1e-12, 1e-15], some=[1e-3, 1e-9, 1e-15]))


@TOLERANCES
@pytest.mark.parametrize(
    ("field", "start", "until"),
    [
        (["1 - (t - 1)**2 - s", "1 - (t - 1)**2 - u"], 0, 2),
        (["1 - (t - 1)**2 - s", "(t - 1)**2 - 1 - u"], 0, 2),
        (["3 - 3*(t - 1)**2 - 3*s", "(7 - 7*(t - 1)**2 - 7*u)/10"], 0, 2),
        (["1 - (t - 1)**2 - s", "1 - (t - 1)**4 - u"], "1/2", "3/2"),
        (["1 - (t - 1)**4 - s", "1 - (t - 1)**2 - u"], "1/2", "3/2"),
        (["1 - (1 - cos(t - 1))**2 - s", "1 - (1 - cos(t - 1))**2 - u"], "1/2", "3/2"),
        (["cos(t - 1) - s", "1 - (1 - cos(t - 1))**2 - u"], "1/2", "3/2"),
        (["sin(t) - s", "sin(t) - u"], 0, 10),
        (["sin(t) - s", "-sin(t) - u"], 0, 10),
    ],
)
def test_two_contacts_whose_loads_touch_their_friction_at_the_same_instant_hold(
    field: Sequence[str], start: str | int, until: str | int, rtol: float
) -> None:
    result = run(make_problem("x y", field, TWO, [0, 0], until, start=start), rtol)
    assert (result.status, kinds(result), result.end_mode) == ("ok", [], (0, 0))


@TOLERANCES
@pytest.mark.parametrize(
    ("field", "x"),
    [
        ("-(t - 1)**2*s + (t - 1)**2/2", 0),
        ("-(t - 1)**4*s", 0),
        ("-x - (t - 1)**2*s", 0),
        ("-(t - 1)**2*s", "1/8"),
    ],
)
def test_a_contact_whose_friction_vanishes_at_an_instant_holds(field: str, x: str | int, rtol: float) -> None:
    """Its two ends touch together. From 1/8 it sticks at 1 - (5/8)^(1/3)."""
    result = run(make_problem("x", [field], {"s": "x"}, [x], 2), rtol)
    assert (result.status, result.end_mode) == ("ok", (0,))
    if x == 0:
        assert kinds(result) == []
    else:
        assert [(q.kind, q.time) for q in result.transitions] == [("stick", pytest.approx(1 - (5 / 8) ** (1 / 3)))]


@TOLERANCES
def test_a_friction_that_vanishes_again_and_again_holds(rtol: float) -> None:
    result = run(make_problem("x v", ["v", "-(1 + cos(t))*s"], {"s": "v"}, [0, 0], 12), rtol)
    assert (result.status, kinds(result)) == ("ok", [])


@TOLERANCES
@pytest.mark.parametrize("surfaces", [{"a": "(t - 1)**2", "s": "x"}, {"s": "x", "a": "(t - 1)**2"}])
def test_a_surface_that_is_touched_while_a_load_touches_is_told_of_alone(surfaces: dict[str, str], rtol: float) -> None:
    result = run(make_problem("x", ["1 - (t - 1)**2 - s"], surfaces, [0], 2), rtol)
    touched = [(q.kind, q.surface, q.time) for q in result.transitions]
    assert (result.status, touched) == ("ok", [("graze", list(surfaces).index("a"), 1.0)])


BALLS = ["v", "-1", "w", "-1"]


@TOLERANCES
@pytest.mark.parametrize("lower", ["y - 1/2", "1/2 - y"])
def test_two_surfaces_touched_together_are_both_told_of(lower: str, rtol: float) -> None:
    result = run(make_problem("x v y w", BALLS, {"a": "x - 1/2", "b": lower}, [0, 1, 0, 1], "9/5"), rtol)
    touched = [(q.kind, q.surface, q.time) for q in result.transitions]
    assert (result.status, touched) == ("ok", [("graze", 0, 1.0), ("graze", 1, 1.0)])


@pytest.mark.parametrize("gap", [1e-8, 1e-10])
def test_two_touches_a_little_apart_have_their_own_times(gap: float) -> None:
    surfaces = {"a": "(x - 1)**2", "b": f"(x - 1 - 1/10**{round(-np.log10(gap))})**2"}
    first, second = run(make_problem("x", ["1"], surfaces, [0], 2), 1e-9).transitions
    assert (first.kind, first.time, second.kind) == ("graze", 1.0, "graze")
    assert second.time - first.time == pytest.approx(gap, abs=1e-15)


@TOLERANCES
def test_where_one_surface_is_touched_and_another_crossed_the_crossing_is_told(rtol: float) -> None:
    result = run(make_problem("x v y w", BALLS, {"a": "x - 1/2", "b": "y - 1/2"}, [0, 1, "-1/2", "3/2"], "9/5"), rtol)
    assert [(q.kind, q.surface, q.time) for q in result.transitions] == [("crossing", 1, pytest.approx(1, abs=1e-15))]


def test_where_there_is_room_for_one_touch_alone_both_are_told_of() -> None:
    problem = make_problem("x v y w", BALLS, {"a": "x - 1/2", "b": "y - 1/2"}, [0, 1, 0, 1], "9/5")
    integrator = Integrator(problem.system, 20)
    run = Run(integrator, integrator.start(problem, tolerance=1e-12), block=1)
    told = [transition for block in run.stream() for transition in block]
    assert [(q.kind, q.surface) for q in told] == [("graze", 0), ("graze", 1)]


@TOLERANCES
def test_a_model_that_just_ceases_to_hold_as_a_load_touches_ends(rtol: float) -> None:
    problem = make_problem("x", ["1 - (t - 1)**2 - s"], {"s": "x"}, [0], 2, valid=["(t - 1)**2"])
    result = run(problem, rtol)
    assert (result.status, kinds(result), result.end_time) == ("invalid", [], 1.0)


@TOLERANCES
@pytest.mark.parametrize(("speed", "told"), [("3/2", ["graze"]), ("41/25", [])])
def test_a_touch_in_the_first_mode_is_told_if_the_start_is_given_by_doubles(
    speed: str, told: list[str], rtol: float
) -> None:
    """Otherwise the surface is named in ``undecided_after``."""
    result = run(make_problem("x v", ["v", "-x"], {"s": f"v + {speed}"}, [0, speed], 4), rtol)
    assert (result.status, kinds(result), len(result.undecided_after)) == ("ok", told, 1 - len(told))
