"""Systems whose state jumps, with closed forms."""

from __future__ import annotations

from math import asin, atan2, pi, sqrt

import sympy as sp

from henon_ref.modes.problem import Problem
from henon_ref.modes.resets import with_resting
from henon_ref.modes.switched_field import Reset
from henon_ref.modes.system import FilippovSystem

X, V, S = sp.symbols("x v s", real=True)
FALL = sqrt(2 / 10)
"""A ball's first fall, from 1 under gravity 10 [s]."""


def ball(until: sp.Expr, restitution: sp.Expr) -> Problem:
    """x'' = -10 from (1, 0), v -> -r v at x = 0: impacts at T (1 + 2 (r + ... + r^k)), T = sqrt(1/5)."""
    system = FilippovSystem((X, V), (S,), (X,), (V, sp.Integer(-10)), resets={0: Reset({V: -restitution * V})})
    return Problem(with_resting(system), sp.Integer(0), (sp.Integer(1), sp.Integer(0)), until)


def ball_impacts(count: int, restitution: float) -> list[float]:
    """Times of a ball's first impacts [s]."""
    return [FALL * (1 + 2 * sum(restitution**j for j in range(1, k + 1))) for k in range(count)]


def impact_oscillator(depth: sp.Expr, restitution: sp.Expr, until: int) -> Problem:
    """x'' = -x from (0, 1), x = sin t, and a wall at 1 - depth."""
    system = FilippovSystem((X, V), (S,), (1 - depth - X,), (V, -X), resets={0: Reset({V: -restitution * V})})
    return Problem(with_resting(system), sp.Integer(0), (sp.Integer(0), sp.Integer(1)), sp.Integer(until))


def oscillator_impacts(depth: float, restitution: float, until: float) -> list[float]:
    """Times at which it hits the wall [s]: each impact at the speed that the one before has left."""
    wall = 1 - depth
    speed, times = sqrt(depth * (2 - depth)), [asin(wall) if depth > 0.1 else pi / 2 - 2 * asin(sqrt(depth / 2))]
    while times[-1] < until:
        speed *= restitution
        times.append(times[-1] + 2 * pi - 2 * atan2(speed, wall))
    return times[:-1]
