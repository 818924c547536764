"""Modes of a system at points in ball arithmetic, by series of the truth's own (:mod:`.series`).

A point carries radii (what the precision leaves open), and a derivative is positive, negative or *zero to the
precision*, where its ball holds zero: a tie within that radius counts as exact. The mode that follows is decided by the
one rule of :mod:`henon_ref.modes.selection`; nothing that it is decided from shares code with the reference's.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp
from flint import arb

from henon_ref.errors import ModelError
from henon_ref.harness.truth.multiprecision import series
from henon_ref.modes.arithmetic import BALLS, Leading
from henon_ref.modes.decision import Decision
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.selection import mode_by_signs
from henon_ref.modes.system import FilippovSystem

ORDERS = (1, 3, series.ORDER)
"""Orders of the guards' series, tried in turn: in nearly all events the first one tells."""


class SeriesEvaluation:
    """The modes of one system at one precision; what :func:`henon_ref.modes.after_jump.after_jump` asks of numbers.

    Parameters
    ----------
    system : FilippovSystem
    bits : int
        Precision of the exact numbers in its equations.
    """

    rounding = 0.0
    """A point carries the radii to which it is known."""

    def __init__(self, system: FilippovSystem, bits: int) -> None:
        self.system, self.bits = system, bits
        self._numeric: dict[Mode, tuple[list[sp.Expr], list[sp.Expr]]] = {}
        """Of each mode its field and its guards, parameters put in."""

    def at(self, time: arb, state: Sequence[arb]) -> Point:
        """A point, with the radii to which it is known."""
        return Point(self, time, tuple(state))

    def exactly(self, start: sp.Expr, initial: Sequence[sp.Expr]) -> Point:
        """A point of exact numbers."""
        return self.at(series.exact_ball(start, self.bits), [series.exact_ball(v, self.bits) for v in initial])

    def values(self, expressions: Sequence[sp.Expr], t: arb, x: Sequence[arb]) -> list[arb]:
        """Expressions in time and states at a point; ValueError where one has none that is finite."""
        found = self.along([sp.Integer(0)] * len(x), expressions, t, x, 0)
        if not all(c[0].is_finite() for c in found):
            raise ValueError("a value is not finite")
        return [c[0] for c in found]

    def guard_series(self, mode: Mode, t: arb, x: Sequence[arb], order: int = series.ORDER) -> list[list[arb]]:
        """Taylor coefficients in time of a mode's guards."""
        if mode not in self._numeric:
            equations, numeric = self.system.equations(mode), self.system.numeric
            guards = [numeric(g.expression) for g in equations.guards]
            self._numeric[mode] = [numeric(f) for f in equations.field], guards
        rates, guards = self._numeric[mode]
        return series.along(rates, guards, self.system.states, t, x, bits=self.bits, order=order)

    def along(
        self, field: Sequence[sp.Expr], outputs: Sequence[sp.Expr], t: arb, x: Sequence[arb], order: int
    ) -> list[list[arb]]:
        """Taylor coefficients in time of functions along the solution through a point."""
        numeric = self.system.numeric
        rates, found = [numeric(f) for f in field], [numeric(e) for e in outputs]
        return series.along(rates, found, self.system.states, t, x, bits=self.bits, order=order)

    def sign(self, value: arb) -> int:
        """0 where it cannot be told from zero."""
        return series.sign(value)

    def decide(self, t: arb, x: Sequence[arb], surfaces: Sequence[int], valid: Sequence[int]) -> Decision:
        """The mode at a point where surfaces and ``valid`` expressions have these signs."""
        return mode_by_signs(self.at(t, x), surfaces, valid, where="after the reset")

    def text(self, t: arb) -> str:
        """A time as messages have it."""
        return str(t.str(17, radius=False))


class Point:
    """See :class:`henon_ref.modes.arithmetic.Point`."""

    arithmetic = BALLS
    levels = BALLS.levels

    def __init__(self, modes: SeriesEvaluation, time: arb, state: tuple[arb, ...]) -> None:
        self._modes, self.time, self.state = modes, time, state
        self.system = modes.system
        self._series: dict[tuple[Mode, int], list[list[arb]]] = {}

    @property
    def when(self) -> str:
        """See :class:`henon_ref.modes.arithmetic.Point`, and so on."""
        return self._modes.text(self.time)

    def series(self, mode: Mode, order: int) -> list[list[arb]]:
        """Taylor coefficients of a mode's guards; ZeroDivisionError or ValueError where they are not finite."""
        if (mode, order) not in self._series:
            found = self._modes.guard_series(mode, self.time, self.state, order)
            if not all(value.is_finite() for own in found for value in own[:2]):
                raise ValueError("a derivative is not finite")
            self._series[mode, order] = found
        return self._series[mode, order]

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
        signs = self.system.signs
        beside = ({s: sp.Integer(v) for s, v in zip(signs, replaced(mode, index, way), strict=True)} for way in (-1, 1))
        normal = self.system.normal_velocity(index)
        below, above = self._modes.values([normal.xreplace(side) for side in beside], self.time, self.state)
        return below, above

    def values(self, expressions: tuple[sp.Expr, ...], signs: Mode) -> list[arb] | None:
        entries = {s: sp.Integer(v) for s, v in zip(self.system.signs, signs, strict=True)}
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
        """What each guard of a mode does first, just after the point; None where its field is not finite.

        Parameters
        ----------
        active : frozenset of int
            Surfaces that the point is on, whatever rounding says.
        """
        try:
            guards = self.system.equations(mode).guards
            first = [1 if g.kind == "surface" and g.index in active else 0 for g in guards]
            return [self.leading(mode, place, order) for place, order in enumerate(first)]
        except (ZeroDivisionError, ValueError):  # python-flint's words for a series that does not exist
            return None

    def guard_values(self, mode: Mode) -> list[arb]:
        """Values of a mode's guards at the middle of the point (balls drop digits below their radius)."""
        middle = self.time.mid(), [v.mid() for v in self.state]
        return [c[0] for c in self._modes.guard_series(mode, *middle, order=0)]
