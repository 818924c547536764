"""Modes of a system at points in ball arithmetic, by the truth's own series (:mod:`.series`).

A point has radii for its accuracy. A derivative is positive, negative, or *zero to the precision* if its ball contains
zero: a tie within the radius counts as exact. The next mode is decided by the common rule of
:mod:`henon_ref.modes.selection`; the values that the rule uses share no code with the reference integrator.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp
from flint import arb

from henon_ref.errors import ModelError
from henon_ref.harness.truth.multiprecision import series
from henon_ref.method_cache import cached_method
from henon_ref.modes.arithmetic import BALLS, Leading
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem

ORDERS = (1, 3, series.ORDER)
"""Orders of the guards' series, tried in turn; the first one decides nearly all events."""


class SeriesEvaluation:
    """The modes of one system at one precision: the arithmetic of :func:`henon_ref.modes.after_jump.after_jump`.

    Parameters
    ----------
    system : FilippovSystem
    bits : int
        Precision of the exact numbers in the equations.
    """

    rounding = 0.0
    """0, because the radii of a point contain all errors."""

    def __init__(self, system: FilippovSystem, bits: int) -> None:
        self.system, self.bits = system, bits

    def at(self, time: arb, state: Sequence[arb]) -> Point:
        return Point(self, time, tuple(state))

    def at_start(self, problem: Problem) -> Point:
        start, *initial = (series.exact_ball(v, self.bits) for v in (problem.start, *problem.initial))
        return self.at(start, initial)

    def values(self, expressions: Sequence[sp.Expr], t: arb, x: Sequence[arb]) -> list[arb]:
        """Evaluate expressions in time and states at a point; raise ValueError if a value is not finite."""
        found = self.along([sp.Integer(0)] * len(x), expressions, t, x, 0)
        if not all(c[0].is_finite() for c in found):
            raise ValueError("a value is not finite")
        return [c[0] for c in found]

    def guard_series(self, mode: Mode, t: arb, x: Sequence[arb], order: int = series.ORDER) -> list[list[arb]]:
        """Taylor coefficients in time of a mode's guards."""
        equations = self.system.equations(mode)
        return self.along(equations.field, [g.expression for g in equations.guards], t, x, order)

    def along(
        self, field: Sequence[sp.Expr], outputs: Sequence[sp.Expr], t: arb, x: Sequence[arb], order: int
    ) -> list[list[arb]]:
        rates, found = map(self._numeric, field), map(self._numeric, outputs)
        return series.along(list(rates), list(found), self.system.states, t, x, bits=self.bits, order=order)

    @cached_method
    def _numeric(self, expression: sp.Expr) -> sp.Expr:
        """The expression with numbers for the parameters."""
        return self.system.numeric(expression)

    def sign(self, value: arb) -> int:
        """Sign of a value; 0 if its ball contains zero."""
        return series.sign(value)


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
        found = (series.leading(self.series(mode, order)[place], first) for order in ORDERS)
        return next((term for term in found if term is not None), None)

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
        one, other = (
            self._modes.along(field, self.system.states, self.time, self.state, series.ORDER) for field in fields
        )
        return all(BALLS.equal(a, b) for a, b in zip(one, other, strict=True))

    def leading_terms(self, mode: Mode, active: frozenset[int]) -> list[Leading | None] | None:
        """Leading term of each guard of a mode just after the point; None if the field is not finite.

        Parameters
        ----------
        active : frozenset of int
            Surfaces that the point is exactly on.
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
