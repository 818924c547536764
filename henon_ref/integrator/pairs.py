"""Conversion of Python numbers to pairs of doubles: the nearest double and the remainder."""

from __future__ import annotations

from collections.abc import Collection
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike, NDArray

from henon_ref.expressions.bounds import double_double, quotient

Pair = tuple[float, float]
"""Number as its nearest double and the remainder."""
SHORT = 1e6
"""A multiple of 1/256 below this has at most 15 decimals, so that Python prints it exactly."""


def pair_of(value: Any) -> Pair | None:
    """Return an int, float or Fraction as a pair; None for other types and for values that are not finite.

    A float stands for the decimal number that Python prints.

    >>> pair_of(3), pair_of(0.5), pair_of(0.1), pair_of("1/3"), pair_of(float("nan"))
    ((3.0, 0.0), (0.5, 0.0), (0.1, -5.551115123125783e-18), None, None)
    >>> from fractions import Fraction
    >>> pair_of(Fraction(1, 10)) == pair_of(0.1)
    True
    """
    if type(value) is int:
        return (float(value), 0.0) if abs(value) <= 2**53 else None  # up to this size integers are exact doubles
    if isinstance(value, float):  # NumPy's doubles are
        value = float(value)
        return (value, 0.0) if -SHORT < value < SHORT and (value * 256.0).is_integer() else _printed(value)
    return quotient(value.numerator, value.denominator) if type(value) is Fraction else None


def pairs_of(values: Collection[Any]) -> tuple[Pair, ...] | None:
    """Apply :func:`pair_of` to several values; None if it is None for one."""
    found = tuple([pair for value in values if (pair := pair_of(value)) is not None])
    return found if len(found) == len(values) else None


def exact_number(value: Any) -> Fraction:
    """Return the exact number that :func:`pair_of` represents."""
    return Fraction(repr(float(value))) if isinstance(value, float) else Fraction(value)


def exact_expression(value: Any) -> sp.Expr:
    """Return a number as an exact SymPy number; a SymPy number is returned unchanged."""
    if isinstance(value, sp.Expr):
        return value
    number = exact_number(value)
    return sp.Rational(number.numerator, number.denominator)


def pair_of_exact(value: Any) -> Pair:
    """Return a number as a pair; unlike :func:`pair_of`, also an exact SymPy number.

    ModelError if the value is not a finite real number.
    """
    found = None if isinstance(value, sp.Expr) else pair_of(value)
    return double_double(exact_expression(value)) if found is None else found


def decimal_pairs(values: ArrayLike) -> NDArray[np.float64]:
    """Apply :func:`pair_of` to each double of an array, shape (..., 2); the remainder of inf and NaN is 0."""
    high = np.asarray(values, dtype=np.float64)
    found = np.stack([high, np.zeros_like(high)], axis=-1)
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = high * 256.0
        decimals = np.isfinite(high) & ~((np.abs(high) < SHORT) & (np.floor(scaled) == scaled))
    different, places = np.unique(high[decimals], return_inverse=True)
    lows = [(_printed(value) or (value, 0.0))[1] for value in different.tolist()]
    found[decimals, 1] = np.array(lows, dtype=np.float64)[places.ravel()]
    return found


@lru_cache(maxsize=256)  # most of many runs have the same initial values and horizon
def _printed(value: float) -> Pair | None:
    """Return a double and the remainder of the decimal number that Python prints for it; None if not finite."""
    try:
        numerator, denominator = value.as_integer_ratio()
    except (OverflowError, ValueError):  # infinity, NaN
        return None
    mantissa, _, exponent = repr(value).partition("e")
    whole, _, decimals = mantissa.partition(".")
    digits, shift = int(whole + decimals), len(decimals) - int(exponent or 0)
    if shift < 0:
        return value, (digits * 10**-shift * denominator - numerator) / denominator
    scale = 10**shift
    return value, (digits * denominator - numerator * scale) / (denominator * scale)
