"""Flights between two impacts that are too low for a library.

Impacts that accumulate make flights ever lower. A restart on the surface lifts a guard by rounding, waits out the noise
of the state, or takes that noise for a second impact: a flight no higher than that is as long as the restart makes it,
for ever, or leads through the surface. Such flights are so short that their Taylor polynomials have them to rounding.
So are the first instants of a flight whose restart takes noise for an impact.
"""

from __future__ import annotations

from collections.abc import Sequence

from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import LONGEST, MARGIN, quiet_until
from henon_ref.modes.callables import ARITHMETIC

LEAST = 1e-9
"""Tolerance below which it is rounding that a restart's error comes from: of a flight so low it is a 1e-7th part."""
ORDER = 8
"""Of the polynomials."""
ROUNDS = 4
"""Newton's steps from a parabola's end to that of the polynomial."""


def low_flight(
    model: ModeFunctions, guard: int, t: float, x: Sequence[float], accuracy: tuple[float, float]
) -> tuple[float, tuple[float, ...]] | None:
    """Time [s] and state at the end of a flight; None where it is high enough for a library, or something else is near.

    The guard rises from zero at (t, x), on its surface, and falls back to it. ``accuracy`` is the relative and absolute
    error that the tolerances allow a step.
    """
    try:
        rate, bend = model.bend(guard)(t, *x)
        noise = MARGIN * model.size(guard, t, x, *(max(part, LEAST) for part in accuracy))
        if not (rate > 0.0 > bend) or rate * rate > -2.0 * bend * noise:
            return None
        states, guards = model.series(t, x, ORDER)
    except ARITHMETIC:
        return None
    own = guards[guard][1:]
    slopes = [k * c for k, c in enumerate(own)][1:]
    length = -own[0] / own[1]
    for _ in range(ROUNDS):
        slope = _value(slopes, length)
        if not slope < 0.0:
            return None
        length -= _value(own, length) / slope
    if not length > 0.0 or not _alone(guards, guard, length):
        return None
    return t + length, tuple(_value(c, length) for c in states)


def behind_noise(
    model: ModeFunctions, guard: int, t: float, x: Sequence[float], accuracy: tuple[float, float], until: float
) -> tuple[float, tuple[float, ...]] | None:
    """Time [s] and state where a surface that is left can be told from zero; None where it is not left so soon."""
    level = model.size(guard, t, x, *(max(part, EPSILON) for part in accuracy))
    (end,) = quiet_until(model, [(guard, 0.0, 0.0)], t, x, [level], LONGEST * (until - t))
    try:
        states, guards = model.series(t, x, ORDER)
    except ARITHMETIC:
        return None
    length = end - t
    if not _value(guards[guard][1:], length) > 0.0 or not _alone(guards, guard, length):
        return None
    return end, tuple(_value(c, length) for c in states)


def _alone(guards: Sequence[Sequence[float]], guard: int, length: float) -> bool:
    """Whether no other guard can fall within a length of time."""
    others = (c for k, c in enumerate(guards) if k != guard)
    return all(value > length * _value([abs(c) for c in rest], length) for value, *rest in others)


def _value(coefficients: Sequence[float], at: float) -> float:
    """A polynomial, by Horner's rule."""
    value = 0.0
    for c in reversed(coefficients):
        value = value * at + c
    return value
