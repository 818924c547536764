"""Callbacks compiled by numba have the values of plain Python, and only they import numba."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from henon_ref.baselines.mode_functions import compiled, jacobian
from henon_ref.modes.callables import scalar
from henon_ref.taylor.tape import TIME

CASES = Path(__file__).parents[2] / "cases"
X, Y, S = sp.symbols("x y s", real=True)
FIELD = [
    sp.sqrt(3) / 9 * X * sp.sin(sp.pi * TIME / 3) - X**3 + sp.sqrt(Y),
    (X + Y) ** sp.Rational(1, 3) / (1 + sp.Rational(1, 10) * Y) + sp.exp(-X) * sp.tanh(Y),
    sp.Integer(0),
]
POINT = np.array([0.5, 1.25])


def test_values_are_those_of_plain_python() -> None:
    out = np.empty(3)
    compiled((X, Y), FIELD)(0.75, POINT, out)
    assert out == pytest.approx(scalar((X, Y), FIELD)(0.75, *POINT), rel=4e-16)


def test_integers_longer_than_numba_takes_are_doubles() -> None:
    """In units far from one: it knows none of more than 64 bits."""
    field = (10**27 * X + 10**18, 10**27 / (Y + 2**60), sp.Integer(10**30))
    out = np.empty(3)
    compiled((X, Y), field)(0.0, POINT, out)
    assert out.tolist() == [10**27 * 0.5 + 10**18, 10**27 / (1.25 + 2**60), 1e30]


@pytest.mark.parametrize(("expression", "value"), [((X + Y) ** sp.Rational(1, 3), math.nan), (1 / (1 + X), math.inf)])
def test_what_has_no_value_is_none_and_raises_nothing(expression: sp.Expr, value: float) -> None:
    out = np.empty(1)
    compiled((X, Y), [expression])(0.0, np.array([-1.0, 0.0]), out)
    assert out == pytest.approx([value], nan_ok=True)


def test_the_jacobian_is_that_of_plain_python() -> None:
    one, other = (jacobian((X, Y), FIELD, callbacks)(0.75, POINT) for callbacks in ("numba", "python"))
    assert one == pytest.approx(other, rel=1e-14)
    assert jacobian((X,), [sp.Integer(1)], "numba")(0.0, POINT[:1]).tolist() == [[0.0]]
    switched = jacobian((X, Y), [S * X * Y, S + Y], "numba", (S,)).at([-1.0])
    assert switched(0.0, POINT).tolist() == [[-1.25, -0.5], [0.0, 1.0]]


@pytest.mark.slow  # daily: test_package.py runs the library without numba
def test_numba_is_imported_for_them_only() -> None:
    code = (
        "import sys; from henon_ref import load_case; from henon_ref.harness import registry; "
        f"problem = load_case({str(CASES / 'free_coulomb.yaml')!r}).readings[0].problem\n"
        "for name in ('henon', 'henon-rk4', 'scipy-dop853', 'scipy-dop853+numba'):\n"
        "    setting = {'step': 0.01} if name == 'henon-rk4' else {'rtol': 1e-6, 'atol': 1e-6}\n"
        "    assert registry.solver(name).prepare(problem, **setting)().status == 'ok'\n"
        "    print(name, 'numba' in sys.modules)"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.splitlines() == [
        "henon False", "henon-rk4 False", "scipy-dop853 False", "scipy-dop853+numba True",
    ]  # fmt: skip
