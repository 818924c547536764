"""Surfaces that stand for the kinks and jumps of a field: where they are none, and where the field is continuous."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.filippov.affine import constant_slope
from henon_ref.filippov.algebra import MAX_DERIVED
from henon_ref.filippov.bounds import put
from henon_ref.filippov.modes import Mode
from henon_ref.filippov.system import FilippovSystem
from henon_ref.taylor.size import size


class _Transition(Protocol):
    @property
    def surface(self) -> int: ...
    @property
    def from_mode(self) -> Mode: ...
    @property
    def to_mode(self) -> Mode: ...


TransitionT = TypeVar("TransitionT", bound=_Transition)


def visible(system: FilippovSystem, transitions: Sequence[TransitionT]) -> Sequence[TransitionT]:
    """Transitions without those on kinks that another branch hides on both sides of them."""
    if not system.kinks:
        return transitions
    known: dict[tuple[int, Mode], bool] = {}

    def hidden(index: int, mode: Mode) -> bool:
        key = index, mode
        if key not in known:
            known[key] = is_hidden(system, index, mode)
        return known[key]

    return tuple(
        t
        for t in transitions
        if t.surface not in system.kinks or not (hidden(t.surface, t.from_mode) and hidden(t.surface, t.to_mode))
    )


def is_hidden(system: FilippovSystem, index: int, mode: Mode) -> bool:
    """Whether nothing in a mode depends on the sign of a surface but the surface itself."""
    try:
        shared = system.shared_equations(frozenset(i for i, s in enumerate(mode) if s == 0))
    except ModelError:
        return False
    slip = {system.signs[i]: sp.Integer(s) for i, s in enumerate(mode) if s and i != index}
    guards = [guard.expression for guard in shared.guards if guard.index != index or guard.kind != "surface"]
    return not any(put(e, slip).has(system.signs[index]) for e in (*shared.field, *guards))


def continuous(system: FilippovSystem) -> frozenset[int]:
    """Surfaces that the field depends on the side of, without a jump: nothing slides there.

    A jump that does not vanish by its form, with the surface's own expression or with a state that it is linear in
    put in, counts as one.
    """
    found = set()
    for index, (sign, surface) in enumerate(zip(system.signs, system.surfaces, strict=True)):
        rates = [rate for rate in system.field if rate.has(sign)]
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
