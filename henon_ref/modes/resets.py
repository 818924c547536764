"""Jumps of the state (resets), impacts, the limit of accumulating impacts, and the rest that follows it.

A reset map gives the new state when a surface falls through zero. All right-hand sides of a map use the state before
the jump; states that the map does not name keep their values. :mod:`henon_ref.modes.cascade` decides which maps are
applied at one instant. After a jump the mode is decided as at a start. If a surface was at zero and the map leaves its
function unchanged, the state is on this surface. See Goebel, Sanfelice and Teel, *Hybrid Dynamical Systems* (2012), and
Brogliato, *Nonsmooth Mechanics* (2016), Ch. 1.

A body that bounces on a surface h with decreasing speed comes to rest in finite time. With the speed v of h just after
an impact, the acceleration -a < 0 between impacts, and the ratio r < 1 of the speeds after and before an impact, all
later flights together last ``2 v / (a (1 - r))``. If friction reverses at the apex of each flight, the acceleration is
-a on the way up and -b on the way down: a flight ends with the speed ``q v``, q = sqrt(b/a), and all flights last
``v (1 + 1/q) / (a (1 - q r))``. Both formulas neglect changes of a and b, an error of about the square of that time, so
they are used once the time is below :data:`REMAINING` of the run. The impacts until then are recorded; afterwards the
body rests on the surface, a one-sided constraint (Brogliato, *Nonsmooth Mechanics*, 2016, Ch. 5): the force of the
surface acts along the jumps of the state and keeps h'' at zero while it does not have to pull.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import sympy as sp
from sympy.utilities.iterables import connected_components

from henon_ref.expressions.bounds import put
from henon_ref.modes.equations import Guard, along
from henon_ref.modes.mode import Mode
from henon_ref.modes.switched_field import Release, SlidingOverride
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.text import listed

REMAINING = 2.0**-26
"""Largest duration of all later flights, as a part of the run, at which accumulating impacts are replaced by rest."""


@dataclass(frozen=True, eq=False)
class Jump:
    """Reset of a surface."""

    states: tuple[sp.Expr, ...]
    """State after the jump, in time and the state before, shape (n,)."""
    moved: tuple[int, ...]
    """States that get a new value."""
    guards: tuple[sp.Expr, ...]
    """All surfaces at the state after the jump, in time and the state before."""
    index: int
    """Surface whose reset this is."""
    kept: Collection[int]
    """Surfaces whose function has the same value before and after."""
    stays: bool
    """Whether a state on the surface stays on it: its function after the jump is zero where that before it is."""
    lands: bool
    """Whether each state is put on the surface."""

    def side(self, index: int, before: int) -> int | None:
        """Return the sign of a surface after the jump, given the sign before; None if the new value decides."""
        if index in self.kept:
            return before
        return 0 if index == self.index and (self.lands or (self.stays and before == 0)) else None


def resetting(system: FilippovSystem, mode: Mode, hits: Sequence[Guard]) -> tuple[int, ...]:
    """Return the surfaces that reset the state when guards of a mode fall; none if one of the guards ends the run."""
    if not system.resets or any(guard.ends for guard in hits):
        return ()
    found = {g.index for g in hits if g.kind == "surface" and g.index in system.resets and mode[g.index] > 0}
    return tuple(sorted(found))


@lru_cache(maxsize=256)
def jump_of(system: FilippovSystem, index: int) -> Jump:
    """Return the reset of a surface."""
    own = {x: value for x, value in system.resets[index].map.items() if x != value}
    guards = tuple(h.xreplace(own) for h in system.surfaces)
    kept = {i for i, h in enumerate(system.surfaces) if sp.expand(guards[i] - h) == 0}
    h, after = system.surfaces[index], sp.expand(guards[index])
    on = settled_state(h, system.states)
    stays = index in kept or after == 0 or sp.expand(after + h) == 0 or (on and sp.expand(after.xreplace(on)) == 0)
    states = tuple(own.get(x, x) for x in system.states)
    moved = tuple(k for k, x in enumerate(system.states) if x in own)
    return Jump(states, moved, guards, index, kept, bool(stays), after == 0)


def rows_at(before: Mode, after: Mode, applied: Sequence[int]) -> list[tuple[int, int | None]]:
    """Return the rows recorded for an instant at which the maps of ``applied`` surfaces were applied in this order.

    A row is a surface and the index of its application, None for a surface that only changes sides. Rows are in the
    order of the surfaces, with all applications at the position of the first.
    """
    changed = [i for i, (old, new) in enumerate(zip(before, after, strict=True)) if old != new and i not in applied]
    rows: list[tuple[int, int | None]] = [(i, None) for i in changed if i < applied[0]]
    rows += [(i, place) for place, i in enumerate(applied)]
    return rows + [(i, None) for i in changed if i > applied[0]]


@dataclass(frozen=True, eq=False)
class Impact:
    """Jump that does not change the surface's function h; expressions in time, states and signs of other surfaces."""

    speed: sp.Expr
    """h' [unit of the surface / s]."""
    acceleration: sp.Expr
    """h'' without a force of the surface."""
    refusal: str
    """Reason why rest on the surface cannot be derived; if empty, the fields below describe the rest."""
    ratio: sp.Expr = sp.S.Zero
    """h' after the impact over h' before it."""
    push: tuple[sp.Expr, ...] = ()
    """Change of the state per unit change of h' by a force of the surface, shape (n,)."""
    field: tuple[sp.Expr, ...] = ()
    """x' at rest, shape (n,)."""


@lru_cache(maxsize=64)
def impact_of(system: FilippovSystem, index: int) -> Impact | None:
    """Return the impact on a surface that resets the state; None if the map moves the state off the surface.

    A body can rest on the surface if the jump is an impact of a body: the state changes in proportion to h'.
    """
    jump, surface = jump_of(system, index), system.surfaces[index]
    if not jump.stays:
        return None
    field = tuple(put(f, {system.signs[index]: sp.Integer(1)}) for f in system.field)
    speed = along(surface, system.states, field)
    acceleration = along(speed, system.states, field)
    on = settled_state(surface, system.states)
    fast = speed.xreplace(on)
    if speed.has(*system.signs):
        names = listed([s.name for s in system.signs if speed.has(s)])
        return Impact(speed, acceleration, f"the speed of the impact depends on the sign of {names}")
    moving = set(system.states)
    changes = {k: (jump.states[k] - system.states[k]).xreplace(on) for k in jump.moved}
    shares = {k: sp.Integer(0) if fast == 0 else sp.cancel(change / fast) for k, change in changes.items()}
    slope = sp.expand(sp.Add(*(sp.diff(speed, system.states[k]) * share for k, share in shares.items())))
    bad = [system.states[k].name for k, share in shares.items() if sp.fraction(share)[1].free_symbols & moving]
    if bad or slope == 0 or slope.free_symbols & moving:
        what = f"{listed(bad)} does not change" if bad else "the state does not change"
        return Impact(speed, acceleration, f"{what} in proportion to the speed of the impact")
    push = tuple(sp.cancel(shares[k] / slope) if k in shares else sp.Integer(0) for k in range(len(system.states)))
    held = tuple(sp.expand(f - acceleration * p) if p != 0 else f for f, p in zip(field, push, strict=True))
    return Impact(speed, acceleration, "", sp.expand(1 + slope), push, held)


@lru_cache(maxsize=64)
def stops(system: FilippovSystem) -> dict[int, Impact]:
    """Return the surfaces on which a body can rest, with their impacts."""
    impacts = {i: impact_of(system, i) for i in system.resets}
    return {i: impact for i, impact in impacts.items() if impact is not None and not impact.refusal}


@lru_cache(maxsize=64)
def never_pressed(system: FilippovSystem) -> frozenset[int]:
    """Return the surfaces on which a state with h = h' = 0 stays without a force, unless a jump moves it.

    h'' is zero there, and in its whole group: a body at rest on one stop is pressed if a body rests on it.
    """
    impacts = {i: impact for i in system.resets if (impact := impact_of(system, i))}
    moved = {i: {system.states[k] for k in jump_of(system, i).moved} for i in impacts}
    edges = [(i, j) for i, impact in impacts.items() for j in impacts if impact.speed.free_symbols & moved[j]]
    groups = connected_components((list(impacts), edges))
    return frozenset(i for group in groups if not any(_pressed(system, j) for j in group) for i in group)


def _pressed(system: FilippovSystem, index: int) -> bool:
    """Return whether h'' is not zero for all states with h = h' = 0."""
    impact = impact_of(system, index)
    assert impact is not None
    on = settled_state(system.surfaces[index], system.states)
    slow = settled_state(impact.speed.xreplace(on), system.states)
    return bool(sp.expand(impact.acceleration.xreplace(on).xreplace(slow)) != 0)


def into_surface(name: str, time: str) -> str:
    """Return the message for a start on a surface that resets the state, with motion into the surface."""
    return f"at t = {time} the state is on {name}, which resets it, and moves into it"


def settled_state(surface: sp.Expr, states: Collection[sp.Symbol]) -> dict[sp.Symbol, sp.Expr]:
    """Return a state in which the surface is linear with a constant factor, solved for; empty if there is none."""
    for x in states:
        slope = sp.diff(surface, x)
        if slope != 0 and not slope.free_symbols & {TIME, *states}:
            return {x: sp.expand(x - surface / slope)}
    return {}


def kept_zero(system: FilippovSystem, index: int) -> tuple[sp.Expr, ...]:
    """Return the functions that sliding on a surface keeps at zero: h, and h' if a body rests on the surface."""
    impact = impact_of(system, index) if system.rests(index) else None
    return system.surfaces[index], *(() if impact is None else (impact.speed,))


def with_resting(system: FilippovSystem) -> FilippovSystem:
    """Return the system with overrides for bodies that rest on surfaces which reset the state.

    A surface without an acceleration towards it gets none: the state stays on it without a force.
    """
    own = {
        i: SlidingOverride(impact.field, (Release(impact.acceleration, "rising", 1),), "resting", push=impact.push)
        for i, impact in stops(system).items()
        if i not in never_pressed(system)
    }
    return replace(system, overrides={**system.overrides, **own}) if own else system


@lru_cache(maxsize=64)
def turning_in_flight(system: FilippovSystem, index: int) -> frozenset[int]:
    """Return surfaces that are multiples of h': their signs change at the apex of each flight and at impacts."""
    impact = impact_of(system, index)
    if impact is None or impact.speed.has(*system.signs):
        return frozenset()
    speed = system.numeric(impact.speed)
    parts = {j: sp.cancel(system.numeric(h) / speed) for j, h in enumerate(system.surfaces) if j != index}
    return frozenset(j for j, part in parts.items() if part.is_number)


def time_to_rest(before: Any, after: Any, acceleration: Any, most: Any, falling: Any = None) -> Any:
    """Return the duration of all later flights; None if above ``most`` [s], or if the body does not come to rest.

    ``before``, ``after``: h' before and after the impact; ``acceleration``: h'' after it; ``falling``: h'' on the way
    back, if different.
    """
    if not acceleration < 0 or after < 0 or not before < 0:
        return None
    fall = 1 if falling is None else falling / acceleration
    if not fall > 0:
        return None
    part = fall**0.5  # speed at the end of a flight over speed at its start
    lost = 1 + part * after / before
    if not lost > 0:
        return None
    time = after * (1 + 1 / part) / (-acceleration * lost)
    return time if time <= most else None
