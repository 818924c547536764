"""Accelerations of bodies in contact with Coulomb friction, by Gauss's principle, computed by pivoting.

The principle and its literature are explained in :mod:`henon_ref.modes.held_groups`. Its dual problem has the contact
forces s_i as unknowns: the relative accelerations are N = a - W s, and each s_i is in an interval [lower_i, upper_i],
at the upper bound if N_i > 0, at the lower bound if N_i < 0. N and W are computed from values of the accelerations at a
point with and without each force, in any arithmetic (floats, balls). A friction force is in units of kinetic friction,
unless the contact's override has a ``push``.

A mode states which contacts hold (N_i = 0) and in which direction the others slip. It is found in double precision by
block principal pivoting (Júdice and Pires, *Comput. Oper. Res.* 21 (1994) 587-596) and, if blocks make no progress, by
Murty's rule of the last index, which terminates. A proof checks the conditions of the minimum for this solution in ball
arithmetic (:mod:`henon_ref.enclosure.consistency`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from flint import arb
from numpy.typing import NDArray
from sympy.utilities.iterables import connected_components

from henon_ref.errors import ModelError
from henon_ref.expressions.bounds import put
from henon_ref.modes.decision import with_entries
from henon_ref.modes.mode import Mode
from henon_ref.modes.system import FilippovSystem

TIE = 1e-6
"""Relative acceleration, as a part of its terms, below which it may be zero."""
ROUNDING = 1e-12
"""Part of its terms by which a number may exceed a bound through rounding."""
MAX_BLOCK_PIVOTS = 10
"""Largest number of successive block pivots without progress."""

Row = list[Any]
Settled = Callable[[list[int], int], bool]
"""(places of contacts that hold, place) -> whether these contacts keep the contact at that place at rest."""
Negative = Callable[[Any, Any], bool]
"""(value, size of its terms) -> whether the value is clearly negative."""
Values = Callable[[tuple[sp.Expr, ...], Mode], Sequence[Any] | None]
"""(expressions, signs of all surfaces) -> values at the point; None if one is not finite."""


class ContactProblem(NamedTuple):
    """Relative accelerations ``N = free - matrix s`` of m contacts and bounds of their forces s, in any arithmetic.

    The bounds hold after a contact has slipped (kinetic friction).
    """

    free: Row
    """N without contact forces, shape (m,)."""
    matrix: list[Row]
    """Inverse inertia W, shape (m, m), with positive diagonal."""
    lower: Row
    """Least force of each contact, None if unbounded."""
    upper: Row
    static: Mapping[int, tuple[Any, Any]] = {}
    """Place of a contact -> least and largest force before it slips (static friction); None if unbounded."""


class Accelerations(NamedTuple):
    """Solution of a contact problem."""

    forces: NDArray[np.float64]
    """s, shape (m,)."""
    entries: tuple[int, ...]
    """0 if the force is between its bounds, -1 at the lower bound, +1 at the upper bound."""
    slips: tuple[bool, ...]
    """Whether each contact's relative acceleration is clearly not zero."""
    clear: bool
    """Whether the forces of all contacts that hold are clearly between their bounds and are unique."""


def solved(problem: ContactProblem) -> Accelerations:
    """Solve a contact problem in double precision.

    ModelError if pivoting does not terminate: the forces are not those of friction.
    """
    count = len(problem.free)
    free = np.array([_double(v) for v in problem.free])
    given = np.array([[_double(v) for v in row] for row in problem.matrix]).reshape(count, count)
    scale = np.diag(given)
    # Forces are in units of the acceleration that they cause; a compliance determines the loads in a loop of contacts.
    matrix = given / scale + 1e-9 * np.eye(count)
    lower, upper = (
        scale * np.array([way * np.inf if v is None else _double(v) for v in bounds])
        for way, bounds in ((-1, problem.lower), (1, problem.upper))
    )
    # A negative normal force puts the upper bound below the lower one, perhaps by rounding only: derivatives decide.
    crossed = lower > upper
    lower, upper = (np.where(crossed, 0.0, bounds) for bounds in (lower, upper))
    entries, fewest, patience = np.zeros(count, dtype=int), count + 1, MAX_BLOCK_PIVOTS
    for _ in range(100 * (count + 1)):
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
            slips = ~held & ~crossed & (np.abs(speeds) > TIE * sizes)
            room = np.minimum(upper - forces, forces - lower)
            inside = slips | (held & (room > TIE * (np.abs(forces) + sizes)))
            own = np.flatnonzero(held).tolist()
            clear = bool(inside.all()) and (len(own) < 2 or independent_of(problem, own) == own)
            entries[crossed] = 0
            return Accelerations(forces / scale, tuple(entries.tolist()), tuple(slips.tolist()), clear)
        patience = MAX_BLOCK_PIVOTS if wrong.size < fewest else patience - 1
        fewest = min(fewest, wrong.size)
        turned = wrong if patience > 0 else wrong[-1:]
        entries[turned] = above[turned].astype(int) - below[turned].astype(int)
    raise ModelError("pivoting finds no forces for contacts that act on each other")


def _double(value: Any) -> float:
    """Return a number as a double; 0 for a ball that contains zero, as where forces vanish with the normal force."""
    return 0.0 if isinstance(value, arb) and value.contains(0) else float(value)


def independent_of(problem: ContactProblem, order: Sequence[int]) -> list[int]:
    """Select, in this order, the contacts whose accelerations their own forces can set independently of each other."""
    matrix = np.array([[float(v) for v in row] for row in problem.matrix])
    own, chosen = np.diag(matrix).copy(), list[int]()
    for k in order:
        if matrix[k, k] > 1e-8 * own[k]:  # what remains of its inverse inertia, with the chosen contacts held
            chosen.append(k)
            matrix = matrix - np.outer(matrix[:, k], matrix[k]) / matrix[k, k]
    return chosen


def problem_of(
    system: FilippovSystem, mode: Mode, contacts: tuple[int, ...], values: Values, negative: Negative
) -> ContactProblem | None:
    """Return the problem of a group; the entries of all other surfaces are those of ``mode``.

    None if the accelerations are not affine in the forces or not finite, or if a force does not act on its own contact.
    """
    rows = _rows(system, mode, contacts, values, negative)
    if rows is None:
        return None
    fixed = frozenset(i for i in contacts if system.held_inside(i))
    free, matrix, lower, upper = [], [], list[Any](), list[Any]()
    static: dict[int, tuple[Any, Any]] = {}
    ways = [1 if system.rests(i) else -1 for i in contacts]  # a reaction acts along +h', friction against h
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
    return ContactProblem(free, matrix, lower, upper, static)


def _rows(
    system: FilippovSystem, mode: Mode, group: tuple[int, ...], values: Values, negative: Negative
) -> Iterator[Row] | None:
    """Return, for each expression of the group, its value without contact signs and its slope in each sign.

    Slopes are differences of values with the signs 0 and 1; contacts that no expression has in common get their signs
    in one evaluation. A last evaluation with all signs 1 checks that the expressions are affine; None if one is not.
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
    """Return the slope of a user-written load in the acceleration, by the slopes of both in another force."""
    for side, end in ends:
        slope, j = max(((abs(float(v)), j) for j, v in enumerate(own[1:]) if j != place), default=(0.0, 0))
        if slope:
            inertia = -side * end[1 + j] / own[1 + j]
            if not inertia > 0:
                name = system.sign_names[index]
                raise ModelError(f"the load of {name} in its 'sliding' override is not a force that keeps its surface")
            return inertia
    return 0 * own[0] + 1


@lru_cache(maxsize=256)
def _written(system: FilippovSystem, group: tuple[int, ...]) -> tuple[sp.Expr, ...]:
    """Return the expressions of each contact: acceleration, ends of its hold zone, inertia, kinetic friction."""
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
    """Return the contacts, by place, in each expression; and an evaluation number of each contact."""
    contacts = {system.signs[i]: k for k, i in enumerate(group)}
    own = [frozenset(contacts[s] for s in e.free_symbols if s in contacts) for e in _written(system, group)]
    parts = connected_components((range(len(group)), [pair for few in own for pair in pairwise(sorted(few))]))
    places = {k: place for part in parts for place, k in enumerate(sorted(part))}
    return own, [places[k] for k in range(len(group))]
