"""Inelastic collapse: bodies on several stops that act on each other come to rest in infinitely many impacts together.

A ball that falls on a second one on the ground, say (McNamara and Young, *Phys. Fluids A* 4, 1992, 496-504). Their
duration has no formula. Once it is short, accelerations are constant, and the impacts are followed until little of
their speed is left.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp
from flint import arb

from henon_ref.modes.instant import Numbers
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem

MOST_FLIGHTS = 2000
"""Largest number of flights that are followed."""
LEFT = 2.0**-40
"""Part of the first speeds that is no longer followed."""


@dataclass(frozen=True)
class Flight:
    """Motion between impacts: from a point, the surfaces that are left there excepted."""

    mode: Mode
    time: Any
    state: Sequence[Any]
    left: Collection[int]
    """Surfaces on which the flight begins."""
    speeds: Sequence[Any] = ()
    """Speeds after the last impacts."""
    fired: Collection[int] = ()
    """Surfaces of the last impacts."""


Impacts = Callable[[Mode, Any, Sequence[Any], Collection[int]], Flight | None]
"""(mode, time, state, surfaces hit) -> the flight that follows; None if there is none."""


def collapse(
    system: FilippovSystem, numbers: Numbers, first: Flight, most: Any, impacts: Impacts
) -> tuple[Flight, frozenset[int]] | None:
    """Return the last flight of impacts that end within ``most`` [s], and their surfaces; None if they last longer."""
    now, fastest, fired = first, 0.0, set[int]()
    for _ in range(MOST_FLIGHTS):
        next_hit = _next_hit(system, numbers, now)
        if next_hit is None or not now.time + next_hit[0] - first.time <= most:
            return None
        length, hit = next_hit
        x = moved(numbers, system.equations(now.mode).field, now.time, now.state, length)
        following = impacts(now.mode, _middle(now.time + length), [*map(_middle, x)], hit)
        if following is None:
            return None
        now = following
        fired.update(now.fired)
        speed = max((abs(float(v)) for v in now.speeds), default=0.0)
        fastest = max(fastest, speed)
        if speed <= LEFT * fastest:
            return now, frozenset(fired)
    return None


def moved(numbers: Numbers, field: tuple[sp.Expr, ...], t: Any, x: Sequence[Any], length: Any) -> list[Any]:
    """Return the state after a short time [s], by the midpoint rule: exact for constant accelerations."""
    half = [value + length / 2 * rate for value, rate in zip(x, numbers.values(field, t, x), strict=True)]
    rates = numbers.values(field, t + length / 2, half)
    return [value + length * rate for value, rate in zip(x, rates, strict=True)]


def _middle(value: Any) -> Any:
    """Return a number without its error bound, which would grow with every impact."""
    return value.mid() if isinstance(value, arb) else value


def _next_hit(system: FilippovSystem, numbers: Numbers, now: Flight) -> tuple[Any, frozenset[int]] | None:
    """Return the time until the next impact [s], and its surfaces."""
    times = {}
    series = numbers.guard_series(now.mode, now.time, now.state)
    for guard, (h, rate, bend, *_) in zip(system.equations(now.mode).guards, series, strict=True):
        i = guard.index
        if guard.kind == "surface" and i in system.resets and now.mode[i] > 0:
            time = _root(0 * h if i in now.left else h, rate, bend)
            if time is not None:
                times[i] = time
    if not times:
        return None
    first = min(times.values(), key=float)
    return first, frozenset(i for i, time in times.items() if float(time - first) <= LEFT * float(first))


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
