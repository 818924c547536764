"""Periodic orbits with proof: closed forms, published digits, and guesses that lead nowhere."""

from __future__ import annotations

import pytest
import sympy as sp
import systems
from flint import arb, ctx
from problems import make_problem

from henon_ref.enclosure import periodic_orbit as orbit
from henon_ref.enclosure.balls import enclose
from henon_ref.enclosure.periodic_orbit import find_periodic_orbit
from henon_ref.enclosure.return_map import Guess, OrbitError
from henon_ref.enclosure.run import certify
from henon_ref.modes.problem import Problem

PERIOD = 2 * sp.pi / (3 * sp.pi / 2 / sp.Rational(12364, 10000))


@pytest.fixture
def den_hartog() -> Problem:
    start = "sqrt(1/9 - 1/100)"
    drive = f"-3*{start}*cos(2*t) - 3/10*sin(2*t)"
    return make_problem("x v", ["v", f"-x + {drive} - s/5"], {"s": "v"}, [start, 0], "1/2")


def at_the_end(problem: Problem, period: sp.Expr) -> Guess:
    """A guess from the end of a run that is settled there."""
    run = certify(problem, radius=1e-8)
    assert run.mode is not None
    return Guess(problem.until, tuple(float(c) for c in run.state), run.mode, period=period)


def test_forced_coulomb_orbit_and_its_derivative(den_hartog: Problem) -> None:
    """The return map's determinant is the product of two saltations: jumps of v' at a turn, (a - F)/(a + F) each."""
    found = find_periodic_orbit(den_hartog.system, at_the_end(den_hartog, sp.pi))
    assert [e.to_mode for e in found.events] == [(1,), (-1,)]
    assert found.dimension == 2
    with ctx.workprec(found.bits):
        assert found.events[0].time.overlaps(enclose(sp.pi / 2))
        assert found.events[1].time.overlaps(enclose(sp.pi))
        x0 = sp.sqrt(sp.Rational(1, 9) - sp.Rational(1, 100))
        # At a turn from x0: v' without friction is -4 x0 (x0 = -V P cos phi, W = 2).
        jump = (4 * x0 - sp.Rational(1, 5)) / (4 * x0 + sp.Rational(1, 5))
        assert found.derivative.det().overlaps(enclose(jump**2))
        assert max(float(entry.rad()) for entry in found.derivative.entries()) < 1e-40
        assert all(float(c.rad()) < 1e-40 for c in found.state)


def test_autonomous_orbit_from_an_event() -> None:
    """Leine's belt: FACTS' slip, stick and period; the release wipes out the past, so the multiplier is zero."""
    last_stick = (-0.541006353870, 0.2)
    guess = Guess(sp.Integer(0), last_stick, (0,), events=2, surface=0)
    found = find_periodic_orbit(systems.stribeck_belt().system, guess, radius=1e-30)
    assert found.dimension == 1
    assert float(found.period) == pytest.approx(12.001031294831, abs=1e-12)
    assert float(found.durations((-1,))[0]) == pytest.approx(4.295999525480, abs=1e-12)
    assert found.multipliers[0].contains(0)
    assert abs(found.multipliers[0]) < 1e-30
    assert found.period.rad() < 1e-30


@pytest.mark.slow  # daily: the plane map of the same figure, below, and an autonomous orbit, above
def test_fig8_scalar_map_from_a_stick() -> None:
    """Two sticks over 2T (the published 1.1746 and 0.4161 without the listing's step), multiplier 0.4005."""
    guess = Guess(sp.Rational(613, 10), (0.42142948400854, 0.4), (0,), period=2 * PERIOD)
    found = find_periodic_orbit(systems.fig8("listing_limit").system, guess, radius=1e-15)
    assert found.dimension == 1
    long, short = found.durations((0,))
    assert float(long) == pytest.approx(1.1743004676, abs=1e-10)
    assert float(short) == pytest.approx(0.4164164369, abs=1e-10)
    assert float(found.multipliers[0].real) == pytest.approx(0.4005, abs=5e-5)


def test_fig8_plane_map_of_the_equations() -> None:
    guess = Guess(sp.Integer(60), (0.00721368413, 1.01530656615), (1,), period=PERIOD)
    found = find_periodic_orbit(systems.fig8("equations").system, guess, radius=1e-15)
    assert found.durations((0,)) == []
    assert [float(m.real) for m in found.multipliers] == pytest.approx([-0.6639, -0.5638], abs=5e-5)
    down, up = (float(e.time) % float(PERIOD) for e in found.events)
    assert (up, down) == pytest.approx((0.3500047649, 0.9327451920), abs=1e-10)


def test_a_guess_near_no_orbit_is_refused() -> None:
    drift = make_problem("x", ["1"], {"s": "x - 1000"}, [0], 1)
    with pytest.raises(OrbitError, match="no isolated orbit"):
        find_periodic_orbit(drift.system, Guess(sp.Integer(0), (0.0,), (-1,), period=sp.Integer(1)))


def test_a_return_map_into_another_mode_is_refused() -> None:
    through = make_problem("x", ["1"], {"s": "x - 1/2"}, [0], 1)
    with pytest.raises(OrbitError, match="ends in mode"):
        find_periodic_orbit(through.system, Guess(sp.Integer(0), (0.0,), (-1,), period=sp.Integer(1)))


def test_a_guess_gives_period_or_events() -> None:
    with pytest.raises(OrbitError, match="either a period or a number of events"):
        find_periodic_orbit(systems.leaving_slide().system, Guess(sp.Integer(0), (0.0,), (0,)))


def test_a_box_beside_the_orbit_is_not_accepted(den_hartog: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Krawczyk's test is what proves: a point 1e-3 off, said to be good to 1e-20, must fail it."""
    guess = at_the_end(den_hartog, sp.pi)
    off = [arb(guess.state[0] + 1e-3), arb(guess.state[1])]
    monkeypatch.setattr(orbit._Search, "_newton", lambda _: (off, [arb(1e-20)] * 2))
    monkeypatch.setattr(orbit, "BOXES", 1)
    with pytest.raises(OrbitError, match="no box around its limit"):
        find_periodic_orbit(den_hartog.system, guess, radius=1e-25)


def test_a_fixed_point_must_prove_a_period() -> None:
    """A return to the same state proves nothing where the drive is not the same again."""
    system = systems.fig8("equations").system
    state = (0.00721368413, 1.01530656615)
    with pytest.raises(OrbitError, match="not proven to have the period"):
        find_periodic_orbit(system, Guess(sp.Integer(60), state, (1,), period=sp.Rational(16485, 10000)))
    with pytest.raises(OrbitError, match="depends on time"):
        find_periodic_orbit(system, Guess(sp.Integer(60), state, (1,), events=2, surface=0))


def test_an_event_orbit_ends_with_the_event_it_starts_at() -> None:
    guess = Guess(sp.Integer(0), (-0.541006353870, 0.2), (0,), events=2, surface=0, tangent=True)
    with pytest.raises(OrbitError, match="not with the event it starts at"):
        find_periodic_orbit(systems.stribeck_belt().system, guess, radius=1e-15)


def test_a_motion_that_never_returns_has_no_orbit() -> None:
    """x = t leaves the surface x = 0 for good."""
    away = make_problem("x v", ["v", "0"], {"s": "x"}, [0, 1], 1)
    with pytest.raises(OrbitError, match="has 0 events, not 1"):
        find_periodic_orbit(away.system, Guess(sp.Integer(0), (0.0, 1.0), (1,), events=1, surface=0))
