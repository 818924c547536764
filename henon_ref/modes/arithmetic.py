"""What the selection of modes asks of numbers: which are negative, and which term of a series is the first that counts.

The rule (:mod:`henon_ref.modes.selection`) is written once, over points whose numbers are of some arithmetic: doubles,
in which what rounding may have made of zero counts as zero, or balls of python-flint, in which what cannot be told from
zero at a point known to a radius is zero. A :class:`Point` has the numbers of a system's modes at a time and state.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import sympy as sp
from flint import arb

from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.rules import FUNCTIONS
from henon_ref.taylor.series import FLOAT, Ring

NO_VALUE = (ZeroDivisionError, ValueError, OverflowError)
"""What ``math`` and python-flint raise where an expression has no finite value."""
ZERO = 1e-13
"""Relative size below which a derivative counts as zero (a tangency within it cannot be told in double)."""
NOISE = 1e-13
"""Part of the coefficients after it below which one is what rounding has left of zero."""
CLEAR = 1e-9
"""Part of its terms from which on a value is clearly no zero."""
ORDER = 8
"""Derivatives looked at before a contact counts as one that never separates."""
DIGITS = 75
"""Of the constants in balls: more than the precision holds."""
RING = Ring({name: getattr(arb, name) for name in (*FUNCTIONS, "sqrt")}, arb.__pow__)

Leading = tuple[int, int]
"""(index, sign) of the first coefficient of a Taylor series that counts as not zero."""


class Doubles:
    """The arithmetic of doubles, which say nothing of their errors."""

    ring = FLOAT
    levels: tuple[float, ...] = (ZERO, 1e-11, 1e-15, 0.0)
    """Relative sizes below which a derivative counts as zero: each is tried where no mode fits with the last, since
    rounding may be larger, or the derivative as small."""
    carries_errors = False
    """Whether a number says how far it may be off, so that it is small or large against nothing else."""

    def number(self, exact: sp.Expr) -> float:
        """An exact number."""
        return float(exact)

    def rate(self, states: Sequence[Sequence[float]], outputs: Sequence[Sequence[float]]) -> float:
        """An inverse time that makes coefficients of two orders comparable; ValueError where some are not finite."""
        return rate_of(states, outputs)

    def leading(self, series: Sequence[float], first: int, rate: float, size: float, zero: float) -> int | None:
        """Index of the first coefficient from ``first`` on that is not zero beside ``size`` and the others, or None."""
        terms = scaled(series, rate)
        unit = max(size / rate if first else size, *map(abs, terms[first:]))
        return next((k for k in range(first, len(terms)) if abs(terms[k]) > zero * unit), None)

    def end_of_hold(
        self, series: Sequence[float], ends: Sequence[Sequence[float]], rate: float, zero: float
    ) -> int | None:
        """The same of one end of a hold zone, whose load may be small against its distance to the other ``ends``."""
        width = max(abs(value) for c in ends for value in scaled(c, rate))
        return 0 if abs(series[0]) > zero * width else self.leading(series, 1, rate, 0.0, zero)

    def negative(self, value: float, size: float, part: float = CLEAR) -> bool:
        """Whether a value is below zero by more than a part of the sizes of its terms."""
        return bool(value < -part * size)

    def equal(self, one: Sequence[float], other: Sequence[float]) -> bool:
        """Whether two series are the same, so far as can be told."""
        rate = rate_of([one, other])
        pairs = list(zip(scaled(one, rate), scaled(other, rate), strict=True))
        largest = max(abs(c) for pair in pairs for c in pair)
        return all(abs(a - b) <= ZERO * largest for a, b in pairs)


class Balls:
    """The arithmetic of balls of the working precision, whose radii say how far they may be off."""

    ring = RING
    levels: tuple[float, ...] = (0.0,)
    carries_errors = True

    def number(self, exact: sp.Expr) -> arb:
        return arb(str(sp.N(exact, DIGITS))).mid()

    def rate(self, states: Sequence[Sequence[arb]], outputs: Sequence[Sequence[arb]]) -> float:
        """1: each coefficient is told from zero by itself."""
        if not all(c.is_finite() for series in outputs for c in series):
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
    """A time and state, with the modes of a system there. What has been worked out is kept as long as the point is."""

    @property
    def system(self) -> FilippovSystem: ...

    @property
    def arithmetic(self) -> Arithmetic: ...

    @property
    def levels(self) -> tuple[float, ...]:
        """As :attr:`Doubles.levels`, unless the point was given others."""

    @property
    def when(self) -> str:
        """Its time, as messages have it."""

    def guards(self, mode: Mode) -> tuple[Guard, ...] | None:
        """Guards of a mode; None where it has no equations, :data:`NO_VALUE` where their derivatives are not finite."""

    def leading(self, mode: Mode, place: int, first: int, zero: float, beside: int | None = None) -> Leading | None:
        """What a guard does first just after the point, from its derivative ``first`` on; None: it stays at zero.

        ``beside``: the surface against whose normal velocities it is small or large.
        """

    def end_of_hold(self, mode: Mode, place: int, zero: float) -> Leading | None:
        """The same of an end of a hold zone, from its value on."""

    def first_order(self, mode: Mode) -> Sequence[Sequence[Any]]:
        """Values and first derivatives of a mode's guards."""

    def sides(self, mode: Mode, index: int) -> tuple[Any, Any]:
        """dh/dt of a surface below and above it, the signs of the others being those of a mode."""

    def values(self, expressions: tuple[sp.Expr, ...], signs: Mode) -> Sequence[Any] | None:
        """Expressions in time, states and signs; None where they are not finite."""

    def same_motion(self, first: Mode, second: Mode) -> bool:
        """Whether two modes that have equations have the same motion, so far as its derivatives tell."""


def rate_of(states: Sequence[Sequence[float]], guards: Sequence[Sequence[float]] = ()) -> float:
    """An inverse time in which the solution changes: makes coefficients of different order comparable.

    From how the coefficients of the states grow on their slopes, and from the high orders of the guards (whose low
    orders may be zeros that rounding has touched). What is noise beside the coefficients after it is no scale.
    """
    rate = 0.0
    for series in states:
        rate = max(rate, _growth(series, 3 if _noise(series, 1, 3) else 1))
    for series in guards:
        for j in range(2, len(series) // 2 + 1):
            if series[j] == 0 or _noise(series, j, j + 1):
                continue
            for k in range(j + 2, len(series)):
                if series[k] != 0:
                    rate = max(rate, (abs(series[k]) / abs(series[j])) ** (1 / (k - j)))
    return rate or 1.0


def _growth(series: Sequence[float], first: int) -> float:
    """Rate at which coefficients grow on the larger one of the two from ``first`` on; 0 where these are zero."""
    slope, rate = max((abs(c) for c in series[first : first + 2]), default=0.0), 0.0
    for k in range(first + 1, len(series)):
        if slope > 0 and series[k] != 0:
            rate = max(rate, (abs(series[k]) / slope) ** (1 / (k - first)))
    return rate


def _noise(series: Sequence[float], first: int, after: int) -> bool:
    """Whether coefficients vanish beside the two that follow them, in units of the rate at which these grow."""
    terms = [abs(c) for c in scaled(series, _growth(series, after) or 1.0)]
    return 0.0 < max(terms[first:after]) <= NOISE * max(terms[after : after + 2], default=0.0)


def scaled(series: Sequence[float], rate: float) -> list[float]:
    """Coefficients in units of a rate's inverse: finite for rates, too, of which no power is."""
    terms, power = [], 1.0
    for c in series:
        terms.append(c * power)
        power = min(power / rate, 1e300)
    return terms
