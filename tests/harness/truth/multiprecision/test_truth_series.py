"""Series in ball arithmetic against closed forms; decided and undecided signs."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import sympy as sp
from flint import arb, ctx

from henon_ref.errors import ModelError
from henon_ref.harness.truth.multiprecision.points import leading_term, series_along
from henon_ref.harness.truth.reference import exact_ball
from henon_ref.taylor.tape import TIME

X, V = sp.symbols("x v", real=True)


@pytest.fixture(autouse=True)
def _precision() -> Iterator[None]:
    with ctx.workprec(288):
        yield


def test_the_oscillator_is_the_cosine() -> None:
    (found,) = series_along([V, -X], [X], [X, V], arb(0), [arb(1), arb(0)], bits=256, order=8)
    exact = [sp.cos(TIME).diff(TIME, k).subs(TIME, 0) / sp.factorial(k) for k in range(9)]
    assert all(abs(a - exact_ball(b, 256)) < 1e-70 for a, b in zip(found, exact, strict=True))


@pytest.mark.parametrize(
    "expression",
    [
        sp.sin(X) * sp.exp(-TIME),
        sp.tanh(X) + sp.sinh(X) - sp.cosh(TIME),
        sp.sqrt(1 + X**2) ** 3 / (2 + TIME) ** 2,
        sp.atan(X) + sp.asin(X / 3) + sp.acos(X / 5) + sp.tan(X),
        sp.log(2 + X) ** sp.Rational(1, 3),
        (1 + X) ** TIME,
        (1 + X**2) ** sp.Rational(-5, 2),
    ],
)
def test_every_function_has_the_series_that_sympy_gives(expression: sp.Expr) -> None:
    # x' = 1 from 0.3 at t = 0, so that x = 0.3 + t
    (found,) = series_along([sp.Integer(1)], [expression], [X], arb(0), [arb(3) / 10], bits=256, order=4)
    moving = expression.subs(X, sp.Rational(3, 10) + TIME)
    for k, coefficient in enumerate(found):
        exact = exact_ball(sp.N(moving.diff(TIME, k).subs(TIME, 0) / sp.factorial(k), 70), 200)
        assert abs(coefficient - exact) < 1e-55


def test_a_function_without_a_series_is_refused() -> None:
    with pytest.raises(ModelError, match="no power series"):
        series_along([sp.Abs(X)], [X], [X], arb(0), [arb(1)], bits=128, order=2)


def test_leading_passes_over_what_may_be_zero() -> None:
    assert leading_term([arb(0, 1e-60), arb(0), arb(-3, 1e-60)]) == (2, -1)
    assert leading_term([arb(2), arb(-1)], first=1) == (1, -1)
    assert leading_term([arb(0, 1e-60), arb(0)]) is None
    assert leading_term([arb.nan()]) is None
