"""A problem's smooth equations as functions of arrays: closed forms of a block on a belt."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.modes.problem import Problem
from henon_ref.modes.switched_field import SlidingOverride
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

X, V, S, F, B = sp.symbols("x v s F b", real=True)
FRICTION, BELT = 0.75, 0.1
T, STATE = 2.0, np.array([0.25, -0.5])


def belt() -> Problem:
    """x'' = -x^2 + t - F s on a belt of speed b."""
    numbers = {F: sp.Rational(3, 4), B: sp.Rational(1, 10)}
    system = FilippovSystem((X, V), (S,), (V - B,), (V, -(X**2) + TIME - F * S), parameters=numbers)
    return Problem(system, sp.Integer(0), (sp.Integer(1), sp.Integer(0)), sp.Integer(10))


@pytest.mark.parametrize("sign", [-1, 1])
def test_slip_has_the_field_of_its_sign_and_the_distance_from_its_surface(sign: int) -> None:
    problem = belt()
    rates = problem.right_hand_side((sign,))(T, STATE)
    assert rates.shape == (2,)
    assert rates == pytest.approx([STATE[1], -(STATE[0] ** 2) + T - sign * FRICTION], abs=1e-15)
    assert problem.guards((sign,))(T, STATE) == pytest.approx([sign * (STATE[1] - BELT)], abs=1e-15)


def test_a_slide_moves_with_the_belt_and_ends_where_friction_holds_no_longer() -> None:
    problem = belt()
    assert problem.right_hand_side((0,))(T, STATE).tolist() == [BELT, 0.0]
    guards, ends = problem.guards((0,)), problem.system.equations((0,)).guards
    at = {sign: np.array([np.sqrt(T - sign * FRICTION), BELT]) for sign in (-1, 1)}
    for k, guard in enumerate(ends):
        # The spring's force and the drive's are F s at the end to which the slide is released with sign s.
        assert guards(T, at[guard.to_sign])[k] == pytest.approx(0.0, abs=1e-15)
        assert guards(T, at[-guard.to_sign])[k] > 0.5
    assert guards(T, STATE).shape == (len(ends),)


@pytest.mark.parametrize("mode", [(-1,), (0,), (1,)])
def test_the_jacobian_is_the_derivative_of_the_field(mode: tuple[int, ...]) -> None:
    problem = belt()
    field, jacobian = problem.right_hand_side(mode), problem.jacobian(mode)(T, STATE)
    h = 2.0**-20
    central = [(field(T, STATE + h * e) - field(T, STATE - h * e)) / (2 * h) for e in np.eye(2)]
    assert jacobian.shape == (2, 2)
    assert jacobian == pytest.approx(np.array(central).T, abs=1e-9)


def test_where_the_field_has_no_value_all_of_it_is_nan() -> None:
    system = FilippovSystem((X, V), (S,), (V - 1 / X,), (sp.sqrt(X) - S, sp.Integer(1)))
    problem = Problem(system, sp.Integer(0), (sp.Integer(1), sp.Integer(0)), sp.Integer(1))
    outside, at_zero = np.array([-1.0, 0.0]), np.array([0.0, 0.0])
    assert np.isnan(problem.right_hand_side((1,))(0.0, outside)).all()
    assert np.isnan(problem.guards((1,))(0.0, at_zero)).all()
    slopes = problem.jacobian((1,))(0.0, at_zero)
    assert np.isnan(slopes[0, 0])
    assert slopes[1].tolist() == [0.0, 0.0]


def test_a_mode_without_equations_is_refused() -> None:
    system = FilippovSystem((X, V), (S, F), (X, V), (-S, -F), overrides={0: SlidingOverride((V, X), ())})
    problem = Problem(system, sp.Integer(0), (sp.Integer(1), sp.Integer(1)), sp.Integer(1))
    for numeric in (problem.right_hand_side, problem.guards, problem.jacobian):
        with pytest.raises(ModelError, match="cannot slide together"):
            numeric((0, 0))
