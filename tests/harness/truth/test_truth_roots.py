"""All roots of a step's polynomial: pairs, touches, multiple roots, roots at the end of the step."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from flint import arb, arb_poly, ctx
from hypothesis import given, settings
from hypothesis import strategies as st

from henon_ref.harness.truth.roots import END, NearMiss, Root, isolate

ZERO = 2.0**-192


@pytest.fixture(autouse=True)
def _precision() -> Iterator[None]:
    with ctx.workprec(288):
        yield


def isolated(polynomial: arb_poly) -> tuple[list[Root], list[NearMiss]]:
    coefficients = polynomial.coeffs()
    return isolate(coefficients, arb(ZERO) * max((abs(c) for c in coefficients), key=float))


def roots_of(polynomial: arb_poly) -> list[Root]:
    return isolated(polynomial)[0]


def from_roots(*roots: float | arb) -> arb_poly:
    product = arb_poly([1])
    for root in roots:
        product *= arb_poly([-arb(root), 1])
    return product


def test_a_single_root_is_found_to_the_precision() -> None:
    (root,) = roots_of(arb_poly([-1, 0, 2]))  # 2 u^2 = 1
    assert root.odd
    assert abs(root.at - arb(0.5).sqrt()) < arb(2) ** -280


@pytest.mark.parametrize("apart", [1e-1, 1e-6, 1e-12, 1e-24])
def test_a_pair_of_roots_is_two_roots_however_close(apart: float) -> None:
    found = roots_of(from_roots(0.25, arb(0.25) + arb(apart)))
    assert [r.odd for r in found] == [True, True]
    assert abs(found[1].at - found[0].at - arb(apart)) < 1e-40


def test_a_double_root_is_a_touch_and_keeps_all_its_digits() -> None:
    third = arb(1) / 3
    (root,) = roots_of(from_roots(third, third, -2))
    assert not root.odd
    assert abs(root.at - third) < arb(2) ** -250


@pytest.mark.parametrize(("order", "odd"), [(3, True), (4, False), (5, True)])
def test_a_root_of_higher_order_changes_the_sign_or_not(order: int, odd: bool) -> None:
    (root,) = roots_of(from_roots(*[0.375] * order))
    assert root.odd is odd
    assert abs(root.at - arb(0.375)) < 1e-12


def test_a_root_at_the_end_of_the_step_is_on_it_and_one_past_it_is_not() -> None:
    assert len(roots_of(from_roots(1.0))) == 1
    assert len(roots_of(from_roots(1.0 + 2 * (END - 1)))) == 0


def test_roots_before_the_step_do_not_count() -> None:
    assert roots_of(from_roots(-0.5, -1e-20)) == []


def test_a_minimum_that_nearly_touches_is_told_with_its_distance() -> None:
    roots, near_misses = isolated(arb_poly([0.25 + 1e-12, -1, 1]))  # (u - 1/2)^2 + 1e-12
    assert roots == []
    ((at, value),) = near_misses
    assert float(at) == 0.5
    assert float(value) == pytest.approx(1e-12)


def test_a_minimum_far_from_zero_is_no_near_miss() -> None:
    assert isolated(arb_poly([0.35, -1, 1])) == ([], [])


@settings(max_examples=60)
@given(st.lists(st.integers(-2000, 2000), min_size=1, max_size=6, unique=True))
def test_every_root_of_a_product_of_factors_is_found(places: list[int]) -> None:
    with ctx.workprec(288):
        found = roots_of(from_roots(*(arb(p) / 1500 for p in places)))
        expected = sorted(p / 1500 for p in places if 0 < p <= 1500)
        assert [float(r.at) for r in found] == pytest.approx(expected, abs=1e-30)
        assert all(r.odd for r in found)


@pytest.mark.parametrize("exponent", [*range(-30, 0)])
@pytest.mark.parametrize("part", [2, 10, 100])
def test_a_root_next_to_an_extremum_is_as_narrow_as_any(exponent: int, part: int) -> None:
    """The slope runs from next to nothing to one over the bracket: Newton's interval alone stays as wide as that."""
    near = arb(10) ** exponent
    slope = near / part
    found, _ = isolate([-near * (near + slope), slope, arb(1)], arb(ZERO))
    assert len(found) == 1
    assert found[0].at.rad() <= arb(2) ** -80
    assert abs(found[0].at - near) <= arb(2) ** -80
