"""Cached functions of single surfaces and guards of a system, shared by all modes in which they are equal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from henon_ref.modes.callables import Scalar, scalar
from henon_ref.modes.mode import Mode, replaced
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

MANY_ARGUMENTS = 16
"""From this number of arguments on, a function takes only the arguments that its expressions contain: SymPy traverses
the expressions once per argument."""


@lru_cache(maxsize=4096)
def of_few(arguments: tuple[sp.Symbol, ...], expressions: tuple[sp.Expr, ...]) -> Scalar:
    """Return ``f(t, *arguments)`` with one float per expression."""
    if len(arguments) < MANY_ARGUMENTS:
        return scalar(arguments, expressions)
    standing = set().union(*(e.free_symbols for e in expressions))
    places = [k for k, symbol in enumerate(arguments) if symbol in standing]
    function = scalar([arguments[k] for k in places], expressions)
    return lambda t, *x: function(t, *[x[k] for k in places])


@lru_cache(maxsize=4096)
def is_linear(expression: sp.Expr, states: tuple[sp.Symbol, ...]) -> bool:
    """Check whether an expression is linear in time and states together; cached, since modes share expressions."""
    moving = expression.free_symbols & {TIME, *states}
    return not any(sp.diff(expression, v).free_symbols & moving for v in moving)


@lru_cache(maxsize=4096)
def slopes_of(
    guard: sp.Expr, states: tuple[sp.Symbol, ...]
) -> tuple[tuple[int, ...], Scalar, tuple[float, ...] | None]:
    """Return the indices of the states in a guard, its derivatives in these, and their values if all are constant."""
    places = tuple(k for k, x in enumerate(states) if guard.has(x))
    slopes = [sp.diff(guard, states[k]) for k in places]
    constants = tuple(map(float, slopes)) if all(d.is_number for d in slopes) else None
    return places, of_few(states, tuple(slopes)), constants


@lru_cache(maxsize=4096)
def landing(system: FilippovSystem, mode: Mode, index: int) -> Scalar:
    """Return the function of a surface on which a mode begins or ends.

    The function ``f(t, *x)`` returns ``(h, dh/dt below, dh/dt above, *point)``: the surface's value at x; the normal
    velocities at ``point`` on both sides; and ``point``, the projection of x onto the surface by one Newton step along
    the gradient. The step moves x only by the rounding or tolerance error in h.
    """
    states = system.states
    h, normal = (system.numeric(e) for e in (system.surfaces[index], system.normal_velocity(index)))
    sides = [normal.xreplace(system.entries(replaced(mode, index, side))) for side in (-1, 1)]
    gradient = [sp.diff(h, x) for x in states]
    square = sp.Add(*(d**2 for d in gradient))
    if not square.is_number:
        first = scalar(states, [h, *(x - h * d / square for x, d in zip(states, gradient, strict=True))])
        second = scalar(states, sides)

        def curved(t: float, *x: float) -> tuple[float, ...]:
            h, *point = first(t, *x)
            return (h, *second(t, *point), *point)

        return curved
    # After expanding, a flat surface cancels exactly: x2 - (x2 - vp) is vp, without rounding.
    # A surface that depends on time alone moves no state.
    point = [x - sp.expand(h * d / square) if d != 0 else x for x, d in zip(states, gradient, strict=True)]
    moved = {k: p for k, (p, x) in enumerate(zip(point, states, strict=True)) if p != x}
    there = {states[k]: p for k, p in moved.items()}
    velocities = [side.subs(there, simultaneous=True) for side in sides]
    if len(states) < MANY_ARGUMENTS:
        return scalar(states, [h, *velocities, *point])
    values, places = of_few(states, (h, *velocities, *moved.values())), tuple(moved)

    def at(t: float, *x: float) -> tuple[float, ...]:
        h, below, above, *found = values(t, *x)
        state = list(x)
        for k, value in zip(places, found, strict=True):
            state[k] = value
        return (h, below, above, *state)

    return at


@lru_cache(maxsize=4096)
def surface(system: FilippovSystem, index: int) -> tuple[Scalar, Scalar]:
    """Return a surface's function ``h(t, *x) -> (value,)`` and its gradient in the states."""
    states, h = system.states, system.numeric(system.surfaces[index])
    return of_few(states, (h,)), of_few(states, tuple(sp.diff(h, x) for x in states))


def projected(
    system: FilippovSystem, indices: Iterable[int], t: float, x: Sequence[float]
) -> tuple[tuple[float, ...], float]:
    """Return the point nearest to x on the intersection of surfaces, and the largest abs(h) at x."""
    surfaces = [surface(system, i) for i in indices]
    point: NDArray[np.float64] = np.array(x, dtype=float)
    drift = 0.0
    for step in range(2):
        values = np.array([h(t, *point.tolist())[0] for h, _ in surfaces])
        if step == 0:
            drift = float(np.max(np.abs(values), initial=0.0))
        slopes = np.array([g(t, *point.tolist()) for _, g in surfaces])
        if not values.any() or not np.isfinite(slopes).all():
            break
        point = point - np.linalg.lstsq(slopes, values, rcond=None)[0]
    return tuple(point.tolist()), drift
