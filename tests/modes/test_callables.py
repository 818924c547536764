"""SymPy to callables: one rounding a constant, derivatives right, no value is NaN and not an exception."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from henon_ref.baselines.heyoka_taylor import to_heyoka
from henon_ref.baselines.mode_functions import ModeFunctions
from henon_ref.baselines.surface_functions import landing
from henon_ref.errors import ModelError, UnsupportedError
from henon_ref.modes.callables import Jacobian, rounded, scalar
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

X, Y, S = sp.symbols("x y s", real=True)
FIELD = [
    sp.sqrt(3) / 9 * X * sp.sin(sp.pi * TIME / 3) - X**3 + sp.sqrt(Y),
    (X + Y) ** sp.Rational(1, 3) / (1 + sp.Rational(1, 10) * Y) + sp.exp(-X) * sp.tanh(Y),
    sp.Integer(0),
]


def exact(t: float, x: float, y: float) -> list[float]:
    at = {TIME: sp.Rational(t), X: sp.Rational(x), Y: sp.Rational(y)}
    return [float(sp.N(f.subs(at), 30)) for f in FIELD]


def test_a_constant_is_rounded_once() -> None:
    folded = rounded(sp.Rational(1, 10) * 3 * X)
    assert folded == sp.Float(0.3, 17) * X  # 0.1 * 3 in doubles is 0.30000000000000004
    assert rounded(X**3 / 2).has(sp.Integer(3))
    assert rounded(sp.sqrt(X)).exp == sp.Rational(1, 2)


def test_scalar_agrees_with_exact_values() -> None:
    assert scalar((X, Y), FIELD)(0.75, 0.5, 1.25) == pytest.approx(exact(0.75, 0.5, 1.25), rel=4e-16)


def test_long_integers_are_doubles() -> None:
    """In units far from one."""
    field = (10**27 * X + 10**18, 10**27 / (Y + 2**60), sp.Integer(10**30))
    expected = (10**27 * 0.5 + 10**18, 10**27 / (1.25 + 2**60), 1e30)
    assert scalar((X, Y), field)(0.0, 0.5, 1.25) == expected


def test_a_root_of_a_negative_number_raises() -> None:
    with pytest.raises(ValueError, match="domain"):
        scalar((X, Y), [(X + Y) ** sp.Rational(1, 3)])(0.0, -1.0, 0.0)


def test_jacobian_is_the_derivative() -> None:
    found = Jacobian((X, Y), FIELD)(0.75, np.array([0.5, 1.25]))
    at = {TIME: 0.75, X: 0.5, Y: 1.25}
    want = [[float(sp.diff(f, v).subs(at)) for v in (X, Y)] for f in FIELD]
    assert found == pytest.approx(np.array(want), rel=1e-14)
    assert Jacobian((X,), [sp.Integer(1)])(0.0, np.array([1.0])).tolist() == [[0.0]]


def test_a_curved_guard_is_followed_and_a_flat_one_is_not() -> None:
    system = FilippovSystem((X, Y), (S,), (Y - 1,), (Y, sp.sin(TIME) - X**2 - 2 * S))
    assert ModeFunctions(system, (1,)).followed == ()
    stick = ModeFunctions(system, (0,))
    assert stick.followed == (0, 1)
    assert stick.start(0.0, (0.5, 1.0)).tolist() == [0.5, 1.0, 2.25, 1.75]  # 2 + x^2, then 2 - x^2


def test_landing_moves_to_the_nearest_point_of_the_surface() -> None:
    circle = FilippovSystem((X, Y), (S,), (X**2 + Y**2 - 1,), (X - S * Y, Y + S * X))
    h, below, above, *point = landing(circle, (1,), 0)(0.0, 0.6 + 3e-6, 0.8 + 4e-6)
    assert h == pytest.approx(1e-5, rel=1e-5)
    assert point == pytest.approx([0.6, 0.8], abs=1e-10)
    assert (below, above) == pytest.approx((2.0, 2.0), rel=1e-4)
    flat = FilippovSystem((X, Y), (S,), (Y - sp.Rational(2, 5),), (Y, -S))
    assert landing(flat, (1,), 0)(0.0, 3.0, 0.4000001)[3:] == (3.0, 0.4)


def test_heyoka_gets_the_same_expression_and_refuses_what_it_has_not() -> None:
    hy = pytest.importorskip("heyoka")
    variables = {X: hy.expression("x"), Y: hy.expression("y")}
    made = hy.cfunc([to_heyoka(f, variables) for f in FIELD], [variables[X], variables[Y]])
    assert made(np.array([0.5, 1.25]), time=0.75) == pytest.approx(exact(0.75, 0.5, 1.25), rel=1e-15)
    with pytest.raises(UnsupportedError, match="heyoka has no Abs"):
        to_heyoka(sp.Abs(X), variables)


def test_normal_velocities_are_taken_on_the_surface_not_beside_it() -> None:
    # 1e-6 off the surface a slope of 1e6 would halve the friction and turn the decision round.
    slip = Y - sp.Rational(1, 5)
    system = FilippovSystem((X, Y), (S,), (slip,), (Y, -S / (1 + 10**6 * S * slip) - X))
    _, below, above, *_ = landing(system, (-1,), 0)(0.0, 0.75, 0.2 - 1e-6)
    assert (below, above) == (0.25, -1.75)


def test_a_constant_that_is_no_number_is_a_model_error() -> None:
    with pytest.raises(ModelError, match="not a finite number"):
        rounded(sp.zoo * X)
    with pytest.raises(ModelError, match="not a finite number"):
        scalar((X,), [sp.nan])
