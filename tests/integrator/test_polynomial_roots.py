"""Roots on a step: none stepped over, in order, landed on to rounding."""

from __future__ import annotations

import itertools
from math import comb, factorial

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from henon_ref.integrator.mode_code import bernstein_code
from henon_ref.jit.ir_writer import row_length
from henon_ref.kernel.library import EPS, LEVELS, doubles, ffi
from henon_ref.kernel.library import kernel as p

ORDER = 12


def bernstein(
    order: int, q: np.ndarray, powers: np.ndarray, degree: int, scaled: np.ndarray, coefficients: np.ndarray
) -> int:
    """What the signs of the Bernstein coefficients tell, which are filled in."""
    call = ffi.cast("bernstein_code", bernstein_code(order).address("bernstein"))
    outcome: int = call(doubles(q), doubles(powers), degree, doubles(scaled), doubles(coefficients))
    return outcome


def isolate(q: np.ndarray) -> tuple[int, tuple[int, float, float]]:
    """What the signs tell, and what the subdivision finds."""
    width = row_length(ORDER)
    stack, scaled = np.zeros((p.DEPTH + 2, width)), np.zeros(width)
    outcome = bernstein(ORDER, q, np.ones(width), ORDER, scaled, stack)
    found = p.test_first_falling_root(doubles(scaled), ORDER, doubles(stack), width)
    return outcome, (found.outcome, found.low, found.high)


def isolated(coefficients: np.ndarray) -> tuple[int, float, float]:
    """What the subdivision finds on [0, 1]; where the signs alone tell, they tell the same."""
    q = np.zeros(row_length(ORDER))
    q[: ORDER + 1] = coefficients
    outcome, found = isolate(q)
    assert outcome in (p.SUBDIVIDE, found[0])
    return found


def land(coefficients: np.ndarray, low: float, high: float, method: int) -> tuple[float, int, int]:
    """Root, landing used, evaluations."""
    if method == p.BRENT:
        found = p.test_brent(doubles(coefficients), ORDER, low, high)
    else:
        found = p.test_land(doubles(coefficients), ORDER, low, high, method)
    return found.tau, found.used, found.evaluations


def positive_by_bound(q: np.ndarray, powers: np.ndarray) -> bool:
    return bool(p.test_positive_by_bound(doubles(q), doubles(powers), ORDER))


def first_root(roots: list[float], lead: float, landing: int = p.HENON) -> tuple[int, float, int]:
    coefficients = np.zeros(ORDER + 1)
    poly = Polynomial.fromroots(roots) * lead
    coefficients[: len(roots) + 1] = poly.coef
    outcome, low, high = isolated(coefficients)
    if outcome != p.ROOT:
        return outcome, 0.5 * (low + high), -1
    tau, used, _ = land(coefficients, low, high, landing)
    return outcome, tau, used


@given(st.lists(st.floats(0.02, 0.98), min_size=1, max_size=5))
@example([0.5, 0.75, 0.7541430480585207, 0.2109375])  # a root where the step is halved, another one before it
@example([0.5, 0.75, 0.625])
@settings(max_examples=60)
def test_the_first_falling_root_is_found_whatever_else_is_there(roots: list[float]) -> None:
    roots = sorted(roots)
    if any(b - a < 1e-3 for a, b in itertools.pairwise(roots)):
        return
    lead = 1.0 if len(roots) % 2 == 0 else -1.0  # positive at 0, so the first root falls
    outcome, tau, _ = first_root(roots, lead)
    assert outcome == p.ROOT
    assert tau == pytest.approx(roots[0], abs=1e-9)


@pytest.mark.parametrize("landing", [p.HENON, p.NEWTON, p.BRENT])
@pytest.mark.parametrize("root", [1e-6, 0.1, 0.5, 0.7390851332151607, 1 - 1e-12])
def test_every_landing_reaches_rounding(root: float, landing: int) -> None:
    outcome, tau, _ = first_root([root, 3.0], 1.0, landing)
    assert outcome == p.ROOT
    assert tau == pytest.approx(root, rel=1e-15)


def test_where_a_guard_falls_evenly_one_evaluation_lands_on_it() -> None:
    """1/5 - sin(t/3), from the root of the inverse cubic; from the chord's it takes two."""
    sine = [-((0, 1, 0, -1)[j % 4]) / factorial(j) / 3**j for j in range(1, ORDER + 1)]
    tau, used, evaluations = land(np.array([0.2, *sine]), 0.0, 1.0, p.HENON)
    assert (used, evaluations) == (p.HENON, 1)
    assert tau == pytest.approx(3 * np.arcsin(0.2), rel=2 * EPS)


@pytest.mark.parametrize("gap", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
def test_near_another_root_a_parabola_comes_close_enough_for_the_swap(gap: float) -> None:
    """Newton's step halves the distance to a pair of roots, and stops at none of them."""
    coefficients = np.zeros(ORDER + 1)
    coefficients[:5] = (Polynomial.fromroots([0.4, 0.4 + gap, -2.0, 3.0]) * -1).coef
    tau, used, evaluations = land(coefficients, 0.0, 0.4 + gap / 2, p.HENON)
    assert (used, tau) == (p.HENON, pytest.approx(0.4, abs=1e-15 / gap))
    assert evaluations <= 6
    assert evaluations < land(coefficients, 0.0, 0.4 + gap / 2, p.BRENT)[2]


@pytest.mark.parametrize("gap", [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_a_pair_of_roots_is_not_stepped_over(gap: float) -> None:
    outcome, tau, _ = first_root([0.4, 0.4 + gap], 1.0)
    assert outcome == p.ROOT
    assert tau == pytest.approx(0.4, abs=1e-15 / gap)


def test_a_double_root_is_a_touch_and_a_near_miss_is_nothing() -> None:
    assert first_root([0.5, 0.5], 1.0)[0] in (p.TANGENTIAL, p.ROOT)
    coefficients = np.zeros(ORDER + 1)
    coefficients[:3] = [0.25 + 1e-9, -1.0, 1.0]
    assert isolated(coefficients)[0] == p.NO_ROOT


@pytest.mark.parametrize("depth", [-0.5, 0.0, 0.5])
@pytest.mark.parametrize("place", [0.3, 0.5, 0.6770673077])
def test_what_is_left_of_a_touch_ends_where_the_polynomial_is_clear_of_noise(place: float, depth: float) -> None:
    """The pieces beside it hold nothing, and it is not cut again."""
    noise = 4 * EPS * (1 + place) ** 2
    coefficients = np.zeros(ORDER + 1)
    coefficients[:3] = [place**2 + depth * noise, -2 * place, 1.0]
    outcome, low, high = isolated(coefficients)
    assert (outcome, low < place < high) == (p.TANGENTIAL, True)
    for end in (low, high):
        assert 1.2 * noise < (end - place) ** 2 + depth * noise < LEVELS.clearance * noise


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
    assert positive_by_bound(q, powers)
    q[1] = -1.0
    assert not positive_by_bound(q, powers)


def test_a_pair_whose_first_root_is_a_bisection_point_is_no_touch() -> None:
    for roots in ([0.25, 0.375], [0.5, 0.625], [0.5, 0.5 + 2.0**-10]):
        outcome, tau, _ = first_root(roots, 1.0)
        assert outcome == p.ROOT
        assert tau == pytest.approx(roots[0], abs=1e-12)


@pytest.mark.parametrize("order", [4, 7, 12, 24])
@pytest.mark.parametrize("short", [0, 1, 2])
def test_the_machine_code_makes_bernstein_coefficients_and_reads_their_signs(order: int, short: int) -> None:
    width = row_length(order)
    rng = np.random.default_rng(order)
    theta, seen = 0.7, set()
    for _ in range(200):
        q = rng.normal(size=width) * 3.0 ** -(rng.uniform(0, 2) ** np.arange(width))
        q[order - short + 1 :] = np.nan  # the next row: not its own
        powers, a, b = theta ** np.arange(width), np.zeros(width), np.zeros(width)
        outcome = bernstein(order, q, powers, order - short, a, b)
        kept = np.array([q[i] * theta**i if i <= order - short else 0.0 for i in range(width)])
        exact = [sum(comb(i, j) / comb(order, j) * kept[j] for j in range(i + 1)) for i in range(order + 1)]
        np.testing.assert_allclose(a, kept, rtol=1e-15)
        np.testing.assert_allclose(b[: order + 1], exact, atol=1e-14 * abs(kept).sum())
        changes = sum(x * y < 0 for x, y in itertools.pairwise(exact))
        assert outcome == (
            p.NO_ROOT if changes == 0 or (changes == 1 and exact[0] < 0) else p.ROOT if changes == 1 else p.SUBDIVIDE
        )
        seen.add(outcome)
    assert seen == {p.NO_ROOT, p.ROOT, p.SUBDIVIDE}


def test_a_zero_or_no_number_among_them_is_looked_at() -> None:
    width = row_length(ORDER)
    for first in (0.0, np.nan):
        q = np.ones(width)
        q[0] = first
        assert isolate(q)[0] == p.SUBDIVIDE
