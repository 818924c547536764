"""Touches and misses in quad-double: the outcomes against those of the closer look in multiprecision."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import closer_look
import numpy as np
import pytest
import sympy as sp
from flint import arb, ctx
from numpy.typing import NDArray
from problems import make_problem
from runs import kinds, run

from henon_ref.henon import registers as k
from henon_ref.henon import touch
from henon_ref.henon.closer import CloserLook
from henon_ref.henon.engine import Engine
from henon_ref.henon.session import Session
from henon_ref.henon.solvers import HENON_SOLVER
from henon_ref.henon.window import ACROSS, MISS, ROOT, TOUCH, UNSURE
from henon_ref.jit import njit
from henon_ref.model.case import load_case
from henon_ref.model.system import FilippovSystem

CASES = Path(__file__).parent.parent / "cases"
X = sp.Symbol("x", real=True)
S = sp.Symbol("s", real=True)


def away(parts: Sequence[float], place: int) -> float:
    """How far a number in doubles is from a round one."""
    with ctx.workprec(300):
        return abs(float(sum((arb(float(part)) for part in parts), arb(-place))))


@pytest.mark.parametrize("shape", ["exp(x/3)", "2 + sin(x)", "sqrt(2 + x)", "exp(x)*(3 + sin(5*x))", "exp(-3*x)"])
def test_a_touch_of_a_function_of_a_polynomial_motion_is_not_missed(shape: str) -> None:
    """x = t + t^2 / 2: the motion is a polynomial, the guard is none."""
    problem = make_problem("x v", ["v", "1"], {"s": f"(x - 1)**2*({shape})"}, [0, 1], 2)
    for rtol in (1e-9, 1e-12):
        (graze,) = HENON_SOLVER.prepare(problem, rtol=rtol)().transitions
        assert (graze.kind, graze.time) == ("graze", pytest.approx(np.sqrt(3) - 1, abs=1e-15))


def looked_at(surface: sp.Expr, reach: float = 2.0) -> tuple[int, NDArray[np.float64]]:
    """(outcome, the run's floats) next to 1 on a step from x = t = 0 on a surface's upper side."""
    system = FilippovSystem((X,), (S,), (surface,), (sp.Integer(1),))
    floats, integers = np.zeros(k.F_STATE + 2), np.zeros(k.I_SIZE + 4, dtype=np.int64)
    floats[k.F_NEAR], floats[k.F_REACH], floats[k.F_UNTIL] = 1 + 1e-10, reach, 2 * reach
    integers[k.I_ORDER] = 20
    layout = np.zeros((3, k.T_SIZE), dtype=np.int64)
    layout[0, k.T_GUARDS] = 1
    outcome = closer_look.look(system, (1,), floats, integers, layout)
    assert integers[k.I_SIZE] == (2 if outcome in (TOUCH, MISS) else 0)
    return outcome, floats


@pytest.mark.parametrize("depth", ["0", "1e-29", "-1e-29", "1e-35", "-1e-35", "1e-45", "-1e-45", "1e-53", "-1e-53"])
@pytest.mark.parametrize("shape", [sp.Integer(1), 3 + X, (2 - X / 3) ** 2, sp.exp(X / 3), 2 + sp.sin(X)])
def test_a_minimum_is_what_the_closer_look_says_it_is(shape: sp.Expr, depth: str) -> None:
    surface = (X - 1) ** 2 * shape + sp.Rational(depth)
    outcome, floats = looked_at(surface)
    system = FilippovSystem((X,), (S,), (surface,), (sp.Integer(1),))
    found = CloserLook(system).look((1,), 0, 0, (0.0, 0.0), [(0.0, 0.0)], (1 + 1e-10, 0.0), 2.0)
    assert outcome in {"touch": (TOUCH,), "miss": (MISS,), "root": (ROOT, ACROSS)}[found.what]
    assert found.lowest == (found.what != "root")
    for place in (floats[k.F_TIME : k.F_LOW + 1], floats[k.F_STATE :]):
        if found.lowest:
            assert away(place, 1) < 2.0**-104
        else:
            assert away([*place, *(-part for part in found.time)], 0) < 2.0**-102


@njit()
def at_minimum(row, degree, size, s):  # type: ignore[no-untyped-def]
    return touch.at_minimum(row, degree, size, s)


@pytest.mark.parametrize(("s", "told"), [(1e-4, TOUCH), (1.0, UNSURE)])
def test_what_is_flat_is_told_by_the_curvature_on_the_step(s: float, told: int) -> None:
    """(t - s)^2, in units of s, on a step on which it is as large as 10^8 s^2."""
    row = np.zeros(12)
    row[::4] = 1.0, -2.0, 1.0
    assert at_minimum(row, 2, 1e8, s) == (told, 0.0)


@pytest.mark.parametrize("reach", [1.25, 8.0, 1e3])
def test_a_touch_is_one_wherever_on_the_step_it_is(reach: float) -> None:
    outcome, floats = looked_at((X - 1) ** 2, reach)
    assert outcome == TOUCH
    assert away(floats[k.F_TIME : k.F_LOW + 1], 1) < 2.0**-104


def test_a_touch_at_a_round_time_is_at_that_time() -> None:
    problem = load_case(CASES / "hard" / "grazing_ballistic.yaml").reading("exact").problem
    (graze,) = HENON_SOLVER.prepare(problem, rtol=1e-9)().transitions
    assert (graze.kind, graze.time, graze.time_low, graze.state[2]) == ("graze", 1.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("case", "reading"), [("grazing", "exact"), ("grazing_ballistic", "exact"), ("stick_zones_merge", "eq13")]
)
def test_multiprecision_is_not_asked_about_a_touch_of_second_order(
    case: str, reading: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: Any, **__: Any) -> Callable[..., Any]:
        raise AssertionError("asked")

    monkeypatch.setattr(CloserLook, "look", never)
    problem = load_case(CASES / "hard" / f"{case}.yaml").reading(reading).problem
    assert HENON_SOLVER.prepare(problem, rtol=1e-9)().status == "ok"


TWO = {"s": "x", "u": "y"}
TOLERANCES = pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15])


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
    engine = Engine(problem.system, 20)
    session = Session(engine, engine.start(problem, tolerance=1e-12, landing=k.HENON), block=1)
    told = [transition for block in session.stream() for transition in block]
    assert [(q.kind, q.surface) for q in told] == [("graze", 0), ("graze", 1)]


@TOLERANCES
def test_a_model_that_just_ceases_to_hold_as_a_load_touches_ends(rtol: float) -> None:
    problem = make_problem("x", ["1 - (t - 1)**2 - s"], {"s": "x"}, [0], 2, valid=["(t - 1)**2"])
    result = run(problem, rtol)
    assert (result.status, kinds(result), result.end_time) == ("invalid", [], 1.0)
