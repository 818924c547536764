"""Equations of modes in which several surfaces slide and some of them are held by static friction.

Each held contact's force is what its ``sliding`` override says; the rates that its sign acts on are taken from there.
Contacts that act on no common rate, and whose loads hold no sign of each other, are decided each for itself: a chain of
blocks on a belt, coupled by springs and dampers. Of the assignments (holds, slips either way) the one counts where
loads are inside their limits and slips move off along their sign; holding wins. See Lötstedt, "Mechanical systems of
rigid bodies subject to unilateral constraints", *SIAM J. Appl. Math.* 42 (1982) 281-296, and Pfeiffer and Glocker,
*Multibody Dynamics with Unilateral Contacts* (1996).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.filippov.bounds import put
from henon_ref.filippov.linear_system import surfaces_solved
from henon_ref.filippov.switched_field import SwitchedField
from henon_ref.text import listed


class Held(Protocol):
    """What is read of a ``sliding`` override."""

    @property
    def field(self) -> tuple[sp.Expr, ...]: ...


@dataclass(frozen=True)
class HeldField:
    """A field with the rates of held contacts put in."""

    field: tuple[sp.Expr, ...]
    on_surface: Mapping[sp.Symbol, sp.Expr]
    """States that the held contacts' surfaces settle."""


def held_field(
    system: SwitchedField, held: Mapping[int, Held], loads: Sequence[sp.Expr], sliding: Collection[int]
) -> HeldField:
    """The field with several contacts held, or one beside others that slide.

    Parameters
    ----------
    system : SwitchedField
    held : mapping
        Surface -> its override.
    loads : sequence of Expr
        Release functions of all of them.
    sliding : collection of int
        All surfaces that slide, the held ones among them.

    Raises
    ------
    ModelError
        Where contacts act on a common rate, or one's force is in another's load.
    """
    signs = {system.signs[i] for i in sliding}
    _, on_surface = surfaces_solved(system, tuple(sorted(held)))
    rates = [put(rate, on_surface) for rate in system.field]
    taken: set[int] = set()
    slipping = tuple(rates)
    for i, own in held.items():
        stuck = [put(rate, on_surface) for rate in own.field]
        rows = [k for k, rate in enumerate(slipping) if rate.has(system.signs[i]) or rate != stuck[k]]
        others = signs - {system.signs[i]}
        if taken.intersection(rows) or any(stuck[k].has(*signs) or slipping[k].has(*others) for k in rows):
            raise _coupled(system, sliding)
        taken.update(rows)
        for k in rows:
            rates[k] = stuck[k]
    if any(load.has(*signs) for load in loads):
        raise _coupled(system, sliding)
    return HeldField(tuple(rates), on_surface)


def _coupled(system: SwitchedField, sliding: Collection[int]) -> ModelError:
    names = listed([system.sign_names[i] for i in sorted(sliding)])
    return ModelError(
        f"surfaces that act on each other at once, some with a 'sliding' override, cannot slide together: {names}"
    )
