"""Equality of expressions as mathematics, not as text."""

from __future__ import annotations

from collections.abc import Collection

import sympy as sp

from henon_ref.harness.studies.paper.systems import K1, K2, MU0, M

_POSITIVE = {symbol: sp.Symbol(symbol.name, positive=True) for symbol in (M, K1, K2, MU0)}


def same(one: sp.Expr, other: sp.Expr) -> bool:
    """Whether two expressions are equal, masses, stiffnesses and friction being positive."""
    difference = sp.simplify((sp.sympify(one) - other).xreplace(_POSITIVE))
    # Cosines of parts of pi: SymPy proves these by their minimal polynomial.
    return bool(difference == 0 or (not difference.free_symbols and difference.equals(0)))


def same_set(found: Collection[sp.Expr], printed: Collection[sp.Expr]) -> bool:
    """Whether two sets of expressions are equal."""
    return len(found) == len(printed) and all(any(same(a, b) for a in found) for b in printed)
