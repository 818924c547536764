"""Conditioning against closed forms and against runs from perturbed starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf, sqrt

import numpy as np
import pytest
import sympy as sp
import systems
from multiprecision import simulate, transitions
from problems import make_problem

from henon_ref.harness.truth.conditioning import conditioning
from henon_ref.modes.problem import Problem


def _from(problem: Problem, *state: str) -> Problem:
    """The same from another start, off the surface: from there times depend smoothly on it."""
    return replace(problem, initial=tuple(sp.Rational(v) for v in state))


def conditioned(problem: Problem) -> list[float]:
    return conditioning(problem, transitions(problem, 128))


def test_a_release_at_a_fixed_time_is_perfectly_conditioned() -> None:
    assert conditioned(systems.leaving_slide()) == [0.0]


def test_turns_of_the_free_oscillator_move_with_the_velocity_over_the_acceleration() -> None:
    """Turn k falls pi after turn k - 1 whatever x was; v off by e moves it by e / abs(v')."""
    accelerations = [5.3 - 0.6 - 1.2 * k for k in range(4)]
    assert conditioned(systems.free_coulomb()) == pytest.approx([1 / a for a in accelerations], rel=1e-3)


def test_growth_of_a_finite_time_blow_up() -> None:
    """x' = x^2 from 1/4 is 1/2 at t = 1/x0 - 2: dt/dx0 = -1/x0^2."""
    assert conditioned(make_problem("x", ["x**2 + 0*s"], {"s": "x - 1/2"}, ["1/4"], 3)) == pytest.approx([16])


def test_conditioning_beside_a_pole_is_unknown() -> None:
    """The variational equations are not integrated up to a pole 1e-9 beyond the surface; nothing is printed."""
    assert conditioned(make_problem("v", ["-(1 + s)/2/(v + 10**(-9)) - (1 - s)/2"], {"s": "v"}, [1], 1)) == [inf]


def test_a_jump_of_the_field_counts_in_what_follows() -> None:
    """Speed 1 below 0 and 2 above: an early error moves the time at x = 1 by itself, a late one by half."""
    found = conditioned(make_problem("x", ["(3 + s)/2 + 0*u"], {"s": "x", "u": "x - 1"}, [-1], 3))
    assert found == pytest.approx([1.0, 1.0])


def test_a_stick_forgets_what_was_before_but_for_its_place() -> None:
    """Belt at 0.5: x off by e on the belt moves the release by 2 e, and landings by no more."""
    found = conditioned(systems.static_belt(until="20"))
    assert found[1::2] == pytest.approx([2.0] * len(found[1::2]), rel=1e-3)


def test_simultaneous_events_are_conditioned_surface_by_surface() -> None:
    fields = ["-1 + 0*s", "-1/4 + 0*u"]
    assert conditioned(make_problem("x y", fields, {"s": "x", "u": "y"}, [1, "1/4"], 2)) == pytest.approx([1.0, 4.0])


def test_a_graze_is_ill_conditioned_and_what_follows_is_not() -> None:
    found = conditioned(make_problem("x v", ["v", "2 + 0*u"], {"s": "x", "u": "v - 2"}, [1, -2], 3))
    assert found[0] == inf
    assert found[1] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("problem", "count"),
    [
        pytest.param(_from(systems.stribeck_belt(until="16"), "0.3", "-0.5"), 3, id="Stribeck belt"),
        pytest.param(systems.rotating_crossing(), 1, id="curved surface"),
    ],
)
def test_runs_from_perturbed_starts_move_as_the_derivative_says(problem: Problem, count: int) -> None:
    """The start is one place of several where an error can come in, so its effect is a lower bound."""
    found = conditioned(problem)[:count]
    rows = np.array([_moved(problem, k) for k in range(len(problem.initial))])[:, :count]
    from_start = np.linalg.norm(rows, axis=0)
    assert found[0] == pytest.approx(from_start[0], rel=1e-3)
    assert all(f >= s * (1 - 1e-3) for f, s in zip(found, from_start, strict=True))


def _moved(problem: Problem, index: int) -> Sequence[float]:
    """Central difference of the transition times in one initial value."""
    step = sp.Rational(1, 10**12)
    times = []
    for sign in (1, -1):
        initial = list(problem.initial)
        initial[index] += sign * step
        run = simulate(replace(problem, initial=tuple(initial)), 128)
        times.append([e.time for e, *_ in run.instants])
    return [float(a - b) / (2 * float(step)) for a, b in zip(*times, strict=False)]


def test_errors_that_leave_a_holding_surface_are_none() -> None:
    """Two states, x held at 0 until t = 1 by its field: an error in x is no error, y's never matters to x."""
    found = conditioned(make_problem("x y", ["t - s", "y"], {"s": "x"}, [0, 1], 3))
    assert found == [0.0]


def test_norm_is_euclidean() -> None:
    found = conditioned(make_problem("x y", ["-1 + 0*s", "-1"], {"s": "x + y"}, [1, 1], 3))
    assert found == pytest.approx([sqrt(2) / 2], rel=1e-3)
