"""Surfaces at kinks and jumps of a field: modes that hide them, and surfaces without a jump of the field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain
from typing import Any, TypeVar

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.expressions.algebra import MAX_DERIVED
from henon_ref.expressions.bounds import put
from henon_ref.expressions.traversal import is_longer
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem

TransitionT = TypeVar("TransitionT", bound=Any)
"""Dataclass with ``surface``, ``from_mode`` and ``to_mode``."""


def hidden(system: FilippovSystem, index: int, mode: Mode) -> bool:
    """Check whether a surface is a kink that a mode does not use, since another branch is in force.

    The sign of a hidden kink has no meaning. ``mode``: may have more entries than the system has surfaces, those of the
    sections that a sweep adds.
    """
    return index in system.kinks and system.hides(index, mode[: len(system.signs)])


def shown_mode(system: FilippovSystem, mode: Mode) -> Mode:
    """Return the mode with +1 for its hidden kinks, so that it is one mode whatever their signs."""
    return _shown(system, mode) if system.kinks else mode


@lru_cache(maxsize=1024)
def _shown(system: FilippovSystem, mode: Mode) -> Mode:
    return tuple(1 if hidden(system, i, mode) else entry for i, entry in enumerate(mode))


def visible(system: FilippovSystem, transitions: Sequence[TransitionT]) -> Sequence[TransitionT]:
    """Return the transitions that are not on hidden kinks, with modes as :func:`shown_mode` returns them."""
    if not system.kinks:
        return transitions
    return tuple(
        replace(t, from_mode=shown_mode(system, t.from_mode), to_mode=shown_mode(system, t.to_mode))
        for t in transitions
        if _is_transition(system, t.surface, t.from_mode, t.to_mode)
    )


def _is_transition(system: FilippovSystem, surface: int, before: Mode, after: Mode) -> bool:
    if surface not in system.kinks:
        return True
    if before[surface] == after[surface]:  # a graze
        return not hidden(system, surface, before)
    return shown_mode(system, before)[surface] != shown_mode(system, after)[surface]


def are_visible(system: FilippovSystem, records: NDArray[Any], modes: tuple[Mode, ...]) -> NDArray[np.bool_]:
    """Return which records are of :func:`visible` transitions.

    Their fields ``from_mode`` and ``to_mode`` are indices of ``modes``.
    """
    if not (system.kinks and len(records)):
        return np.ones(len(records), dtype=bool)
    unseen, entries = _table(system, modes)
    before, after = ((records[name], records["surface"]) for name in ("from_mode", "to_mode"))
    graze, found = entries[before] == entries[after], np.where(unseen, 1, entries)
    return np.where(graze, ~unseen[before], found[before] != found[after])


@lru_cache(maxsize=64)
def _table(system: FilippovSystem, modes: tuple[Mode, ...]) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Return whether a surface is hidden, and its entry, by mode and surface."""
    unseen = [[hidden(system, i, mode) for i in range(len(mode))] for mode in modes]
    return np.array(unseen, dtype=bool), np.array(modes, dtype=np.int64)


def continuous(system: FilippovSystem) -> frozenset[int]:
    """Return the surfaces across which the field changes its expression without a jump: no sliding there.

    The jump must vanish in form after the surface's expression, or a state in which it is linear, is eliminated.
    """
    found = set()
    written = [*system.field, *chain.from_iterable(own.field for own in system.overrides.values())]
    for index, (sign, surface) in enumerate(zip(system.signs, system.surfaces, strict=True)):
        rates = [rate for rate in written if rate.has(sign)]
        jumps = (put(rate, {sign: sp.S.One}) - put(rate, {sign: sp.S.NegativeOne}) for rate in rates)
        if rates and all(_vanishes(system, jump, surface) for jump in jumps):
            found.add(index)
    return frozenset(found)


def _vanishes(system: FilippovSystem, jump: sp.Expr, surface: sp.Expr) -> bool:
    if is_longer(jump, MAX_DERIVED):
        return False
    on_surface = [{surface: sp.S.Zero, -surface: sp.S.Zero}]
    for state in system.states:
        slope = system.constant_slope(surface, state)
        if slope is not None:
            on_surface.append({state: state - surface / slope})
    return any(sp.expand(jump.xreplace(values)) == 0 for values in on_surface)
