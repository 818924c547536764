"""Exponents, periodic orbits and tangent points of a system from Python, against closed forms."""

from __future__ import annotations

import doctest
import math
from fractions import Fraction
from importlib import import_module

import pytest
import sympy as sp

import henon_ref as hr

BELT = hr.System(["x", "v"], {"F": 1, "d": 3, "vb": 0.2}, {"s": "v - vb"}, ["v", "-x - F*s/(1 + d*s*(v - vb))"])
SHAKEN = hr.System(["x", "v"], {"F": 0.1, "w": 2}, {"s": "v"}, ["v", "-x - F*s + cos(w*t)"])
SMOOTH = hr.System(["x", "v"], field=["v", "(1 - x^2)*v - x"])
TWO_SURFACES = hr.System(["x", "v"], {}, {"a": "v", "b": "v - 1"}, ["v", "-x - a - b"])


@pytest.mark.parametrize("module", ["analysis.lyapunov", "analysis.periodic_orbit", "analysis.tangent_points"])
def test_the_examples_in_the_docstrings(module: str) -> None:
    tried = doctest.testmod(import_module(f"henon_ref.{module}"))
    assert tried.failed == 0
    assert tried.attempted > 2


@pytest.mark.parametrize(
    "analysis",
    [
        lambda scene: hr.lyapunov_exponents(scene, {"x": 1}, span=1),
        lambda scene: hr.periodic_orbit(scene, {"x": 1}, until=1),
        hr.tangent_points,
        lambda scene: hr.sweep(scene, {"x": 1}, until=1, grid={"x": [1]}),
    ],
)
def test_a_scene_is_no_system(analysis) -> None:
    with pytest.raises(hr.ArgumentError, match=r"wanted a System: write scene\.system\(\)"):
        analysis(hr.Scene())


def test_exponents_of_a_damped_oscillator_are_half_the_damping() -> None:
    oscillator = hr.System(["x", "v"], {"c": 0.2}, {"s": "x"}, ["v", "-x - c*v"])
    found = hr.lyapunov_exponents(oscillator, {"x": 1, "v": 0}, span=300, start=5, parameters={"c": "1/2"})
    assert found.exponents == pytest.approx((-0.25, -0.25), abs=0.02)
    assert sum(found.exponents) == pytest.approx(-0.5, abs=1e-9)


@pytest.mark.parametrize("force", [Fraction(1, 2), 1, "5/2"])
def test_tangent_points_of_a_belt_are_where_the_spring_is_the_friction(force: object) -> None:
    points = hr.tangent_points(BELT, parameters={"F": force})
    exact = sp.Rational(str(force))
    assert [(p.position, p.side) for p in points] == [(exact, -1), (-exact, 1)]
    assert points == hr.tangent_points(BELT, surface="s", along="x", parameters={"F": force})


def test_the_periodic_orbit_of_a_belt_is_proven() -> None:
    """Slip and stick of the orbit that leaves the belt at x = 1; the stick goes from the landing to there."""
    orbit = hr.periodic_orbit(BELT, {"x": 0, "v": 0}, until=120)
    assert float(orbit.period.rad()) < 1e-40
    assert float(orbit.period) == pytest.approx(12.001031294831, abs=1e-12)
    release = next(e for e in orbit.events if e.from_mode == (0,))
    assert float(release.state[0]) == pytest.approx(1, abs=1e-15)


def test_the_multipliers_of_a_shaken_block_are_those_of_its_turns() -> None:
    """Between turns the flow is a rotation; a turn under Coulomb friction multiplies areas (Shaw 1986)."""
    orbit = hr.periodic_orbit(SHAKEN, {"x": 1.5, "v": 0}, until="600*pi/w", period="2*pi/w")
    product = orbit.multipliers[0] * orbit.multipliers[1]
    turns = [float(e.state[0]) - math.cos(2 * float(e.time)) for e in orbit.events]  # spring and load there
    sides = [e.to_mode[0] for e in orbit.events]
    areas = math.prod(abs((-a - 0.1 * s) / (-a + 0.1 * s)) for a, s in zip(turns, sides, strict=True))
    assert float(product.real.mid()) == pytest.approx(areas, rel=1e-9)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: hr.periodic_orbit(SHAKEN, {"x": 1, "v": 0}, until=100), "give the period"),
        (lambda: hr.periodic_orbit(BELT, {"x": 1, "v": 0}, until=1), "does not repeat itself"),
        (lambda: hr.periodic_orbit(BELT, {"x": 1, "v": 0}, until=100, radius=0), "radius"),
        (lambda: hr.periodic_orbit(SHAKEN, {"x": 1, "v": 0}, until=100, period=-1), "period"),
        (lambda: hr.periodic_orbit(BELT, {"x": 1}, until=100), "lacks the state v"),
        (lambda: hr.lyapunov_exponents(BELT, {"x": 1, "v": 0}, span=0), "span"),
        (lambda: hr.lyapunov_exponents(BELT, {"x": 1, "v": 0}, span=1, discard=math.nan), "discard"),
        (lambda: hr.lyapunov_exponents(BELT, {"x": 1, "q": 0}, span=1), "no state"),
        (lambda: hr.tangent_points(BELT, surface="q"), "'q' is no surface"),
        (lambda: hr.tangent_points(SMOOTH), "the system has no surface"),
        (lambda: hr.tangent_points(TWO_SURFACES), "has several surfaces: name one, as in surface='a'"),
        (lambda: hr.tangent_points(SHAKEN), "depends on t besides the coordinate x"),
        (lambda: hr.periodic_orbit(SMOOTH, {"x": 2, "v": 0}, until=50), "add a surface that the orbit crosses, as in"),
        (lambda: hr.tangent_points(BELT, along="q"), "unknown name"),
        (lambda: hr.tangent_points(BELT, parameters={"q": 1}), "no parameter"),
        (lambda: hr.tangent_points(hr.System(["x"], {}, {"s": "x"}, ["s"])), "give the coordinate along it"),
    ],
)
def test_what_cannot_be_meant_is_refused(call: object, says: str) -> None:
    with pytest.raises(hr.HenonRefError, match=says) as refused:
        call()
    assert len(str(refused.value)) < 400


@pytest.mark.parametrize("term", ["x^{k}/{k}", "1/({k} + x^2)"])
def test_tangent_points_of_two_dozen_ordinary_terms(term: str) -> None:
    rate = "-x + " + " + ".join(term.format(k=k) for k in range(1, 25))
    system = hr.System(["x", "v"], {"F": 1}, {"s": "v"}, ["v", f"{rate} - F*s"])
    found = hr.tangent_points(system)
    assert found
    x = sp.Symbol("x")
    for point in found:
        value = sp.sympify(rate.replace("^", "**"), locals={"x": x}).subs(x, sp.N(point.position, 30))
        assert abs(value - point.side) < 1e-20


@pytest.mark.parametrize(
    "terms",
    [
        "+".join(f"sin({k}*x)/(1 + x^{k})" for k in range(1, 25)),
        "sin(" * 6 + "x" + ")" * 6,
        "exp(-1e8*x)",
        "exp(-x/0.37)/10",
    ],
)
def test_what_has_no_closed_form_is_refused_at_once(terms: str) -> None:
    system = hr.System(["x", "v"], {"F": 1}, {"s": "v"}, ["v", f"-x - F*s + {terms}"])
    with pytest.raises(hr.HenonRefError, match="no closed form of the tangent points of"):
        hr.tangent_points(system)
