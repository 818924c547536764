"""Impacts that accumulate, and the rest that they lead to.

A body that a surface h throws back ever more weakly comes to rest on it in a finite time: with the speed v of h just
after an impact, its acceleration -a < 0 between impacts, and the ratio r < 1 of the speeds after and before an impact,
all later flights together last ``2 v / (a (1 - r))``. That neglects how a changes meanwhile, so that it is wrong by
about the square of that time: it is used once the time is below :data:`REMAINING` of the run. Impacts are told of up
to there; then the body rests on the surface, a one-sided constraint (Brogliato, *Nonsmooth Mechanics*, 2016, Ch. 5):
the force of the surface acts along the jumps of the state and keeps h'' at zero, as long as it does not have to pull.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import sympy as sp

from henon_ref.filippov.bounds import put
from henon_ref.filippov.equations import along
from henon_ref.filippov.resets import jump_of
from henon_ref.filippov.system import FilippovSystem, Release, SlidingOverride

REMAINING = 2.0**-26
"""Part of the run that all later flights together may last where impacts have come to their limit."""


@dataclass(frozen=True, eq=False)
class Resting:
    """A surface on which a body can come to rest; expressions in time, states and the signs of other surfaces."""

    speed: sp.Expr
    """h' [unit of the surface / s]."""
    acceleration: sp.Expr
    """h'' where no force of the surface acts."""
    push: tuple[sp.Expr, ...]
    """Change of the state by a force of the surface that changes h' by 1, shape (n,)."""
    field: tuple[sp.Expr, ...]
    """x' at rest, shape (n,)."""

    def expressions(self, surface: sp.Expr, states: Sequence[sp.Symbol]) -> list[sp.Expr]:
        """What :func:`limit` needs: h', h'', the pushes, the field at rest, h, its gradient."""
        gradient = [sp.diff(surface, x) for x in states]
        return [self.speed, self.acceleration, *self.push, *self.field, surface, *gradient]


@lru_cache(maxsize=64)
def resting_of(system: FilippovSystem, index: int) -> Resting | None:
    """How a body rests on a surface that resets the state; None where its jumps are no impacts of a body.

    They are where the map leaves the surface's function and its time derivative's direction alone: the state changes
    in proportion to h'.
    """
    jump = jump_of(system, (index,))
    surface = system.surfaces[index]
    field = tuple(put(f, {system.signs[index]: sp.Integer(1)}) for f in system.field)
    speed = along(surface, system.states, field)
    if jump is None or index not in jump.kept or speed == 0 or speed.has(*system.signs):
        return None
    changes = [sp.cancel((jump.states[i] - system.states[i]) / speed) for i in jump.moved]
    if any(sp.fraction(change)[1].free_symbols & set(system.states) for change in changes):
        return None
    whole = dict(zip(jump.moved, changes, strict=True))
    slope = sp.Add(*(sp.diff(speed, system.states[i]) * change for i, change in whole.items()))
    if sp.expand(slope) == 0:
        return None
    push = tuple(sp.cancel(whole[i] / slope) if i in whole else sp.Integer(0) for i in range(len(system.states)))
    acceleration = along(speed, system.states, field)
    held = tuple(sp.expand(f - acceleration * p) if p != 0 else f for f, p in zip(field, push, strict=True))
    return Resting(speed, acceleration, push, held)


def with_resting(system: FilippovSystem) -> FilippovSystem:
    """The system with the sliding of bodies that rest on surfaces which reset the state."""
    found = {i: rest for i in system.resets if (rest := resting_of(system, i)) is not None}
    if not found:
        return system
    own = {i: SlidingOverride(rest.field, (Release(rest.acceleration, "rising", 1),)) for i, rest in found.items()}
    return replace(system, overrides={**system.overrides, **own})


def rests_on(system: FilippovSystem, surfaces: Sequence[int]) -> Resting | None:
    """How a body would rest where one surface has reset the state; None where it cannot."""
    if len(surfaces) != 1 or surfaces[0] not in system.overrides:
        return None
    return resting_of(system, surfaces[0])


def time_to_rest(before: Any, after: Any, acceleration: Any, most: Any) -> Any:
    """How long all later flights last together; None where they last longer than ``most``, or there is no rest.

    Parameters
    ----------
    before, after
        h' before the impact, and after it.
    acceleration
        h'' after it.
    most
        The longest that counts as come to rest [s].
    """
    if not acceleration < 0 or after < 0 or not after < -before:
        return None
    time = 2 * after / (-acceleration * (1 + after / before))
    return time if time <= most else None


def state_at_rest(states: Sequence[Any], values: Sequence[Any], time: Any) -> list[Any]:
    """The state where a body comes to rest, put on the surface.

    Parameters
    ----------
    states
        After the last impact, shape (n,).
    values
        Of :meth:`Resting.expressions` there.
    time
        From there to the rest [s].
    """
    n = len(states)
    speed, push, field = values[0], values[2 : 2 + n], values[2 + n : 2 + 2 * n]
    h, gradient = values[2 + 2 * n], values[3 + 2 * n :]
    moved = [x - speed * p + time * f for x, p, f in zip(states, push, field, strict=True)]
    rate = sum((g * (m - x) for g, m, x in zip(gradient, moved, states, strict=True)), h)
    size = sum((g * g for g in gradient), 0 * h)
    return [m - rate * g / size for m, g in zip(moved, gradient, strict=True)]
