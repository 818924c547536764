"""Whether a mode is consistent at a point: whether its own field keeps it just after.

A mode is *consistent* when every surface in slip is left on the mode's side (first non-zero derivative of h), and on
every sliding surface the equivalent sign stays inside [-1, 1] and the two fields point at the surface. A surface whose
sliding is overridden with ``entry: inside`` is held wherever every release guard is positive just after the point
(first non-zero derivative; one that stays at zero holds); whether it is, :mod:`henon_ref.modes.held_groups` decides.
"""

from __future__ import annotations

from collections.abc import Collection

from henon_ref.modes.arithmetic import NO_VALUE, ZERO, Point
from henon_ref.modes.equations import Guard
from henon_ref.modes.held_groups import IDENTICALLY_ZERO, Broken, order_of
from henon_ref.modes.mode import Mode, replaced


def broken_guards(at: Point, mode: Mode, active: Collection[int], zero: float, *, alone: bool) -> Broken | None:
    """Guards of a mode that do not hold just after a point, each with the order of the derivative that tells.

    None where the mode has no equations, or no derivatives. ``active``: surfaces that the point is on; ``zero``: the
    relative size below which a derivative counts as zero; ``alone``: the mode is tried by itself, and is none either
    where an override slides that is not to, or the other way round; else by :mod:`henon_ref.modes.held_groups`.
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
            # A surface that is never left is no slip; an equivalent sign that stays at its limit still holds.
            if term is None:
                broken += [(guard, IDENTICALLY_ZERO)] if first else []
            elif term[1] < 0:
                broken.append((guard, order_of(system, guard, term[0])))
    except NO_VALUE:
        return None
    return broken


def _let_go(at: Point, mode: Mode, place: int, guard: Guard, zero: float) -> int | None:
    """The order of the derivative by which an override's slide ends at one of its guards; None where it holds."""
    if at.system.held_inside(guard.index) or at.system.rests(guard.index):
        term = at.end_of_hold(mode, place, zero)
        return term[0] if term is not None and term[1] < 0 else None
    try:
        ways = [speed * guard.to_sign > 0 for speed in at.sides(mode, guard.index)]
    except NO_VALUE:
        return None
    return 0 if all(ways) else None


def stays(at: Point, mode: Mode, index: int) -> bool:
    """Whether a slip stays on a surface, so far as its derivatives tell, at a point that is on it."""
    own = [k for k, g in enumerate(at.guards(mode) or ()) if g.kind == "surface" and g.index == index]
    return all(at.leading(mode, place, 1, at.levels[0], index) is None for place in own)


def indeterminate(at: Point, mode: Mode, index: int, zero: float) -> bool:
    """Whether no end of a slide on a surface is anything but zero, so far as its derivatives tell."""
    if index in at.system.overrides:
        return False
    ends = [k for k, g in enumerate(at.guards(mode) or ()) if g.kind == "release" and g.index == index]
    return all(at.leading(mode, place, 0, zero, index) is None for place in ends)


def _rests(at: Point, mode: Mode, index: int, zero: float) -> bool:
    """Whether a body on a surface stays there: off it, h would neither rise at once nor fall with a speed."""
    free = replaced(mode, index, 1)
    try:
        guards = at.guards(free)
        if guards is None:
            return False
        own = next(k for k, g in enumerate(guards) if g.kind == "surface" and g.index == index)
        term = at.leading(free, own, 1, zero)
    except NO_VALUE:
        return False
    return term is None or (term[0] > 1 and term[1] < 0)


def _attracts(at: Point, mode: Mode, index: int) -> bool:
    """Whether both fields point at a surface, or along it."""
    below, above = at.sides(mode, index)
    size, negative = abs(below) + abs(above), at.arithmetic.negative
    return not negative(below, size, ZERO) and not negative(-above, size, ZERO)
