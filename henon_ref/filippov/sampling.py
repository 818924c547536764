"""Expressions at one point of no meaning: whether two of them are the same, without algebra."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from henon_ref.filippov.bounds import put
from henon_ref.filippov.switched_field import SwitchedField
from henon_ref.taylor.tape import TIME

DIGITS, AGREE = 40, sp.Float("1e-25")
"""Digits of the values, and how far apart two of the same may be, of their size."""


def sample(system: SwitchedField, expressions: Sequence[sp.Expr]) -> list[sp.Expr]:
    """Values of expressions at a point whose coordinates are quotients of primes, the system's parameters put in."""
    symbols = sorted(set().union(*(e.free_symbols for e in expressions)), key=str)
    numbers = {s: sp.Rational(sp.prime(k + 7), sp.prime(k + 17)) for k, s in enumerate(symbols)}
    numbers |= {TIME: sp.Rational(3, 7), **system.parameters}
    return [sp.N(put(e, numbers), DIGITS) for e in expressions]
