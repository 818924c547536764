"""Derivatives of expressions have the form that SymPy gives them."""

from __future__ import annotations

import pytest
import sympy as sp

from henon_ref.modes.equations import derivative

X, V, T, S = sp.symbols("x v t s", real=True)


@pytest.mark.parametrize(
    "expression",
    [
        X**2 * V - sp.sin(X * V) / (1 + X**3) + 4,
        sp.exp(-((V / sp.Rational(1, 1000)) ** 2)) * S * X,
        X**V + V ** (T * X) + 2**X + sp.E**V,
        sp.sqrt(1 - sp.cos(X - 1)) * sp.tan(X) * sp.atan(X * V) - sp.log(X**2 + V),
        sp.tanh(V * 10**8) / (X * V * S) + sp.acos(X) * sp.asin(V),
        sp.Add(*(sp.sin(k * X * V) / (1 + X**k) for k in range(1, 6))),
        S * V,
    ],
)
def test_it_is_what_sympy_makes(expression: sp.Expr) -> None:
    for symbol in (X, V, T, S):
        assert derivative(expression, symbol) == sp.diff(expression, symbol)
        twice = derivative(derivative(expression, symbol), X)
        assert twice == sp.diff(sp.diff(expression, symbol), X)
