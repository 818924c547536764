"""Jumps of the state: where a surface falls through zero, a map gives the state anew.

All right-hand sides of a map use the state before the jump; states that it does not name stay. Which maps are applied
at one instant is told by :mod:`henon_ref.modes.cascade`. After a jump the mode is decided as at a start: a surface
whose function the map leaves as it is, and that was at zero, is where the state is.
See Goebel, Sanfelice and Teel, *Hybrid Dynamical Systems* (2012), and Brogliato, *Nonsmooth Mechanics* (2016), Ch. 1.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem


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
    """What is told of an instant at which resets have been applied, in order.

    Parameters
    ----------
    before, after : Mode
    applied : sequence of int
        Surfaces whose maps were applied, one after the other.

    Returns
    -------
    list of (int, int or None)
        A surface, and the place of the application that the row tells of; None for a surface that changes its side
        with them. In the order of the surfaces, all applications at the place of the first.
    """
    changed = [i for i, (old, new) in enumerate(zip(before, after, strict=True)) if old != new and i not in applied]
    rows: list[tuple[int, int | None]] = [(i, None) for i in changed if i < applied[0]]
    rows += [(i, place) for place, i in enumerate(applied)]
    return rows + [(i, None) for i in changed if i > applied[0]]
