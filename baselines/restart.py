"""Policies for restarting a library on a surface after an event.

After an event the state lies on a surface, and in the new mode that surface's guard starts at zero: with a nonzero
slope after a crossing, with slope zero after the release from a Filippov slide (a double zero). Libraries treat a root
at the starting point differently (each adapter's docstring describes it). The policies are:

``event-free-step``
    The guard is not evaluated during a first short interval, in which its Taylor series stays within the rounding
    (or the tolerance) of the state. Times of later events do not change. The end of an excursion that is shorter than
    the interval is reported at the end of the interval.
``offset``
    The guard is lifted by a few units in the last place, so that it starts clearly positive. The next root is then
    late by the lift divided by the guard's rate.
``direction``
    The guard is not changed, and only falling roots count.
``none``
    The guard is not changed, and roots of either direction count.

When impacts accumulate, flights become ever lower. A flight that is not higher than the lift or the noise of the state
cannot be restarted like this: the restart sets its length, reports a second impact, or lets the body pass through the
surface. Such flights, and the first instants after an impact, are so short that a Taylor polynomial gives them to
rounding. The driver computes them without the library.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.modes.callables import ARITHMETIC

Restart = Literal["event-free-step", "offset", "direction", "none"]

LIFT = 8.0
"""Lift of a guard under ``offset``, in units of the rounding of its terms."""
STOPPED = 0.01
"""Part of the tolerances at which an implicit method stops its iteration in the first step."""
MARGIN = 16.0
"""A guard differs from zero if its value is this multiple of its noise (``event-free-step``)."""
SPAN = 1e-9
"""Part of the horizon over which a surface's normal velocity gives the rounding of a guard whose terms vanish."""
LONGEST = 1e-3
"""Longest event-free step, as a part of the horizon."""
SMALLEST_LIFT = 1e-300
"""Smallest lift; it only avoids an exact zero."""
FLIGHT_ORDER = 8
"""Order of the Taylor polynomials of low flights."""


Fresh = tuple[int, float, float]
"""A guard that starts at zero: its index among the mode's guards, its speed (abs(dh/dt) below plus above its surface),
and its rate, which is much smaller than the speed after a tangential release."""


def lift(model: ModeFunctions, fresh: Fresh, t: float, x: Sequence[float], horizon: float) -> float:
    """Compute the lift of a guard under ``offset`` (negative for a guard that counts only once it has risen)."""
    guard, speed, rate = fresh
    value = max(LIFT * EPSILON * (model.size(guard, t, x, 1.0, 0.0) + speed * SPAN * horizon), SMALLEST_LIFT)
    if model.guards[guard].rising_only:
        return -value
    if not dips(speed, rate):
        return value
    try:
        slope, bend = model.bend(guard)(t, *x)
    except ARITHMETIC:
        return value
    # Twice the depth to which the guard falls; 0 if it does not rise again.
    return value + (slope * slope / bend if bend > 0.0 else 0.0)


def dips(speed: float, rate: float) -> bool:
    """Check whether a guard falls before it rises, because a tangential release was located slightly early or late.

    A rate below 1e-11 of the speed is rounding, which the lift covers; above 1e-2 the release is not tangential.
    """
    return -1e-2 * speed < rate < -1e-11 * speed


def quiet_until(
    model: ModeFunctions, fresh: Sequence[Fresh], t: float, x: Sequence[float], levels: Sequence[float], longest: float
) -> list[float]:
    """Time up to which each fresh guard stays within its noise, in a mode that starts at (t, x).

    ``levels`` is the noise of each guard's value, ``longest`` the longest event-free step [s].
    """
    try:
        series = model.series(t, x, 4)[1]
    except ARITHMETIC:
        series = [[0.0]] * len(model.guards)
    ends = []
    for (guard, *_), level in zip(fresh, levels, strict=True):
        coefficients = series[guard]
        whiles = [
            (MARGIN * level / abs(c)) ** (1.0 / k) for k, c in enumerate(coefficients[1:], start=1) if c and abs(c) > 0
        ]
        step = min([longest, *whiles])
        ends.append(t + max(step, 4.0 * EPSILON * abs(t)))
    return ends


def low_flight(
    model: ModeFunctions, guard: int, t: float, x: Sequence[float], accuracy: tuple[float, float]
) -> tuple[float, tuple[float, ...]] | None:
    """Time [s] and state at the end of a low flight, from its Taylor polynomial.

    The guard rises from zero at (t, x), on its surface, and falls back to zero. ``accuracy`` is the relative and
    absolute error that the tolerances allow per step. The result is None if the flight is high enough for a library,
    or another guard may fall during the flight.
    """
    try:
        rate, bend = model.bend(guard)(t, *x)
        # Below a tolerance of 1e-9 rounding dominates the error of a restart, 1e-7 of the length of such a low flight.
        noise = MARGIN * model.size(guard, t, x, *(max(part, 1e-9) for part in accuracy))
        if not (rate > 0.0 > bend) or rate * rate > -2.0 * bend * noise:
            return None
        states, guards = model.series(t, x, FLIGHT_ORDER)
    except ARITHMETIC:
        return None
    own = guards[guard][1:]
    slopes = [k * c for k, c in enumerate(own)][1:]
    length = -own[0] / own[1]
    for _ in range(4):  # Newton steps from the root of the parabola
        slope = _value(slopes, length)
        if not slope < 0.0:
            return None
        length -= _value(own, length) / slope
    if not length > 0.0 or not _alone(guards, guard, length):
        return None
    return t + length, tuple(_value(c, length) for c in states)


def after_noise(
    model: ModeFunctions, guard: int, t: float, x: Sequence[float], accuracy: tuple[float, float], until: float
) -> tuple[float, tuple[float, ...]] | None:
    """Time [s] and state at which a guard that rises from zero leaves its noise; None if it does not rise."""
    level = model.size(guard, t, x, *(max(part, EPSILON) for part in accuracy))
    (end,) = quiet_until(model, [(guard, 0.0, 0.0)], t, x, [level], LONGEST * (until - t))
    try:
        states, guards = model.series(t, x, FLIGHT_ORDER)
    except ARITHMETIC:
        return None
    length = end - t
    if not _value(guards[guard][1:], length) > 0.0 or not _alone(guards, guard, length):
        return None
    return end, tuple(_value(c, length) for c in states)


def _alone(guards: Sequence[Sequence[float]], guard: int, length: float) -> bool:
    """Check that no other guard can fall within the time ``length``."""
    others = (c for k, c in enumerate(guards) if k != guard)
    return all(value > length * _value([abs(c) for c in rest], length) for value, *rest in others)


def _value(coefficients: Sequence[float], at: float) -> float:
    """Evaluate a polynomial by Horner's rule."""
    value = 0.0
    for c in reversed(coefficients):
        value = value * at + c
    return value
