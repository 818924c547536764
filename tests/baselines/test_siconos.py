"""Siconos by the protocol: the right sequence, with errors of the times of about one step."""

from __future__ import annotations

import math

import pytest
from often import daily
from problems import read_problem

import henon_ref
from henon_ref.baselines.interpreted import DEFAULT, RELAY, VARIABLE, siconos_version
from henon_ref.errors import UnavailableError, UnsupportedError
from henon_ref.harness import registry

installed = pytest.mark.skipif(not siconos_version(DEFAULT), reason="Siconos is not installed")
BLOCK = """
system:
  state: [x, v]
  surfaces: {s: v}
  field: [v, "-x - s/4"]
initial: {t: 0, x: 11/10, v: 0}
until: 10
"""
"""A block that friction of 1/4 brings to rest away from the middle."""


@installed
@pytest.mark.parametrize("step", daily([1e-2, 5e-3], some=[1e-2]))
def test_a_closed_form(step: float) -> None:
    problem = read_problem(BLOCK)
    found = RELAY.prepare(problem, step=step)()
    assert (found.status, found.reason) == ("ok", "")
    assert [event.kind for event in found.transitions] == ["crossing", "stick"]
    assert [event.time for event in found.transitions] == pytest.approx([math.pi, 2 * math.pi], abs=2 * step)
    assert found.end_state == pytest.approx((0.1, 0.0), abs=3 * step)
    assert found.counts.steps == round(10 / step)


@installed
def test_a_slide_that_ends_and_a_field_with_a_pole_beyond_the_surface() -> None:
    text = BLOCK.replace('[v, "-x - s/4"]', '[v, "-x - s/(1 + 3*s*(v - 1/5))"]').replace("{s: v}", "{s: v - 1/5}")
    problem = read_problem(text)
    exact = registry.solver("henon").prepare(problem, rtol=1e-12, atol=1e-12)()
    found = RELAY.prepare(problem, step=1e-2)()
    assert [event.kind for event in found.transitions] == [event.kind for event in exact.transitions]
    assert [event.time for event in found.transitions] == pytest.approx(
        [event.time for event in exact.transitions], abs=0.1
    )


@installed
def test_a_surface_that_changes_nothing_is_not_felt_by_a_step() -> None:
    """x' = x^10 is 1 where the run starts and 1024 on the surface."""
    problem = henon_ref.load_case("blow_up").reading("slow").problem
    found = RELAY.prepare(problem, step=1e-3)()
    assert found.transitions[0].time == pytest.approx((1 - 2**-9) / 9, abs=2e-3)


@installed
def test_a_slide_that_is_not_filippov_s_is_not_supported() -> None:
    problem = henon_ref.load_case("static_belt").readings[0].problem
    with pytest.raises(UnsupportedError, match="Filippov's sliding only"):
        RELAY.prepare(problem, step=1e-2)()


@installed
def test_a_field_that_is_zero_beyond_the_surface_is_no_lost_sign() -> None:
    """x' = 1 below and 0 above: rounding alone tells on which side of it the state stays."""
    text = BLOCK.replace("[x, v]", "[x]").replace("s: v", "s: x").replace('[v, "-x - s/4"]', '["(1 - s)/2"]')
    problem = read_problem(text.replace("{t: 0, x: 11/10, v: 0}", "{x: -1}"))
    found = RELAY.prepare(problem, step=1e-2)()
    assert (found.status, len(found.transitions)) == ("ok", 1)
    assert found.transitions[0].time == pytest.approx(1.0, abs=2e-2)


@installed
def test_a_state_that_rounding_moves_off_its_surface_is_told() -> None:
    problem = henon_ref.load_case("quick_restick").reading("fast").problem
    found = RELAY.prepare(problem, step=1e-3)()
    assert found.status == "failed"
    assert "the rounding of a step" in found.reason


@installed
def test_its_version_is_told() -> None:
    assert registry.library_version("siconos") == RELAY.version == siconos_version(DEFAULT)


def test_without_siconos_it_is_unavailable(monkeypatch) -> None:
    monkeypatch.setenv(VARIABLE, "/no/such/python")
    assert RELAY.version == ""
    with pytest.raises(UnavailableError, match="/no/such/python has no siconos"):
        RELAY.prepare(read_problem(BLOCK), step=1e-2)
    assert DEFAULT != "/no/such/python"
