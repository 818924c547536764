"""Jumps of the state: where a surface falls through zero, a map gives the state anew.

All right-hand sides of a map use the state before the jump; states that it does not name stay. Where several surfaces
fall at one instant their maps are applied together, if none changes or reads a state that another one changes; else
they are impacts that share a body, whose outcome may depend on their order. After a jump the mode is decided as at a
start: a surface whose function the map leaves as it is, and that was at zero, is where the state is.
See Goebel, Sanfelice and Teel, *Hybrid Dynamical Systems* (2012), and Brogliato, *Nonsmooth Mechanics* (2016), Ch. 1.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from henon_ref.filippov.decision import Decision
from henon_ref.filippov.equations import Guard
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.system import FilippovSystem
from henon_ref.text import listed


@dataclass(frozen=True, eq=False)
class Jump:
    """What the resets of some surfaces do together."""

    surfaces: tuple[int, ...]
    """Those that reset the state."""
    states: tuple[sp.Expr, ...]
    """The state after, in time and the state before, shape (n,)."""
    moved: tuple[int, ...]
    """States that get a new value."""
    guards: tuple[sp.Expr, ...]
    """All surfaces, then all ``valid`` expressions, at the state after, in time and the state before."""
    kept: Collection[int]
    """Surfaces whose function is the same before and after."""

    def sides(self, mode: Mode, hit: Collection[int], signs: Sequence[int]) -> list[int]:
        """Signs of the surfaces after the jump; 0 for one that the state is on.

        Parameters
        ----------
        mode : Mode
            Before it.
        hit : collection of int
            Surfaces that are at zero.
        signs : sequence of int
            Of the surfaces' values at the state after.
        """
        return [
            signs[i] if i not in self.kept else 0 if i in hit or entry == 0 else entry for i, entry in enumerate(mode)
        ]


def resetting(system: FilippovSystem, mode: Mode, hits: Sequence[Guard]) -> tuple[int, ...]:
    """Surfaces that reset the state where guards of a mode fall; none where one of the guards ends the run."""
    if not system.resets or any(guard.ends for guard in hits):
        return ()
    found = {g.index for g in hits if g.kind == "surface" and g.index in system.resets and mode[g.index] > 0}
    return tuple(sorted(found))


@lru_cache(maxsize=64)
def jump_of(system: FilippovSystem, surfaces: tuple[int, ...]) -> Jump | None:
    """What the resets of some surfaces do together; None where they share a state, so that their order may matter."""
    values = dict(zip(system.states, system.states, strict=True))
    moved: set[sp.Symbol] = set()
    read: set[sp.Symbol] = set()
    for i in surfaces:
        own = {x: value for x, value in system.resets[i].map.items() if x != value}
        used = set().union(*(value.free_symbols for value in own.values())) & set(system.states)
        if moved & (own.keys() | used) or read & own.keys():
            return None
        values |= own
        moved |= own.keys()
        read |= used
    guards = [h.xreplace(values) for h in (*system.surfaces, *system.valid)]
    kept = {i for i, h in enumerate(system.surfaces) if sp.expand(guards[i] - h) == 0}
    kept |= {i for i in surfaces if sp.expand(guards[i]) == 0}  # a map may put the state on its surface
    states = tuple(values[x] for x in system.states)
    return Jump(surfaces, states, tuple(k for k, x in enumerate(system.states) if x in moved), tuple(guards), kept)


def shared(system: FilippovSystem, surfaces: Sequence[int], time: str) -> Decision:
    """The decision where :func:`jump_of` finds no jump."""
    names = listed([system.sign_names[i] for i in surfaces])
    reason = f"the future is not unique at t = {time}: impacts at one instant that share a body: {names}"
    return Decision("nonunique", None, reason)
