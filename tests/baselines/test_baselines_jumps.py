"""Jumps of the state with every library, by the shared driver."""

from __future__ import annotations

import pytest
import sympy as sp

from henon_ref.casefile.case import load_case
from henon_ref.errors import UnsupportedError
from henon_ref.harness.registry import solver
from tests.support.resets import ball, ball_impacts, impact_oscillator, oscillator_impacts

LIBRARIES = ("heyoka", "cvode-adams", "cvode-bdf", "ida", "scipy-rk45", "scipy-dop853", "scipy-radau", "scipy-lsoda")


@pytest.mark.parametrize("name", LIBRARIES)
def test_a_library_bounces_a_ball(name: str) -> None:
    found = solver(name).prepare(ball(sp.Integer(3), sp.Rational(4, 5)), rtol=1e-9)()
    times = ball_impacts(6, 0.8)
    assert (found.status, [t.kind for t in found.transitions]) == ("ok", ["reset"] * 6)
    assert [t.time for t in found.transitions] == pytest.approx(times, abs=1e-6, rel=0)


@pytest.mark.parametrize("name", ["heyoka", "scipy-dop853"])
def test_a_library_hits_a_wall(name: str) -> None:
    problem = impact_oscillator(sp.Rational(1, 2), sp.Rational(1, 2), 14)
    found = solver(name).prepare(problem, rtol=1e-11)()
    assert [t.time for t in found.transitions] == pytest.approx(oscillator_impacts(0.5, 0.5, 14.0), abs=1e-8)


@pytest.mark.parametrize(
    ("name", "setting"),
    [("scipy-smoothed", {"rtol": 1e-9}), ("scipy-sign", {"rtol": 1e-9}), ("henon-rk4", {"step": 1e-3})],
)
def test_what_knows_no_jumps_says_so(name: str, setting: dict[str, float]) -> None:
    with pytest.raises(UnsupportedError, match="jump"):
        solver(name).prepare(ball(sp.Integer(3), sp.Rational(4, 5)), **setting)


@pytest.mark.parametrize("name", ["heyoka", "cvode-bdf", "cvode-adams", "scipy-lsoda", "scipy-dop853"])
def test_a_surface_that_is_left_without_speed_is_not_hit_by_noise(name: str) -> None:
    # The first impact, at 0.145 s, takes all speed where the table falls away faster than the ball; it is thrown off
    # the table later on, four times.
    reading = load_case("scenes/inelastic_ball").readings[0]
    for rtol in (1e-6, 1e-9):
        found = solver(name).prepare(reading.problem, rtol=rtol)()
        once = ["reset", "stick", "release"]
        assert (found.status, [t.kind for t in found.transitions]) == ("ok", ["reset", *once * 4, "reset", "stick"])
