"""Conversions of digits between SymPy, heyoka and balls lose and add no digits."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import pytest
import sympy as sp
from flint import arb, ctx
from hypothesis import given
from hypothesis import strategies as st

from henon_ref.errors import ModelError
from henon_ref.harness.truth.reference import (
    STATE_DIGITS,
    ReferenceTransition,
    ball_text,
    exact_ball,
    exact_text,
    split_double,
    to_ball,
    with_short_state,
)


def test_exact_text_has_the_digits_of_the_exact_number() -> None:
    digits = Decimal(exact_text(sp.sqrt(3) / 9, 256))
    assert abs((9 * digits) ** 2 - 3) < Decimal("1e-26")  # Decimal's own default precision
    assert exact_text(sp.Rational(1, 3), 256).startswith("0." + "3" * 80)


def test_exact_text_refuses_what_is_no_real_number() -> None:
    with pytest.raises(ModelError, match="not a real number"):
        exact_text(sp.sqrt(-2), 128)


def test_heyoka_numbers_and_balls_convert_without_loss() -> None:
    hy = pytest.importorskip("heyoka")
    from henon_ref.harness.truth.multiprecision.heyoka import to_real

    with ctx.workprec(288):
        third = to_ball(to_real(exact_ball(sp.Rational(1, 3), 256), 256))
        assert to_real(third, 256) == hy.real("1", 256) / hy.real("3", 256)
        assert abs(3 * third - 1) < arb(2) ** -255


def test_no_double_is_on_the_way_of_a_tenth() -> None:
    with ctx.workprec(288):
        assert abs(exact_ball(sp.Rational(1, 10), 256) * 10 - 1) < arb(2) ** -280


@pytest.mark.parametrize(
    ("number", "radius", "text"),
    [
        ("2/3", 1e-5, "0.6666667"),
        ("0", 1e-3, "0.00000"),
        ("-1/3", 1e-2, "-0.3333"),
        ("1000000000/7", 1.0, "142857142.86"),
        ("1/3000000000000", 1e-15, "3.3333e-13"),
    ],
)
def test_digits_are_written_as_far_as_the_radius_goes(number: str, radius: float, text: str) -> None:
    with ctx.workprec(200):
        assert ball_text(exact_ball(sp.Rational(number), 128), radius) == text


def _with_state(*state: str, radius: float) -> ReferenceTransition:
    return ReferenceTransition("release", 0, (0,), (1,), "1", 1e-50, state, radius)


@pytest.mark.parametrize(
    ("state", "short"),
    [
        ("-0.024" + "0" * 60, "-0.024"),
        ("-0." + "0" * 64, "0"),
        ("12" + "0" * 40, "1.2e+41"),
        ("1e25", "1e+25"),
        ("1e24", "1" + "0" * 24),
        ("1200.00", "1200"),
        ("0." + "9" * 64, "1"),
        ("0." + "6" * 64, "0.6666666666666666666666667"),
        ("6." + "6" * 30 + "e-40", "6.666666666666666666666667e-40"),
    ],
)
def test_a_state_is_kept_in_digits_that_a_double_can_use(state: str, short: str) -> None:
    assert with_short_state(_with_state(state, radius=1e-63)).state == (short,)


DECIMALS = st.builds(
    lambda digits, exponent: f"{digits}e{exponent}", st.integers(-(10**70), 10**70), st.integers(-400, 200)
)


@given(st.lists(DECIMALS, min_size=1, max_size=3), st.integers(-308, 0))
def test_the_radius_of_a_short_state_holds_what_the_radius_of_the_whole_one_held(state: list[str], power: int) -> None:
    whole = _with_state(*state, radius=10.0**power)
    short = with_short_state(whole)
    lost = max(abs(Fraction(a) - Fraction(b)) for a, b in zip(short.state, state, strict=True))
    assert Fraction(whole.state_radius) + lost <= Fraction(short.state_radius)
    assert all(len(Decimal(value).as_tuple().digits) <= STATE_DIGITS for value in short.state)
    assert (short.state_radius == whole.state_radius) == (lost == 0)
    assert with_short_state(short) == short


@given(st.decimals(min_value=-1e12, max_value=1e12, allow_nan=False, places=40))
def test_a_double_and_what_it_lost_make_up_the_number(number: Decimal) -> None:
    high, low = split_double(str(number))
    assert high == float(number)
    exact = Fraction(number)
    assert abs(Fraction(high) + Fraction(low) - exact) <= abs(exact) / 2**104


def test_what_tells_modes_apart_is_one_number_in_a_product() -> None:
    """Of a product of several parameters heyoka makes a series, whose product costs the square of the order."""
    hy = pytest.importorskip("heyoka")
    from henon_ref.harness.truth.multiprecision.heyoka import RealParameters, to_heyoka

    x, sign, slip = sp.symbols("x s p", real=True)
    numbers = RealParameters(128)
    made = to_heyoka(slip * sign * sp.Rational(2, 7) / (1 + x), {x: hy.make_vars("x")}, numbers, (sign, slip))
    assert len(numbers) == 1
    assert hy.get_variables(made) == ["x"]
    for entries, value in (((1, 1), "2/7"), ((-1, 1), "-2/7"), ((1, 0), "0")):
        (number,) = numbers.values({sign: sp.Integer(entries[0]), slip: sp.Integer(entries[1])})
        assert to_ball(number) == to_ball(hy.real(str(sp.N(sp.Rational(value), 60)), 128))
