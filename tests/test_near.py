"""The closer look in double-double: it says what the one in multiprecision says, or nothing."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import closer_look
import mpmath
import numpy as np
import pytest
import sympy as sp

from henon_ref.henon import registers as k
from henon_ref.henon.closer import CloserLook, Finding
from henon_ref.henon.window import (
    ACROSS,
    CLEAR,
    LOCAL,
    MISS,
    NOISE,
    OPEN,
    PASSED,
    ROOT,
    STEEP,
    TOUCH,
    UNSURE,
    _sign_changes,
)
from henon_ref.jit import njit
from henon_ref.model.system import FilippovSystem

CASES = Path(__file__).parent.parent / "cases"
X = sp.Symbol("x", real=True)
S = sp.Symbol("s", real=True)
Place = tuple[float, float]


def look(surface: sp.Expr, near: float, reach: float = 2.0) -> tuple[int, Place, Place]:
    """(outcome, when, state) of a surface that depends on x = t alone, from t = 0 on its upper side."""
    outcome, floats = looked_at(sp.Integer(1), surface, near, reach)
    return outcome, (floats[k.F_TIME], floats[k.F_LOW]), (floats[k.F_STATE], floats[k.F_STATE + 1])


def looked_at(field: sp.Expr, surface: sp.Expr, near: float, reach: float, *, acts: bool = False) -> tuple[int, Any]:
    """(outcome, the run's floats) for another field."""
    system = FilippovSystem((X,), (S,), (surface,), (field,))
    floats, integers = np.zeros(k.F_STATE + 2), np.zeros(k.I_SIZE + 4, dtype=np.int64)
    floats[k.F_NEAR], floats[k.F_REACH], floats[k.F_UNTIL] = near, reach, 2 * reach
    integers[k.I_ORDER] = 20
    layout = np.zeros((3, k.T_SIZE), dtype=np.int64)
    layout[0, k.T_GUARDS], layout[1, k.G_ACTS] = 1, acts
    outcome = closer_look.look(system, (1,), floats, integers, layout)
    assert integers[k.I_ARRIVED] == {STEEP: k.LANDED, ACROSS: k.TOLD}.get(outcome, 0)
    return outcome, floats


def finding(surface: sp.Expr, near: float | Place, reach: float = 2.0, clear: float | None = None) -> Finding:
    """The same in multiprecision."""
    system = FilippovSystem((X,), (S,), (surface,), (sp.Integer(1),))
    place = (near, 0.0) if isinstance(near, float) else near
    return CloserLook(system).look((1,), 0, 0, (0.0, 0.0), [(0.0, 0.0)], place, reach, clear)


def exact(pair: Place) -> mpmath.mpf:
    return mpmath.mpf(pair[0]) + mpmath.mpf(pair[1])


@pytest.mark.parametrize(("power", "depth"), [(2, "1e-10"), (2, "1e-16"), (2, "1e-24"), (4, "1e-8"), (4, "1e-10")])
def test_a_dip_below_zero_is_a_root(power: int, depth: str) -> None:
    outcome, when, state = look((X - 1) ** power - sp.Rational(depth), 1 + 1e-9)
    with mpmath.workdps(40):
        root = 1 - mpmath.mpf(depth) ** (mpmath.mpf(1) / power)
        assert outcome in (ACROSS, STEEP)
        distance = float(depth) ** (1 / power)  # from the minimum: known to a double's digits
        assert abs(exact(when) - root) < 1e-15 * distance + 1e-27 / distance ** (power - 1)
        assert abs(exact(state) - exact(when)) < 1e-30


def below_its_size(surface: sp.Expr, when: Place, reach: float = 2.0) -> float:
    """A surface's value over the sum of its terms on the step."""
    terms = sp.Poly(sp.expand(surface.subs(X, reach * X)), X).coeffs()
    at = sp.Rational(when[0]) + sp.Rational(when[1])
    return float(surface.subs(X, at) / sum(map(abs, terms)))


@pytest.mark.parametrize("depth", ["1e-7", "1e-9", "1e-12", "1e-16", "1e-24"])
@pytest.mark.parametrize("power", [2, 4])
def test_a_dip_that_ends_above_zero_is_left_where_the_surface_is_clear_of_zero(power: int, depth: str) -> None:
    surface = (X - 1) ** power + sp.Rational(depth)
    outcome, when, state = look(surface, 1 - 1e-7)
    assert outcome == PASSED
    assert abs(exact(state) - exact(when)) < 1e-30
    assert 1 < when[0] < 1.1
    assert below_its_size(surface, when) > CLEAR


@pytest.mark.parametrize("near", [1 - 1e-7, 1.0, 1 + 1e-9])
@pytest.mark.parametrize("depth", [f"{sign}1e-{digits}" for sign in ("", "-") for digits in (13, 16, 19, 22, 24, 26)])
@pytest.mark.parametrize("power", [4, 6])
def test_of_a_flat_dip_it_says_what_multiprecision_does(power: int, depth: str, near: float) -> None:
    """Of degree 6 the middle terms are lost in a double's noise sooner than the dip's depth."""
    surface = (X - 1) ** power * (3 + X) + sp.Rational(depth)
    outcome, when, _ = look(surface, near)
    assert outcome in (PASSED, ACROSS, STEEP, ROOT, OPEN)
    if power == 4 and abs(float(depth)) > 1e-18:
        assert outcome != OPEN
    if outcome == PASSED:
        assert sp.Rational(depth) > 0
        assert below_its_size(surface, when) > CLEAR
    elif outcome != OPEN:
        assert sp.Rational(depth) < 0
        with mpmath.workdps(60):
            root = sp.lambdify(X, surface, "mpmath")
            middle = 1 - (mpmath.mpf(depth) / -4) ** (mpmath.mpf(1) / power)
            distance = float(1 - middle)
            bound = 1e-14 * distance + 1e-27 / distance ** (power - 1)
            assert abs(exact(when) - mpmath.findroot(root, middle)) < bound


@njit()
def changes(g, width, b, doubt):  # type: ignore[no-untyped-def]
    return _sign_changes(g, width, 1.0, NOISE, 1.0, b, doubt)


@pytest.mark.parametrize(("depth", "said"), [(1e-22, 0), (1e-25, -1), (-1e-22, 1), (-1e-25, -1)])
@pytest.mark.parametrize("width", [0.01, -0.01])
def test_coefficients_that_noise_may_have_made_have_no_sign(width: float, depth: float, said: int) -> None:
    """On v^6 + depth the noise of a double in the coefficient of v^4 counts 3e-25."""
    g = np.zeros(LOCAL + 1)
    g[0], g[6] = depth, 1.0
    assert changes(g, width, np.zeros(LOCAL + 1), np.zeros(LOCAL + 1)) == said


def test_of_a_touch_the_place_is_found_and_the_sign_left_open_where_quad_double_does_not_tell_it() -> None:
    touch = (X - 1) ** 2 * sp.cosh(X)
    outcome, when, state = look(touch, 1 - 1e-7)
    assert (outcome, when, state) == (OPEN, (0.0, 0.0), (0.0, 0.0))
    _, floats = looked_at(sp.Integer(1), touch, 1 - 1e-7, 2.0)
    assert abs(exact((floats[k.F_NEAR], floats[k.F_NEAR_LOW])) - 1) < 1e-25
    assert floats[k.F_CLEAR] == floats[k.F_NEAR]


@pytest.mark.parametrize("power", [4, 6])
def test_of_a_flat_touch_a_window_is_left_open_where_no_polynomial_tells_it(power: int) -> None:
    outcome, floats = looked_at(sp.Integer(1), (X - 1) ** power * sp.exp(X / 3), 1 - 1e-7, 2.0)
    assert outcome == OPEN
    assert 0.8 < floats[k.F_CLEAR] < 1 - 1e-4
    assert abs(floats[k.F_NEAR] - 1) < 1e-4


@pytest.mark.parametrize("behind", [1e-1, 1e-3, 1e-5, 1e-8, 1e-12])
@pytest.mark.parametrize("power", [2, 4])
def test_a_root_behind_a_dip_is_not_passed_over(power: int, behind: float) -> None:
    """At the place where the surface would be clear of zero it is negative, or there is a root before it."""
    root = 1 + sp.Rational(behind)
    surface = ((X - 1) ** power + sp.Rational("1e-14")) * (root - X)
    outcome, when, _ = look(surface, 1 - 1e-7)
    assert outcome in (PASSED, MISS, STEEP, ACROSS) or behind < 1e-2 or power == 4
    if outcome in (STEEP, ROOT, ACROSS):
        assert abs(sum(map(sp.Rational, when)) - root) < 1e-20
    else:
        assert when[0] < root


@pytest.mark.parametrize("behind", [1e-1, 1e-3, 1e-5, 1e-8])
@pytest.mark.parametrize("depth", ["1e-20", "-1e-20", "0"])
@pytest.mark.parametrize("power", [2, 4])
def test_a_second_dip_behind_one_is_not_passed_over(power: int, depth: str, behind: float) -> None:
    second = (X - 1 - sp.Rational(behind)) ** 2 + sp.Rational(depth)
    surface = ((X - 1) ** power + sp.Rational("1e-14")) * second
    outcome, when, _ = look(surface, 1 - 1e-7)
    assert outcome in (PASSED, MISS, OPEN, UNSURE)
    assert when[0] < 1 + behind - 1e-6 or when[0] == 0.0 or depth == "1e-20"


@pytest.mark.parametrize("reach", [1 + 1e-2, 1 + 1e-5, 1 + 1e-12])
@pytest.mark.parametrize("power", [2, 4])
def test_a_dip_at_the_end_of_the_step_is_passed_where_there_is_room_behind_it(power: int, reach: float) -> None:
    surface = (X - 1) ** power + sp.Rational("1e-14")
    outcome, when, _ = look(surface, 1.0, reach)
    assert (outcome == PASSED) == (reach > 1 + 3e-6 * (1 if power == 2 else 1e3))
    assert when[0] <= reach
    if outcome == PASSED:
        assert below_its_size(surface, when, reach) > CLEAR


@pytest.mark.parametrize(("other", "outcome"), [(2, PASSED), (1 + 2e-6, UNSURE), (1 - 1e-9, UNSURE)])
def test_another_guard_s_root_is_not_passed_over(other: float, outcome: int) -> None:
    surfaces = (X - 1) ** 2 + sp.Rational("1e-14"), other - X
    system = FilippovSystem((X,), sp.symbols("s0 s1", real=True), surfaces, (sp.Integer(1),))
    floats, integers = np.zeros(k.F_STATE + 2), np.zeros(k.I_SIZE + 4, dtype=np.int64)
    floats[k.F_NEAR], floats[k.F_REACH], floats[k.F_UNTIL] = 1.0, 2.0, 4.0
    integers[k.I_ORDER] = 20
    layout = np.zeros((3, k.T_SIZE), dtype=np.int64)
    layout[0, k.T_GUARDS] = 2
    assert closer_look.look(system, (1, 1), floats, integers, layout) == outcome


def test_a_series_that_falls_too_slowly_is_left_open() -> None:
    """1/(5 - x) on a step of 2: the terms fall by 0.4 each, and by 0.8 on a step of 4."""
    dip = ((X - 1) ** 2 - sp.Rational("1e-20")) / (5 - X)
    assert look(dip, 1.0, reach=1.5)[0] == STEEP
    assert look(dip, 1.0, reach=4.0)[0] == UNSURE


def test_the_steepness_of_a_root_is_told() -> None:
    assert look((X - 1) ** 2 - sp.Rational("1e-18"), 1.0)[0] == STEEP
    assert look((X - 1) ** 2 - sp.Rational("1e-26"), 1.0)[0] == ACROSS


@pytest.mark.parametrize(("below", "ratio"), [(-2, -2.0), (1, 1.0), (3, 3.0)])
def test_of_a_flat_root_it_is_told_what_the_field_does_beyond(below: int, ratio: float) -> None:
    """x' = 1 above the surface (x - 1)^2 = 1e-23 and another constant below it: a stick, or a crossing."""
    field = (1 + below + (1 - below) * S) / 2
    surface = (X - 1) ** 2 - sp.Rational("1e-23")
    outcome, floats = looked_at(field, surface, 1.0, 2.0)
    assert outcome == ACROSS
    assert abs(floats[k.F_BEYOND] - ratio) < 1e-6
    assert looked_at(field, surface, 1.0, 2.0, acts=True)[0] == ROOT  # other surfaces have a say


def test_of_a_flat_root_a_field_along_the_surface_is_left_to_others() -> None:
    assert looked_at((1 + S) / 2, (X - 1) ** 2 - sp.Rational("1e-23"), 1.0, 2.0)[0] == ROOT


def test_a_root_at_the_end_of_the_step_is_found_in_round_numbers() -> None:
    assert look(1 - X, 1.0, reach=1.0) == (STEEP, (1.0, 0.0), (1.0, 0.0))


def test_a_root_behind_the_end_of_the_step_is_not_this_ones() -> None:
    late = 1 - X + sp.Rational("1e-12")
    outcome, when, _ = look(late, 1.0, reach=1.0)
    assert outcome == PASSED
    assert abs(exact(when) - 1) < 1e-25


def test_an_earlier_pair_of_roots_is_not_passed_over() -> None:
    early = (X - sp.Rational(1, 2)) ** 2 - sp.Rational("1e-20")
    late = (X - 1) ** 2 - sp.Rational("1e-14")
    assert look(early * late, 1.0)[0] == UNSURE
    assert look((early + sp.Rational("2e-20")) * late, 1.0)[0] == UNSURE
    assert look((early + sp.Rational("1e-6")) * late, 1.0)[0] == STEEP


def test_a_sine_meets_its_crest_line_only_where_it_does() -> None:
    for power in (12, 16, 20, 24):
        gap = sp.Rational(1, 10**power)
        assert look(1 + gap - sp.sin(X), 1.57, reach=2.5)[0] == PASSED
        outcome, when, _ = look(1 - gap - sp.sin(X), 1.57, reach=2.5)
        assert outcome in (ACROSS, STEEP)
        with mpmath.workdps(40):
            assert abs(exact(when) - mpmath.asin(1 - mpmath.mpf(10) ** -power)) < 1e-15 * 10 ** (
                -power / 2
            ) + 1e-27 * 10 ** (power / 2)


def cluster(rng: np.random.Generator) -> tuple[sp.Expr, float, float]:
    """A polynomial, positive at 0, with roots close to each other; a place next to them; a step's end."""
    middle = sp.Rational(float(rng.uniform(0.05, 1.5)))
    kind = rng.integers(7)
    power = 2 if kind < 5 else 4
    gap = sp.Rational(float(10 ** rng.uniform(-26 / power, -2)))
    dip = (X - middle) ** power + (gap**power if kind == 0 or rng.integers(3) == 0 else -(gap**power))
    if kind == 2:  # three of them
        dip = dip * (middle + gap * sp.Rational(float(rng.uniform(-3, 3))) - X)
    elif kind in (3, 6):  # another pair before or behind, roots or none
        other = (
            sp.Rational(float(rng.uniform(0.05, 1.5))) if kind == 3 else middle * (1 + gap * int(rng.integers(1, 99)))
        )
        dip = dip * ((X - other) ** 2 - sp.Rational(float(rng.choice([-1, 1]) * 10 ** rng.uniform(-20, -4))))
    elif kind == 4:
        dip = dip * (sp.Rational(float(rng.uniform(1.6, 3))) - X) * (1 + X**3)
    sign = sp.sign(dip.subs(X, 0))
    near = float(middle) + float(rng.choice([-1, 1])) * float(gap) * 10 ** rng.uniform(-3, 1)
    return sp.expand(sign * dip), near, float(max(near, middle + gap)) * float(1 + 10 ** rng.uniform(-4, 0))


def test_it_never_says_anything_else_than_multiprecision_does() -> None:
    rng = np.random.default_rng(7)
    said: Counter[int] = Counter()
    for _ in range(250):
        surface, near, reach = cluster(rng)
        outcome, floats = looked_at(sp.Integer(1), surface, near, reach)
        when = floats[k.F_TIME], floats[k.F_LOW]
        said[outcome] += 1
        if outcome == UNSURE:
            continue
        found = finding(surface, near, reach)
        if outcome == OPEN:
            pair = float(floats[k.F_NEAR]), float(floats[k.F_NEAR_LOW])
            again = finding(surface, pair, reach, float(floats[k.F_CLEAR]))
            if again.what == "root" or found.lowest:
                assert again.what == found.what, (surface, near, reach)
                assert abs(again.time[0] - found.time[0]) < 1e-12 or again.lowest, (surface, near, reach)
            else:  # it may see a minimum where multiprecision by itself sees the root behind it only
                last = sum(map(sp.Rational, again.time))
                assert (again.what, again.lowest) == ("miss", True), (surface, near, reach)
                assert sp.Poly(surface, X).count_roots(0, last) == 0, (surface, near, reach)
            continue
        what = {ACROSS: "root", STEEP: "root", ROOT: "root", TOUCH: "touch", PASSED: "miss", MISS: "miss"}[outcome]
        assert what == found.what, (surface, near, reach)
        if outcome in (TOUCH, MISS):
            assert abs(exact(when) - exact(found.time)) < 1e-28, (surface, near, reach)
            continue
        if outcome == PASSED:  # also of what lies between the minimum and where it is clear of zero
            last = sum(map(sp.Rational, when))
            assert sp.Poly(surface, X).count_roots(0, last) == 0, (surface, near, reach)
            continue
        with mpmath.workdps(40):  # the precision over the root's steepness
            slope = abs(float(surface.diff(X).subs(X, sp.Rational(found.time[0]))))
            bound = 1e-15 if outcome == STEEP else 1e-15 + 1e-26 / slope
            assert abs(exact(when) - exact(found.time)) < bound, (surface, near, reach)
    assert said[ACROSS] + said[STEEP] > 60
    assert said[PASSED] > 25
    assert said[OPEN] > 15


def test_it_stands_back_from_what_it_has_no_digits_for() -> None:
    """A sine of a large argument has no value in double-double."""
    assert look(2 - sp.sin(10**7 + X) - X, 1.5)[0] == UNSURE
