"""Signs at a start: right, or not told."""

from __future__ import annotations

import random

import numpy as np
import pytest
import sympy as sp

from henon_ref.integrator.constant_program import constant_program
from henon_ref.integrator.pairs import pair_of_exact
from henon_ref.kernel.library import kernel

X, V, B = sp.symbols("x v b", real=True)


def signs(symbols: list[sp.Symbol], expressions: list[sp.Expr], *point: float) -> list[int]:
    points = np.array([[pair_of_exact(value) for value in point]])
    found: list[int] = constant_program(symbols, expressions).signs_at(points)[0].tolist()
    return found


def test_what_it_tells_is_the_exact_sign() -> None:
    expressions = [X**3 - 3 * B * X * V + V**2 / 7 - B, X - B]
    draw = random.Random(3)
    told = 0
    for _ in range(400):
        point = [round(draw.uniform(-1, 1), draw.choice([1, 3, 16])) for _ in range(3)]
        exact = [e.subs(dict(zip((X, V, B), map(sp.Rational, map(repr, point)), strict=True))) for e in expressions]
        for found, value in zip(signs([X, V, B], expressions, *point), exact, strict=True):
            told += found != kernel.UNCLEAR_SIGN
            assert found in (kernel.UNCLEAR_SIGN, int(sp.sign(value)))
    assert told > 780


@pytest.mark.parametrize("function", [sp.Integer(0), sp.sin(X - V - sp.Rational(1, 10))])  # the latter by python-flint
def test_it_does_not_tell_what_rounding_may_have_made(function: sp.Expr) -> None:
    difference = X - V - sp.Rational(1, 10) + function
    assert signs([X, V], [difference], 0.3, 0.2) == [kernel.UNCLEAR_SIGN]  # decimal numbers, of which no pair is all
    assert signs([X, V], [difference], 0.3 + 1e-15, 0.2) == [1]
    assert signs([X, V], [X - V, V], 0.5, 0.5) == [0, 1]
    assert signs([X], [X], 1e-300) == [1]


def test_it_does_not_tell_of_what_is_not_finite() -> None:
    assert signs([X], [10 * X**2 - X], 1e308) == [kernel.UNCLEAR_SIGN]
    assert signs([X], [1 / X], 0.0) == [kernel.UNCLEAR_SIGN]
