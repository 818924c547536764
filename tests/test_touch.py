"""Touches and misses in quad-double: the arithmetic against balls, the outcomes against those of the closer look."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from flint import arb, ctx
from numpy.typing import NDArray
from problems import make_problem

from henon_ref.henon import quaddouble as qd
from henon_ref.henon import registers as k
from henon_ref.henon import touch
from henon_ref.henon.closer import CloserLook
from henon_ref.henon.compiled import quad_double
from henon_ref.henon.near import NearLook
from henon_ref.henon.program import program
from henon_ref.henon.solvers import HENON_SOLVER
from henon_ref.henon.window import MISS, OPEN, TOUCH
from henon_ref.jit import njit
from henon_ref.model.case import load_case
from henon_ref.model.equations import TIME
from henon_ref.model.system import FilippovSystem
from henon_ref.taylor.expand import Ring, expand
from henon_ref.taylor.tape import build_tape

CASES = Path(__file__).parent.parent / "cases"
X, Y = sp.symbols("x y", real=True)
S = sp.Symbol("s", real=True)


@pytest.fixture(autouse=True)
def bits() -> Iterator[None]:
    with ctx.workprec(300):
        yield


@njit()
def combined(product, a, b, results):  # type: ignore[no-untyped-def]
    for i in range(len(a)):
        p, q = (a[i, 0], a[i, 1], a[i, 2], a[i, 3]), (b[i, 0], b[i, 1], b[i, 2], b[i, 3])
        y = qd.multiply(p, q) if product else qd.add(p, q)
        results[i, 0], results[i, 1], results[i, 2], results[i, 3] = y


@njit()
def expanded(codes, constants, field, guard, t, t_low, x, x_low, unit, rows):  # type: ignore[no-untyped-def]
    return touch.expand(codes, constants, field, guard, t, t_low, x, x_low, unit, rows)


def ball(parts: Sequence[float]) -> arb:
    return sum((arb(float(part)) for part in parts), arb(0))


def numbers(seed: int) -> NDArray[np.float64]:
    source = random.Random(seed)
    rational = [sp.Rational(source.randint(-(10**70), 10**70), 10 ** source.randint(60, 80)) for _ in range(300)]
    return np.array([quad_double(number) for number in rational])


@pytest.mark.parametrize("product", [False, True])
def test_sums_and_products_have_sixty_digits(product: bool) -> None:
    a, b = numbers(1), numbers(2)
    b[::3] = -a[::3]
    b[::3, 2:] *= 1 + 1e-9  # sums that cancel down to their last parts
    results = np.zeros_like(a)
    combined(product, a, b, results)
    for p, q, y in zip(a, b, results, strict=True):
        exact = ball(p) * ball(q) if product else ball(p) + ball(q)
        size = abs(exact) if product else abs(ball(p)) + abs(ball(q))
        assert abs(ball(y) - exact) <= 2.0**-205 * size
        assert (np.abs(y[1:]) <= 2.0**-52 * np.abs(y[0])).all()


@pytest.mark.parametrize(
    ("field", "output"),
    [
        ((Y, sp.Rational(-981, 100)), X**3 - X * Y + sp.sqrt(2)),
        ((1 - 2 * TIME, X + TIME / 3), (X - Y) ** 2 / 7 - X),
        ((sp.Integer(1), X), 5 - Y * X**2),
    ],
)
def test_a_motion_is_expanded_as_in_balls(field: tuple[sp.Expr, ...], output: sp.Expr) -> None:
    tape = build_tape((X, Y), field, (output,))
    codes, constants, rates, outputs, rows = program(tape, [quad_double(c) for c in tape.constants])
    made = np.zeros((rows, 4 * (touch.HIGHEST + 1)))
    start = (0.3, 1e-18), ((0.7, -2e-17), (-1.1, 1e-17))
    x, low = np.array([s[0] for s in start[1]]), np.array([s[1] for s in start[1]])
    degree = expanded(codes, constants, rates, outputs[0], *start[0], x, low, 0.625, made)
    assert 2 <= degree <= 10
    exact_constants = [arb(str(sp.N(c, 80))) for c in tape.constants]
    ring = Ring({}, arb.__pow__)
    x_balls = [*map(ball, start[1])]
    states, values = expand(tape, exact_constants, ball(start[0]), x_balls, degree, ring, arb(0.625), lambda *_: False)
    for row, exact in ((0, states[0]), (1, states[1]), (outputs[0], values[0])):
        size = sum((abs(c) for c in exact), arb(0))
        for at, c in enumerate(exact):
            assert abs(ball(made[row, 4 * at : 4 * at + 4]) - c) <= 2.0**-200 * size


@pytest.mark.parametrize("field", [sp.sin(X), 1 / (2 + X), sp.sqrt(2 + X)])
def test_a_motion_that_is_no_polynomial_is_left_alone(field: sp.Expr) -> None:
    tape = build_tape((X,), (field,), (X,))
    codes, constants, rates, outputs, rows = program(tape, [quad_double(c) for c in tape.constants])
    work = np.zeros((rows, 4 * (touch.HIGHEST + 1)))
    assert expanded(codes, constants, rates, outputs[0], 0.0, 0.0, np.ones(1), np.zeros(1), 1.0, work) == -1


@pytest.mark.parametrize("shape", ["exp(x/3)", "2 + sin(x)", "sqrt(2 + x)", "exp(x)*(3 + sin(5*x))", "exp(-3*x)"])
def test_a_touch_of_a_function_of_a_polynomial_motion_is_not_missed(shape: str) -> None:
    """x = t + t^2 / 2: the motion is a polynomial, the guard is none."""
    problem = make_problem("x v", ["v", "1"], {"s": f"(x - 1)**2*({shape})"}, [0, 1], 2)
    for rtol in (1e-9, 1e-12):
        (graze,) = HENON_SOLVER.prepare(problem, rtol=rtol)().transitions
        assert (graze.kind, graze.time) == ("graze", pytest.approx(np.sqrt(3) - 1, abs=1e-15))


def looked_at(surface: sp.Expr) -> tuple[int, NDArray[np.float64]]:
    """(outcome, the run's floats) on a step of 2 from x = t = 0 on a surface's upper side."""
    system = FilippovSystem((X,), (S,), (surface,), (sp.Integer(1),))
    floats, integers = np.zeros(k.F_STATE + 2), np.zeros(k.I_SIZE + 4, dtype=np.int64)
    floats[k.F_NEAR], floats[k.F_REACH], floats[k.F_UNTIL] = 1 + 1e-10, 2.0, 4.0
    integers[k.I_ORDER] = 20
    layout = np.zeros((3, k.T_SIZE), dtype=np.int64)
    layout[0, k.T_GUARDS] = 1
    outcome = NearLook(system, lambda _: [0]).look(floats, integers, (1,), layout)
    assert integers[k.I_SIZE] == (0 if outcome == OPEN else 2)
    return outcome, floats


@pytest.mark.parametrize("depth", ["0", "1e-29", "-1e-29", "1e-35", "-1e-35", "1e-45", "-1e-45", "1e-53", "-1e-53"])
@pytest.mark.parametrize("shape", [sp.Integer(1), 3 + X, (2 - X / 3) ** 2])
def test_a_minimum_is_what_the_closer_look_says_it_is(shape: sp.Expr, depth: str) -> None:
    surface = (X - 1) ** 2 * shape + sp.Rational(depth)
    outcome, floats = looked_at(surface)
    system = FilippovSystem((X,), (S,), (surface,), (sp.Integer(1),))
    found = CloserLook(system).look((1,), 0, 0, (0.0, 0.0), [(0.0, 0.0)], (1 + 1e-10, 0.0), 2.0)
    assert outcome == {"touch": TOUCH, "miss": MISS, "root": OPEN}[found.what]
    if outcome != OPEN:
        assert found.lowest
        for place in (floats[k.F_TIME : k.F_LOW + 1], floats[k.F_STATE :]):
            assert abs(ball(place) - 1) < 2.0**-104


def test_a_touch_at_a_round_time_is_at_that_time() -> None:
    problem = load_case(CASES / "hard" / "grazing_ballistic.yaml").reading("exact").problem
    (graze,) = HENON_SOLVER.prepare(problem, rtol=1e-9)().transitions
    assert (graze.kind, graze.time, graze.time_low, graze.state[2]) == ("graze", 1.0, 0.0, 1.0)


@pytest.mark.parametrize(("case", "reading"), [("grazing_ballistic", "exact"), ("stick_zones_merge", "eq13")])
def test_multiprecision_is_not_asked_about_a_touch_of_second_order(
    case: str, reading: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: Any, **__: Any) -> Callable[..., Any]:
        raise AssertionError("asked")

    monkeypatch.setattr(CloserLook, "look", never)
    problem = load_case(CASES / "hard" / f"{case}.yaml").reading(reading).problem
    assert HENON_SOLVER.prepare(problem, rtol=1e-9)().status == "ok"
