"""Whether a mode is consistent at a point: whether its own field keeps it just after.

A mode is *consistent* when every surface in slip is left on the mode's side (first non-zero derivative of h), and on
every sliding surface the equivalent sign stays inside [-1, 1] and the two fields point at the surface. A surface whose
sliding is overridden with ``entry: inside`` is held wherever every release guard is positive just after the point
(first non-zero derivative; one that stays at zero holds); whether it is, :mod:`henon_ref.modes.held_groups` decides.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import lru_cache

import sympy as sp

from henon_ref.modes.arithmetic import NO_VALUE, ZERO, Point
from henon_ref.modes.equations import Guard
from henon_ref.modes.held_groups import IDENTICALLY_ZERO, Broken, order_of
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.patterns import by_pattern


def violations(at: Point, mode: Mode, active: Collection[int], zero: float) -> list[tuple[Guard, bool]] | None:
    """Guards of a mode that do not hold just after a point, each with whether it is a surface that is never left.

    None where the mode has no equations, no derivatives, or holds what does not stick, or the other way round.

    Parameters
    ----------
    at : Point
    mode : Mode
    active : collection of int
        Surfaces that the point is on.
    zero : float
        Relative size below which a derivative counts as zero.
    """
    system, broken = at.system, list[tuple[Guard, bool]]()
    try:
        guards = at.guards(mode)
        if guards is None:
            return None
        held = {i for i in active if mode[i] == 0 and i in system.overrides}
        off = (i for i in active if mode[i] != 0 and system.rests(i))  # no slip starts where a body rests
        if any(_sticks(at, mode, i, zero) for i in off) or not all(_sticks(at, mode, i, zero) for i in held):
            return None
        for place, guard in enumerate(guards):
            i = guard.index
            if guard.ends or i not in active or i in held:
                continue
            term = at.leading(mode, place, 1 if guard.kind == "surface" else 0, zero, i)
            # A surface that is never left is no slip; an equivalent sign that stays at its limit still holds.
            if term is None and guard.kind == "surface":
                broken.append((guard, True))
            elif term is not None and term[1] < 0:
                broken.append((guard, False))
    except NO_VALUE:
        return None
    return broken


def broken_in_groups(at: Point, mode: Mode, active: Collection[int], zero: float) -> Broken | None:
    """The same of contacts in groups, each guard with the order of the derivative of the forces that tells."""
    system, broken = at.system, list[tuple[Guard, int]]()
    try:
        guards = at.guards(mode)
        if guards is None:
            return None
        for place, guard in enumerate(guards):
            i = guard.index
            if guard.ends or i not in active:
                continue
            if guard.kind == "release" and i in system.overrides:
                if system.held_inside(i) or system.rests(i):
                    term = at.end_of_hold(mode, place, zero)
                    broken += [(guard, term[0])] if term is not None and term[1] < 0 else []
                elif way_out(at, mode, i) == guard.to_sign:
                    broken.append((guard, 0))
                continue
            first = 1 if guard.kind == "surface" else 0
            term = at.leading(mode, place, first, zero, None if system.rests(i) else i)
            if term is None:
                broken += [(guard, IDENTICALLY_ZERO)] if first else []
            elif term[1] < 0:
                broken.append((guard, order_of(system, guard, term[0])))
    except NO_VALUE:
        return None
    return broken


def staying(at: Point, mode: Mode, active: Collection[int], zero: float) -> frozenset[int] | None:
    """Surfaces that a slip does not leave, where nothing else keeps the mode out; else None."""
    broken = violations(at, mode, active, zero)
    return None if broken is None or not all(stays for _, stays in broken) else frozenset(g.index for g, _ in broken)


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


def _sticks(at: Point, mode: Mode, index: int, zero: float) -> bool:
    """Whether a surface whose sliding is overridden is slid on from here."""
    return _rests(at, mode, index, zero) if at.system.rests(index) else _attracts(at, mode, index)


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


def way_out(at: Point, mode: Mode, index: int) -> int:
    """Where a surface is left to by the signs of the mode elsewhere; 0 where it attracts or it cannot be told."""
    try:
        below, above = at.sides(mode, index)
    except NO_VALUE:
        return 0
    return 1 if below > 0 and above > 0 else -1 if below < 0 and above < 0 else 0


@lru_cache(maxsize=1024)
def _terms(expression: sp.Expr) -> tuple[sp.Expr, ...]:
    return by_pattern(_multiplied_out, expression) or ()


def _multiplied_out(expression: sp.Expr) -> tuple[sp.Expr, ...]:
    return tuple(sp.Add.make_args(sp.expand_mul(expression)))


def clear_signs(at: Point, signs: Mode, expressions: Sequence[sp.Expr]) -> list[int]:
    """Signs of expressions in time, states and signs at a point; 0 where the terms of one may cancel."""
    sums = [at.values(_terms(expression), signs) for expression in expressions]
    found, negative = list[int](), at.arithmetic.negative
    for own in sums:
        if own is None:
            return [0] * len(sums)
        value, size = sum(own[1:], own[0]), sum(map(abs, own[1:]), abs(own[0]))
        found.append(-1 if negative(value, size) else int(negative(-value, size)))
    return found
