"""Roots on a step: none stepped over, in order, landed on to rounding."""

from __future__ import annotations

import itertools

import numba
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from henon_ref.henon import landing as landings
from henon_ref.henon import polynomial as p
from henon_ref.henon import registers as k

ORDER = 12
TABLE = p.bernstein_table(ORDER)


@numba.njit
def isolate(coefficients, stack, bounds):
    return p.first_falling_root(coefficients, ORDER, TABLE, stack, bounds)


@numba.njit
def land(coefficients, low, high, method):
    return landings.land(coefficients, ORDER, low, high, method)


@numba.njit
def excluded(q, powers):
    return p.excluded(q, powers, ORDER)


def first_root(roots: list[float], lead: float, landing: int = k.HENON) -> tuple[int, float, int]:
    coefficients = np.zeros(ORDER + 1)
    poly = Polynomial.fromroots(roots) * lead
    coefficients[: len(roots) + 1] = poly.coef
    stack, bounds = np.zeros((p.DEPTH + 2, TABLE.shape[2])), np.zeros((p.DEPTH + 2, 2))
    outcome, low, high = isolate(coefficients, stack, bounds)
    if outcome != p.ROOT:
        return outcome, 0.5 * (low + high), -1
    tau, used, _ = land(coefficients, low, high, landing)
    return outcome, tau, used


@given(st.lists(st.floats(0.02, 0.98), min_size=1, max_size=5))
@example([0.5, 0.75, 0.7541430480585207, 0.2109375])  # a root where the step is halved, another one before it
@example([0.5, 0.75, 0.625])
@settings(max_examples=200, deadline=None)
def test_the_first_falling_root_is_found_whatever_else_is_there(roots: list[float]) -> None:
    roots = sorted(roots)
    if any(b - a < 1e-3 for a, b in itertools.pairwise(roots)):
        return
    lead = 1.0 if len(roots) % 2 == 0 else -1.0  # positive at 0, so the first root falls
    outcome, tau, _ = first_root(roots, lead)
    assert outcome == p.ROOT
    assert tau == pytest.approx(roots[0], abs=1e-9)


@pytest.mark.parametrize("landing", [k.HENON, k.NEWTON, k.BRENT])
@pytest.mark.parametrize("root", [1e-6, 0.1, 0.5, 0.7390851332151607, 1 - 1e-12])
def test_every_landing_reaches_rounding(root: float, landing: int) -> None:
    outcome, tau, _ = first_root([root, 3.0], 1.0, landing)
    assert outcome == p.ROOT
    assert tau == pytest.approx(root, rel=1e-15)


@pytest.mark.parametrize("gap", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_a_pair_of_roots_is_not_stepped_over(gap: float) -> None:
    outcome, tau, _ = first_root([0.4, 0.4 + gap], 1.0)
    assert outcome == p.ROOT
    assert tau == pytest.approx(0.4, abs=1e-15 / gap)


def test_a_double_root_is_a_touch_and_a_near_miss_is_nothing() -> None:
    assert first_root([0.5, 0.5], 1.0)[0] in (p.TOUCH, p.ROOT)
    coefficients = np.zeros(ORDER + 1)
    coefficients[:3] = [0.25 + 1e-9, -1.0, 1.0]
    stack, bounds = np.zeros((p.DEPTH + 2, TABLE.shape[2])), np.zeros((p.DEPTH + 2, 2))
    assert isolate(coefficients, stack, bounds)[0] == p.NONE


def test_a_rising_root_is_no_event_but_the_falling_one_after_it_is() -> None:
    outcome, tau, _ = first_root([0.3, 0.6], -1.0)
    assert outcome == p.ROOT
    assert tau == pytest.approx(0.6, abs=1e-14)


def test_a_root_on_a_bisection_point_is_found() -> None:
    outcome, tau, _ = first_root([0.5, 0.8, 0.9], -1.0)
    assert outcome == p.ROOT
    assert tau == pytest.approx(0.5, abs=2e-15)


def test_the_cheap_exclusion_never_excludes_a_root() -> None:
    powers = np.ones(ORDER + 1)
    q = np.zeros(ORDER + 1)
    q[:2] = [1.0, -0.999]
    assert excluded(q, powers)
    q[1] = -1.0
    assert not excluded(q, powers)


def test_a_pair_whose_first_root_is_a_bisection_point_is_no_touch() -> None:
    for roots in ([0.25, 0.375], [0.5, 0.625], [0.5, 0.5 + 2.0**-10]):
        outcome, tau, _ = first_root(roots, 1.0)
        assert outcome == p.ROOT
        assert tau == pytest.approx(roots[0], abs=1e-12)
