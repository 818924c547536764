"""Roots of high order, touches, and clusters of roots below rounding."""

from __future__ import annotations

import math

import numpy as np
import pytest
from often import daily
from problems import make_problem
from runs import kinds, run, times

import henon_ref as hr


@pytest.mark.parametrize("rtol", [1e-6, 1e-13])
@pytest.mark.parametrize("exponent", range(1, 15))
def test_two_roots_in_one_step_are_both_found(exponent: int, rtol: float) -> None:
    gap = 10.0**-exponent
    result = run(make_problem("x v", ["v", "2"], {"s": "x"}, [f"1 - 10**(-{2 * exponent})/4", -2], 3), rtol)
    assert kinds(result) == ["crossing", "crossing"]
    offsets = np.array([(q.time - 1) + q.time_low for q in result.transitions])
    np.testing.assert_allclose(offsets, [-gap / 2, gap / 2], atol=min(1e-15 / gap, 1e-3 * gap))


def test_an_exact_touch_is_a_graze_and_a_miss_by_a_hair_is_nothing() -> None:
    assert kinds(run(make_problem("x v", ["v", "2"], {"s": "x"}, [1, -2], 3))) == ["graze"]
    assert kinds(run(make_problem("x v", ["v", "2"], {"s": "x"}, ["1 + 10**(-28)", -2], 3))) == []


@pytest.mark.parametrize(
    "surface",
    ["(exp(x - 1) - 1)**3", "x - 1 - sin(x - 1)", "sin(x - 1)*(1 - cos(x - 1))", "tanh(x - 1)**5"],
)
@pytest.mark.parametrize("rtol", daily([1e-6, 1e-9, 1e-12, 1e-15], some=[1e-9, 1e-15]))
@pytest.mark.parametrize("field", ["1", "2 + s"])
def test_a_run_goes_on_behind_a_root_of_odd_order_of_any_function(surface: str, rtol: float, field: str) -> None:
    """Its size tells nothing of a guard whose first coefficients are known to be zero: the step must not shrink."""
    result = run(make_problem("x", [field], {"s": surface}, [0], "3/2"), rtol)
    first = result.transitions[0]
    assert (result.status, first.kind, first.state[0]) == ("ok", "crossing", pytest.approx(1, abs=1e-10))
    assert result.counts.steps < 40


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12, 1e-15])
@pytest.mark.parametrize(
    ("surface", "kind", "root"),
    [
        ("(x - 11/10)*(x - 8/5)**2*exp(x/3)", "graze", 1.6),
        ("-(x - 1/10)*(x - 7/5)**3", "crossing", 1.4),
        ("-(x - 1/10)*(x - 7/5)**3*exp(x/3)", "crossing", 1.4),
        ("(x - 1/10)**3*(x - 7/5)**2", "graze", 1.4),
        ("(1/10 - x)**3*(x - 7/5)**3*exp(x/3)", "crossing", 1.4),
        ("(x - 2)*(x - 2 - 1/10**8)**2", "graze", 2 + 1e-8),
    ],
)
def test_multiple_roots_behind_a_crossing_stay_where_they_are(
    surface: str, kind: str, root: float, rtol: float
) -> None:
    """The state at a crossing is beside the surface by its rounding: a root of that, were it not divided out."""
    result = run(make_problem("x", ["1"], {"s": surface}, [0], 3), rtol)
    assert kinds(result) == ["crossing", kind]
    assert times(result)[1] == pytest.approx(root, rel=1e-15)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-14])
@pytest.mark.parametrize("surface", ["(x - 9/10)**2*(x - 23/10)**3", "-(x - 9/10)**2*(x - 14/10)**2*(x - 23/10)"])
def test_multiple_roots_behind_a_touch_stay_where_they_are(surface: str, rtol: float) -> None:
    result = run(make_problem("x", ["1"], {"s": surface}, [0], 3), rtol)
    assert kinds(result) == ["graze"] * (len(result.transitions) - 1) + ["crossing"]
    assert times(result)[0] == pytest.approx(0.9, rel=1e-15)
    assert times(result)[-1] == pytest.approx(2.3, rel=1e-15)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-14])
@pytest.mark.parametrize("apart", [10**6, 10**8, 3 * 10**8])
def test_a_cluster_below_rounding_is_taken_apart(apart: int, rtol: float) -> None:
    """A crossing next to a triple one: all that a double sees between them is noise, of either sign.

    The first crossing is right to 1e-13 (rounding of a polynomial of degree seven), and its root is divided out: that
    reaches the next one a hundredfold.
    """
    surface = f"-(x - 6/5)*(x - 2)*(x - 2 - 1/{apart})**3*(2 + x**2)"
    result = run(make_problem("x", ["1"], {"s": surface}, [0], "69/21"), rtol)
    assert kinds(result) == ["crossing"] * 3
    assert times(result) == pytest.approx([1.2, 2, 2 + 1 / apart], rel=max(1e-2 * rtol, 1e-14), abs=1e-11)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-14])
@pytest.mark.parametrize(
    ("surface", "roots"),
    [
        ("(x - 9/10)*(x - 6/5)*(x - 6/5 - 8/10**12)*(2 + x**2)", [0.9, 1.2, 1.2 + 8e-12]),
        ("(x - 2/5)*(x - 13/30)*(x - 130001/300000)*(x - 250001/300000)**2*(2 + x**2)", [0.4, 13 / 30, 130001 / 3e5]),
    ],
)
@pytest.mark.parametrize("until", ["3/2", "1675000000007/875000000000"])
def test_a_pair_of_roots_behind_a_crossing_is_seen(surface: str, roots: list[float], rtol: float, until: str) -> None:
    """The crossing is landed on to some 1e-13, which moved the pair by 3e-9 or off the axis."""
    result = run(make_problem("x", ["1"], {"s": surface}, [0], until), rtol)
    assert kinds(result)[:3] == ["crossing"] * 3
    assert times(result)[:3] == pytest.approx(roots, rel=1e-12)


@pytest.mark.parametrize("rtol", [1e-9, 1e-12, 1e-13, 1e-14])
def test_a_touch_next_to_a_root_is_seen_wherever_the_halving_falls(rtol: float) -> None:
    """A piece of the step on which only rounding makes all Bernstein coefficients positive may hold a touch."""
    surface = "(x - 2)*(x - 5/2)**2*(x - 5/2 - 9/10**10)*exp(x/3)"
    result = run(make_problem("x", ["1"], {"s": surface}, [0], "7/2 + 9/10**10"), rtol)
    assert kinds(result) == ["crossing", "graze", "crossing"]
    assert times(result) == pytest.approx([2, 2.5, 2.5 + 9e-10], rel=1e-12)


@pytest.mark.parametrize("rtol", [3e-3, 1e-3, 1e-4, 1e-7, 1e-9, 1e-12])
@pytest.mark.parametrize(
    ("a", "b"),
    [("x", "x^3"), ("x", "x^3 + x^5"), ("x", "x*(1 + x^2)"), ("x - v", "(x - v)^3"), ("x^5", "x^3"), ("x^3", "x^3")],
)
def test_a_surface_and_a_power_of_it_cross_together(a: str, b: str, rtol: float) -> None:
    """x = cos t, so x - v = sqrt(2) cos(t - pi/4): one crossing of each surface every pi."""
    system = hr.System(["x", "v"], {}, {"a": a, "b": b}, ["v", "-x"])
    found = hr.simulate(system, {"x": 1, "v": 0}, until=25, rtol=rtol)
    assert (found.status, set(found.transitions.kind)) == ("ok", {"crossing"})
    first = math.pi * (3 / 4 if "v" in a else 1 / 2)
    for surface in ("a", "b"):
        at = found.transitions.time_s[found.transitions.surface == surface].to_list()
        assert at == pytest.approx([first + k * math.pi for k in range(8)], abs=rtol ** (1 / 5))
