"""The first derivative of a guard that is not zero, of Taylor series whose zeros rounding has touched."""

from __future__ import annotations

from collections.abc import Sequence

NOISE = 1e-13
"""Part of the coefficients after it below which one is what rounding has left of zero."""


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


def leading(series: Sequence[float], first: int, rate: float, size: float, zero: float) -> int | None:
    """Index of the first coefficient from ``first`` on that is not zero, or None."""
    terms = scaled(series, rate)
    unit = max(size / rate if first else size, *map(abs, terms[first:]))
    for k in range(first, len(terms)):
        if abs(terms[k]) > zero * unit:
            return k
    return None
