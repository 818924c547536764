"""Tangent points against the printed sets of Olejnik and Awrejcewicz (2013); its equations: test_paper.py."""

from __future__ import annotations

from dataclasses import replace

import pytest
import sympy as sp

import henon_ref as hr
from henon_ref.analysis.tangent_points import TangentAnalysis
from henon_ref.errors import ModelError
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME

X1, X2, S, Z = sp.symbols("x1 x2 s z", real=True)
M, K1, K2, MU0, VP, A, W, DELTA = (
    sp.Symbol(name, real=True) for name in ("m", "k1", "k2", "mu0", "vp", "A", "w", "delta")
)
V = X2 - VP
DRIVEN = X1 - A * sp.sin(W * TIME)
FRICTION = S * MU0 / (1 + DELTA * S * V)
SECTION_2 = FilippovSystem((X1, X2), (S,), (V,), (X2, X1 - X1**3 - FRICTION))
SECTION_4 = FilippovSystem((X1, X2), (S,), (V,), (X2, (-K1 * DRIVEN + K2 * DRIVEN**3 - FRICTION) / M))
C = sp.pi / 9
PRINTED_16 = [2 / sp.sqrt(3) * v for v in (sp.cos(C), sp.cos(2 * C), sp.sin(C / 2))]
PRINTED_16 += [-v for v in reversed(PRINTED_16)]


def same(one, other):
    positive = {k: sp.Symbol(k.name, positive=True) for k in (M, K1, K2)}
    return sp.simplify((one - other).xreplace(positive)) == 0


def valued(system, **values):
    names = {p.name: p for p in (M, K1, K2, MU0, VP, A, W, DELTA)}
    return replace(system, parameters={names[name]: sp.sympify(value) for name, value in values.items()})


@pytest.fixture(scope="module")
def figure_4():
    system = valued(SECTION_2, mu0=1 / (3 * sp.sqrt(3)), vp=1, delta=1)
    return TangentAnalysis(system, X1)


def test_tangent_points_of_figure_4_are_eq_16(figure_4):
    found = [p.position for p in figure_4.tangent_points()]
    assert all(same(a, b) for a, b in zip(found, PRINTED_16, strict=True))


def test_odd_tangent_points_of_figure_4_are_visible_and_even_ones_invisible(figure_4):
    assert [p.visibility for p in figure_4.tangent_points()] == ["visible", "invisible"] * 3


def test_stick_zones_of_figure_4_lie_between_an_invisible_and_a_visible_point(figure_4):
    zones = figure_4.stick_zones()
    assert [(z.low, z.high) for z in zones] == [
        (low.position, high.position)
        for high, low in zip(figure_4.tangent_points()[::2], figure_4.tangent_points()[1::2], strict=True)
    ]
    assert all(z.attracting for z in zones)


def test_at_the_upper_boundary_value_the_zones_join_at_degenerate_points():
    """The paper's x(6, 7) = +-2/sqrt 3 bound the one zone, x(4, 5) lie inside it."""
    system = valued(SECTION_2, mu0=2 / (3 * sp.sqrt(3)), vp=1, delta=1)
    analysis = TangentAnalysis(system, X1)
    found = analysis.tangent_points()
    outer, inner = 2 / sp.sqrt(3), 1 / sp.sqrt(3)
    assert all(same(p.position, q) for p, q in zip(found, [outer, inner, -inner, -outer], strict=True))
    assert [p.visibility for p in found] == ["visible", "degenerate", "degenerate", "invisible"]
    zones = analysis.stick_zones()
    assert [a.low for a in zones[:-1]] == [b.high for b in zones[1:]]


def test_beyond_it_one_zone_is_left():
    """At mu0 = 1 its ends solve z^3 - z = +-1: the plastic number."""
    analysis = TangentAnalysis(valued(SECTION_2, mu0=1, vp=1, delta=1), X1)
    plastic = sp.Float("1.32471795724474602596090885448", 30)
    high, low = (sp.N(p.position, 30) for p in analysis.tangent_points())
    assert abs(high - plastic) < 1e-28
    assert abs(low + plastic) < 1e-28
    assert len(analysis.stick_zones()) == 1


def test_tangent_points_of_figure_8_are_eq_24_and_their_visibility_depends_on_time():
    system = valued(
        SECTION_4, m="1/10", k1=1, k2=1, mu0=sp.sqrt(3) / 9, vp="2/5", A=4 * sp.sqrt(3) / 3 * sp.sin(sp.pi / 18),
        w=3 * sp.pi / sp.Rational("2.4728"), delta=1,
    )  # fmt: skip
    found = TangentAnalysis(system, DRIVEN).tangent_points()
    assert all(same(p.position, q) for p, q in zip(found, PRINTED_16, strict=True))
    assert {p.visibility for p in found} == {"depends on time"}
    # K'(z) (vp - y') / m: the base moves faster than the belt, so each point turns over twice a period.
    z = sp.cos(4 * sp.pi / 9) * 2 / sp.sqrt(3)
    expected = (3 * z**2 - 1) * (sp.Rational(2, 5) - sp.diff(system.numeric(A * sp.sin(W * TIME)), TIME)) * 10
    assert abs(sp.N((found[2].curvature - expected).subs(TIME, sp.Rational(1, 3)), 30)) < 1e-25


def test_any_spring_and_friction_law():
    """sigma and its derivative for an undefined spring force K(z) and friction F(|v|)."""
    spring, friction = sp.Function("K"), sp.Function("F")
    system = replace(SECTION_4, field=(X2, (spring(DRIVEN) - S * friction(S * V)) / M))
    analysis = TangentAnalysis(system, DRIVEN)
    assert same(analysis.transition_function, (spring(Z) ** 2 - friction(0) ** 2) / M**2)
    assert same(analysis.derivative, 2 * spring(Z) * sp.diff(spring(Z), Z) / M**2)


def test_a_coordinate_that_does_not_fix_the_state_is_refused():
    with pytest.raises(ModelError, match="depends on"):
        TangentAnalysis(replace(SECTION_4, field=(X2, X1 - S)), DRIVEN)
    with pytest.raises(ModelError, match="do not determine one state"):
        TangentAnalysis(SECTION_2, X2)


def test_points_of_a_periodic_field_represent_those_of_all_periods() -> None:
    """A pendulum with friction sticks where abs(sin(x)) <= F: each of its fields has two tangent points in a period."""
    pendulum = hr.System(["x", "v"], {"F": "1/2"}, {"s": "v"}, ["v", "-sin(x) - F*s"])
    found = {side: [] for side in (-1, 1)}  # type: dict[int, list[sp.Expr]]
    for point in hr.tangent_points(pendulum):
        found[point.side].append(sp.Mod(point.position, 2 * sp.pi))
    assert {side: set(places) for side, places in found.items()} == {
        -1: {sp.pi / 6, 5 * sp.pi / 6},
        1: {7 * sp.pi / 6, 11 * sp.pi / 6},
    }
    assert [len(places) for places in found.values()] == [2, 2]
