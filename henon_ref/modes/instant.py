"""State between two maps at one instant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import sympy as sp

from henon_ref.modes.mode import Mode


class Numbers(Protocol):
    """Arithmetic of states: evaluation, and comparison with zero."""

    rounding: float
    """Part of the size of its terms below which a value counts as rounding of zero."""

    def values(self, expressions: tuple[sp.Expr, ...], t: Any, x: Sequence[Any]) -> list[Any]:
        """Values of expressions in time and states at a point; raises ``ARITHMETIC`` if one has none."""

    def sign(self, value: Any) -> int:
        """Sign of a value; 0 if it cannot be distinguished from zero."""

    def guard_series(self, mode: Mode, t: Any, x: Sequence[Any]) -> Sequence[Sequence[Any]]:
        """Taylor coefficients in time of a mode's guards."""

    def at(self, t: Any, x: Sequence[Any]) -> Any:
        """:class:`~henon_ref.modes.arithmetic.Point` at which modes are decided; messages contain its ``when``.

        (Its type is not imported, because the enclosure, which uses this module, must not import mode selection.)
        """


@dataclass(frozen=True)
class Rate:
    """h' of a surface on which the state stays."""

    before: Any
    """h' before its last impact, or before the last map if there was no impact."""
    now: Any
    sign: int


@dataclass(frozen=True)
class Instant:
    """State of the cascade after the maps applied so far."""

    state: Sequence[Any]
    sides: tuple[int, ...]
    """Signs of the surfaces; 0 if the state is on the surface."""
    due: frozenset[int]
    """Surfaces whose maps are still to be applied."""
    sizes: Sequence[Any]
    """Scale of rounding errors of each state: the size of the terms from which it was computed."""
    rates: Mapping[int, Rate] = field(default_factory=dict)
    """Rates that a map has changed, of surfaces on which the state is."""
    applied: tuple[tuple[int, Sequence[Any]], ...] = ()
    """Surfaces whose maps were applied, in order, each with the state after its map."""

    limit: bool = False
    """Whether this is the limit of impacts without end."""

    @property
    def fired(self) -> set[int]:
        return {i for i, _ in self.applied}
