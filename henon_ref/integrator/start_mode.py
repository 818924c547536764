"""Mode of a start on surfaces that compiled code does not decide: the one that fields and derivatives select."""

from __future__ import annotations

from typing import NamedTuple

from henon_ref.modes.callables import ARITHMETIC
from henon_ref.modes.mode import Mode
from henon_ref.modes.mode_evaluation import ModeEvaluation
from henon_ref.modes.selection import contact_orders, mode_by_signs, stays
from henon_ref.trajectory import Status


class StartMode(NamedTuple):
    """Mode of a start."""

    mode: Mode | None
    orders: list[int]
    """Known zeros of each guard; empty if there are none."""
    still: list[int]
    """Surfaces whose function vanishes here with its derivative: rounding may decide how it goes on."""
    status: Status = "failed"
    reason: str = ""
    """Status of the run, and the reason, if there is no mode."""


def start_mode(
    modes: ModeEvaluation,
    t: float,
    x: tuple[float, ...],
    signs: tuple[int | None, ...],
    given: tuple[tuple[int, int], ...],
) -> StartMode:
    """Return the mode at a start.

    ``modes``: in doubles; ``signs``: of the surfaces, then of the ``valid`` expressions, None for one without a value;
    ``given``: surfaces with their entries, where several motions are possible.
    """
    system, count = modes.system, len(modes.system.surfaces)
    known = [1 if sign is None else sign for sign in signs]
    at = modes.at(t, x)
    decision = mode_by_signs(at, known[:count], known[count:], dict(given))
    unused = system.unused_kinks(decision.mode) if None in signs and decision.mode else frozenset[int]()
    for i, sign in enumerate(signs):
        if sign is None and i not in unused:  # a kink in a branch that the mode does not use needs no value
            what = f"the surface of '{system.sign_names[i]}'" if i < count else "an expression of 'valid'"
            return StartMode(None, [], [], reason=f"{what} has no finite real value at the start")
    if decision.mode is None:
        return StartMode(None, [], [], decision.ending, decision.reason)
    active, edges = ([i for i, sign in enumerate(part) if sign == 0] for part in (signs[:count], signs[count:]))
    if not (active or edges):
        return StartMode(decision.mode, [], [])
    try:
        orders = contact_orders(at, decision.mode, active, edges)
        still = [
            guard.index
            for guard, order in zip(system.guards(decision.mode), orders, strict=True)
            if guard.kind == "surface" and guard.index in active
            if order > 1 or stays(at, decision.mode, guard.index)
        ]
    except ARITHMETIC:  # the loop finds no finite step either, and the reason
        return StartMode(decision.mode, [], [])
    return StartMode(decision.mode, orders, still)
