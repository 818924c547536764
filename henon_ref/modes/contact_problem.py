"""The accelerations of bodies that touch with Coulomb's friction, by Gauss's principle, found by pivoting.

The principle and its literature stand at the head of :mod:`henon_ref.modes.held_groups`. In the forces s_i of the
contacts, the dual problem, it says: the relative accelerations are N = a - W s, each s_i in an interval [lower_i,
upper_i], at the upper end where N_i > 0, at the lower one where N_i < 0.

N and W are read from the values of the accelerations at a point with and without each force, in any arithmetic:
numbers, balls. A friction's force is in units of what it slides with, where its override does not say what a load does.

A mode is which contacts hold (N_i = 0) and which way the others slip. It is found by block principal pivoting (Júdice
and Pires, *Comput. Oper. Res.* 21 (1994) 587-596), which ends with Murty's rule of the last index where blocks do not
lead on, in double precision; who needs a proof holds the solution against the conditions of the minimum in balls
(:mod:`henon_ref.enclosure.contact_proof`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.errors import ModelError
from henon_ref.modes.bounds import put
from henon_ref.modes.decision import with_entries
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem

COMPLIANCE = 1e-9
"""Of each contact, relative to the inverse inertia that it sees: settles how contacts in a loop share their loads."""
TIE = 1e-6
"""Part of its terms below which a relative acceleration may be zero."""
ROUNDING = 1e-12
"""Part of its terms by which a number may be beyond a bound."""
PATIENCE, MOST_PIVOTS = 10, 100
"""Blocks of pivots in a row that bring no fewer contacts out of bounds; pivots a contact."""
RANK = 1e-8
"""Part of a contact's own inverse inertia below which what the others leave of it is none."""

Row = list[Any]
Settled = Callable[[list[int], int], bool]
"""(places of contacts, place) -> whether a contact is at rest wherever those are."""
Negative = Callable[[Any, Any], bool]
"""(value, size of its terms) -> whether it is clearly below zero."""
Values = Callable[[tuple[sp.Expr, ...], Mode], Sequence[Any] | None]
"""(expressions, signs of all surfaces) -> their values at the point; None if not finite."""


class ContactProblem(NamedTuple):
    """Relative accelerations ``N = free - matrix s`` of m contacts, and the bounds of their forces; any numbers."""

    free: Row
    """N without forces of the contacts, shape (m,)."""
    matrix: list[Row]
    """Shape (m, m); its diagonal is positive."""
    lower: Row
    """Least force of each; None where there is none."""
    upper: Row


class Accelerations(NamedTuple):
    """Solution of a contact problem."""

    forces: NDArray[np.float64]
    """s, shape (m,)."""
    entries: tuple[int, ...]
    """0: the force is between its bounds; -1, +1: at the lower bound, the upper one."""
    slips: tuple[bool, ...]
    """Whether a contact's relative acceleration is plainly not zero."""
    clear: bool
    """Whether all others hold by forces that are plainly between their bounds, and that are the only ones."""


def solved(problem: ContactProblem) -> Accelerations:
    """Solve a contact problem in double precision.

    Raises
    ------
    ModelError
        Where the pivots do not come to an end: the forces are not those of friction.
    """
    count = len(problem.free)
    free = np.array([float(v) for v in problem.free])
    given = np.array([[float(v) for v in row] for row in problem.matrix]).reshape(count, count)
    scale = np.diag(given)
    matrix = given / scale + COMPLIANCE * np.eye(count)  # of forces in units of the acceleration that they give
    lower, upper = (
        scale * np.array([way * np.inf if v is None else float(v) for v in bounds])
        for way, bounds in ((-1, problem.lower), (1, problem.upper))
    )
    entries, fewest, patience = np.zeros(count, dtype=int), count + 1, PATIENCE
    for _ in range(MOST_PIVOTS * (count + 1)):
        held = entries == 0
        forces = np.where(entries > 0, upper, np.where(entries < 0, lower, 0.0))
        rest = free - matrix[:, ~held] @ forces[~held]
        forces[held] = np.linalg.solve(matrix[np.ix_(held, held)], rest[held])
        speeds, sizes = free - matrix @ forces, np.abs(free) + np.abs(matrix) @ np.abs(forces)
        above, below = (
            held & (way * (forces - bound) > ROUNDING * (np.abs(forces) + sizes))
            for way, bound in ((1, upper), (-1, lower))
        )
        back = ~held & (entries * speeds < -ROUNDING * sizes)
        wrong = np.flatnonzero(above | below | back)
        if not wrong.size:
            slips = ~held & (np.abs(speeds) > TIE * sizes)
            room = np.minimum(upper - forces, forces - lower)
            inside = slips | (held & (room > TIE * (np.abs(forces) + sizes)))
            own = np.flatnonzero(held).tolist()
            clear = bool(inside.all()) and (len(own) < 2 or independent_of(problem, own) == own)
            return Accelerations(forces / scale, tuple(entries.tolist()), tuple(slips.tolist()), clear)
        patience = PATIENCE if wrong.size < fewest else patience - 1
        fewest = min(fewest, wrong.size)
        turned = wrong if patience > 0 else wrong[-1:]
        entries[turned] = above[turned].astype(int) - below[turned].astype(int)
    raise ModelError("the forces of contacts that act on each other have no solution that pivoting finds")


def independent_of(problem: ContactProblem, order: Sequence[int]) -> list[int]:
    """Contacts whose accelerations can be chosen freely by their forces, taken in this order while they can."""
    matrix = np.array([[float(v) for v in row] for row in problem.matrix])
    own, chosen = np.diag(matrix).copy(), list[int]()
    for k in order:
        if matrix[k, k] > RANK * own[k]:
            chosen.append(k)
            matrix = matrix - np.outer(matrix[:, k], matrix[k]) / matrix[k, k]
    return chosen


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
        found.append(acting.normal_velocity(i))
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
