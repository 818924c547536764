"""Inelastic collapse: bodies on several stops that act on each other come to rest in infinitely many impacts together.

A ball that falls on a second one on the ground, say (McNamara and Young, *Phys. Fluids A* 4, 1992, 496-504). Their
duration has no formula. Once it is short, accelerations are constant, and the impacts are followed until little of
their speed is left. A light ball that a heavy one presses on the ground loses little speed with each impact, and all
gaps close much sooner: then the impacts are those of one instant, which have a limit
(:mod:`henon_ref.modes.impact_limit`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp
from flint import arb

from henon_ref.modes.instant import Numbers
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem

MOST_FLIGHTS = 2000
"""Largest number of flights that are followed."""
LATEST = 16
"""Number of the latest impacts that end; bodies that others have met before may still fly."""
LEFT = 2.0**-80
"""Part of the first speeds, or of the duration, that is no longer followed; smaller differences of two are none."""


@dataclass(frozen=True)
class Flight:
    """Motion between impacts: from a point, the surfaces that are left there excepted."""

    mode: Mode
    time: Any
    state: Sequence[Any]
    left: Collection[int] = ()
    """Surfaces on which the flight begins."""
    fired: Collection[int] = ()
    """Surfaces of the last impacts."""
    limit: bool = False
    """Whether the last impacts went on without end at one instant."""


After = Callable[[Flight, Collection[int]], Flight | None]
"""(point, surfaces) -> the flight that follows impacts on these surfaces, or their limit; None if there is none."""
Gap = tuple[Any, Any, Any]
"""Function of a stop: its value, rate, and half of its acceleration."""
Rest = tuple[Flight, frozenset[int]]
"""Flight at whose beginning bodies rest, and the surfaces met before."""


def collapse(
    system: FilippovSystem, numbers: Numbers, first: Flight, most: Any, impacts: After, limit: After
) -> Rest | None:
    """Return the last flight at whose beginning bodies have come to rest within ``most`` [s], and surfaces met before.

    ``limit``: rest on surfaces from a state close to it. None if no bodies come to rest.
    """
    return _Collapse(system, numbers, first, most, impacts, limit).followed()


class _Collapse:
    """Impacts that are followed until bodies have come to rest: all of them, or some, and then others."""

    def __init__(
        self, system: FilippovSystem, numbers: Numbers, first: Flight, most: Any, impacts: After, limit: After
    ) -> None:
        self.system, self.numbers, self.first, self.most = system, numbers, first, most
        self.impacts, self.limit = impacts, limit
        self.now = first
        self.found: Rest | None = None
        self.fired, self.latest = set(first.left), deque([set(first.left)], maxlen=LATEST)
        self.fastest = 0.0
        self.alike: dict[tuple[Mode, frozenset[int]], tuple[Any, list[Any]]] = {}
        """Flights that begin on all surfaces: mode and surfaces -> the latest one's time and rates."""

    def followed(self) -> Rest | None:
        for _ in range(MOST_FLIGHTS):
            gaps = _gaps(self.system, self.numbers, self.now)
            bend = max((abs(float(own[2])) for own in gaps.values()), default=0.0)
            own, begun = set().union(*self.latest), self.now is not self.first
            whole, speed = (_speed([gaps[i] for i in some & gaps.keys()], bend) for some in (self.fired, own))
            self.fastest = max(self.fastest, whole)
            if begun and whole <= LEFT * self.fastest:
                self._rests(self.now, self.fired)
                break
            if self._recurs(gaps):
                break
            slow = begun and bool(own) and speed <= LEFT * self.fastest
            if slow or self._at_one_instant(gaps, own, speed):
                if not self._rests(self.now, own):
                    break
                self.latest.clear()
            elif not self._flies(gaps):
                break
        return self.found

    def _rests(self, at: Flight, surfaces: Collection[int]) -> bool:
        """Go on from the rest of bodies on surfaces; false if they do not rest there."""
        at_rest = self.limit(at, surfaces)
        if at_rest is not None:
            self.found, self.now = (at_rest, frozenset(self.fired)), at_rest
        return at_rest is not None

    def _recurs(self, gaps: Mapping[int, Gap]) -> bool:
        """Check whether the flight is an earlier one with a part of its speeds; find the rest that then follows.

        All that follows is the same again, with this part of the speeds and durations.
        """
        now, key = self.now, (self.now.mode, frozenset(self.now.left))
        if not set(gaps) <= set(now.left):
            return False
        rates = [rate for _, rate, _ in gaps.values()]
        began, before = self.alike.get(key, (now.time, []))
        part = _part(before, rates, max(self.numbers.rounding, LEFT)) if before else None
        self.alike[key] = now.time, rates
        if part is None:
            return False
        end = _middle(now.time + (now.time - began) * part / (1 - part))
        at_rest = self.limit(now, self.fired) if end - self.first.time <= self.most else None
        if at_rest is not None:
            field = self.system.equations(at_rest.mode).field
            x = moved(self.numbers, field, now.time, at_rest.state, end - now.time)
            self._rests(Flight(now.mode, end, [*map(_middle, x)]), self.fired)
        return True

    def _at_one_instant(self, gaps: Mapping[int, Gap], own: Collection[int], speed: float) -> bool:
        """Check whether several gaps are closed, but for a part that is not followed, and impacts go on without end."""
        close = gaps.keys() & own
        reach = LEFT * speed * float(self.now.time - self.first.time)
        if len(close) < 2 or any(float(gaps[i][0]) > reach for i in close):
            return False
        following = self.impacts(self.now, close)
        return following is not None and following.limit

    def _flies(self, gaps: Mapping[int, Gap]) -> bool:
        """Go on from the next impacts; false if none follow in time."""
        now, next_hit = self.now, _next_hit(self.numbers, gaps)
        if next_hit is None or not now.time + next_hit[0] - self.first.time <= self.most:
            return False
        length, hit = next_hit
        x = moved(self.numbers, self.system.equations(now.mode).field, now.time, now.state, length)
        following = self.impacts(Flight(now.mode, _middle(now.time + length), [*map(_middle, x)]), hit)
        if following is not None:
            self.now = following
            self.fired.update(following.fired)
            self.latest.append(set(following.fired))
        return following is not None


def meets_another(system: FilippovSystem, numbers: Numbers, now: Flight, most: Any) -> bool:
    """Return whether a flight ends within ``most`` [s] on a surface on which it does not begin."""
    next_hit = _next_hit(numbers, _gaps(system, numbers, now))
    return next_hit is not None and bool(next_hit[0] <= most) and not next_hit[1] <= set(now.left)


def moved(numbers: Numbers, field: tuple[sp.Expr, ...], t: Any, x: Sequence[Any], length: Any) -> list[Any]:
    """Return the state after a short time [s], by the midpoint rule: exact for constant accelerations."""
    half = [value + length / 2 * rate for value, rate in zip(x, numbers.values(field, t, x), strict=True)]
    rates = numbers.values(field, t + length / 2, half)
    return [value + length * rate for value, rate in zip(x, rates, strict=True)]


def _middle(value: Any) -> Any:
    """Return a number without its error bound, which would grow with every impact."""
    return value.mid() if isinstance(value, arb) else value


def _gaps(system: FilippovSystem, numbers: Numbers, now: Flight) -> dict[int, Gap]:
    """Return the gaps of stops on which no body rests."""
    found, series = {}, numbers.guard_series(now.mode, now.time, now.state)
    for guard, (h, rate, bend, *_) in zip(system.equations(now.mode).guards, series, strict=True):
        i = guard.index
        if guard.kind == "surface" and i in system.resets and now.mode[i] > 0:
            found[i] = (0 * h if i in now.left else h, rate, bend)
    return found


def _speed(gaps: Sequence[Gap], bend: float) -> float:
    """Return the largest speed with which gaps would close with half an acceleration of ``bend``."""
    return max((float(rate) ** 2 + 4 * bend * max(float(h), 0.0) for h, rate, _ in gaps), default=0.0) ** 0.5


def _part(before: Sequence[Any], now: Sequence[Any], rounding: float) -> Any:
    """Return the part of rates that is left, if it is below 1 and the same for all; else None."""
    pairs = list(zip(before, now, strict=True))
    most, then = max(pairs, key=lambda pair: abs(float(pair[0])), default=(0.0, 0.0))
    if not 0 < float(then) * float(most) < float(most) ** 2:
        return None
    same = all(abs(float(b * most - a * then)) <= rounding * abs(float(most * then)) for a, b in pairs)
    return then / most if same else None


def _next_hit(numbers: Numbers, gaps: Mapping[int, Gap]) -> tuple[Any, frozenset[int]] | None:
    """Return the time until the next impact [s], and its surfaces."""
    times = {i: time for i, own in gaps.items() if (time := _root(*own)) is not None}
    if not times:
        return None
    first = min(times.values(), key=float)
    last = (1 + max(numbers.rounding, LEFT)) * first
    return first, frozenset(i for i, time in times.items() if float(last - time) >= 0)


def _root(h: Any, rate: Any, bend: Any) -> Any:
    """Return the first positive root of h + rate t + bend t^2, where h >= 0; None if there is none."""
    if not float(h) > 0:
        return -rate / bend if float(rate) > 0 > float(bend) else None
    inside = rate * rate - 4 * h * bend
    if not float(inside) > 0:
        return None
    root = inside**0.5
    if float(rate) < 0:
        return 2 * h / (root - rate)
    return -(rate + root) / (2 * bend) if float(bend) < 0 else None
