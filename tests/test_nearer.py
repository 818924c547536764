"""The closer look in quad-double at roots that stand close together: what multiprecision says, or nothing."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import closer_look
import mpmath
import numpy as np
import pytest
import sympy as sp
from problems import make_problem

from henon_ref.henon import about, beyond
from henon_ref.henon import registers as k
from henon_ref.henon.closer import CloserLook, Finding
from henon_ref.henon.compiled import quad_double
from henon_ref.henon.session import Session
from henon_ref.henon.solvers import HENON_SOLVER
from henon_ref.henon.window import ACROSS, MISS, OPEN, PASSED, ROOT, STEEP, TOUCH, UNSURE
from henon_ref.jit import njit
from henon_ref.model.case import load_case
from henon_ref.model.system import FilippovSystem
from henon_ref.trajectory import Problem

CASES = Path(__file__).parent.parent / "cases"
X = sp.Symbol("x", real=True)
S = sp.Symbol("s", real=True)
REACH = 2.0
SHAPES = [sp.Integer(1), 3 + X, sp.exp(X / 3), 2 + sp.sin(X), 1 + X**3 * sp.exp(-X)]
SAID = {ACROSS: "root", STEEP: "root", ROOT: "root", TOUCH: "touch", MISS: "miss", PASSED: "miss"}


def looked_at(surface: sp.Expr, near: float, zeros: int = 0) -> tuple[int, Any, Finding]:
    """Outcome and floats of the compiled look from x = t = 0, and what multiprecision finds."""
    system = FilippovSystem((X,), (S,), (surface,), (sp.Integer(1),))
    floats, integers = np.zeros(k.F_STATE + 2), np.zeros(k.I_SIZE + 4, dtype=np.int64)
    floats[k.F_NEAR], floats[k.F_REACH], floats[k.F_UNTIL] = near, REACH, 2 * REACH
    integers[k.I_ORDER], integers[k.I_SIZE] = 20, zeros
    layout = np.zeros((3, k.T_SIZE), dtype=np.int64)
    layout[0, k.T_GUARDS] = 1
    outcome = closer_look.look(system, (1,), floats, integers, layout)
    return outcome, floats, CloserLook(system).look((1,), 0, zeros, (0.0, 0.0), [(0.0, 0.0)], (near, 0.0), REACH)


def apart(one: Any, other: Any) -> float:
    with mpmath.workdps(60):
        return float(abs(sum(map(mpmath.mpf, one)) - sum(map(mpmath.mpf, other))))


def cluster(rng: np.random.Generator) -> tuple[sp.Expr, float, float, int]:
    """A surface, positive next to 0, with roots too close to each other for double-double; near; gap; zeros at 0."""
    kind = rng.integers(4)
    least = {0: -21, 2: -14}.get(kind, -10)  # 1e-50 of the surface's size is zero; of a touch it has to see the bend
    middle, gap = sp.Rational(float(rng.uniform(0.1, 1.5))), sp.Rational(float(10 ** rng.uniform(least, -9)))
    if kind == 0:  # a pair of roots, or a miss by as much
        dip = (X - middle) ** 2 + rng.choice([-1, 1]) * gap**2
    elif kind == 1:  # a touch, and a crossing before or behind
        dip = (X - middle) ** 2 * (middle + rng.choice([-1, 1]) * gap - X)
    elif kind == 2:  # three crossings
        dip = ((X - middle) ** 2 - gap**2) * (middle + gap * sp.Rational(float(rng.uniform(-3, 3))) - X)
    else:  # a crossing behind a miss
        dip = ((X - middle) ** 2 + gap**2 / 100) * (middle + gap - X)
    zeros = int(rng.integers(3))
    near = float(middle) + float(rng.choice([-1, 1])) * float(gap) * 10 ** rng.uniform(-2, 2)
    return X**zeros * dip * SHAPES[rng.integers(len(SHAPES))], near, float(gap), zeros


def test_of_roots_that_stand_close_together_it_says_what_multiprecision_does() -> None:
    rng = np.random.default_rng(11)
    said: Counter[int] = Counter()
    for _ in range(160):
        surface, near, gap, zeros = cluster(rng)
        outcome, floats, found = looked_at(surface, near, zeros)
        said[outcome] += 1
        if outcome in (UNSURE, OPEN):
            continue
        if outcome in (PASSED, MISS) and found.what == "root":  # of which it is not there yet
            assert sum(map(sp.Rational, map(float, floats[k.F_TIME : k.F_LOW + 1]))) < sum(map(sp.Rational, found.time))
            continue
        assert SAID[outcome] == found.what, (surface, near)
        if outcome != PASSED:
            assert apart(floats[k.F_TIME : k.F_LOW + 1], found.time) < 1e-6 * gap + 1e-31, (surface, near)
            assert apart(floats[k.F_STATE :], found.state[0]) < 1e-6 * gap + 1e-31, (surface, near)
    assert said[UNSURE] + said[OPEN] < 20
    assert said[ROOT] + said[STEEP] + said[ACROSS] > 60
    assert said[TOUCH] > 10
    assert said[MISS] + said[PASSED] > 10


@pytest.mark.parametrize("side", [-1, 1])
def test_a_touch_is_told_next_to_a_crossing(side: int) -> None:
    place, gap = sp.Rational(7, 5), sp.Rational(1, 10**9)
    outcome, floats, _ = looked_at((X - place) ** 2 * (place + side * gap - X) * sp.exp(X / 3), 1.4)
    assert outcome == TOUCH if side > 0 else outcome in (ROOT, ACROSS)
    first = place if side > 0 else place - gap
    assert abs(sum(map(sp.Rational, map(float, floats[k.F_TIME : k.F_LOW + 1]))) - first) < 2e-32


ROOTS = {
    ("two_roots", "beside_a_touch"): [("crossing", 0.5), ("graze", 1.0), ("crossing", 1 + 1e-9)],
    ("two_roots", "d1e13"): [("crossing", 1 - 5e-14), ("crossing", 1 + 5e-14)],
    ("two_roots", "d1e14"): [("crossing", 1 - 5e-15), ("crossing", 1 + 5e-15)],
    ("two_roots_ballistic", "d1e14"): [("crossing", 1 - 5e-15), ("crossing", 1 + 5e-15)],
    ("odd_orders", "behind_a_crossing"): [("crossing", 0.1), ("crossing", 1.4)],
    ("odd_orders", "third"): [("crossing", 1.0)],
    ("odd_orders", "seventh"): [("crossing", 1.0)],
    ("odd_orders", "release"): [("release", 1.0)],
}


def never(*_: Any, **__: Any) -> Any:
    raise AssertionError("asked")


@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize(("case", "reading"), ROOTS)
def test_python_is_asked_nothing(case: str, reading: str, rtol: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CloserLook, "look", never)
    monkeypatch.setattr(Session, "_resolve", never)
    problem = load_case(CASES / "hard" / f"{case}.yaml").reading(reading).problem
    found = [(t.kind, t.time) for t in HENON_SOLVER.prepare(problem, rtol=rtol)().transitions]
    assert [kind for kind, _ in found] == [kind for kind, _ in ROOTS[case, reading]]
    assert [time for _, time in found] == pytest.approx([time for _, time in ROOTS[case, reading]], abs=3e-16)


@pytest.mark.parametrize(
    ("field", "kind"),
    [
        ("-1", "crossing"),
        ("-2*u", "crossing"),
        ("-3*u**2", "crossing"),
        ("-5*u**4*exp(x)", "crossing"),
        ("-2*u*exp(-10*u)", "crossing"),
        ("1", "stick"),
        ("2*u", "stick"),
        ("7*u**6", "stick"),
    ],
)
def test_the_field_beyond_decides_what_a_flat_root_is(field: str, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """x = -u^3 above the surface, where u = t - 1/4 (no step ends before), and this field below it."""
    if kind == "crossing":
        monkeypatch.setattr(Session, "_resolve", never)
    found = HENON_SOLVER.prepare(flat_above(field), rtol=1e-9)().transitions
    assert [(t.kind, t.time) for t in found] == [(kind, 0.25)]


def flat_above(below: str) -> Problem:
    field = f"(-3*u**2*(1 + s) + ({below})*(1 - s))/2".replace("u", "(t - 1/4)")
    return make_problem("x", [field], {"s": "x"}, ["1/64"], "1/2")


@pytest.mark.parametrize("below", ["-2*u + 24*u**2", "-2*u + 24*u**2*exp(u)"])
def test_the_zeros_with_which_a_surface_is_left_are_known(below: str) -> None:
    """Below it x = -u^2 + 8 u^3: from a double zero away, and back at u = 1/8."""
    first, second, *_ = HENON_SOLVER.prepare(flat_above(below), rtol=1e-12)().transitions
    assert (first.kind, first.time) == ("crossing", 0.25)
    assert second.kind == "stick"
    assert second.time == pytest.approx(0.375, abs=1e-15) if "exp" not in below else 0.35 < second.time < 0.375


@njit()
def valued(row, degree, zeros, size, s, s_low):  # type: ignore[no-untyped-def]
    return about.about(row, degree, zeros, size, s, s_low)


@pytest.mark.parametrize("zeros", [0, 1, 3])
@pytest.mark.parametrize("s_low", [0.0, 3e-17])
def test_value_and_slope_are_those_of_what_is_left_without_the_zeros(zeros: int, s_low: float) -> None:
    """Terms of 1e-30 and 1e-50 are summed with fewer digits; of the value 40 digits cancel."""
    place = sp.Rational(0.625) + sp.Rational(s_low)
    q = sp.Poly((X - place) * (2 - X) + 10 ** sp.Integer(-40) + X**9 / 10**30 + X**12 / 10**50, X)
    row = np.array([quad_double(c) for c in reversed((q * sp.Poly(X**zeros, X)).all_coeffs())]).ravel()
    value, slope = valued(row, 12 + zeros, zeros, 4.0, 0.625, s_low)
    assert value == pytest.approx(float(q.eval(place)), abs=1e-58, rel=1e-14)
    assert slope == pytest.approx(float(q.diff().eval(place)), rel=1e-14)
    value, slope = valued(row, 12 + zeros, zeros, 4.0, 0.5, s_low)
    near = sp.Rational(0.5) + sp.Rational(s_low)
    assert (value, slope) == pytest.approx((float(q.eval(near)), float(q.diff().eval(near))), rel=1e-14)


@njit()
def leading(series, order):  # type: ignore[no-untyped-def]
    return beyond._leading(series, order)


@pytest.mark.parametrize(
    ("head", "zeros"),
    [
        ([0.0, 1.0], 1),
        ([0.0, 1e-16, 1.0], 2),
        ([0.0, 1e-16, 0.0, 0.5], 3),
        ([0.0, 1e-16, -1.0], 0),
        ([0.0, 1e-12, 1.0], 0),  # neither zero for certain, nor not
        ([0.0, -1e-12, 1.0], 0),
        ([0.0] * 9 + [1.0], 0),
        ([0.0], 0),
    ],
)
def test_only_a_clear_order_counts(head: list[float], zeros: int) -> None:
    series = np.zeros(21)
    series[: len(head)] = head
    assert leading(series, 20) == zeros
