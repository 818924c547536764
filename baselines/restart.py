"""Restarting a library on the surface it has just left.

After an event the state lies on a surface, and in the new mode that surface's guard starts at zero:
with a slope after a crossing, with none after the release from a Filippov slide (a double zero). What a
library makes of a root at its starting point differs (each adapter's docstring says what); the policies:

``event-free-step``
    The guard is not looked at for a first short while: as long as the solution itself says that the guard
    cannot yet be told from zero (its Taylor series against the rounding, or the tolerance, of the state).
    Times of later events are not touched. An excursion shorter than that while ends when it ends.
``offset``
    The guard is lifted by a few units in the last place, so that it starts clearly positive. The next root
    is then late by that lift over the guard's rate, which is the rounding of the state over the rate.
``direction``
    The guard is watched as it is, and only falling roots count.
``none``
    The guard is watched as it is, roots of either direction count.

Impacts that accumulate make flights ever lower. A restart on the surface lifts a guard by rounding, waits out the noise
of the state, or takes that noise for a second impact: a flight no higher than that is as long as the restart makes it,
for ever, or leads through the surface. Such flights, and the first instants of one whose restart takes noise for an
impact, are so short that their Taylor polynomials have them to rounding: no library is asked for them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.modes.callables import ARITHMETIC

Restart = Literal["event-free-step", "offset", "direction", "none"]

Watcher = Callable[[float, NDArray[np.float64]], float]
"""A guard as an event function ``g(t, x)`` of a library."""

LIFT = 8.0
"""``offset``: lift of a guard, in units of the rounding of its terms."""
STOPPED = 0.01
"""An implicit first step stops its iteration at about this part of the tolerances."""
MARGIN = 16.0
"""``event-free-step``: how far a guard has to come out of the noise."""
ORDER = 4
"""Highest Taylor coefficient looked at for the length of the event-free step."""
SPAN = 1e-9
"""Part of the horizon over which a surface's normal velocity gives the rounding of a guard whose terms vanish."""
TANGENT = 1e-11
"""A rate below this part of the speed is rounding: the lift covers what it does."""
NEARLY_TANGENT = 1e-2
"""A falling rate above this part of the speed is no tangential release."""
LONGEST = 1e-3
"""Longest event-free step, as a part of the horizon."""
LEAST = 1e-300
"""Smallest lift: anything but an exact zero."""
ROUGHEST = 1e-9
"""Tolerance below which it is rounding that a restart's error comes from: of a flight so low it is a 1e-7th part."""
FLIGHT_ORDER = 8
"""Of the polynomials of low flights."""
ROUNDS = 4
"""Newton's steps from a parabola's end to that of the polynomial."""


Fresh = tuple[int, float, float]
"""A guard that starts at zero: its index among the mode's guards, abs(dh/dt) below plus above its surface, and its
own rate, which is small against that after a tangential release."""


def lift(model: ModeFunctions, fresh: Fresh, t: float, x: Sequence[float], horizon: float) -> float:
    """How far ``offset`` lifts a guard (negative for one that is armed only once it has risen)."""
    guard, speed, rate = fresh
    value = max(LIFT * EPSILON * (model.size(guard, t, x, 1.0, 0.0) + speed * SPAN * horizon), LEAST)
    if model.guards[guard].rising_only:
        return -value
    return value + dip(model, fresh, t, x) if dips(speed, rate) else value


def dips(speed: float, rate: float) -> bool:
    """Whether a guard falls before it rises: a tangential release found a little early or late."""
    return -NEARLY_TANGENT * speed < rate < -TANGENT * speed


def dip(model: ModeFunctions, fresh: Fresh, t: float, x: Sequence[float]) -> float:
    """Twice the depth to which a guard falls before it rises (0 where it does not rise)."""
    try:
        slope, bend = model.bend(fresh[0])(t, *x)
    except ARITHMETIC:
        return 0.0
    return slope * slope / bend if bend > 0.0 else 0.0


def quiet_until(
    model: ModeFunctions, fresh: Sequence[Fresh], t: float, x: Sequence[float], levels: Sequence[float], longest: float
) -> list[float]:
    """Time up to which each fresh guard cannot be told from zero in a mode that starts at (t, x).

    ``levels`` is the noise of each one's value, ``longest`` the longest event-free step [s].
    """
    try:
        series = model.series(t, x, ORDER)[1]
    except ARITHMETIC:
        series = [[0.0] * (ORDER + 1)] * len(model.guards)
    ends = []
    for (guard, *_), level in zip(fresh, levels, strict=True):
        coefficients = series[guard]
        whiles = [
            (MARGIN * level / abs(c)) ** (1.0 / k) for k, c in enumerate(coefficients[1:], start=1) if c and abs(c) > 0
        ]
        step = min([longest, *whiles])
        ends.append(t + max(step, 4.0 * EPSILON * abs(t)))
    return ends


class GatedGuards:
    """The guards of one mode as a library sees them, under one restart policy, set at the start of every run of it.

    ``errors`` are the relative and absolute error that the library's first steps leave in the state: rounding for an
    explicit method, the tolerances where a nonlinear solver stops at a part of them.
    """

    def __init__(self, model: ModeFunctions, policy: Restart, errors: tuple[float, float]) -> None:
        self.model, self.policy, self.errors = model, policy, errors
        count = len(model.guards)
        self.quiet = [-np.inf] * count
        """Up to here the guard reads :attr:`resting`."""
        self.lifts = [0.0] * count
        self.resting = [-1.0 if g.rising_only else 1.0 for g in model.guards]

    @property
    def direction(self) -> int:
        """Direction of the roots that count: -1 falling, 0 either."""
        return 0 if self.policy == "none" else -1

    def open(self, t: float, x: Sequence[float], fresh: Sequence[Fresh], horizon: float) -> None:
        """Set the gates for a run of the mode from (t, x)."""
        count = len(self.quiet)
        self.quiet[:] = [-np.inf] * count
        self.lifts[:] = [0.0] * count
        if not fresh:
            return
        if self.policy == "offset":
            for item in fresh:
                self.lifts[item[0]] = lift(self.model, item, t, x, horizon)
        elif self.policy == "event-free-step":
            levels = [self._level(guard, speed, t, x, horizon) for guard, speed, _ in fresh]
            ends = quiet_until(self.model, fresh, t, x, levels, LONGEST * horizon)
            for (guard, *_), end in zip(fresh, ends, strict=True):
                self.quiet[guard] = end

    def _level(self, guard: int, speed: float, t: float, x: Sequence[float], horizon: float) -> float:
        return self.model.size(guard, t, x, *self.errors) + EPSILON * speed * SPAN * horizon

    def watcher(self, k: int, count: Callable[[], None], value: Watcher | None = None) -> Watcher:
        """Guard k as the library sees it; ``count`` is called at every evaluation.

        ``value`` is ``g(t, x)`` in place of the mode's own, where a library has another function of the same zero.
        """
        quiet, lifts, resting = self.quiet, self.lifts, self.resting[k]
        guard, n = self.model.guard[k], len(self.model.states)
        plain = value or (lambda t, x: guard(t, *x[:n].tolist())[0])

        def watched(t: float, x: NDArray[np.float64]) -> float:
            count()
            if t <= quiet[k]:
                return resting
            try:
                return plain(t, x) + lifts[k]
            except ARITHMETIC:
                return np.nan

        return watched

    def watchers(self, count: Callable[[], None]) -> list[Watcher]:
        """All guards as the library sees them."""
        return [self.watcher(k, count) for k in range(len(self.quiet))]


def low_flight(
    model: ModeFunctions, guard: int, t: float, x: Sequence[float], accuracy: tuple[float, float]
) -> tuple[float, tuple[float, ...]] | None:
    """Time [s] and state at the end of a flight; None where it is high enough for a library, or something else is near.

    The guard rises from zero at (t, x), on its surface, and falls back to it. ``accuracy`` is the relative and absolute
    error that the tolerances allow a step.
    """
    try:
        rate, bend = model.bend(guard)(t, *x)
        noise = MARGIN * model.size(guard, t, x, *(max(part, ROUGHEST) for part in accuracy))
        if not (rate > 0.0 > bend) or rate * rate > -2.0 * bend * noise:
            return None
        states, guards = model.series(t, x, FLIGHT_ORDER)
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
        states, guards = model.series(t, x, FLIGHT_ORDER)
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
