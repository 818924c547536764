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

from henon_ref.henon import registers as k
from henon_ref.henon import touch
from henon_ref.henon.closer import CloserLook
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
