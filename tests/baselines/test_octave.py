"""Octave's ``ode45`` by the protocol: every transition, with the error of its linear interpolation."""

from __future__ import annotations

import math

import pytest
from problems import read_problem
from shipped import proven

import henon_ref
from henon_ref.baselines import interpreted as module
from henon_ref.baselines.interpreted import ODE45, octave_version
from henon_ref.errors import UnavailableError
from henon_ref.harness import registry
from henon_ref.harness.score.scoring import score

pytestmark = pytest.mark.skipif(not octave_version(), reason="Octave is not installed")
BLOCK = """
system:
  state: [x, v]
  surfaces: {s: v}
  field: [v, "-x - s/4"]
initial: {t: 0, x: 1, v: 0}
until: 10
"""
"""A block that friction of 1/4 brings to rest."""


@pytest.mark.parametrize("name", ["free_coulomb", "leaving_slide"])
def test_every_transition_is_found(name: str) -> None:
    case = henon_ref.load_case(name)
    found = ODE45.prepare(case.readings[0].problem, rtol=1e-9, atol=1e-9)()
    scored = score(found, proven(case, case.readings[0]), tolerance=1e-9)
    assert (found.status, scored.status) == ("ok", "ok")
    assert scored.max_time_error is not None
    assert scored.max_time_error < 1e-3


def test_a_closed_form() -> None:
    found = ODE45.prepare(read_problem(BLOCK), rtol=1e-9, atol=1e-9)()
    assert [event.kind for event in found.transitions] == ["crossing", "stick"]
    assert [event.time for event in found.transitions] == pytest.approx([math.pi, 2 * math.pi], abs=1e-3)
    assert found.counts.steps > 10


def test_a_run_past_its_time_says_so() -> None:
    problem = read_problem(BLOCK)
    found = ODE45.prepare(problem, rtol=1e-12, atol=1e-12, deadline=1e-3)()
    assert (found.status, found.reason) == ("timeout", "the time that a run may take has passed")


def test_a_root_of_a_negative_number_is_no_complex_number() -> None:
    case = henon_ref.load_case("hard/running_dry")
    found = ODE45.prepare(case.readings[0].problem, rtol=1e-6, atol=1e-6, deadline=60.0)()
    assert found.status == "failed"
    assert found.end_time == pytest.approx(2.0, abs=0.05)


def test_its_version_is_told() -> None:
    assert registry.library_version("octave-ode45") == ODE45.version == octave_version()
    assert registry.program_versions()["octave"] == octave_version()


def test_without_octave_it_is_unavailable(monkeypatch) -> None:
    monkeypatch.setattr(module, "octave_version", lambda: "")
    with pytest.raises(UnavailableError, match="octave-cli is not installed"):
        ODE45.prepare(read_problem(BLOCK), rtol=1e-9)


def test_a_run_ends_at_the_last_state_that_is_one() -> None:
    """y' = sqrt(x), x' = -1 from 1: no number from t = 1 on; ode45 goes on, the adapter does not."""
    (own,) = (own for own in henon_ref.load_case("hard/nan_region").readings if own.name == "field")
    found = ODE45.prepare(own.problem, rtol=1e-9, atol=1e-9)()
    assert found.status == "failed"
    assert 0.9 < found.end_time < 1.0
    assert found.end_state[0] == pytest.approx(1.0 - found.end_time, abs=1e-9)
