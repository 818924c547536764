"""Modes of a system in double precision: what rounding may have made of zero counts as zero."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import sympy as sp

from henon_ref.modes.arithmetic import CLEAR, ZERO
from henon_ref.modes.mode_evaluation import ExactTapes, ModeEvaluation
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.series import FLOAT
from henon_ref.taylor.tape import TIME

NOISE = 1e-13
"""Part of the coefficients after it below which one is what rounding has left of zero."""


class Doubles:
    """The arithmetic of doubles, which say nothing of their errors."""

    ring = FLOAT
    levels = (ZERO, 1e-11, 1e-15, 0.0)
    """Rounding may be larger, or the derivative as small."""
    carries_errors = False

    def number(self, exact: sp.Expr) -> float:
        """An exact number."""
        return float(exact)

    def text(self, t: float) -> str:
        """A time as messages have it."""
        return f"{t:.17g}"

    def rate(self, states: Sequence[Sequence[float]], outputs: Sequence[Sequence[float]]) -> float:
        """See :func:`rate_of`."""
        return rate_of(states, outputs)

    def leading(self, series: Sequence[float], first: int, rate: float, size: float, zero: float) -> int | None:
        """Index of the first coefficient from ``first`` on that is not zero, or None."""
        terms = scaled(series, rate)
        unit = max(size / rate if first else size, *map(abs, terms[first:]))
        for k in range(first, len(terms)):
            if abs(terms[k]) > zero * unit:
                return k
        return None

    def end_of_hold(
        self, series: Sequence[float], ends: Sequence[Sequence[float]], rate: float, zero: float
    ) -> int | None:
        """The same, where the value is small against the ends and the derivatives against each other."""
        width = max(abs(value) for c in ends for value in scaled(c, rate))
        return 0 if abs(series[0]) > zero * width else self.leading(series, 1, rate, 0.0, zero)

    def negative(self, value: float, size: float, part: float = CLEAR) -> bool:
        """Whether a value is below zero by more than a part of the sizes of its terms."""
        return bool(value < -part * size)

    def equal(self, one: Sequence[float], other: Sequence[float]) -> bool:
        """Whether two series are the same, but for rounding."""
        rate = rate_of([one, other])
        pairs = list(zip(scaled(one, rate), scaled(other, rate), strict=True))
        largest = max(abs(c) for pair in pairs for c in pair)
        return all(abs(a - b) <= ZERO * largest for a, b in pairs)


DOUBLES = Doubles()


class _Tapes(ExactTapes):
    def function(self, names: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Callable[..., list[Any]]:
        values, names = [self.numeric(e) for e in expressions], [TIME, *names]
        # The time that lambdify takes grows with the names that it is given.
        used = set().union(*(value.free_symbols for value in values))
        places = [k for k, name in enumerate(names) if name in used]
        found: Callable[..., list[Any]] = sp.lambdify([names[k] for k in places], values, "math", cse=True)
        return lambda *at: found(*(at[k] for k in places))


def in_doubles(system: FilippovSystem, values: FilippovSystem | None = None) -> ModeEvaluation:
    """The modes of a system in double precision.

    Parameters
    ----------
    system : FilippovSystem
    values : FilippovSystem, optional
        The same with values of its parameters, where ``system`` has none.
    """
    return ModeEvaluation(system, DOUBLES, _Tapes(system, values, DOUBLES.number))


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
