"""SciPy with sign or tanh in the right-hand side: sticks, and the transitions that are read from the samples."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
import systems
from test_baselines_solvers import run

from henon_ref.baselines.scipy_naive import SIGN, SMOOTHED, Band, joined
from henon_ref.errors import UnsupportedError
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem


def fed(h: Any, until: float, width: float = 1e-3, step: float = 0.05) -> list[tuple[str, float]]:
    """Kinds and times read off a function of time alone."""
    band = Band(lambda t, x: (h(t),), width, 0.0, (0.0,))
    times = np.arange(0.0, until + step / 2, step)
    for t_old, t in zip(times[:-1].tolist(), times[1:].tolist(), strict=True):
        band.step(t_old, t, lambda k: k.reshape(1, -1))
    band.end(until)
    found, _ = joined([band])
    return [(t.kind, t.time) for t in found]


def test_passing_through_the_band_is_a_crossing_at_the_root() -> None:
    assert fed(lambda t: t - 1.0, 2.0) == [("crossing", pytest.approx(1.0, abs=1e-12))]
    assert fed(lambda t: math.cos(t), 5.0) == [
        ("crossing", pytest.approx(math.pi / 2, abs=1e-12)),
        ("crossing", pytest.approx(3 * math.pi / 2, abs=1e-12)),
    ]


def test_a_long_stay_is_a_stick_between_its_edges() -> None:
    def h(t: float) -> float:
        return max(1.0 - t, 0.0) - max(t - 2.0, 0.0)

    assert fed(h, 3.0) == [
        ("stick", pytest.approx(0.999, abs=1e-9)),
        ("release", pytest.approx(2.001, abs=1e-9)),
    ]
    assert fed(lambda t: max(1.0 - t, 0.0), 3.0) == [("stick", pytest.approx(0.999, abs=1e-9))]


def test_a_short_stick_is_told_from_a_slow_crossing() -> None:
    """Let go with constant acceleration the band is left slowly: fig8's first stick at 1e-6, of 19 ms."""
    assert fed(lambda t: max(1.0 - t, 0.0) - 10.0 * max(t - 1.012, 0.0) ** 2, 2.0, step=1e-3) == [
        ("stick", pytest.approx(0.999, abs=1e-9)),
        ("release", pytest.approx(1.022, abs=1e-9)),
    ]
    assert fed(lambda t: 10.0 * (t - 1.0) ** 3, 2.0) == [("crossing", pytest.approx(1.0, abs=1e-6))]


def test_a_touch_is_nothing_and_a_start_on_the_surface_has_the_mode_it_leaves_for() -> None:
    assert fed(lambda t: (t - 1.0) ** 2 + 0.0005, 2.0) == []
    assert fed(lambda t: t, 2.0) == []
    assert fed(lambda t: max(t - 1.0, 0.0), 2.0) == [("release", pytest.approx(1.001, abs=1e-9))]


def test_smoothed_friction_finds_the_crossings_and_sticks_of_free_coulomb() -> None:
    found = run(SMOOTHED, systems.free_coulomb(), 1e-8)
    assert [t.kind for t in found.transitions] == ["crossing", "crossing", "crossing", "stick"]
    times = [t.time for t in found.transitions]
    assert times[:3] == pytest.approx([math.pi, 2 * math.pi, 3 * math.pi], abs=1e-7)
    assert times[3] == pytest.approx(4 * math.pi, abs=1e-4)
    assert found.counts.event_evaluations == 0


def test_smoothed_friction_creeps() -> None:
    # https://github.com/google-deepmind/mujoco/issues/3328: smoothed friction never sticks.
    found = run(SMOOTHED, systems.free_coulomb(until="40"), 1e-6)
    assert found.end_mode == (0,)
    assert abs(found.end_state[1]) > 1e-5


def test_sign_in_the_right_hand_side_spends_its_budget_in_a_stick_and_keeps_its_transitions() -> None:
    found = run(replace(SIGN, budget=30_000), systems.free_coulomb(), 1e-6)
    assert found.status == "failed"
    assert "budget of 30000" in found.reason
    assert [t.kind for t in found.transitions] == ["crossing", "crossing", "crossing", "stick"]
    assert found.transitions[0].time == pytest.approx(math.pi, abs=1e-4)
    assert found.counts.rhs_evaluations == 30_001


def test_three_surfaces_are_read_off_jointly() -> None:
    found = run(SMOOTHED, systems.three_blocks(), 1e-8)
    assert [(t.kind, t.surface) for t in found.transitions] == [
        ("crossing", 1), ("crossing", 0), ("crossing", 2), ("crossing", 1), ("crossing", 0),
        ("stick", 0), ("stick", 2), ("stick", 1),
    ]  # fmt: skip
    for before, after in zip(found.transitions[:-1], found.transitions[1:], strict=True):
        assert before.to_mode == after.from_mode


@pytest.mark.parametrize("solver", [SMOOTHED, SIGN], ids=lambda s: s.name)
def test_both_end_as_the_contract_says(solver: Any) -> None:
    with pytest.raises(UnsupportedError, match="cannot begin there on a given side"):
        run(solver, systems.static_belt(), 1e-6)
    found = run(solver, systems.blow_up(), 1e-6)
    assert (found.status, found.end_time) == ("diverged", pytest.approx(1.0, abs=1e-4))
    x, s = sp.symbols("x s", real=True)
    system = FilippovSystem((x,), (s,), (x + 1,), (sp.Integer(1),), valid=(1 - x,))
    found = run(solver, Problem(system, sp.Integer(0), (sp.Integer(0),), sp.Integer(3)), 1e-6)
    assert (found.status, found.end_time) == ("invalid", pytest.approx(1.0, abs=1e-9))
    assert run(solver, systems.stribeck_belt(), 1e-6, deadline=0.0).status == "timeout"
