"""Signs in double precision: right, or not told."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest
import sympy as sp

from henon_ref.integrator.constant_program import sign_function

X, V, B = sp.symbols("x v b", real=True)


def test_what_it_tells_is_the_exact_sign() -> None:
    expression = X**3 - 3 * B * X * V + V**2 / 7 - B
    signs = sign_function([X, V, B], [expression, X - B])
    draw = random.Random(3)
    told = 0
    for _ in range(400):
        point = [round(draw.uniform(-1, 1), draw.choice([1, 3, 16])) for _ in range(3)]
        exact = [
            e.subs(dict(zip((X, V, B), map(sp.Rational, map(Fraction, point)), strict=True)))
            for e in (expression, X - B)
        ]
        found = signs(*point)
        if found is not None:
            told += 1
            assert found == tuple(int(sp.sign(e)) for e in exact)
    assert told > 300


def test_it_does_not_tell_what_rounding_may_have_made() -> None:
    signs = sign_function([X, V], [X - V - sp.Rational(1, 10)])
    assert signs(0.3, 0.2) is None  # 2.8e-17 in doubles
    assert signs(0.3 + 1e-12, 0.2) is None
    assert signs(0.4, 0.2) == (1,)
    assert sign_function([X], [X])(0.0) is None
    assert sign_function([X], [X])(1e-300) == (1,)


@pytest.mark.parametrize("point", [float("inf"), float("nan"), 1e308])
def test_it_does_not_tell_of_what_is_not_finite(point: float) -> None:
    assert sign_function([X], [10 * X**2 - X])(point) is None


@pytest.mark.parametrize("expression", [sp.sin(X) - V, sp.sqrt(X) - V, sp.pi * X - V, (X - V) ** 2 / (X + V)])
def test_it_takes_sums_of_products_only(expression: sp.Expr) -> None:
    assert sign_function([X, V], [expression]) is None
