"""The balance of forces of contacts that act on each other, at a point.

The relative accelerations of a group's contacts are affine in their forces, ``N = a - M f``; a friction's force is in
units of what it slides with, where its override does not say what a load does. M and a are read from the values of the
accelerations with and without each force, in any arithmetic: numbers, balls.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import sympy as sp

from henon_ref.errors import ModelError
from henon_ref.modes.bounds import put
from henon_ref.modes.contact_problem import ContactProblem, Negative, Row
from henon_ref.modes.decision import with_entries
from henon_ref.modes.equations import along
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem

Values = Callable[[tuple[sp.Expr, ...], Mode], Sequence[Any] | None]
"""(expressions, signs of all surfaces) -> their values at the point; None if not finite."""


class Balance(NamedTuple):
    """A group's relative accelerations, and the limits of its static friction."""

    problem: ContactProblem
    """With the limits of contacts that have slipped."""
    static: Mapping[int, tuple[Any, Any]]
    """Place of a contact -> its least and largest force before that; None: no limit."""


def balance_of(
    system: FilippovSystem, mode: Mode, contacts: tuple[int, ...], values: Values, negative: Negative
) -> Balance | None:
    """The balance of a group, the other surfaces' entries being those of a mode.

    None where the accelerations are not affine in the forces, or not finite, or a force does not act at all.
    """
    rows = _rows(system, mode, contacts, values, negative)
    if rows is None:
        return None
    fixed = frozenset(i for i in contacts if system.held_inside(i))
    free, matrix, lower, upper = [], [], list[Any](), list[Any]()
    static: dict[int, tuple[Any, Any]] = {}
    ways = [1 if system.rests(i) else -1 for i in contacts]  # a reaction pushes off, friction holds back
    for k, i in enumerate(contacts):
        own = next(rows)
        free.append(own[0])
        matrix.append([way * slope for way, slope in zip(ways, own[1:], strict=True)])
        if not negative(-matrix[k][k], abs(matrix[k][k])):
            return None
        ends = [(guard.to_sign, next(rows)) for guard in system.hold_guards(i)] if i in fixed else []
        inertia, kinetic = 0 * own[0] + 1, 0 * own[0] + 1
        if i in fixed and system.overrides[i].inertia is not None:
            inertia = next(rows)[0]
        elif i in fixed:
            inertia = _inertia(system, i, k, own, ends)
        if i in fixed and system.overrides[i].push:
            kinetic = inertia * next(rows)[0]
        lower.append(None if system.rests(i) else -kinetic)
        upper.append(0 * kinetic if system.rests(i) else kinetic)
        if ends:
            limits = {side: (end[0] + side * inertia * own[0]) / (inertia * matrix[k][k]) for side, end in ends}
            static[k] = (-limits[-1] if -1 in limits else None), limits.get(1)
    return Balance(ContactProblem(free, matrix, lower, upper), static)


def _rows(
    system: FilippovSystem, mode: Mode, group: tuple[int, ...], values: Values, negative: Negative
) -> Iterator[Row] | None:
    """Numbers by which functions are affine in the signs of the contacts: values at no sign, and slopes in each.

    Contacts that are in no function together have their signs put in at once.
    """
    count = len(group)
    written, (together, places) = _written(system, group), _together(system, group)
    steps = range(max(places, default=-1) + 1)
    corners = [(0,) * count, *(tuple(int(place == step) for place in places) for step in steps), (1,) * count]
    found = [values(written, with_entries(mode, group, corner)) for corner in corners]
    known = [value for value in found if value is not None]
    if len(known) < len(found):
        return None
    rows: list[Row] = []
    for own, first, *stepped, last in zip(together, *known, strict=True):
        slopes = [stepped[places[k]] - first if k in own else 0 * first for k in range(count)]
        rest, size = last - sum(slopes, first), sum(map(abs, slopes), abs(first))
        if negative(rest, size) or negative(-rest, size):
            return None
        rows.append([first, *slopes])
    return iter(rows)


def _inertia(system: FilippovSystem, index: int, place: int, own: Row, ends: Iterable[tuple[int, Row]]) -> Any:
    """How a load that is written by hand grows with the acceleration, from how both do with another force."""
    for side, end in ends:
        slope, j = max(((abs(float(v)), j) for j, v in enumerate(own[1:]) if j != place), default=(0.0, 0))
        if slope:
            inertia = -side * end[1 + j] / own[1 + j]
            if not inertia > 0:
                name = system.sign_names[index]
                raise ModelError(f"the load of {name} is no force that keeps its surface: its 'sliding' is by hand")
            return inertia
    return 0 * own[0] + 1


@lru_cache(maxsize=256)
def _written(system: FilippovSystem, group: tuple[int, ...]) -> tuple[sp.Expr, ...]:
    """What is read of each contact of a group: its acceleration, the ends of its hold zone, inertia, friction."""
    off = {system.signs[i]: sp.S.One for i in system.resting}
    acting = system.with_reactions(frozenset(i for i in group if i in system.overrides and system.overrides[i].push))
    found = []
    for i in group:
        found.append(along(acting.surfaces[i], acting.states, acting.field))
        if system.held_inside(i):
            own, speed, sign = system.overrides[i], system.normal_velocity(i), system.signs[i]
            found += [put(guard.expression, off) for guard in system.hold_guards(i)]
            found += [] if own.inertia is None else [own.inertia]
            found += [put(put(speed, {sign: sp.S.Zero}) - put(speed, {sign: sp.S.One}), off)] if own.push else []
    return tuple(found)


@lru_cache(maxsize=256)
def _together(system: FilippovSystem, group: tuple[int, ...]) -> tuple[list[frozenset[int]], list[int]]:
    """Contacts, by places, that each of these functions may depend on; the place of each among those it is with."""
    contacts = {system.signs[i]: k for k, i in enumerate(group)}
    own = [frozenset(contacts[s] for s in e.free_symbols if s in contacts) for e in _written(system, group)]
    parts: list[frozenset[int]] = []
    for few in own:
        joined = [part for part in parts if part & few]
        parts = [part for part in parts if not part & few] + [few.union(*joined)]
    places = {k: place for part in parts for place, k in enumerate(sorted(part))}
    return own, [places.get(k, 0) for k in range(len(group))]
