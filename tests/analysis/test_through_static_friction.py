"""Derivatives through the release of contacts with static friction that act on each other, against closed forms."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, log, sin

import numpy as np
import pytest
import sympy as sp
from derivatives import fundamental_matrix

import henon_ref as hr
from henon_ref.simulation.arguments import problem_of


def two_pads(scene: hr.Scene) -> None:
    """A block between two pads at rest."""
    a = scene.body("a", mass=1)
    for name in ("upper", "lower"):
        scene.friction(a, scene.wall, law="coulomb", force=0.5, static=1, name=name)
    scene.force(a, "t")
    scene.spring(a, scene.wall, stiffness=1)


def stack(scene: hr.Scene) -> None:
    """The upper of two blocks is pulled; the lower one stays at rest."""
    a, b = scene.body("a", mass=1), scene.body("b", mass=1)
    scene.friction(b, scene.wall, law="coulomb", force=2, static=3)
    scene.friction(a, b, law="coulomb", force=1, static=2)
    scene.force(a, "t")
    scene.spring(a, scene.wall, stiffness=1)


def loop(scene: hr.Scene) -> None:
    """Two blocks on a floor that stick to each other, and are released together."""
    a, b = scene.body("a", mass=0.5), scene.body("b", mass=0.5)
    for body in (a, b):
        scene.friction(body, scene.wall, law="coulomb", force=0.5, static=1)
    scene.friction(b, a, law="coulomb", force=3, static=4)
    scene.force(b, "t")
    scene.spring(a, scene.wall, stiffness=1)


@pytest.mark.parametrize(("built", "follows"), [(two_pads, None), (stack, 0), (loop, 1)])
def test_the_derivative_over_the_release_of_a_group_is_that_of_the_closed_form(
    built: Callable[[hr.Scene], None], follows: int | None
) -> None:
    # Held until t - x(0) = 2; then x'' = t - x - 1, so that x = t - 1 - cos(s) - sin(s) with s = t - 2 - x(0).
    scene = hr.Scene()
    built(scene)
    system = scene.system()
    at_rest = dict.fromkeys(map(str, system.state), 0)
    run = hr.simulate(system, at_rest, until=4)
    assert run.transitions["time_s"].unique().tolist() == [2.0]
    assert run["x_a"][-1] == pytest.approx(3 - cos(2) - sin(2), rel=1e-12)
    x, v = cos(2) - sin(2), -cos(2) - sin(2)
    expected = np.zeros((len(system.state),) * 2)
    expected[:2, 0] = x, v
    if follows is not None:  # states of the other block: it stays where it is, or moves with the first one
        expected[2:, 0] = follows * (x - 1), follows * v
        expected[2, 2] = 1
    _, problem = problem_of(system, at_rest, until=4, start=0, parameters=None, mode=None)
    matrix, rank = fundamental_matrix(problem, sp.Integer(0), sp.Integer(4), tolerance=2e-16)
    assert matrix == pytest.approx(expected, abs=1e-10)
    assert rank == (1 if follows is None else 2)
    grown = expected[:, expected.any(axis=0)]
    exponents = hr.lyapunov_exponents(system, at_rest, span=4).exponents
    assert sum(exponents[:rank]) == pytest.approx(log(np.linalg.det(grown.T @ grown)) / 8, abs=1e-9)
