"""The guard that falls first on a step, what is kept of it, and what it is called."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flint import arb

from henon_ref.enclosure.enclosure import Curve, UndecidedError
from henon_ref.enclosure.event import first_root
from henon_ref.enclosure.impacts import Rest
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode

HORIZON_MARGIN = 1.125
"""How far beyond the horizon is looked, in the time left, so that an event just there shows as a tie with it."""


@dataclass(frozen=True)
class Hit:
    """A guard that fell to zero, and where."""

    guard: Guard
    before: Mode
    after: Mode
    box: tuple[arb, ...]
    """Enclosure of (t, x)."""
    rate: arb
    """Slope of the guard at the event [1/s]."""
    applied: tuple[tuple[int, tuple[arb, ...]], ...] = ()
    """Surfaces that reset the state, in order, each with the enclosure after its map; ``box`` is after all."""
    rest: Rest | None = None
    """What follows at once, or after impacts that are not told of."""
    told: bool = True
    """Whether the guard's fall is told of: not where impacts have come to their limit before."""


def first_fall(
    watched: Sequence[tuple[Curve, bool, str]], reach: float, left: float
) -> tuple[tuple[int, arb] | None, list[bool]]:
    """The first guard to fall on a step of length ``reach``, of which ``left`` is left to the horizon."""
    if left * HORIZON_MARGIN < reach:
        try:
            # Look a little beyond the horizon, so that an event just there shows as a tie with it.
            return first_root(watched, left * HORIZON_MARGIN)
        except UndecidedError:
            return first_root(watched, left)
    return first_root(watched, min(left, reach))


def guard_text(guard: Guard, names: Sequence[str]) -> str:
    """A guard in words, for reasons."""
    if guard.kind == "valid":
        return f"valid expression {guard.index}"
    if guard.kind == "attracts":
        return f"whether sliding on {names[guard.index]} and others attracts"
    if guard.kind == "surface":
        return f"surface {names[guard.index]}"
    return f"the release of {names[guard.index]} to {guard.to_sign:+d}"
