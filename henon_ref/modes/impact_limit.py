"""Impacts at one instant that go on without end, and their limit.

Without restitution, a body that falls on one at rest on the ground is stopped in infinitely many impacts, after each of
which it has the same part of its speed. The maps act on the rates h' of the surfaces in proportion. So if the rates of
the surfaces hit return multiplied by one number below 1, the impacts never end, and their limit follows: the forces of
these surfaces have made their rates zero. Others, which bodies have left, must not be due then.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from henon_ref.modes.equations import gradient
from henon_ref.modes.instant import Instant, Numbers
from henon_ref.modes.resets import Impact

PROPORTIONAL = 2.0**-30
"""Difference, relative to the largest, up to which rates are proportional."""
PERIOD = 64
"""Largest number of maps after which rates are compared."""


def recurring(made: Sequence[Instant]) -> frozenset[int]:
    """Return the surfaces whose maps recur without end; empty if there are none.

    Since an earlier map all their rates have become smaller by one factor. All surfaces that are due are among them.
    """
    *earlier, now = made
    for before in earlier:
        if (before.due, before.sides, before.rates.keys()) != (now.due, now.sides, now.rates.keys()):
            continue
        own = frozenset(i for i, _ in now.applied[len(before.applied) :])
        if not now.due <= own:
            continue
        pairs = [(float(before.rates[i].now), float(now.rates[i].now)) for i in own]
        most, then = max(pairs, key=lambda pair: abs(pair[0]))
        off = max(abs(b * most - a * then) for a, b in pairs)
        if 0 < then / most < 1 - PROPORTIONAL and off <= PROPORTIONAL * abs(most * then):
            return own
    return frozenset()


def moved_to_zero(
    states: Sequence[sp.Symbol],
    numbers: Numbers,
    t: Any,
    x: Sequence[Any],
    functions: Sequence[sp.Expr],
    directions: Sequence[Sequence[sp.Expr]],
) -> list[Any]:
    """Return the state after it has moved along one direction for each function, so that all functions are zero."""
    own = [numbers.values((h, *along), t, x) for h, along in zip(functions, directions, strict=True)]
    steep = [numbers.values(gradient(h, states), t, x) for h in functions]
    matrix = [[sum((a * b for a, b in zip(row, along, strict=True)), 0 * x[0]) for _, *along in own] for row in steep]
    found = list(x)
    for length, (_, *along) in zip(_solved(matrix, [h for h, *_ in own]), own, strict=True):
        found = [value - length * part for value, part in zip(found, along, strict=True)]
    fixed = set[int]()
    for h, row in zip(functions, steep, strict=True):  # without rounding, or a body would move off again
        (rest,) = numbers.values((h,), t, found)
        free = [k for k, slope in enumerate(row) if numbers.sign(slope) and k not in fixed]
        if free:
            fixed.add(free[-1])
            found[free[-1]] -= rest / row[free[-1]]
    return found


def without_speeds(
    states: Sequence[sp.Symbol], numbers: Numbers, t: Any, x: Sequence[Any], impacts: Sequence[Impact]
) -> list[Any]:
    """Return the state after forces of surfaces have made h' of all of them zero, at which bodies can rest."""
    speeds, pushes = [impact.speed for impact in impacts], [impact.push for impact in impacts]
    return moved_to_zero(states, numbers, t, x, speeds, pushes)


def _solved(matrix: Sequence[Sequence[Any]], right: Sequence[Any]) -> list[Any]:
    """Solve a small linear system by elimination; an unknown on which no equation depends clearly is zero."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    sizes = [abs(float(row[k])) for k, row in enumerate(matrix)]
    found, used = [0 * value for value in right], dict[int, int]()
    for k in range(len(rows)):
        free = [i for i in range(len(rows)) if i not in used.values()]
        pivot = max(free, key=lambda i: abs(float(rows[i][k])))
        if abs(float(rows[pivot][k])) <= PROPORTIONAL * sizes[k]:
            continue
        used[k] = pivot
        for i in range(len(rows)):
            if i != pivot:
                factor = rows[i][k] / rows[pivot][k]
                rows[i] = [a - factor * b for a, b in zip(rows[i], rows[pivot], strict=True)]
    for k, i in used.items():
        found[k] = rows[i][-1] / rows[i][k]
    return found
