"""The closer look in double-double: it says what the one in multiprecision says, or nothing."""

from __future__ import annotations

import time
from collections import Counter
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from henon_ref.henon import registers as k
from henon_ref.henon.closer import CloserLook, Finding
from henon_ref.henon.near import ACROSS, NearLook
from henon_ref.henon.solvers import HENON_SOLVER
from henon_ref.henon.window import MISS, OPEN, PASSED, ROOT, STEEP, UNSURE
from henon_ref.model.case import load_case
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
    outcome = NearLook(system).look(floats, integers, (1,), layout, [0])
    assert integers[k.I_ARRIVED] == {STEEP: k.LANDED, ACROSS: k.TOLD}.get(outcome, 0)
    return outcome, floats


def finding(surface: sp.Expr, near: float, reach: float = 2.0) -> Finding:
    """The same in multiprecision."""
    system = FilippovSystem((X,), (S,), (surface,), (sp.Integer(1),))
    return CloserLook(system).look((1,), 0, 0, (0.0, 0.0), [(0.0, 0.0)], near, reach)


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


@pytest.mark.parametrize("depth", ["1e-12", "1e-16", "1e-24"])
def test_a_dip_that_ends_above_zero_is_a_miss(depth: str) -> None:
    outcome, when, _ = look((X - 1) ** 2 + sp.Rational(depth), 1 - 1e-7)
    assert outcome == MISS
    assert abs(exact(when) - 1) < 1e-15


def test_of_a_touch_the_place_is_found_and_the_sign_left_open() -> None:
    outcome, when, state = look((X - 1) ** 2, 1 - 1e-7)
    assert (outcome, when, state) == (OPEN, (0.0, 0.0), (0.0, 0.0))
    assert look((X - 1) ** 4, 1 - 1e-7)[0] == UNSURE


def test_a_miss_that_no_parabola_tells_of_is_left_open() -> None:
    assert look((X - 1) ** 4 + sp.Rational("1e-20"), 1 - 1e-7)[0] == UNSURE


def test_a_series_that_falls_too_slowly_is_left_open() -> None:
    """1/(5 - x) on a step of 2: the terms fall by 0.4 each, and by 0.8 on a step of 4."""
    dip = ((X - 1) ** 2 - sp.Rational("1e-20")) / (5 - X)
    assert look(dip, 1.0, reach=1.5)[0] == STEEP
    assert look(dip, 1.0, reach=4.0)[0] == UNSURE


def test_a_minimum_well_above_zero_is_not_taken_for_a_double_zero() -> None:
    assert look((X - 1) ** 2 + sp.Rational("1e-9"), 1 - 1e-7)[0] == UNSURE


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
        assert look(1 + gap - sp.sin(X), 1.57, reach=2.5)[0] == MISS
        outcome, when, _ = look(1 - gap - sp.sin(X), 1.57, reach=2.5)
        assert outcome in (ACROSS, STEEP)
        with mpmath.workdps(40):
            assert abs(exact(when) - mpmath.asin(1 - mpmath.mpf(10) ** -power)) < 1e-15 * 10 ** (
                -power / 2
            ) + 1e-27 * 10 ** (power / 2)


def cluster(rng: np.random.Generator) -> tuple[sp.Expr, float, float]:
    """A polynomial, positive at 0, with roots close to each other; a place next to them; a step's end."""
    middle = sp.Rational(float(rng.uniform(0.05, 1.5)))
    gap = sp.Rational(float(10 ** rng.uniform(-13, -2)))
    kind = rng.integers(5)
    dip = (X - middle) ** 2 + (gap**2 if kind == 0 else -(gap**2))
    if kind == 2:  # three of them
        dip = dip * (middle + gap * sp.Rational(float(rng.uniform(-3, 3))) - X)
    elif kind == 3:  # another pair before or behind
        other = sp.Rational(float(rng.uniform(0.05, 1.5)))
        dip = dip * ((X - other) ** 2 - sp.Rational(float(10 ** rng.uniform(-20, -4))))
    elif kind == 4:
        dip = dip * (sp.Rational(float(rng.uniform(1.6, 3))) - X) * (1 + X**3)
    sign = sp.sign(dip.subs(X, 0))
    near = float(middle) + float(rng.choice([-1, 1])) * float(gap) * 10 ** rng.uniform(-3, 1)
    return sp.expand(sign * dip), near, float(max(near, middle + gap)) * float(1 + 10 ** rng.uniform(-4, 0))


def test_it_never_says_anything_else_than_multiprecision_does() -> None:
    rng = np.random.default_rng(7)
    said: Counter[int] = Counter()
    for _ in range(150):
        surface, near, reach = cluster(rng)
        outcome, when, _ = look(surface, near, reach)
        said[outcome] += 1
        if outcome in (UNSURE, OPEN):
            continue
        found = finding(surface, near, reach)
        what = {ACROSS: "root", STEEP: "root", MISS: "miss", PASSED: "miss"}[outcome]
        assert what == found.what, (surface, near, reach)
        # A minimum's place is known to the root of the precision, a root's to the precision over its steepness.
        bound = {MISS: 1e-12, ACROSS: 1e-13, STEEP: 1e-15, PASSED: 1e-20}[outcome]
        with mpmath.workdps(40):
            assert abs(exact(when) - exact(found.time)) < bound, (surface, near, reach)
    assert said[ACROSS] + said[STEEP] > 40
    assert said[MISS] > 15


@pytest.mark.parametrize(("loading", "status"), [(0.2, "ok"), (0.0, "timeout")])
def test_compiling_it_is_not_counted_against_a_deadline(
    loading: float, status: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = load_case(CASES / "hard" / "grazing.yaml").reading("inside1e10").problem
    looked = NearLook.look

    def slow(self: NearLook, *arguments: Any) -> int:
        time.sleep(0.2)
        self.loading_s += loading
        return looked(self, *arguments)

    HENON_SOLVER.prepare(problem, rtol=1e-12)()  # whatever is compiled is compiled now
    monkeypatch.setattr(NearLook, "look", slow)
    assert HENON_SOLVER.prepare(problem, rtol=1e-12, deadline=0.1)().status == status


def test_it_stands_back_from_what_it_has_no_digits_for() -> None:
    """A sine of a large argument has no value in double-double."""
    assert look(2 - sp.sin(10**7 + X) - X, 1.5)[0] == UNSURE
