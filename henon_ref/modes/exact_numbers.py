"""Exact numbers."""

from __future__ import annotations

from functools import lru_cache

import sympy as sp

from henon_ref.errors import ModelError


def exact_sign(number: sp.Expr) -> int:
    """Sign of an exact number: of one that is not rational by its digits, 0 where 60 of them show nothing.

    +1 of what has no real value, as a kink of a branch that is not used has (all else is refused before).
    """
    if number.is_Rational:
        return int(sp.sign(number))
    digits = sp.N(number, 60, maxn=400, chop=False)
    if digits.has(sp.nan, sp.zoo) or abs(sp.im(digits)) > sp.Float("1e-55", 60):
        return 1
    value = sp.re(digits)
    if abs(value) < sp.Float("1e-55", 60):
        return 0
    return 1 if value > 0 else -1


@lru_cache(maxsize=4096)
def double_double(number: sp.Expr) -> tuple[float, float]:
    """An exact number as the nearest double and what that leaves, rounded again.

    Raises
    ------
    ModelError
        If it is not a finite real number.
    """
    rest = sp.N(number, 50)
    if not rest.is_number or not rest.is_real or not rest.is_finite:
        raise ModelError(f"not a finite real number: {number}")
    high = float(rest)
    return high, float(rest - sp.Float(high, 50))


class Rounded:
    """An exact number that is compared by its first digits, and by all of them only where these are the same."""

    def __init__(self, exact: sp.Expr) -> None:
        self.exact = exact
        self.value = float(exact)

    def __lt__(self, other: Rounded) -> bool:
        if abs(self.value - other.value) > 1e-12 * (abs(self.value) + abs(other.value)):
            return self.value < other.value
        return self.exact != other.exact and exact_sign(other.exact - self.exact) > 0
