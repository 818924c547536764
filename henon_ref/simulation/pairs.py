"""Numbers from Python as the compiled loop takes them: a double and what it leaves of the exact number."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

Pair = tuple[float, float]
"""A number as its double and what that leaves."""
WHOLE = 2**53
"""Whole numbers up to here are doubles."""
SHORT = 1e6
"""A multiple of 1/256 below this has no more than 15 decimals: it is printed as it is."""


def pair_of(value: Any) -> Pair | None:
    """An int, a Fraction, or a float, which stands for the decimal number that it is printed as; else None.

    Examples
    --------
    >>> pair_of(3), pair_of(0.5), pair_of(0.1), pair_of("1/3"), pair_of(float("nan"))
    ((3.0, 0.0), (0.5, 0.0), (0.1, -5.551115123125783e-18), None, None)
    >>> from fractions import Fraction
    >>> pair_of(Fraction(1, 10)) == pair_of(0.1)
    True
    """
    kind = type(value)
    if isinstance(value, float):  # NumPy's doubles are
        value = float(value)
        return (value, 0.0) if -SHORT < value < SHORT and (value * 256.0).is_integer() else _printed(value)
    if kind is int and -WHOLE <= value <= WHOLE:
        return float(value), 0.0
    if kind is Fraction:
        return _rational(value.numerator, value.denominator)
    return None


def exact_number(value: Any) -> Fraction:
    """What :func:`pair_of` is a pair of, exactly."""
    return Fraction(repr(float(value))) if isinstance(value, float) else Fraction(value)


def _rational(numerator: int, denominator: int) -> Pair | None:
    """A quotient of whole numbers; None where it is no double."""
    try:
        high = numerator / denominator
        p, q = high.as_integer_ratio()
        return high, (numerator * q - p * denominator) / (denominator * q)
    except OverflowError:
        return None


def _printed(value: float) -> Pair | None:
    """A double and what it leaves of the decimal number that it is printed as; None where it is not finite."""
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
