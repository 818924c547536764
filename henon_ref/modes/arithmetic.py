"""Arithmetics of mode selection: sign decisions, and the first significant coefficient of a series.

The selection (:mod:`henon_ref.modes.selection`) is written once, over points with numbers of some arithmetic. In
doubles, a number counts as zero if rounding may have produced it from zero. In balls of python-flint, a number counts
as zero if its ball contains zero. A :class:`Point` has the values of a system's modes at one time and state.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, log2
from typing import Any, Protocol

import sympy as sp
from flint import arb

from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import CLEAR, Mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.series import BALL, FLOAT

ZERO = 1e-13
"""Relative size below which a derivative counts as zero (doubles cannot resolve a tangency below it)."""
ORDER = 8
"""Number of derivatives that are computed."""
LAST_ORDER = 32
"""Number of derivatives that are computed before a slip counts as one that stays on its surface."""

Leading = tuple[int, int]
"""(index, sign) of the first non-zero coefficient of a Taylor series."""


class Doubles:
    """Arithmetic of doubles, without error bounds."""

    ring = FLOAT
    levels: tuple[float, ...] = (ZERO, 1e-11, 1e-15, 0.0)
    """Relative sizes below which a derivative counts as zero. The next level is tried if no mode is consistent at the
    last, since rounding may be larger, or the derivative smaller."""
    carries_errors = False
    """Whether a number has its own error bound, so that no size is needed to decide whether it is zero."""

    def rate(
        self, states: Sequence[Sequence[float]], guards: Sequence[Sequence[float]] = (), unit: float = 1.0
    ) -> float:
        """Return an inverse time scale of the solution, which makes coefficients of different orders comparable.

        It is the largest growth rate of the states' coefficients relative to their slopes, and of the guards' high
        orders (whose low orders may be zeros changed by rounding). Coefficients that are noise are not used as a scale.
        ``unit``: :func:`time_unit` of the run.
        """
        rate = 0.0
        if unit != 1.0:
            states, guards = ([scaled(series, 1.0 / unit) for series in some] for some in (states, guards))
        for series in states:
            rate = max(rate, growth(series, 3 if _noise(series, 1, 3) else 1))
        for series in guards:
            for j in range(2, len(series) // 2 + 1):
                if series[j] == 0 or _noise(series, j, j + 1):
                    continue
                for k in range(j + 2, len(series)):
                    if series[k] != 0:
                        rate = max(rate, (abs(series[k]) / abs(series[j])) ** (1 / (k - j)))
        return (rate or 1.0) / unit

    def leading(self, series: Sequence[float], first: int, rate: float, size: float, zero: float) -> int | None:
        """Index of the first coefficient from ``first`` on that is not zero relative to ``size`` and the rest."""
        terms = scaled(series, rate)
        unit = max(size / rate if first else size, *map(abs, terms[first:]))
        return next((k for k in range(first, len(terms)) if abs(terms[k]) > zero * unit), None)

    def end_of_hold(
        self, series: Sequence[float], ends: Sequence[Sequence[float]], rate: float, zero: float
    ) -> int | None:
        """Like :meth:`leading`, for an end of a hold zone; a load is compared with the distance to the other ends."""
        width = max(abs(value) for c in ends for value in scaled(c, rate))
        return 0 if abs(series[0]) > zero * width else self.leading(series, 1, rate, 0.0, zero)

    def negative(self, value: float, size: float, part: float = CLEAR) -> bool:
        """Check whether a value is below zero by more than a part of the size of its terms."""
        return bool(value < -part * size)

    def equal(self, one: Sequence[float], other: Sequence[float]) -> bool:
        """Check whether two series are equal up to rounding."""
        rate = self.rate([one, other])
        pairs = list(zip(scaled(one, rate), scaled(other, rate), strict=True))
        largest = max(abs(c) for pair in pairs for c in pair)
        return all(abs(a - b) <= ZERO * largest for a, b in pairs)


class Balls:
    """Arithmetic of balls of the working precision, whose radii are error bounds."""

    ring = BALL
    levels: tuple[float, ...] = (0.0,)
    carries_errors = True

    def rate(self, states: Sequence[Sequence[arb]], guards: Sequence[Sequence[arb]], unit: float = 1.0) -> float:
        """1: each coefficient is compared with zero by itself; ValueError if one is not finite."""
        if not all(c.is_finite() for series in guards for c in series):
            raise ValueError("a derivative is not finite")
        return 1.0

    def leading(self, series: Sequence[arb], first: int, rate: float, size: float, zero: float) -> int | None:
        return next((k for k in range(first, len(series)) if not series[k].contains(0)), None)

    def end_of_hold(self, series: Sequence[arb], ends: Sequence[Sequence[arb]], rate: float, zero: float) -> int | None:
        return self.leading(series, 0, rate, 0.0, zero)

    def negative(self, value: arb, size: arb, part: float = CLEAR) -> bool:
        return bool(value < 0)

    def equal(self, one: Sequence[arb], other: Sequence[arb]) -> bool:
        return all(a.overlaps(b) for a, b in zip(one, other, strict=True))


Arithmetic = Doubles | Balls
DOUBLES, BALLS = Doubles(), Balls()


class Point(Protocol):
    """Time and state, with the modes of a system there; results are cached with the point."""

    @property
    def system(self) -> FilippovSystem: ...

    @property
    def arithmetic(self) -> Arithmetic: ...

    @property
    def levels(self) -> tuple[float, ...]:
        """See :attr:`Doubles.levels`; a point may have its own."""

    @property
    def when(self) -> str:
        """Time as messages name it."""

    def guards(self, mode: Mode) -> tuple[Guard, ...] | None:
        """Guards of a mode, None without equations; raises ``ARITHMETIC`` if their derivatives are not finite."""

    def leading(self, mode: Mode, place: int, first: int, zero: float, beside: int | None = None) -> Leading | None:
        """First non-zero coefficient of a guard, from derivative ``first`` on; None if the guard stays zero.

        ``beside``: the surface whose normal velocities are the scale of comparison (for an end of its slide, both ends:
        where surfaces act on each other, they are no velocities).
        """

    def late(self, mode: Mode, place: int, zero: float, index: int) -> Leading | None:
        """Like :meth:`leading` from the first derivative on, for surface ``index`` in slip, up to :data:`LAST_ORDER`.

        The scale is that of the mode's own side: the field on the other side may be much larger.
        """

    def end_of_hold(self, mode: Mode, place: int, zero: float) -> Leading | None:
        """Like :meth:`leading`, for an end of a hold zone, from its value on."""

    def first_order(self, mode: Mode) -> Sequence[Sequence[Any]]:
        """Values and first derivatives of a mode's guards."""

    def sides(self, mode: Mode, index: int) -> tuple[Any, Any]:
        """dh/dt of a surface below and above it, with the other signs from ``mode``."""

    def values(self, expressions: tuple[sp.Expr, ...], signs: Mode) -> Sequence[Any] | None:
        """Values of expressions in time, states and signs; None if one is not finite."""

    def same_motion(self, first: Mode, second: Mode) -> bool:
        """Whether two modes with equations have the same motion, in all derivatives that are computed."""


def size_of_ends(at: Point, mode: Mode, index: int) -> Any:
    """Return the sum of the sizes of the guards that end a slide on a surface, whose scale it is."""
    guards, values = at.guards(mode) or (), at.first_order(mode)
    own = [abs(c[0]) for g, c in zip(guards, values, strict=False) if g.kind == "release" and g.index == index]
    return sum(own[1:], own[0])


def time_unit(length: float) -> float:
    """Return the time [s] in which a slope is compared with the slope's derivative, where nothing else gives a scale.

    A second, or the length of a run that is shorter than 2^-10 s or longer than 2^30 s, to a power of 2 (which changes
    no bits).
    """
    return 1.0 if 2.0**-10 <= length <= 2.0**30 or not length > 0.0 else 2.0 ** floor(log2(length))


def growth(series: Sequence[float], first: int) -> float:
    """Return the growth rate of coefficients from the larger of the two at ``first``; 0 if both are zero."""
    slope, rate = max((abs(c) for c in series[first : first + 2]), default=0.0), 0.0
    for k in range(first + 1, len(series)):
        if slope > 0 and series[k] != 0:
            rate = max(rate, (abs(series[k]) / slope) ** (1 / (k - first)))
    return rate


def _noise(series: Sequence[float], first: int, after: int) -> bool:
    """Check whether coefficients are rounding noise of zeros: negligible against the following two.

    Both are in units of the growth rate of these two.
    """
    terms = [abs(c) for c in scaled(series, growth(series, after) or 1.0)]
    return 0.0 < max(terms[first:after]) <= 1e-13 * max(terms[after : after + 2], default=0.0)


def scaled(series: Sequence[float], rate: float) -> list[float]:
    """Return coefficients in units of 1/rate, finite also if a power of the rate overflows."""
    terms, power = [], 1.0
    for c in series:
        terms.append(c * power)
        power = min(power / rate, 1e300)
    return terms
