"""What a system does in its own way on a surface: sliding that is not Filippov's, and jumps of the state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import sympy as sp

EntryRule = Literal["attracting", "inside", "resting"]


@dataclass(frozen=True)
class Release:
    """One way out of an overridden sliding mode: where ``when`` crosses zero in ``direction``."""

    when: sp.Expr
    direction: Literal["rising", "falling"]
    to: int


@dataclass(frozen=True)
class SlidingOverride:
    """Sliding that a source does in its own way, in place of Filippov's convex combination."""

    field: tuple[sp.Expr, ...]
    release: tuple[Release, ...]
    entry: EntryRule = "attracting"
    """When a trajectory that reaches the surface (or starts on it) sticks.

    ``attracting``: where both slip fields point at the surface, as in Filippov's sliding. ``inside``: where
    every release guard is positive, or zero and about to rise or to stay, whatever the slip fields do; this is
    static friction, which holds a load that kinetic friction could not (between Fk and Fs both slip fields
    point the same way, and a block that comes to rest on the belt sticks all the same). ``resting``: where h' is
    zero, too, and the first derivative of h that is not, the slip field being in force, is negative; a one-sided
    constraint on a surface that resets the state (:mod:`henon_ref.modes.resting`).
    """
    inertia: sp.Expr | None = None
    """How much the load, in the unit of the ends of the hold zone, grows with the acceleration of the surface by
    forces that these ends do not know: of a body on a wall its mass. None where that is not known."""
    push: tuple[sp.Expr, ...] = ()
    """Change of x' by the force of the contact, shape (n,): of a body at rest by a reaction of the surface that changes
    h'' by 1, of a contact that is held by a load of 1. Empty where that is not known."""


@dataclass(frozen=True)
class Reset:
    """A jump of the state where a surface is reached."""

    map: Mapping[sp.Symbol, sp.Expr]
    """State -> its value after the jump, in time, the states before it, and parameters; the other states stay."""
    when: Literal["falling"] = "falling"
    """The way in which the surface goes through zero there; the other way it is crossed."""
    priority: float = 0.0
    """Of several that are due at one instant the lowest goes first."""
