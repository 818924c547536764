"""Multiprecision event location: what guards do near an undecided place, far below a double's rounding."""

from __future__ import annotations

from dataclasses import dataclass

import mpmath
import numpy as np
import pytest
import sympy as sp
from flint import arb, arb_poly
from problems import make_problem
from runs import kinds, run

from henon_ref.integrator import multiprecision_roots as isolation
from henon_ref.integrator.multiprecision_event import LocatedEvent, UndecidedStep, locate_event
from henon_ref.integrator.multiprecision_roots import ONE, bernstein, first_event_of, first_falling_root
from henon_ref.integrator.precise_modes import PreciseModes, SharedTapes
from henon_ref.modes.mode_evaluation import in_doubles
from henon_ref.modes.system import FilippovSystem
from henon_ref.precision import working_precision
from henon_ref.taylor.tape import TIME

X = sp.Symbol("x", real=True)
S = sp.Symbol("s", real=True)
Pair = tuple[float, float]


def locate(
    system: FilippovSystem,
    near: float,
    reach: float,
    *,
    state: tuple[Pair, ...] = ((0.0, 0.0),),
    time: Pair = (0.0, 0.0),
    zeros: int = 0,
) -> LocatedEvent:
    """The event of a system's first guard, in the mode above all surfaces."""
    mode = (1,) * len(system.surfaces)
    known = (zeros, *[0] * (len(system.surfaces) - 1))
    exact = [arb(high) + arb(low) for high, low in state]
    step = UndecidedStep(mode, time, exact, [0.0] * len(exact), reach, near, 0, known)
    return locate_event(PreciseModes(in_doubles(system), lambda: SharedTapes(system, ()).in_balls(())), step)


@dataclass(frozen=True)
class Found:
    what: str
    order: int
    time: Pair
    state: tuple[Pair, ...]


def look(surface: sp.Expr, near: float, reach: float = 2.0, zeros: int = 0) -> Found:
    """What a surface that depends on x = t alone does, from t = 0 on its upper side."""
    found = locate(FilippovSystem((X,), (S,), (surface,), (sp.Integer(1),)), near, reach, zeros=zeros)
    what = "root" if found.falling else "touch" if found.touching else "miss"
    return Found(what, found.known_zeros[0], found.time, found.state)


def test_a_touch_is_found_in_two_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """That before it, and that around it, which is so short that all values on it count as zero."""
    pieces, piece = [], isolation._piece
    monkeypatch.setattr(isolation, "_piece", lambda *given: pieces.append(1) or piece(*given))
    with working_precision(isolation.BITS):
        x, root = arb_poly([0, 1]), arb(3) / 5
        touching = (x - root) ** 2 * (x + 1) * (x * x + 2)
        outcome, low, high = first_falling_root(isolation.fixed(touching.coeffs()))
    assert (outcome, len(pieces)) == ("touch", 2)
    assert low / ONE == pytest.approx(0.6) == high / ONE


@pytest.mark.parametrize("power", [2, 4, 6])
@pytest.mark.parametrize("depth", ["1e-10", "1e-15", "1e-30"])
def test_a_dip_below_zero_is_a_root_and_one_above_it_a_miss(power: int, depth: str) -> None:
    bottom = (X - 1) ** power
    below = look(bottom - sp.Rational(depth), 1 + 1e-9)
    with mpmath.workdps(40):
        exact = 1 - mpmath.mpf(depth) ** (mpmath.mpf(1) / power)
        assert below.what == "root"
        assert abs(mpmath.mpf(below.time[0]) + mpmath.mpf(below.time[1]) - exact) < 1e-30
    above = look(bottom + sp.Rational(depth), 1 + 1e-9)
    assert (above.what, above.order) == ("miss", power)
    assert above.time[0] == pytest.approx(1, abs=1e-11 if power == 6 else 1e-15)


@pytest.mark.parametrize("power", [2, 4, 6])
def test_an_exact_touch_is_one(power: int) -> None:
    found = look((X - 1) ** power, 1 - 1e-7)
    assert (found.what, found.order, found.time) == ("touch", power, (1.0, 0.0))


@pytest.mark.parametrize("missing", [3, 30])
def test_an_expansion_does_not_end_at_a_gap(missing: int) -> None:
    """Next to nothing happens before the last order: x' = t^m y, and y (no polynomial by its form) is 1."""
    y = sp.Symbol("y", real=True)
    field = (-(missing + 1) * TIME**missing * sp.exp(y), sp.Integer(0) * y)
    system = FilippovSystem((X, y), (S,), (X,), field)
    found = locate(system, 0.9, 2.0, state=((0.5, 0.0), (0.0, 0.0)))
    assert found.falling == (0,)
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
    found = look(root, 1 + float(apart))
    assert (found.what, found.time[0]) == ("root", pytest.approx(1, abs=1e-15))


def test_a_root_behind_the_minimum_waits() -> None:
    found = look(((X - 1) ** 2 + sp.Rational(1, 10**20)) * (sp.Rational(3, 2) - X), 1.0)
    assert (found.what, found.order) == ("miss", 2)
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
    what, _, place = first_event_of(product(*cluster), 0, ONE * 3 // 10)
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
    what, lowest, _ = first_event_of(product(*cluster), 0, ONE * 238008 // 10**6)
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
    found = locate(system, 0.5, 0.75, time=(0.5, 1e-20))
    assert found.falling == (0,)
    assert found.time == (1.0, 0.0)


PLACE = sp.Rational(7, 5)


@pytest.mark.parametrize("shape", [sp.Integer(1), 3 + X, (2 - X / 3) ** 2, sp.exp(X / 3), 2 + sp.sin(X)])
@pytest.mark.parametrize("order", range(2, 9))
def test_a_flat_root_is_a_touch_or_a_root_and_its_place_is_known(order: int, shape: sp.Expr) -> None:
    """All is below 1e-50 about it; on the far side of one of odd order the guard is negative."""
    found = look((PLACE - X) ** order * shape, 1.4 - 1e-5)
    assert found.what == ("touch" if order % 2 == 0 else "root")
    if order % 2 == 0:
        assert found.order == order
    with mpmath.workdps(60):
        for place in (found.time, found.state[0]):
            assert abs(mpmath.fsum(place) - mpmath.mpf(7) / 5) < 2.0**-103


@pytest.mark.parametrize("zeros", [1, 2, 3])
def test_zeros_at_the_start_are_divided_out(zeros: int) -> None:
    found = look(X**zeros * (PLACE - X) ** 3, 1.4 - 1e-5, zeros=zeros)
    assert (found.what, found.time[0]) == ("root", 1.4)


def cluster(rng: np.random.Generator) -> tuple[sp.Expr, float, float]:
    """A polynomial, positive at 0, with roots close to each other; a place next to them; a step's end."""
    middle, gap = (sp.Rational(float(v)) for v in (rng.uniform(0.05, 1.5), 10 ** rng.uniform(-11, -2)))
    dip = (X - middle) ** 2 + int(rng.choice([-1, 1])) * gap**2
    if rng.integers(2):  # three of them
        dip *= middle + gap * sp.Rational(float(rng.uniform(-3, 3))) - X
    near = float(middle) * (1 + float(rng.choice([-1, 1])) * float(gap) * 10 ** rng.uniform(-3, 1))
    reach = float(max(near, middle + gap)) * float(1 + 10 ** rng.uniform(-4, 0))
    return sp.expand(sp.sign(dip.subs(X, 0)) * dip), near, reach


def test_no_root_is_passed_over_where_several_stand_close_together() -> None:
    """Against Sturm's theorem, in rational numbers."""
    rng = np.random.default_rng(7)
    said = []
    for _ in range(60):
        surface, near, reach = cluster(rng)
        found = look(surface, near, reach)
        said.append(found.what)
        place, width = sum(map(sp.Rational, found.time)), sp.Rational(1, 10**25)
        assert sp.Poly(surface, X).count_roots(0, place - width) == 0, (surface, near, reach)
        count = sp.Poly(surface, X).count_roots(place - width, place + width)
        assert count == (found.what == "root"), (surface, near, reach)
    assert min(map(said.count, ("root", "miss"))) > 10


def test_the_first_event_of_any_guard_is_gone_to() -> None:
    y, u = sp.symbols("y u", real=True)
    dip = (X - 1) ** 2 + sp.Rational("1e-14")
    for other, time, falling in ((sp.Rational(1, 2), 0.5, (1,)), (1 - sp.Rational("1e-20"), 1.0, (1,)), (2, 1.0, ())):
        system = FilippovSystem((X, y), (S, u), (dip, other - y), (sp.Integer(1), sp.Integer(1)))
        found = locate(system, 1.0 + 1e-9, 1.9, state=((0.0, 0.0), (0.0, 0.0)))
        assert (found.time[0], found.falling) == (time, falling)


def test_what_rounding_leaves_between_a_flat_root_and_a_steep_one_is_one_instant() -> None:
    y, u = sp.symbols("y u", real=True)
    system = FilippovSystem((X, y), (S, u), ((1 - X) ** 3, 1 - y), (sp.Integer(1), sp.Integer(1)))
    for off in (0.0, 1e-16, -1e-16):
        found = locate(system, 1.0 + 1e-6, 1.9, state=((0.0, 0.0), (off, 0.0)))
        assert sorted(found.falling) == [0, 1]
        assert found.decision is not None
        assert found.decision.mode == (-1, -1)


@pytest.mark.parametrize("power", [16, 20, 24])
def test_the_mode_behind_a_pair_of_roots_is_decided_by_its_slope_however_small(power: int) -> None:
    gap = sp.Rational(1, 10**power)
    found = locate(FilippovSystem((X,), (S,), ((X - 1) ** 2 - gap**2,), (2 + S,)), 1 / 3, 0.6)
    assert found.decision is not None
    assert (found.decision.mode, found.known_zeros) == ((-1,), (1,))


@pytest.mark.parametrize("surface", ["tanh(x - 1)**5", "tanh(x - 1)**7*exp(x)", "(x - 1)**3/(4 - x)"])
def test_where_the_series_is_cut_off_the_place_is_known_to_less(surface: str) -> None:
    """A coefficient that the place's radius leaves open is zero: the crossing is no stick and not left open."""
    found = locate(FilippovSystem((X,), (S,), (-sp.sympify(surface, {"x": X}),), (2 - S,)), 1.0, 1.25)
    assert found.decision is not None
    assert found.decision.mode == (-1,)


def test_a_guard_that_is_a_polynomial_is_whole_beside_one_that_is_none() -> None:
    """Its last term is no measure for what is left out: a pair behind a zero that is divided out is two crossings."""
    pair = X * ((X - 1) ** 2 - sp.Rational(1, 10**24))
    system = FilippovSystem((X,), (S, sp.Symbol("u", real=True)), (pair, 9 + sp.exp(X)), (2 + S,))
    found = locate(system, 1 / 3, 0.6, zeros=1)
    assert found.decision is not None
    assert (found.decision.mode, found.known_zeros) == ((-1, 1), (1, 0))


ROOTS = {
    "(x - 1)**4": [("graze", 1.0)],
    "(1 - x)**3": [("crossing", 1.0)],
    "(x - 1/2)*(x - 1)**2*(x - 1 - 1/10**9)*exp(x/3)": [("crossing", 0.5), ("graze", 1.0), ("crossing", 1 + 1e-9)],
    "(x - 1)**2 - 1/10**28/4": [("crossing", 1 - 5e-15), ("crossing", 1 + 5e-15)],
    "-(x - 1/10)*(x - 7/5)**3": [("crossing", 0.1), ("crossing", 1.4)],
}


@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize("surface", ROOTS)
def test_runs_meet_the_roots_where_they_are(surface: str, rtol: float) -> None:
    found = [(q.kind, q.time) for q in run(make_problem("x", ["1"], {"s": surface}, [0], 2), rtol).transitions]
    assert [kind for kind, _ in found] == [kind for kind, _ in ROOTS[surface]]
    assert [time for _, time in found] == pytest.approx([time for _, time in ROOTS[surface]], abs=1e-15)


@pytest.mark.parametrize(
    ("field", "kind"),
    [
        ("-1", "crossing"),
        ("-2*u", "crossing"),
        ("-3*u**2", "crossing"),
        ("-5*u**4*exp(x)", "crossing"),
        ("-2*u*exp(-10*u)", "crossing"),
        ("1", "stick"),
        ("2*u", "stick"),
        ("7*u**6", "stick"),
    ],
)
def test_the_field_beyond_decides_what_a_flat_root_is(field: str, kind: str) -> None:
    """x = -u^3 above the surface, where u = t - 1/4 (no step ends before), and this field below it."""
    text = f"(-3*u**2*(1 + s) + ({field})*(1 - s))/2".replace("u", "(t - 1/4)")
    found = run(make_problem("x", [text], {"s": "x"}, ["1/64"], "1/2"), 1e-9)
    assert [(q.kind, q.time) for q in found.transitions] == [(kind, 0.25)]


@pytest.mark.parametrize("below", ["-2*u + 24*u**2", "-2*u + 24*u**2*exp(u)"])
def test_the_zeros_with_which_a_surface_is_left_are_known(below: str) -> None:
    """Below it x = -u^2 + 8 u^3: from a double zero away, and back at u = 1/8."""
    text = f"(-3*u**2*(1 + s) + ({below})*(1 - s))/2".replace("u", "(t - 1/4)")
    found = run(make_problem("x", [text], {"s": "x"}, ["1/64"], "1/2"), 1e-12)
    assert kinds(found)[:2] == ["crossing", "stick"]
    first, second, *_ = found.transitions
    assert first.time == 0.25
    assert second.time == pytest.approx(0.375, abs=1e-15) if "exp" not in below else 0.35 < second.time < 0.375
