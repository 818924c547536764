"""Two roots in one step, 1e-8 apart and more: none is missed, wherever they lie and whatever the tolerance."""

from __future__ import annotations

import random

import pytest
import sympy as sp

from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.records import HENON
from henon_ref.integrator.run import Run
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem

X, V, Y = sp.symbols("x v y", real=True)
S = sp.Symbol("s", real=True)
ZERO, ONE = sp.Integer(0), sp.Integer(1)


def thrown(first: sp.Rational, second: sp.Rational) -> Problem:
    """A body that falls to a surface and leaves it again: x'' = 1."""
    system = FilippovSystem((X, V, Y), (S,), (X,), (V, ONE, S))
    start = (first * second / 2, -(first + second) / 2, ZERO)
    return Problem(system, ZERO, start, sp.Integer(3))


def curved(first: sp.Rational, second: sp.Rational) -> Problem:
    """A curved surface passed at unit speed, with a third root behind the horizon."""
    system = FilippovSystem((X, V, Y), (S,), ((X - first) * (X - second) * (4 - X),), (ONE, ZERO, S))
    return Problem(system, ZERO, (ZERO,) * 3, sp.Integer(3))


@pytest.mark.parametrize("problem", [thrown, curved])
def test_no_pair_is_missed(problem) -> None:
    rng = random.Random(20130216)
    for exponent in [-8, -8, -7, *(rng.uniform(-8, -1) for _ in range(9))]:
        first = sp.Rational(rng.randint(5 * 10**5, 25 * 10**5), 10**6)
        second = first + sp.Rational(round(10 ** (exponent + 12)), 10**12)
        given = problem(first, second)
        integrator = Integrator(given.system, 20)
        for tolerance in (2e-16, 1e-13, 1e-10, 1e-7):
            run = Run(integrator, integrator.start(given, tolerance=tolerance, landing=HENON)).to_horizon()
            assert [t.to_mode for t in run.transitions] == [(-1,), (1,)], (first, second, tolerance)
            for transition, root in zip(run.transitions, (first, second), strict=True):
                error = abs(float(sp.Rational(transition.time) + sp.Rational(transition.time_low) - root))
                assert error <= 1e-11 * max(1.0, float(1 / (second - first)))
