"""Surfaces that stand for the kinks and jumps of a field: where they are none, and where the field is continuous."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain
from typing import Any, TypeVar

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.modes.algebra import MAX_DERIVED, constant_slope
from henon_ref.modes.bounds import put
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.size import size

TransitionT = TypeVar("TransitionT", bound=Any)
"""A dataclass with ``surface``, ``from_mode`` and ``to_mode``."""


@dataclass(frozen=True)
class HiddenKinks:
    """Which kinks of a system another branch hides: in such a mode they are none, and their signs mean nothing."""

    system: FilippovSystem

    def hidden(self, index: int, mode: Mode) -> bool:
        """Whether a surface is a kink that is hidden in a mode."""
        own = mode[: len(self.system.signs)]  # sections that a sweep adds stand behind the system's own surfaces
        return index in self.system.kinks and self.system.hides(index, own)

    def shown(self, mode: Mode) -> Mode:
        """A mode with +1 for what is hidden in it, so that it is one mode however these signs change."""
        if not self.system.kinks:
            return mode
        return _shown(self, mode)

    def hides_none(self, modes: Iterable[Mode]) -> bool:
        """Whether no kink is hidden in any of some modes: all that is found in these is a transition."""
        kinks = self.system.kinks
        return not kinks or not any(self.hidden(i, mode) for mode in modes for i in kinks)

    def is_transition(self, surface: int, before: Mode, after: Mode) -> bool:
        """Whether what has been found on a surface, between two modes, is a transition: it is not on a hidden kink."""
        if surface not in self.system.kinks:
            return True
        if before[surface] == after[surface]:  # it was touched
            return not self.hidden(surface, before)
        return self.shown(before)[surface] != self.shown(after)[surface]

    def are_transitions(self, records: NDArray[Any], modes: Sequence[Mode]) -> NDArray[np.bool_]:
        """The same of records with fields ``surface``, ``from_mode`` and ``to_mode``, the modes by their number."""
        found, count = np.ones(len(records), dtype=bool), len(modes)
        pairs = records["from_mode"].astype(np.int64) * count + records["to_mode"]
        for index in self.system.kinks:
            at = np.flatnonzero(records["surface"] == index)
            if at.size:
                own, which = np.unique(pairs[at], return_inverse=True)
                told = [self.is_transition(index, modes[pair // count], modes[pair % count]) for pair in own.tolist()]
                found[at] = np.array(told, dtype=bool)[which]
        return found


@lru_cache(maxsize=1024)
def _shown(kinks: HiddenKinks, mode: Mode) -> Mode:
    return tuple(1 if kinks.hidden(i, mode) else entry for i, entry in enumerate(mode))


def visible(system: FilippovSystem, transitions: Sequence[TransitionT]) -> Sequence[TransitionT]:
    """Transitions without those on hidden kinks, their modes as :meth:`HiddenKinks.shown` has them."""
    if not system.kinks:
        return transitions
    kinks = HiddenKinks(system)
    return tuple(
        replace(t, from_mode=kinks.shown(t.from_mode), to_mode=kinks.shown(t.to_mode))
        for t in transitions
        if kinks.is_transition(t.surface, t.from_mode, t.to_mode)
    )


def continuous(system: FilippovSystem) -> frozenset[int]:
    """Surfaces that the field depends on the side of, without a jump: nothing slides there.

    A jump that does not vanish by its form, with the surface's own expression or with a state that it is linear in
    put in, counts as one.
    """
    found = set()
    written = [*system.field, *chain.from_iterable(own.field for own in system.overrides.values())]
    for index, (sign, surface) in enumerate(zip(system.signs, system.surfaces, strict=True)):
        rates = [rate for rate in written if rate.has(sign)]
        if rates and all(_vanishes(system, _jump(rate, sign), surface) for rate in rates):
            found.add(index)
    return frozenset(found)


def _jump(rate: sp.Expr, sign: sp.Symbol) -> sp.Expr:
    return put(rate, {sign: sp.Integer(1)}) - put(rate, {sign: sp.Integer(-1)})


def _vanishes(system: FilippovSystem, jump: sp.Expr, surface: sp.Expr) -> bool:
    if size(jump, MAX_DERIVED) > MAX_DERIVED:
        return False
    on_surface = [{surface: sp.S.Zero, -surface: sp.S.Zero}]
    for state in system.states:
        slope = constant_slope(surface, state, system.states)
        if slope is not None:
            on_surface.append({state: state - surface / slope})
    return any(sp.expand(jump.xreplace(values)) == 0 for values in on_surface)
