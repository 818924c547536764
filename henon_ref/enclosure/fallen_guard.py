"""The guard that falls first on a step, the record of its event, and its name in messages."""

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
"""Search interval as a multiple of the remaining time: an event just after the horizon is then reported as a tie."""


@dataclass(frozen=True)
class Hit:
    """The event of a guard that fell to zero."""

    guard: Guard
    before: Mode
    after: Mode
    box: tuple[arb, ...]
    """Enclosure of (t, x)."""
    rate: arb
    """Slope of the guard at the event [1/s]."""
    applied: tuple[tuple[int, tuple[arb, ...]], ...] = ()
    """Surfaces that reset the state, in order, each with the enclosure after its map; ``box`` is after the last map."""
    rest: Rest | None = None
    """Rest that follows at this instant, or after accumulating impacts that are not recorded."""
    recorded: bool = True
    """False for an impact after the limit of accumulating impacts was detected."""


def first_fall(
    watched: Sequence[tuple[Curve, bool, str]], reach: float, left: float
) -> tuple[tuple[int, arb] | None, list[bool]]:
    """Locate the first guard that falls on a step of length ``reach``, with time ``left`` to the horizon."""
    if left * HORIZON_MARGIN < reach:
        try:
            return first_root(watched, left * HORIZON_MARGIN)
        except UndecidedError:
            return first_root(watched, left)
    return first_root(watched, min(left, reach))


def guard_text(guard: Guard, names: Sequence[str]) -> str:
    if guard.kind == "valid":
        return f"valid expression {guard.index}"
    if guard.kind == "attracts":
        return f"whether sliding on {names[guard.index]} and others attracts"
    if guard.kind == "surface":
        return f"surface {names[guard.index]}"
    return f"the release of {names[guard.index]} to {guard.to_sign:+d}"
