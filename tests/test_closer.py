"""The closer look: what a polynomial does near a doubtful point, far below a double's rounding."""

from __future__ import annotations

import mpmath
import pytest
import sympy as sp

from henon_ref.henon import closer, isolation
from henon_ref.henon.closer import CloserLook, Finding
from henon_ref.henon.isolation import ONE, bernstein, decided, first_falling_root
from henon_ref.model.equations import TIME
from henon_ref.model.system import FilippovSystem

X = sp.Symbol("x", real=True)
S = sp.Symbol("s", real=True)


def look(surface: sp.Expr, near: float, reach: float = 2.0, clear: float | None = None) -> Finding:
    """Look at a surface that depends on x = t alone, from t = 0 on its upper side."""
    system = FilippovSystem((X,), (S,), (surface,), (sp.Integer(1),))
    return CloserLook(system).look((1,), 0, 0, (0.0, 0.0), [(0.0, 0.0)], (near, 0.0), reach, clear)


@pytest.mark.parametrize("power", [2, 4, 6])
@pytest.mark.parametrize("depth", ["1e-10", "1e-15", "1e-30"])
def test_a_dip_below_zero_is_a_root_and_one_above_it_a_miss(power: int, depth: str) -> None:
    bottom = (X - 1) ** power
    below = look(bottom - sp.Rational(depth), 1 + 1e-9)
    with mpmath.workdps(40):
        exact = 1 - mpmath.mpf(depth) ** (mpmath.mpf(1) / power)
        assert below.what == "root"
        assert not below.lowest
        assert abs(mpmath.mpf(below.time[0]) + mpmath.mpf(below.time[1]) - exact) < 1e-30
    above = look(bottom + sp.Rational(depth), 1 + 1e-9)
    assert (above.what, above.lowest) == ("miss", True)
    assert above.time[0] == pytest.approx(1, abs=1e-11 if power == 6 else 1e-15)


@pytest.mark.parametrize("power", [2, 4, 6])
def test_an_exact_touch_is_one(power: int) -> None:
    found = look((X - 1) ** power, 1 - 1e-7)
    assert (found.what, found.lowest, found.parabolic) == ("touch", True, power == 2)
    assert found.time[0] == pytest.approx(1, abs=1e-11 if power == 6 else 1e-15)


@pytest.mark.parametrize("depth", ["0", "1e-30", "-1e-30", "1e-45", "-1e-45", "1e-53", "-1e-53"])
def test_a_minimum_that_stands_alone_is_what_the_whole_step_says_it_is(depth: str) -> None:
    surface = (X - 1) ** 2 * (3 + X) + sp.Rational(depth)
    whole, alone = look(surface, 1 + 1e-9), look(surface, 1 + 1e-9, clear=1 + 1e-9)
    assert (alone.what, alone.lowest) == (whole.what, whole.lowest)
    with mpmath.workdps(40):
        difference = mpmath.fsum(alone.time) - mpmath.fsum(whole.time)
        assert abs(difference) < (1e-30 if whole.what == "root" else 1e-15)


@pytest.mark.parametrize("near", [1 - 1e-10, 1.0, 1 + 1e-6])
@pytest.mark.parametrize("depth", ["0", "1e-20", "-1e-20", "1e-30", "-1e-30", "1e-44", "-1e-44", "1e-54", "-1e-54"])
@pytest.mark.parametrize("power", [2, 4, 6])
def test_a_minimum_behind_a_clear_part_is_what_the_whole_step_says_it_is(power: int, depth: str, near: float) -> None:
    surface = (X - 1) ** power * (3 + X) + sp.Rational(depth)
    found = look(surface, near, clear=0.99)
    what = "touch" if abs(float(depth)) < 1e-50 else "miss" if float(depth) > 0 else "root"
    assert (found.what, found.lowest, found.parabolic) == (what, what != "root", what != "root" and power == 2)
    assert abs(found.time[0] - look(surface, near).time[0]) < 1e-11
    if what == "root":
        with mpmath.workdps(60):
            value = sp.lambdify(X, surface, "mpmath")
            middle = 1 - (mpmath.mpf(depth) / -4) ** (mpmath.mpf(1) / power)
            assert abs(mpmath.fsum(found.time) - mpmath.findroot(value, middle)) < 1e-27


@pytest.mark.parametrize("depth", ["0", "1e-30", "-1e-30"])
@pytest.mark.parametrize("power", [2, 4, 6])
def test_behind_a_clear_part_the_whole_step_need_not_be_looked_at(
    power: int, depth: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(closer, "decided")
    surface = (X - 1) ** power * (3 + X) + sp.Rational(depth)
    found = look(surface, 1 - 1e-9, clear=0.99)
    assert found.what == {"0": "touch", "1e-30": "miss", "-1e-30": "root"}[depth]


@pytest.mark.parametrize("power", [3, 5, 7])
def test_behind_a_clear_part_a_root_of_odd_order_is_no_touch(power: int) -> None:
    found = look((1 - X) ** power * (2 + X), 1 - 1e-7, clear=0.99)
    assert found.what == "root"
    assert abs(found.time[0] - 1) < 1e-15


@pytest.mark.parametrize("depth", ["1e-20", "-1e-20"])
def test_a_pair_of_roots_behind_a_clear_part_is_not_passed_over(depth: str) -> None:
    pair = (X - sp.Rational("0.995")) ** 2 + sp.Rational(depth)
    found = look(pair * (X - 1) ** 4, 1 - 1e-7, clear=0.99)
    assert found.what == ("touch" if depth == "1e-20" else "root")
    assert abs(found.time[0] - (1 if depth == "1e-20" else 0.995)) < 1e-9


@pytest.mark.parametrize("missing", [3, 30])
def test_an_expansion_does_not_end_at_a_gap(missing: int) -> None:
    """Next to nothing happens before the last order: x' = t^m y, and y (no polynomial by its form) is 1."""
    y = sp.Symbol("y", real=True)
    field = (-(missing + 1) * TIME**missing * sp.exp(y), sp.Integer(0) * y)
    system = FilippovSystem((X, y), (S,), (X,), field)
    found = CloserLook(system).look((1,), 0, 0, (0.0, 0.0), [(0.5, 0.0), (0.0, 0.0)], (0.9, 0.0), 2.0)
    assert found.what == "root"
    with mpmath.workdps(40):
        assert abs(mpmath.fsum(found.time) - mpmath.mpf(0.5) ** (mpmath.mpf(1) / (missing + 1))) < 1e-30


@pytest.mark.parametrize(("gap", "what"), [("1e-40", "miss"), ("-1e-40", "root"), ("0", "touch")])
def test_a_series_that_falls_slowly_is_taken_far_enough(gap: str, what: str) -> None:
    """1/(5 - x) on a step of 2: the terms fall by 0.4 each, so that 48 of them leave 1e-19."""
    assert look(((X - 1) ** 2 + sp.Rational(gap)) / (5 - X), 1.0).what == what


@pytest.mark.parametrize("apart", ["1e-3", "7e-9", "1e-12"])
def test_a_touch_next_to_a_root_is_no_triple_root(apart: str) -> None:
    """Their mean is an inflection, where the first two derivatives are next to nothing."""
    touch = (1 - X) ** 2 * (1 + sp.Rational(apart) - X)
    assert look(touch, 1.0).what == "touch"
    assert abs(look(touch, 1.0).time[0] - 1) < 1e-15
    root = (1 - X) * (1 + sp.Rational(apart) - X) ** 2
    assert (look(root, 1.0).what, look(root, 1.0).time[0]) == ("root", pytest.approx(1, abs=1e-15))


@pytest.mark.parametrize("apart", ["1e-6", "1e-9", "1e-11"])
def test_a_simple_root_next_to_a_triple_one_comes_first(apart: str) -> None:
    root = (1 - X) * (1 + sp.Rational(apart) - X) ** 3
    found = look(root, 1 + float(apart), clear=None)
    assert (found.what, found.time[0]) == ("root", pytest.approx(1, abs=1e-15))
    found = look(root, 1 + float(apart), clear=1 + float(apart))
    assert (found.what, found.time[0]) == ("root", pytest.approx(1, abs=1e-15))


def test_a_root_behind_the_minimum_waits() -> None:
    found = look(((X - 1) ** 2 + sp.Rational(1, 10**20)) * (sp.Rational(3, 2) - X), 1.0)
    assert (found.what, found.lowest) == ("miss", True)
    assert found.time[0] == pytest.approx(1, abs=1e-15)


def test_a_root_at_the_end_of_the_step_is_found_in_round_numbers() -> None:
    found = look(1 - X, 1.0, reach=1.0)
    assert (found.what, found.time, found.state) == ("root", (1.0, 0.0), ((1.0, 0.0),))


def test_a_sine_touches_only_where_it_does() -> None:
    """1 + g - sin(t) at its crest, from far away: the polynomial knows it to 1e-37."""
    for power in (12, 16, 24):
        gap = sp.Rational(1, 10**power)
        assert look(1 + gap - sp.sin(X), 1.57, reach=2.5).what == "miss"
        assert look(1 - gap - sp.sin(X), 1.57, reach=2.5).what == "root"


def test_the_first_of_many_roots_is_isolated() -> None:
    q = [sp.Integer(1)]
    for root in ("0.25", "0.2500001", "0.5", "0.75"):
        factor = [sp.Rational(root), sp.Integer(-1)]
        q = [sum(q[i] * factor[k - i] for i in range(len(q)) if 0 <= k - i < 2) for k in range(len(q) + 1)]
    size = sum(map(abs, q))
    outcome, low, high = first_falling_root([int(c / size * ONE) for c in q])
    assert outcome == "root"
    assert low <= ONE // 4 <= high < int(sp.Rational("0.2500001") * ONE)


def product(*roots: str, degree: int = 20) -> list[int]:
    """Positive at 0, with these roots and none else on the step, in fixed point."""
    q = [sp.Rational(1, 3**k) for k in range(degree)]
    for root in roots:
        factor = [sp.Rational(root), sp.Integer(-1)]
        q = [sum(q[i] * factor[k - i] for i in range(len(q)) if 0 <= k - i < 2) for k in range(len(q) + 1)]
    size = sum(map(abs, q))
    return [int(c / size * ONE) for c in q]


@pytest.mark.parametrize("apart", ["1e-10", "1e-13", "1e-16", "1e-20"])
@pytest.mark.parametrize("roots", [3, 5])
def test_an_odd_number_of_roots_next_to_each_other_is_a_crossing(roots: int, apart: str) -> None:
    """Even where all between them is below 1e-50: the guard is below zero on their far side."""
    cluster = [str(sp.Rational("0.238008") + k * sp.Rational(apart)) for k in range(roots)]
    what, _, place = decided(product(*cluster), 0, ONE * 3 // 10)
    assert what == "root"
    assert abs(place / ONE - 0.238008) < 2e-9


@pytest.mark.parametrize(
    ("roots", "apart", "told"),
    [(2, "1e-24", True), (2, "1e-25", False), (4, "1e-12", True), (4, "1e-13", False), (4, "1e-20", False)],
)
def test_an_even_number_of_roots_is_a_crossing_down_to_1e_50_and_then_a_touch(
    roots: int, apart: str, told: bool
) -> None:
    cluster = [str(sp.Rational("0.238008") + k * sp.Rational(apart)) for k in range(roots)]
    what, lowest, _ = decided(product(*cluster), 0, ONE * 238008 // 10**6)
    assert (what, lowest) == (("root", False) if told else ("touch", True))


@pytest.mark.parametrize("roots", [("0.6", "0.6"), ("0.6", "0.6", "0.6000001"), ("0.6", "0.6", "0.6", "0.6")])
def test_flat_places_are_isolated_in_few_pieces(monkeypatch: pytest.MonkeyPatch, roots: tuple[str, ...]) -> None:
    """Newton's method leads to them: halving alone looks at 167 for the first."""
    looked = []
    monkeypatch.setattr(isolation, "bernstein", lambda q: looked.append(len(q)) or bernstein(q))
    assert first_falling_root(product(*roots))[0] in ("touch", "root")
    assert len(looked) <= 24


def test_time_is_the_system_s() -> None:
    system = FilippovSystem((X,), (S,), (1 - TIME,), (sp.Integer(0),))
    found = CloserLook(system).look((1,), 0, 0, (0.5, 1e-20), [(0.0, 0.0)], (0.5, 0.0), 0.75)
    assert found.what == "root"
    assert found.time == (1.0, 0.0)


@pytest.mark.parametrize("power", [3, 5, 7])
def test_a_root_of_odd_order_is_a_root(power: int) -> None:
    """All is below 1e-50 about it, as about a touch; on the far side the guard is negative."""
    found = look((1 - X) ** power * (2 + X), 1 - 1e-3)
    assert found.what == "root"
    assert abs(found.time[0] - 1) < 1e-15
    assert look((1 - X) ** (power + 1) * (2 + X), 1 - 1e-3).what == "touch"
