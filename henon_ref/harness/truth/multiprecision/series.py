"""Taylor series of smooth expressions in ball arithmetic, and proven signs of their coefficients.

Expressions are evaluated over truncated power series. No recurrence is shared with the Taylor tape or with heyoka, so
that decisions based on these series are a check on both.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import reduce
from operator import add, mul

import sympy as sp
from flint import arb, arb_series, ctx

from henon_ref.enclosure.balls import sign_of
from henon_ref.errors import ModelError
from henon_ref.expressions.traversal import Rules, Walk, fold
from henon_ref.harness.truth.multiprecision.numbers import exact_ball
from henon_ref.taylor.tape import TIME

ORDER = 12
"""Highest derivative examined before a contact counts as one that never separates."""


def _evaluated(expressions: Iterable[sp.Expr], values: Mapping[sp.Expr, arb_series], bits: int) -> Iterator[arb_series]:
    """Evaluate expressions over truncated power series (of length one: over balls), common parts once.

    ``bits`` is the precision of the exact numbers in the expressions.
    """

    def power(e: sp.Expr, walk: Walk[arb_series]) -> arb_series:
        if not e.exp.is_number:
            return (walk(e.exp) * walk(e.base).log()).exp()
        return constant_power(walk(e.base), e.exp)

    def constant_power(base: arb_series, exponent: sp.Expr) -> arb_series:
        if exponent.could_extract_minus_sign():
            return 1 / constant_power(base, -exponent)
        if exponent.is_Integer:
            return reduce(mul, [base] * int(exponent))
        if (2 * exponent).is_Integer:
            return constant_power(base.sqrt(), 2 * exponent)
        return (exact_ball(exponent, bits) * base.log()).exp()

    rules = Rules(
        number=lambda e: arb_series([exact_ball(e, bits)]),
        add=lambda e, walk: reduce(add, map(walk, e.args)),
        multiply=lambda e, walk: reduce(mul, map(walk, e.args)),
        power=power,
        function=lambda e, walk: _function(e.func.__name__, walk(e.args[0]), e),
    )
    known = dict(values)
    return (fold(expression, rules, known) for expression in expressions)


def _function(name: str, a: arb_series, e: sp.Expr) -> arb_series:
    if name in ("sin", "cos", "tan", "asin", "acos", "atan", "exp", "log"):
        return getattr(a, name)()
    if name == "sinh":
        return (a.exp() - (-a).exp()) / 2
    if name == "cosh":
        return (a.exp() + (-a).exp()) / 2
    if name == "tanh":
        return 1 - 2 / ((2 * a).exp() + 1)
    raise ModelError(f"no power series for {e}: a field is smooth in t and x; write signs as sign symbols")


def along(
    field: Sequence[sp.Expr],
    outputs: Sequence[sp.Expr],
    states: Sequence[sp.Symbol],
    time: arb,
    point: Sequence[arb],
    *,
    bits: int,
    order: int = ORDER,
) -> list[list[arb]]:
    """Taylor coefficients in time of functions (``outputs``) along the solution through a point.

    ``field`` (x') and ``outputs`` are in time and states, without parameters. The ``order + 1`` coefficients of each
    output enclose those for every point within the radii. ModelError if a function has no power series here.
    """
    cap = ctx.cap
    ctx.cap = order + 1
    try:
        solution = [[x] for x in point]
        for k in range(order + 1):
            values: dict[sp.Expr, arb_series] = {TIME: arb_series([time, 1])}
            values.update((x, arb_series(s)) for x, s in zip(states, solution, strict=True))
            if k == order:
                return [[e[i] for i in range(order + 1)] for e in _evaluated(outputs, values, bits)]
            ctx.cap = k + 1
            slopes = [f[k] for f in _evaluated(field, values, bits)]
            ctx.cap = order + 1
            for coefficients, slope in zip(solution, slopes, strict=True):
                coefficients.append(slope / (k + 1))
    finally:
        ctx.cap = cap
    raise AssertionError("unreachable")


def leading(coefficients: Sequence[arb], first: int = 0) -> tuple[int, int] | None:
    """(index, sign) of the first coefficient from ``first`` on that is proven nonzero, or None."""
    for k in range(first, len(coefficients)):
        if sign := sign_of(coefficients[k]):
            return k, sign
    return None
