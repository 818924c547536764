"""Constants by a program in double-double: against exact numbers, with error bounds that hold."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from hypothesis import example, given
from hypothesis import strategies as st

from henon_ref.errors import ModelError
from henon_ref.expressions.bounds import double_double
from henon_ref.integrator.constant_program import constant_program

A, B, C = sp.symbols("a b c", real=True)
EXPRESSIONS = (
    A + B / 3 - C,
    A * B - C**2,
    (A - B) * (A + B) / (C - sp.Rational(1, 10)),
    sp.sqrt(A**2 + B**2 + 1) * sp.pi,
    C**-3 + A**7,
    sp.exp(-sp.Abs(A - B) / 4) * sp.sin(C) + sp.log(1 + A**2),
    (1 + A**2) ** sp.Rational(3, 2) + (2 + sp.cos(B)) ** sp.Rational(-1, 3),
    sp.sqrt(2) / 7,
)
PROGRAM = constant_program((A, B, C), EXPRESSIONS)
doubles = st.floats(-50, 50).filter(lambda v: abs(v) > 0.05)


def exact(expression: sp.Expr, values: tuple[float, ...]) -> sp.Expr:
    return expression.xreplace({s: sp.Rational(v) for s, v in zip((A, B, C), values, strict=True)})


@given(st.tuples(doubles, doubles, doubles))
@example((1.0, 2.0, 0.1))
def test_each_number_is_within_its_error_bound_of_the_exact_one(values: tuple[float, float, float]) -> None:
    found = PROGRAM.registers(np.array([values]))[0, list(PROGRAM.outputs)]
    pole = min(1.0, abs(values[2] - 0.1) or 2.0**-57)  # of the third expression: the double 0.1 is 5.6e-18 from it
    for (high, low, error), expression in zip(found.tolist(), EXPRESSIONS, strict=True):
        number = exact(expression, values)
        off = abs(sp.N(number - sp.Rational(high) - sp.Rational(low), 60))
        assert off <= error
        assert error <= 1e-22 * (1 + max(map(abs, values))) ** 8 / pole**2


def test_what_needs_no_cancellation_is_the_exact_number_s_double_double() -> None:
    rng = np.random.default_rng(7)
    for values in rng.uniform(0.1, 9, (50, 3)):
        found = PROGRAM.registers(values[None])[0, list(PROGRAM.outputs)]
        for k in (3, 5, 7):
            high, low = double_double(exact(EXPRESSIONS[k], tuple(values)))
            assert found[k, 0] == high
            assert found[k, 1] == pytest.approx(low, abs=1e-28 * abs(high))


def test_many_points_are_those_one_by_one() -> None:
    values = np.random.default_rng(1).uniform(0.5, 2, (40, 3))
    values[::2, 2] = 1.0  # functions are evaluated once for each distinct argument
    together = PROGRAM.registers(values)
    for row, each in zip(values, together, strict=True):
        assert np.array_equal(PROGRAM.registers(row[None])[0], each)


def test_in_doubles_it_is_the_function_of_the_expressions() -> None:
    for values in np.random.default_rng(3).uniform(0.5, 9, (20, 3)).tolist():
        wanted = [float(sp.N(exact(expression, tuple(values)), 30)) for expression in EXPRESSIONS]
        assert PROGRAM.in_doubles(values) == pytest.approx(wanted, rel=1e-9)
    for point, error in (((1.0, 1.0, 0.1), ZeroDivisionError), ((1e200, 1.0, 1.0), OverflowError)):
        with pytest.raises(error):
            PROGRAM.in_doubles(point)


def numbers(*values: float) -> list[sp.Expr]:
    return [sp.Rational(value) for value in values]


def test_signs_are_exact() -> None:
    rational = constant_program((A, B, C), (A - B, A * B - C, A - sp.Rational(1, 10)))
    assert rational.signs(numbers(0.5, 0.5, 0.25)) == [0, 0, 1]
    sign = int(Fraction(0.1) / 2 > Fraction(0.05))
    assert rational.signs(numbers(0.1, 0.5, 0.05)) == [-1, sign, 1]  # 0.1 is above 1/10
    tiny = constant_program((A, B), (A * B - 1,))
    assert tiny.signs(numbers(3.0, 1 / 3)) == [-1]
    other = constant_program((A, B), (sp.sqrt(A) - B, sp.sin(A) - B, sp.cos(B) - 1))
    assert other.signs(numbers(4.0, 2.0)) == [0, -1, -1]
    assert other.signs(numbers(0.0, 0.0)) == [0, 0, 0]


def test_a_number_that_is_not_finite_says_so() -> None:
    program = constant_program((A,), (1 / A, sp.log(A), sp.sqrt(A)))
    at_zero, below = (program.registers(np.array([[v]]))[0, list(program.outputs)] for v in (0.0, -1.0))
    assert not np.isfinite(at_zero[0, :2]).all()
    assert not np.isfinite(below[1:, :2]).any()


def test_what_has_no_program_is_refused() -> None:
    with pytest.raises(ModelError, match="no program"):
        constant_program((A,), (sp.gamma(A),))


def test_a_constant_that_cancels_is_evaluated_anew() -> None:
    program = constant_program((A, B), ((A + B) ** 2 - A**2 - 2 * A * B, A / 3))
    values = np.array([[3.0**20 + 0.5, 2.0**-40 / 3], [1.0, 1.0]])
    before = program.registers(values)[:, list(program.outputs)]
    found = program.pairs(values, lambda point: numbers(*values[point].tolist())).reshape(2, 2, 2)
    for row, (a, b) in zip(found, values.tolist(), strict=True):
        exact = sp.Rational(b) ** 2, sp.Rational(a) / 3
        assert [value for value, _ in row.tolist()] == [float(number) for number in exact]
    assert before[0, 0, 0] != found[0, 0, 0]
    assert np.array_equal(before[0, 1, :2], found[0, 1])
    assert np.array_equal(before[1, :, :2], found[1])
