"""Modes of a system at points, by Taylor series in ball arithmetic and proven signs of their coefficients.

Smooth expressions are evaluated over truncated power series. No recurrence is shared with the Taylor tape or with
heyoka, so that decisions based on these series are a check on both.

A point has radii for its accuracy. A derivative is positive, negative, or *zero to the precision* if its ball contains
zero: a tie within the radius counts as exact. The next mode is decided by the common rule of
:mod:`henon_ref.modes.selection`; the values that the rule uses share no code with the reference integrator.
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
from henon_ref.harness.truth.reference import exact_ball
from henon_ref.method_cache import cached_method
from henon_ref.modes.arithmetic import BALLS, LAST_ORDER, Leading
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
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


def series_along(
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


def leading_term(coefficients: Sequence[arb], first: int = 0) -> tuple[int, int] | None:
    """(index, sign) of the first coefficient from ``first`` on that is proven nonzero, or None."""
    for k in range(first, len(coefficients)):
        if sign := sign_of(coefficients[k]):
            return k, sign
    return None


ORDERS = (1, 3, ORDER)
"""Orders of the guards' series, tried in turn; the first one decides nearly all events."""


class SeriesEvaluation:
    """The modes of one system at one precision: the arithmetic of :func:`henon_ref.modes.after_jump.after_jump`.

    ``bits``: precision of the exact numbers in the equations.
    """

    rounding = 0.0
    """0, because the radii of a point contain all errors."""

    def __init__(self, system: FilippovSystem, bits: int) -> None:
        self.system, self.bits = system, bits

    def at(self, time: arb, state: Sequence[arb]) -> Point:
        return Point(self, time, tuple(state))

    def at_start(self, problem: Problem) -> Point:
        start, *initial = (exact_ball(v, self.bits) for v in (problem.start, *problem.initial))
        return self.at(start, initial)

    def values(self, expressions: Sequence[sp.Expr], t: arb, x: Sequence[arb]) -> list[arb]:
        """Evaluate expressions in time and states at a point; raise ValueError if a value is not finite."""
        found = self.along([sp.Integer(0)] * len(x), expressions, t, x, 0)
        if not all(c[0].is_finite() for c in found):
            raise ValueError("a value is not finite")
        return [c[0] for c in found]

    def guard_series(self, mode: Mode, t: arb, x: Sequence[arb], order: int = ORDER) -> list[list[arb]]:
        """Taylor coefficients in time of a mode's guards."""
        equations = self.system.equations(mode)
        return self.along(equations.field, [g.expression for g in equations.guards], t, x, order)

    def along(
        self, field: Sequence[sp.Expr], outputs: Sequence[sp.Expr], t: arb, x: Sequence[arb], order: int
    ) -> list[list[arb]]:
        rates, found = map(self._numeric, field), map(self._numeric, outputs)
        return series_along(list(rates), list(found), self.system.states, t, x, bits=self.bits, order=order)

    @cached_method
    def _numeric(self, expression: sp.Expr) -> sp.Expr:
        """The expression with numbers for the parameters."""
        return self.system.numeric(expression)

    def sign(self, value: arb) -> int:
        """Sign of a value; 0 if its ball contains zero."""
        return sign_of(value)


class Point:
    """See :class:`henon_ref.modes.arithmetic.Point`."""

    arithmetic = BALLS
    levels = BALLS.levels

    def __init__(self, modes: SeriesEvaluation, time: arb, state: tuple[arb, ...]) -> None:
        self._modes, self.time, self.state = modes, time, state
        self.system = modes.system

    @property
    def when(self) -> str:
        """Time as written in messages."""
        return str(self.time.str(17, radius=False))

    @cached_method
    def series(self, mode: Mode, order: int) -> list[list[arb]]:
        """Taylor coefficients of a mode's guards; ZeroDivisionError or ValueError if they are not finite."""
        found = self._modes.guard_series(mode, self.time, self.state, order)
        if not all(value.is_finite() for own in found for value in own[:2]):
            raise ValueError("a derivative is not finite")
        return found

    def guards(self, mode: Mode) -> tuple[Guard, ...] | None:
        try:
            self.series(mode, ORDERS[0])
        except ModelError:
            return None
        return self.system.equations(mode).guards

    def leading(
        self, mode: Mode, place: int, first: int, zero: float = 0.0, beside: int | None = None
    ) -> Leading | None:
        found = (leading_term(self.series(mode, order)[place], first) for order in ORDERS)
        return next((term for term in found if term is not None), None)

    def late(self, mode: Mode, place: int, zero: float, index: int) -> Leading | None:
        return leading_term(self.series(mode, LAST_ORDER)[place], 1)

    def end_of_hold(self, mode: Mode, place: int, zero: float) -> Leading | None:
        return self.leading(mode, place, 0)

    def first_order(self, mode: Mode) -> list[list[arb]]:
        return self.series(mode, 1)

    def sides(self, mode: Mode, index: int) -> tuple[arb, arb]:
        beside = (self.system.entries(replaced(mode, index, way)) for way in (-1, 1))
        normal = self.system.normal_velocity(index)
        below, above = self._modes.values([normal.xreplace(side) for side in beside], self.time, self.state)
        return below, above

    def values(self, expressions: tuple[sp.Expr, ...], signs: Mode) -> list[arb] | None:
        entries = self.system.entries(signs)
        try:
            return self._modes.values([e.xreplace(entries) for e in expressions], self.time, self.state)
        except (ZeroDivisionError, ValueError):
            return None

    def same_motion(self, first: Mode, second: Mode) -> bool:
        fields = (self.system.equations(mode).field for mode in (first, second))
        one, other = (self._modes.along(field, self.system.states, self.time, self.state, ORDER) for field in fields)
        return all(BALLS.equal(a, b) for a, b in zip(one, other, strict=True))

    def leading_terms(self, mode: Mode, active: frozenset[int]) -> list[Leading | None] | None:
        """Leading term of each guard of a mode just after the point; None if the field is not finite.

        ``active``: surfaces that the point is exactly on.
        """
        try:
            guards = self.system.equations(mode).guards
            first = [1 if g.kind == "surface" and g.index in active else 0 for g in guards]
            return [self.leading(mode, place, order) for place, order in enumerate(first)]
        except (ZeroDivisionError, ValueError):  # python-flint raises these if a series does not exist
            return None

    def guard_values(self, mode: Mode) -> list[arb]:
        """Values of a mode's guards at the midpoint of the point (balls would drop digits below their radius)."""
        middle = self.time.mid(), [v.mid() for v in self.state]
        return [c[0] for c in self._modes.guard_series(mode, *middle, order=0)]
