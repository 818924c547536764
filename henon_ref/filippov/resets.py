"""Jumps of the state: where a surface falls through zero, a map gives the state anew.

All right-hand sides of a map use the state before the jump; states that it does not name stay. Where several surfaces
fall at one instant their maps are applied one after the other, if the order makes no difference. After a jump the mode
is decided as at a start: a surface whose function the map leaves as it is, and that was at zero, is where the state is.
See Goebel, Sanfelice and Teel, *Hybrid Dynamical Systems* (2012), and Brogliato, *Nonsmooth Mechanics* (2016), Ch. 1.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations

import sympy as sp

from henon_ref.filippov.equations import Guard
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.system import FilippovSystem

MOST_TOGETHER = 4
"""Surfaces that may reset the state at one instant: all orders of their maps are compared."""


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
    kept: frozenset[int]
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
    """What the resets of some surfaces do together; None where the order of their maps makes a difference."""
    if len(surfaces) > MOST_TOGETHER:
        return None
    found = {tuple(map(sp.expand, _composed(system, order))) for order in permutations(surfaces)}
    if len(found) > 1:
        return None
    states = _composed(system, surfaces)
    at = dict(zip(system.states, states, strict=True))
    guards = [h.xreplace(at) for h in (*system.surfaces, *system.valid)]
    kept = {i for i, h in enumerate(system.surfaces) if sp.expand(guards[i] - h) == 0}
    moved = [i for i, (x, value) in enumerate(at.items()) if x != value]
    return Jump(surfaces, states, tuple(moved), tuple(guards), frozenset(kept))


def _composed(system: FilippovSystem, order: Sequence[int]) -> tuple[sp.Expr, ...]:
    """The state after some surfaces' maps, in this order."""
    values = dict(zip(system.states, system.states, strict=True))
    for i in order:
        own = system.resets[i].map
        values = {x: own[x].xreplace(values) if x in own else value for x, value in values.items()}
    return tuple(values.values())


def order_matters(system: FilippovSystem, surfaces: Sequence[int], time: str) -> str:
    """Why a run ends where :func:`jump_of` finds no jump."""
    names = ", ".join(system.sign_names[i] for i in surfaces)
    return f"the future is not unique at t = {time}: {names} reset the state at once, and their order matters"
