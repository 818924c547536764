"""Consistency of a mode at a point: whether its own field keeps it just after the point.

See :mod:`henon_ref.modes.selection`, which tests the candidates.
"""

from __future__ import annotations

from collections.abc import Collection

from henon_ref.modes.arithmetic import ZERO, Point
from henon_ref.modes.callables import ARITHMETIC
from henon_ref.modes.contact_group import IDENTICALLY_ZERO, Broken, order_of
from henon_ref.modes.equations import Guard
from henon_ref.modes.mode import Mode, replaced


def broken_guards(at: Point, mode: Mode, active: Collection[int], zero: float, *, alone: bool) -> Broken | None:
    """Return the guards of a mode that become negative just after a point, each with the deciding order of derivative.

    None if the mode has no equations or no finite derivatives. ``active``: surfaces on which the point lies; ``zero``:
    the relative size below which a derivative counts as zero; ``alone``: the mode is tested by itself (not by
    :mod:`henon_ref.modes.held_groups`), and None is returned also if an override disagrees with the mode about sliding.
    """
    system, broken = at.system, list[tuple[Guard, int]]()
    try:
        guards = at.guards(mode)
        if guards is None:
            return None
        for i in system.overrides.keys() & active if alone else ():
            sticks = _rests(at, mode, i, zero) if system.rests(i) else not mode[i] and _attracts(at, mode, i)
            if sticks != (mode[i] == 0):
                return None
        for place, guard in enumerate(guards):
            i = guard.index
            if guard.ends or i not in active:
                continue
            if guard.kind == "release" and i in system.overrides:
                order = None if alone else _let_go(at, mode, place, guard, zero)
                broken += [] if order is None else [(guard, order)]
                continue
            first = 1 if guard.kind == "surface" else 0
            term = at.leading(mode, place, first, zero, None if system.rests(i) else i)
            if term is None and first and not system.rests(i):
                term = at.late(mode, place, zero, i)
            # If h stays at zero there is no slip; an equivalent sign that stays at its limit still holds.
            if term is None:
                broken += [(guard, IDENTICALLY_ZERO)] if first else []
            elif term[1] < 0:
                broken.append((guard, order_of(system, guard, term[0])))
    except ARITHMETIC:
        return None
    return broken


def _let_go(at: Point, mode: Mode, place: int, guard: Guard, zero: float) -> int | None:
    """Return the order of the derivative by which a guard ends an override's sliding; None if the sliding continues."""
    if at.system.held_inside(guard.index) or at.system.rests(guard.index):
        term = at.end_of_hold(mode, place, zero)
        return term[0] if term is not None and term[1] < 0 else None
    try:
        ways = [speed * guard.to_sign > 0 for speed in at.sides(mode, guard.index)]
    except ARITHMETIC:
        return None
    return 0 if all(ways) else None


def stays(at: Point, mode: Mode, index: int) -> bool:
    """Check whether a slip stays on a surface on which the point lies, in all derivatives that are computed."""
    own = [k for k, g in enumerate(at.guards(mode) or ()) if g.kind == "surface" and g.index == index]
    return all(at.leading(mode, place, 1, at.levels[0], index) is None for place in own)


def exactly_stays(at: Point, mode: Mode, surfaces: Collection[int]) -> bool:
    """Check whether slips stay on surfaces, in derivatives that are zero themselves and not only next to their terms.

    In doubles a force that has decayed below rounding is not zero: it is no other solution beside one that leaves.
    """
    own = [(k, g.index) for k, g in enumerate(at.guards(mode) or ()) if g.kind == "surface" and g.index in surfaces]
    return all(at.late(mode, place, 0.0, index) is None for place, index in own)


def indeterminate(at: Point, mode: Mode, index: int, zero: float) -> bool:
    """Check whether all release guards of a surface stay at zero, in all derivatives that are computed."""
    if index in at.system.overrides:
        return False
    ends = [k for k, g in enumerate(at.guards(mode) or ()) if g.kind == "release" and g.index == index]
    return all(at.leading(mode, place, 0, zero, index) is None for place in ends)


def _rests(at: Point, mode: Mode, index: int, zero: float) -> bool:
    """Check whether a body stays on a stop: without the reaction, h would start with zero speed and not rise."""
    free = replaced(mode, index, 1)
    try:
        guards = at.guards(free)
        if guards is None:
            return False
        own = next(k for k, g in enumerate(guards) if g.kind == "surface" and g.index == index)
        term = at.leading(free, own, 1, zero)
    except ARITHMETIC:
        return False
    return term is None or (term[0] > 1 and term[1] < 0)


def _attracts(at: Point, mode: Mode, index: int) -> bool:
    (below, above), negative = at.sides(mode, index), at.arithmetic.negative
    size = abs(below) + abs(above)
    return not negative(below, size, ZERO) and not negative(-above, size, ZERO)
