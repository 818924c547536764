"""Flat roots in quad-double: what they are told to be is what the closer look in multiprecision says, or nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import closer_look
import mpmath
import numpy as np
import pytest
import sympy as sp

from henon_ref.henon import registers as k
from henon_ref.henon.closer import CloserLook
from henon_ref.henon.solvers import HENON_SOLVER
from henon_ref.henon.window import ROOT, TOUCH
from henon_ref.model.case import load_case
from henon_ref.model.system import FilippovSystem

CASES = Path(__file__).parent.parent / "cases"
X = sp.Symbol("x", real=True)
S = sp.Symbol("s", real=True)
PLACE = sp.Rational(7, 5)
SHAPES = [sp.Integer(1), 3 + X, (2 - X / 3) ** 2, 1 + (X - 1) ** 2]


def looked_at(surface: sp.Expr, near: float, *, zeros: int = 0) -> tuple[int, Any, Any]:
    """(outcome, floats, integers) on a step of 2 from x = t = 0 on a surface's upper side."""
    system = FilippovSystem((X,), (S,), (surface,), (sp.Integer(1),))
    floats, integers = np.zeros(k.F_STATE + 2), np.zeros(k.I_SIZE + 4, dtype=np.int64)
    floats[k.F_NEAR], floats[k.F_REACH], floats[k.F_UNTIL] = near, 2.0, 4.0
    integers[k.I_ORDER], integers[k.I_SIZE] = 20, zeros
    layout = np.zeros((3, k.T_SIZE), dtype=np.int64)
    layout[0, k.T_GUARDS] = 1
    outcome = closer_look.look(system, (1,), floats, integers, layout)
    return outcome, floats, integers


def off(pair: Any) -> float:
    """How far a place is from where the root is."""
    with mpmath.workdps(60):
        return float(abs(mpmath.mpf(pair[0]) + mpmath.mpf(pair[1]) - mpmath.mpf(7) / 5))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("order", [3, 4, 5, 6, 7, 8])
def test_a_flat_root_is_told_and_where_it_is(order: int, shape: sp.Expr) -> None:
    surface = (PLACE - X) ** order * shape
    outcome, floats, integers = looked_at(surface, 1.4 - 1e-5)
    assert outcome == (TOUCH if order % 2 == 0 else ROOT)
    assert off(floats[k.F_TIME : k.F_LOW + 1]) < 2.0**-103
    assert off(floats[k.F_STATE :]) < 2.0**-103
    if outcome == TOUCH:
        assert integers[k.I_SIZE] == order
    else:
        assert integers[k.I_SIZE + 2] == 1


@pytest.mark.parametrize("order", [3, 4, 5, 7])
def test_it_is_what_the_closer_look_says(order: int) -> None:
    surface = (PLACE - X) ** order * (3 + X)
    outcome, floats, _ = looked_at(surface, 1.4 - 1e-5)
    system = FilippovSystem((X,), (S,), (surface,), (sp.Integer(1),))
    found = CloserLook(system).look((1,), 0, 0, (0.0, 0.0), [(0.0, 0.0)], (1.4 - 1e-5, 0.0), 2.0)
    assert outcome == {"touch": TOUCH, "root": ROOT}[found.what]
    assert off(found.time) < 1e-21
    assert off(found.state[0]) < 1e-21
    assert off(floats[k.F_TIME : k.F_LOW + 1]) < 2.0**-103


@pytest.mark.parametrize(
    "surface",
    [
        (X - PLACE) ** 4 + sp.Rational("1e-45"),  # a miss, by less than is told of a flat one here
        (X - PLACE) ** 4 - sp.Rational("1e-45"),  # two roots
        (PLACE - X) ** 3 + sp.Rational("1e-12") * (X - PLACE),  # three of them
        (PLACE - X) ** 5 * (X - sp.Rational(6, 5)) ** 2,  # a touch before it
        (PLACE - X) ** 5 * (sp.Rational(6, 5) - X),  # a crossing before it
        (PLACE - X) ** 3 * sp.exp(X),  # no polynomial
    ],
)
def test_what_is_not_one_flat_root_alone_is_left_open(surface: sp.Expr) -> None:
    outcome, floats, _ = looked_at(surface, 1.4 - 1e-5)
    assert outcome not in (TOUCH, ROOT)
    assert abs(floats[k.F_TIME] - 1.4) > 1e-7


@pytest.mark.parametrize("zeros", [1, 2])
def test_the_flat_root_of_a_guard_that_has_just_left_zero_is_told(zeros: int) -> None:
    outcome, floats, _ = looked_at(X**zeros * (PLACE - X) ** 3, 1.4 - 1e-5, zeros=zeros)
    assert outcome == ROOT
    assert off(floats[k.F_TIME : k.F_LOW + 1]) < 2.0**-103


@pytest.mark.parametrize(
    ("case", "reading"),
    [("odd_orders", "third"), ("odd_orders", "seventh"), ("odd_orders", "release"), ("grazing_fourth_order", "exact")],
)
def test_multiprecision_is_not_asked_about_flat_roots(case: str, reading: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any, **__: Any) -> Callable[..., Any]:
        raise AssertionError("asked")

    monkeypatch.setattr(CloserLook, "look", never)
    problem = load_case(CASES / "hard" / f"{case}.yaml").reading(reading).problem
    (transition,) = HENON_SOLVER.prepare(problem, rtol=1e-9)().transitions
    assert (transition.time, transition.time_low) == (1.0, 0.0)
