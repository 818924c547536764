"""First falls through zero: found with proof, excluded with proof, or not told."""

from __future__ import annotations

import pytest
from flint import arb, ctx

from henon_ref.enclosure.enclosure import Curve, Tail, UndecidedError
from henon_ref.enclosure.event import first_root, guard_curve, refine, scan


@pytest.fixture(autouse=True)
def _precision():
    with ctx.workprec(160):
        yield


def parabola(distance: object) -> Curve:
    """(s - 1)^2 - distance."""
    return Curve.of([1 - arb(distance), arb(-2), arb(1)], [])


@pytest.mark.parametrize("exponent", [2, 8, 20, 28])
def test_pair_of_roots_is_told_from_none(exponent: int) -> None:
    gap = arb(10) ** -exponent
    bracket, _ = scan(parabola(gap), 2.0, True, "g")
    assert bracket is not None
    root = refine(*bracket)
    assert root.overlaps(1 - gap.sqrt())
    assert root.rad() < 1e-10 * gap.sqrt()
    assert scan(parabola(-gap), 2.0, True, "g")[0] is None


@pytest.mark.parametrize("power", [2, 4])
def test_touching_is_never_decided(power: int) -> None:
    curve = parabola(0)
    if power == 4:
        square = curve.polynomial * curve.polynomial
        curve = Curve.of([square[k] for k in range(5)], [])
    with pytest.raises(UndecidedError, match="graze") as caught:
        scan(curve, 2.0, True, "g")
    assert caught.value.kind == "graze"


def test_tail_can_hide_a_root() -> None:
    """A root that only the tail could hold is not excluded: the proof fails instead of passing over it."""
    curve = Curve.of([arb(1), arb(-1)], [Tail(2, 1e-3, 1.0)])
    assert scan(curve, 0.99, True, "g")[0] is None
    with pytest.raises(UndecidedError):
        scan(curve, 0.99999, True, "g")


def test_start_on_the_surface_divides_the_zero_out() -> None:
    """g = s - s^2 starts at zero: with its zero known the next is at 1, without it nothing can be told."""
    coefficients = [arb(0, 1e-30), arb(1), arb(-1)]
    root, _ = scan(guard_curve(coefficients, [], [], 1), 1.5, True, "g")
    assert root is not None
    assert refine(*root).overlaps(arb(1))
    with pytest.raises(UndecidedError, match="starts at zero"):
        scan(guard_curve(coefficients, [], [], 0), 1.5, True, "g")


def test_two_known_zeros_at_a_release() -> None:
    coefficients = [arb(0, 1e-30), arb(0, 1e-30), arb(3), arb(-4)]
    root, _ = scan(guard_curve(coefficients, [], [Tail(4, 1e-20, 2.0)], 2), 1.0, True, "g")
    assert root is not None
    assert refine(*root).contains(arb(3) / 4)


def test_negative_start_is_refused_unless_it_may_rise() -> None:
    rising = Curve.of([arb(-1), arb(2)], [])
    with pytest.raises(UndecidedError, match="negative where it should start positive"):
        scan(rising, 1.0, True, "g")
    assert scan(rising, 1.0, False, "g") == (None, True)
    assert scan(rising, 0.25, False, "g") == (None, False)


def test_unarmed_guard_that_is_positive_counts_at_once() -> None:
    """1 - s falls within its very first piece (a stick's release that rises and falls on one step)."""
    root, _ = scan(Curve.of([arb(1), arb(-1)], []), 3.0, False, "g")
    assert root is not None
    assert refine(*root).contains(1)


def test_unarmed_guard_rises_then_falls() -> None:
    """-(s - 1)(s - 2): rises at 1, counts from there, falls at 2."""
    root, _ = scan(Curve.of([arb(-2), arb(3), arb(-1)], []), 4.0, False, "g")
    assert root is not None
    assert refine(*root).contains(2)


def test_first_of_several_guards_and_a_tie() -> None:
    early, late = Curve.of([arb(1), arb(-2)], []), Curve.of([arb(1), arb(-1)], [])
    hit, _ = first_root([(late, True, "late"), (early, True, "early")], 2.0)
    assert hit is not None
    assert hit[0] == 1
    assert hit[1].contains(arb(0.5))
    with pytest.raises(UndecidedError, match="tie"):
        first_root([(early, True, "a"), (Curve.of([arb(3), arb(-6)], []), True, "b")], 2.0)
