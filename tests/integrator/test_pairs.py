"""Pairs of doubles are the exact numbers, rounded twice."""

from __future__ import annotations

import doctest
import random
from fractions import Fraction

import numpy as np
import sympy as sp

from henon_ref.expressions.bounds import double_double
from henon_ref.integrator import pairs


def test_the_examples() -> None:
    assert doctest.testmod(pairs).failed == 0


def test_they_are_those_of_exact_numbers() -> None:
    draw = random.Random(2)
    for k in range(2000):
        value = draw.uniform(-1, 1) * 10.0 ** draw.randint(-300, 300)
        value = draw.choice([value, round(value, 3), draw.randint(-(10**8), 10**8) / 2 ** draw.randint(0, 12)])
        fraction = Fraction(draw.randint(-(10**9), 10**9), draw.randint(1, 10**6))
        for number, exact in ((value, Fraction(repr(value))), (fraction, fraction), (k**4, Fraction(k**4))):
            wanted = float(exact), float(exact - Fraction(float(exact)))
            assert pairs.pair_of(number) == double_double(sp.Rational(exact)) == wanted


def test_a_remainder_has_all_its_digits_where_it_is_small() -> None:
    assert double_double(sp.Rational(3, 2) - sp.Rational(5, 10**41)) == (1.5, -5e-41)


def test_what_is_none_of_these_is_left_to_others() -> None:
    others = [True, None, "1", 1j, np.inf, -np.inf, np.nan, 2**60, Fraction(10**400), sp.Integer(1), np.int64(1), [1.0]]
    assert [pairs.pair_of(value) for value in others] == [None] * len(others)
    assert pairs.pair_of(np.float64(0.1)) == pairs.pair_of(0.1)
