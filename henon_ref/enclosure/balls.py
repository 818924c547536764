"""Enclosures of SymPy expressions in balls, without conversion to floats, and algebraic proofs of zero."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import reduce

import sympy as sp
from flint import arb, fmpq, fmpz

from henon_ref.errors import ModelError
from henon_ref.expressions.algebra import simplified
from henon_ref.expressions.bounds import terms
from henon_ref.expressions.grammar import ELEMENTARY
from henon_ref.expressions.traversal import Rules, Walk, fold, is_longer

MAX_PROOF_OPERATIONS = 400
"""Largest number of operations for which a proof is tried, since algebra may not end; a quarter of it if the expression
has symbols."""

_FUNCTIONS: dict[str, Callable[[arb], arb]] = {
    name: getattr(arb, name) for name in (*ELEMENTARY, "asinh", "acosh", "atanh")
} | {"Abs": abs}


def enclose(expression: sp.Expr, values: Mapping[sp.Symbol, arb] | None = None) -> arb:
    """Return a ball, at the working precision of ``flint.ctx``, that contains the value of an expression.

    The expression has exact numbers, elementary functions, and symbols, with a ball for each in ``values``. ModelError
    if a symbol has no value, or a function has no version for balls.

    >>> enclose(sp.sqrt(2) ** 2 - 1).contains(1)
    True
    """
    return fold(sp.sympify(expression), _RULES, dict(values or {}))


def _number(e: sp.Expr) -> arb:
    if e.is_Integer:
        return arb(fmpz(int(e)))
    if e.is_Rational or e.is_Float:  # a Float denotes its binary value exactly
        exact = sp.Rational(e)
        return arb(fmpq(int(exact.p), int(exact.q)))
    if e is sp.pi or e is sp.E:
        return arb.pi() if e is sp.pi else arb.const_e()
    raise _without_enclosure(e)


def _function(e: sp.Expr, walk: Walk[arb]) -> arb:
    name = e.func.__name__
    if name == "atan2":
        return walk(e.args[0]).atan2(walk(e.args[1]))
    if name in _FUNCTIONS and len(e.args) == 1:
        return _FUNCTIONS[name](walk(e.args[0]))
    raise _without_enclosure(e)


def _without_enclosure(e: sp.Expr) -> ModelError:
    return ModelError(f"{e} has no enclosure: it is not an exact number, a state, the time or an elementary function")


def _power(e: sp.Expr, walk: Walk[arb]) -> arb:
    if e.base is sp.E:
        return walk(e.exp).exp()
    base = walk(e.base)
    if e.exp.is_Integer:
        n = int(e.exp)
        # By products: arb's power is undefined on a ball that contains zero.
        result = reduce(arb.__mul__, [base] * abs(n), arb(1))
        return result if n > 0 else 1 / result
    if e.exp == sp.Rational(1, 2):
        return base.sqrt()
    if e.exp == -sp.Rational(1, 2):
        return base.rsqrt()
    return base ** walk(e.exp)


_RULES = Rules(
    number=_number,
    add=lambda e, walk: reduce(arb.__add__, map(walk, e.args)),
    multiply=lambda e, walk: reduce(arb.__mul__, map(walk, e.args)),
    power=_power,
    function=_function,
    into_numbers=True,
)


def proves_zero(expression: sp.Expr) -> bool:
    """Check whether an expression is proven to be zero by algebra: by simplification or its minimal polynomial.

    False means that no proof was found, not that the expression differs from zero.

    >>> z = 2 / sp.sqrt(3) * sp.sin(sp.pi / 18)  # the tangent point of Fig. 8, Eq. (24)
    >>> proves_zero(z**3 - z + sp.sqrt(3) / 9)
    True
    """
    if terms(expression) <= MAX_PROOF_OPERATIONS:
        expression = sp.expand(expression)
    if expression == 0 or simplified(expression) == 0:
        return True
    patience = MAX_PROOF_OPERATIONS if expression.is_number else MAX_PROOF_OPERATIONS // 4
    if is_longer(expression, patience):
        return False
    simple = sp.simplify(expression)
    if simple == 0:
        return True
    if simple.free_symbols or not simple.is_algebraic:
        return False
    unknown = sp.Dummy("x")
    return bool(sp.minimal_polynomial(simple, unknown) == unknown)


def sign_of(ball: arb) -> int:
    """Return the sign of a ball; 0 if it contains zero or is not finite."""
    return 0 if not ball.is_finite() or ball.contains(0) else (1 if ball > 0 else -1)
