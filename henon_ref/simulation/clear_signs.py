"""Signs of polynomials in double precision, where rounding cannot have changed them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import sympy as sp

CLEAR = 1e-9
"""Part of the size of its terms that a sum is larger than where its sign is beyond rounding: a thousand terms of a
thousand factors each are off by less."""
MOST_TERMS = 100
"""Terms of one polynomial: more are left to others."""


def sign_function(
    symbols: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]
) -> Callable[..., tuple[int, ...] | None] | None:
    """What gives the signs of some expressions at a point; None where one of them is no short sum of products.

    Parameters
    ----------
    symbols : sequence of Symbol
        What the function takes, as floats that are off by no more than rounding.
    expressions : sequence of Expr

    Returns
    -------
    callable or None
        It returns None where a sign is not beyond rounding.
    """
    sums = [sp.Add.make_args(sp.expand(e)) for e in expressions]
    if any(len(terms) > MOST_TERMS or not all(map(_is_product, terms)) for terms in sums):
        return None
    values_at = sp.lambdify(symbols, [_value_and_size(terms) for terms in sums], "math")

    def signs(*point: float) -> tuple[int, ...] | None:
        found = []
        try:
            values = values_at(*point)
        except ArithmeticError:
            return None
        for value, size in values:
            if not abs(value) > CLEAR * size:  # nor where they are not finite
                return None
            found.append(1 if value > 0.0 else -1)
        return tuple(found)

    return signs


def _value_and_size(terms: Sequence[sp.Expr]) -> tuple[sp.Expr, sp.Expr]:
    """A sum, and that of the sizes of its terms, as they are to be evaluated."""
    return sp.Add(*terms, evaluate=False), sp.Add(*(sp.Abs(term, evaluate=False) for term in terms), evaluate=False)


def _is_product(term: sp.Expr) -> bool:
    """Whether a term is a product of rational numbers and whole powers of symbols."""
    factors = (factor.as_base_exp() for factor in sp.Mul.make_args(term))
    return all((base.is_Rational or base.is_Symbol) and exponent.is_Integer for base, exponent in factors)
