"""Jumps of the state, the impacts among them, the limit of impacts that accumulate, and the rest that they lead to.

Where a surface falls through zero, a map gives the state anew. All right-hand sides of a map use the state before the
jump; states that it does not name stay. Which maps are applied at one instant is told by
:mod:`henon_ref.modes.cascade`. After a jump the mode is decided as at a start: a surface whose function the map leaves
as it is, and that was at zero, is where the state is.
See Goebel, Sanfelice and Teel, *Hybrid Dynamical Systems* (2012), and Brogliato, *Nonsmooth Mechanics* (2016), Ch. 1.

A body that a surface h throws back ever more weakly comes to rest on it in a finite time: with the speed v of h just
after an impact, its acceleration -a < 0 between impacts, and the ratio r < 1 of the speeds after and before an impact,
all later flights together last ``2 v / (a (1 - r))``. Where friction turns round at the height of each flight it is -a
on the way up and -b on the way down: a flight ends with the speed ``q v``, q = sqrt(b/a), and all of them together
last ``v (1 + 1/q) / (a (1 - q r))``. That neglects how a and b change meanwhile, so that it is wrong by about the
square of that time: it is used once the time is below :data:`REMAINING` of the run. Impacts are told of up to there;
then the body rests on the surface, a one-sided constraint (Brogliato, *Nonsmooth Mechanics*, 2016, Ch. 5): the force of
the surface acts along the jumps of the state and keeps h'' at zero, as long as it does not have to pull.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import sympy as sp

from henon_ref.modes.bounds import put
from henon_ref.modes.equations import Guard, along
from henon_ref.modes.mode import Mode
from henon_ref.modes.switched_field import Release, SlidingOverride
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.text import listed

REMAINING = 2.0**-26
"""Part of the run that all later flights together may last where impacts have come to their limit."""


@dataclass(frozen=True, eq=False)
class Jump:
    """What the reset of a surface does."""

    states: tuple[sp.Expr, ...]
    """The state after, in time and the state before, shape (n,)."""
    moved: tuple[int, ...]
    """States that get a new value."""
    guards: tuple[sp.Expr, ...]
    """All surfaces at the state after, in time and the state before."""
    kept: Collection[int]
    """Surfaces whose function is the same before and after."""


def resetting(system: FilippovSystem, mode: Mode, hits: Sequence[Guard]) -> tuple[int, ...]:
    """Surfaces that reset the state where guards of a mode fall; none where one of the guards ends the run."""
    if not system.resets or any(guard.ends for guard in hits):
        return ()
    found = {g.index for g in hits if g.kind == "surface" and g.index in system.resets and mode[g.index] > 0}
    return tuple(sorted(found))


@lru_cache(maxsize=256)
def jump_of(system: FilippovSystem, index: int) -> Jump:
    """What the reset of a surface does."""
    own = {x: value for x, value in system.resets[index].map.items() if x != value}
    guards = tuple(h.xreplace(own) for h in system.surfaces)
    kept = {i for i, h in enumerate(system.surfaces) if sp.expand(guards[i] - h) == 0}
    if sp.expand(guards[index]) == 0:  # a map may put the state on its surface
        kept.add(index)
    states = tuple(own.get(x, x) for x in system.states)
    return Jump(states, tuple(k for k, x in enumerate(system.states) if x in own), guards, kept)


def rows_at(before: Mode, after: Mode, applied: Sequence[int]) -> list[tuple[int, int | None]]:
    """What is told of an instant at which the maps of surfaces have been applied, one after the other.

    A surface, and the place of the application that the row tells of; None for a surface that changes its side with
    them. In the order of the surfaces, all applications at the place of the first.
    """
    changed = [i for i, (old, new) in enumerate(zip(before, after, strict=True)) if old != new and i not in applied]
    rows: list[tuple[int, int | None]] = [(i, None) for i in changed if i < applied[0]]
    rows += [(i, place) for place, i in enumerate(applied)]
    return rows + [(i, None) for i in changed if i > applied[0]]


@dataclass(frozen=True, eq=False)
class Impact:
    """A jump that leaves the surface's function h as it is; expressions in time, states and signs of other surfaces."""

    speed: sp.Expr
    """h' [unit of the surface / s]."""
    acceleration: sp.Expr
    """h'' where no force of the surface acts."""
    refusal: str
    """Why it is not told how a body rests on the surface; empty where it is, and then the rest is there."""
    idle: bool = False
    """Whether nothing but a jump moves a state off the surface where h' is zero: it needs no force to stay there."""
    ratio: sp.Expr = sp.S.Zero
    """h' after the impact over h' before it."""
    push: tuple[sp.Expr, ...] = ()
    """Change of the state by a force of the surface that changes h' by 1, shape (n,)."""
    field: tuple[sp.Expr, ...] = ()
    """x' at rest, shape (n,)."""


@lru_cache(maxsize=64)
def impact_of(system: FilippovSystem, index: int) -> Impact | None:
    """How a surface that resets the state throws it back; None where the map leads off the surface.

    A body can rest on the surface where the jumps are impacts of a body: the state changes in proportion to h'.
    """
    jump, surface = jump_of(system, index), system.surfaces[index]
    if index not in jump.kept:
        return None
    field = tuple(put(f, {system.signs[index]: sp.Integer(1)}) for f in system.field)
    speed = along(surface, system.states, field)
    acceleration = along(speed, system.states, field)
    on = settled_state(surface, system.states)
    fast = speed.xreplace(on)
    idle = sp.expand(acceleration.xreplace(on).xreplace(settled_state(fast, system.states))) == 0
    if speed.has(*system.signs):
        names = listed([s.name for s in system.signs if speed.has(s)])
        return Impact(speed, acceleration, f"how fast the surface is reached depends on the sign of {names}", idle)
    moving = set(system.states)
    changes = {k: (jump.states[k] - system.states[k]).xreplace(on) for k in jump.moved}
    shares = {k: sp.Integer(0) if fast == 0 else sp.cancel(change / fast) for k, change in changes.items()}
    slope = sp.expand(sp.Add(*(sp.diff(speed, system.states[k]) * share for k, share in shares.items())))
    bad = [system.states[k].name for k, share in shares.items() if sp.fraction(share)[1].free_symbols & moving]
    if bad or slope == 0 or slope.free_symbols & moving:
        what = f"{listed(bad)} does not change" if bad else "the state does not change"
        return Impact(speed, acceleration, f"{what} in proportion to the speed of the impact", idle)
    push = tuple(sp.cancel(shares[k] / slope) if k in shares else sp.Integer(0) for k in range(len(system.states)))
    held = tuple(sp.expand(f - acceleration * p) if p != 0 else f for f, p in zip(field, push, strict=True))
    return Impact(speed, acceleration, "", idle, sp.expand(1 + slope), push, held)


def into_surface(name: str, time: str) -> str:
    """Why a run ends whose state is on a surface that resets it and moves into it."""
    return f"at t = {time} the state is on {name}, which resets it, and moves into it"


def settled_state(surface: sp.Expr, states: Collection[sp.Symbol]) -> dict[sp.Symbol, sp.Expr]:
    """A state that the surface settles, where it is linear in one with a constant factor."""
    for x in states:
        slope = sp.diff(surface, x)
        if slope != 0 and not slope.free_symbols & {TIME, *states}:
            return {x: sp.expand(x - surface / slope)}
    return {}


def with_resting(system: FilippovSystem) -> FilippovSystem:
    """The system with the sliding of bodies that rest on surfaces which reset the state.

    Where nothing could press a body on, there is none: it stays on the surface by itself.
    """
    own = {
        i: SlidingOverride(impact.field, (Release(impact.acceleration, "rising", 1),), "resting", push=impact.push)
        for i in system.resets
        if (impact := impact_of(system, i)) is not None and not (impact.refusal or impact.idle)
    }
    return replace(system, overrides={**system.overrides, **own}) if own else system


@lru_cache(maxsize=64)
def turning_in_flight(system: FilippovSystem, index: int) -> frozenset[int]:
    """Surfaces whose functions are multiples of h': their signs change at the height of each flight, and at impacts."""
    impact = impact_of(system, index)
    if impact is None or impact.speed.has(*system.signs):
        return frozenset()
    speed = system.numeric(impact.speed)
    parts = {j: sp.cancel(system.numeric(h) / speed) for j, h in enumerate(system.surfaces) if j != index}
    return frozenset(j for j, part in parts.items() if part.is_number)


def time_to_rest(before: Any, after: Any, acceleration: Any, most: Any, falling: Any = None) -> Any:
    """How long all later flights last together; None where they last longer than ``most`` [s], or there is no rest.

    ``before``, ``after``: h' before and after the impact; ``acceleration``: h'' after it, ``falling``: on the way back,
    where that is another one.
    """
    if not acceleration < 0 or after < 0 or not before < 0:
        return None
    fall = 1 if falling is None else falling / acceleration
    if not fall > 0:
        return None
    part = fall**0.5  # of the speed that a flight begins with: with that it ends
    lost = 1 + part * after / before
    if not lost > 0:
        return None
    time = after * (1 + 1 / part) / (-acceleration * lost)
    return time if time <= most else None
