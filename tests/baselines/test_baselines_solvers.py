"""Every library against closed forms: free Coulomb, belts, a slide, a curved surface, three blocks.

Sources of the systems stand in ``systems.py``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy as sp
import systems
from often import daily
from runs import kinds

from henon_ref.baselines.heyoka_taylor import HEYOKA
from henon_ref.baselines.scipy_ivp import BDF, DOP853, LSODA, RADAU, RK45
from henon_ref.baselines.sundials import ADAMS, IDA
from henon_ref.baselines.sundials import BDF as CVODE_BDF
from henon_ref.harness import registry
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.solver import Solver
from henon_ref.taylor.tape import TIME

LADDER = [
    (HEYOKA, 1e-16, 3e-14),
    (DOP853, 1e-12, 1e-11),
    (RK45, 1e-8, 1e-6),
    (RADAU, 1e-8, 1e-5),
    (BDF, 1e-7, 1e-4),
    (LSODA, 1e-10, 1e-7),
    (ADAMS, 1e-11, 1e-8),
    (CVODE_BDF, 1e-9, 1e-6),
    (IDA, 1e-9, 1e-6),
]
EACH = pytest.mark.parametrize(("solver", "rtol", "bound"), LADDER, ids=lambda v: getattr(v, "name", ""))


def run(solver: Any, problem: Problem, rtol: float, **options: Any) -> Any:
    options.setdefault("deadline", 30)
    return solver.prepare(problem, rtol=rtol, atol=rtol, **options)()


@EACH
def test_each_meets_the_contract(solver: Any, rtol: float, bound: float) -> None:
    assert isinstance(solver, Solver)
    assert solver.library(rtol, rtol).module
    assert solver.version
    assert not solver.fixed_step


@EACH
def test_free_coulomb(solver: Any, rtol: float, bound: float) -> None:
    found = run(solver, systems.free_coulomb(), rtol)
    assert kinds(found) == ["crossing", "crossing", "crossing", "stick"]
    turns = [5.3, -4.1, 2.9, -1.7, 0.5]
    for k, t in enumerate(found.transitions, start=1):
        assert t.time + t.time_low == pytest.approx(k * math.pi, abs=bound)
        assert t.state == pytest.approx((turns[k], 0.0), abs=bound)
    assert found.end_state == pytest.approx((0.5, 0.0), abs=bound)
    assert found.max_surface_drift < max(1e-11, 10 * rtol)
    assert min(found.counts.steps, found.counts.rhs_evaluations, found.counts.event_evaluations) > 0


@EACH
def test_belt_with_static_above_kinetic_friction(solver: Any, rtol: float, bound: float) -> None:
    found = run(solver, systems.static_belt(), rtol)
    assert kinds(found) == ["stick", "release", "stick", "release", "stick"]
    slip = 2 * math.pi - 2 * math.atan(1.0)
    ends = np.cumsum([slip, 2.0, slip, 2.0, slip])
    assert [t.time for t in found.transitions] == pytest.approx(ends.tolist(), abs=10 * bound)
    assert found.transitions[0].state == pytest.approx((0.5, 0.5), abs=10 * bound)


@EACH
def test_stribeck_belt(solver: Any, rtol: float, bound: float) -> None:
    found = run(solver, systems.stribeck_belt("30"), rtol)
    assert kinds(found) == ["stick", "release", "stick", "release", "stick"]
    durations = np.diff([t.time for t in found.transitions])
    assert durations == pytest.approx([7.705031769350, 4.295999525480] * 2, abs=100 * bound + 1e-11)


@EACH
def test_crossing_on_a_curved_surface(solver: Any, rtol: float, bound: float) -> None:
    found = run(solver, systems.rotating_crossing(), rtol)
    assert kinds(found) == ["crossing"]
    assert found.transitions[0].time == pytest.approx(1.0, abs=10 * bound)
    x, y = found.transitions[0].state
    assert math.hypot(x, y) == pytest.approx(1.0, abs=1e-14)


@EACH
def test_relay_feedback_releases_where_lambert_s_w_says(solver: Any, rtol: float, bound: float) -> None:
    found = run(solver, systems.relay_feedback("3"), rtol)
    assert kinds(found) == ["release"]
    assert found.transitions[0].time == pytest.approx(2.812403376023301, abs=100 * bound)


@pytest.mark.parametrize(
    ("solver", "rtol", "bound"), [LADDER[0], LADDER[1], LADDER[6], LADDER[8]], ids=lambda v: getattr(v, "name", "")
)
def test_three_blocks_come_to_rest_one_after_another(solver: Any, rtol: float, bound: float) -> None:
    found = run(solver, systems.three_blocks(), rtol)
    assert [(t.kind, t.surface) for t in found.transitions] == [
        ("crossing", 1), ("crossing", 0), ("crossing", 2), ("crossing", 1), ("crossing", 0),
        ("stick", 0), ("stick", 2), ("stick", 1),
    ]  # fmt: skip
    assert found.end_mode == (0, 0, 0)
    # Digits of the certified truth of the case three_blocks.
    assert found.transitions[-1].time == pytest.approx(3.927104415444, abs=10 * bound + 1e-12)


@EACH
def test_blow_up_is_divergence_at_its_time(solver: Any, rtol: float, bound: float) -> None:
    found = run(solver, systems.blow_up(), rtol)
    assert found.status == "diverged"
    assert found.end_time == pytest.approx(1.0, abs=100 * bound + 1e-11)


@EACH
def test_a_field_that_ends_is_a_failure_in_the_library_s_words(solver: Any, rtol: float, bound: float) -> None:
    # x' = sqrt(1/2 - x) + 1: no value beyond x = 1/2, which is reached with speed.
    x, s = sp.symbols("x s", real=True)
    system = FilippovSystem((x,), (s,), (x + 1,), (1 + sp.sqrt(sp.Rational(1, 2) - x),))
    problem = Problem(system, sp.Integer(0), (sp.Integer(0),), sp.Integer(3))
    found = run(solver, problem, rtol)
    assert found.status == "failed"
    assert found.reason
    assert found.end_time < 0.4


@EACH
def test_accumulating_events_end(solver: Any, rtol: float, bound: float) -> None:
    found = run(solver, systems.twisting(), rtol)
    assert found.status == "failed"
    assert found.end_time == pytest.approx(3.2320508075688776, abs=1e-2)
    assert "accumulate" in found.reason


@pytest.mark.parametrize("solver", [s for s, _, _ in LADDER if s is not HEYOKA], ids=lambda s: s.name)
def test_a_deadline_is_kept_inside_the_library(solver: Any) -> None:
    found = run(solver, systems.fig8(until="100000"), 1e-9, deadline=0.05)
    assert found.status == "timeout"
    assert found.end_time < 100.0


def test_heyoka_looks_at_the_clock_too() -> None:
    found = run(HEYOKA, systems.fig8(until="100000"), 1e-15, deadline=0.05)
    assert found.status == "timeout"


@pytest.mark.parametrize("solver", [RK45, DOP853, RADAU], ids=lambda s: s.name)
def test_samples_do_not_change_the_run(solver: Any) -> None:
    """SciPy's are drawn where the reference cannot be; nobody asks the other libraries."""
    asked = np.array([0.0, 2.0, 4.0, 4.5, 15.0])
    problem = systems.free_coulomb()
    plain, sampled = run(solver, problem, 1e-8), run(solver, problem, 1e-8, sample_times=asked)
    assert [t.time for t in plain.transitions] == [t.time for t in sampled.transitions]
    assert plain.counts.steps == sampled.counts.steps
    want = [5.3, 0.6 + 4.7 * math.cos(2.0), -0.6 + 3.5 * math.cos(4.0), -0.6 + 3.5 * math.cos(4.5), 0.5]
    assert sampled.samples[:, 0] == pytest.approx(want, abs=1e-5)
    assert sampled.sample_modes == ((-1,), (-1,), (1,), (1,), (0,))
    assert run(HEYOKA, problem, 1e-8, sample_times=asked).samples is None


@pytest.mark.parametrize("plain", daily([DOP853, ADAMS, IDA], some=[DOP853]), ids=lambda s: s.name)
def test_compiled_callbacks_change_nothing_but_the_price(plain: Any) -> None:
    compiled = registry.solver(plain.name + registry.COMPILED)
    problem = systems.free_coulomb(until="4")
    first, second = run(plain, problem, 1e-8), run(compiled, problem, 1e-8)
    assert first.counts.steps == second.counts.steps
    assert first.counts.rhs_evaluations == second.counts.rhs_evaluations
    assert [t.time for t in first.transitions] == pytest.approx([t.time for t in second.transitions], abs=1e-13)


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    # CVODE's steps underflow (its logger warns) before it fails (scikit-sundae prints); heyoka's root finder gives up.
    run(CVODE_BDF, systems.blow_up(), 1e-6)
    run(HEYOKA, systems.twisting(), 1e-16)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("solver", [HEYOKA, DOP853, ADAMS, IDA], ids=lambda s: s.name)
def test_a_surface_in_time_alone_moves_no_state(solver: Any) -> None:
    # x' = s, s = sgn(t - 1): its gradient in x is zero, so there is nothing to project along.
    x, s = sp.symbols("x s", real=True)
    problem = Problem(FilippovSystem((x,), (s,), (TIME - 1,), (s,)), sp.Integer(0), (sp.Integer(3),), sp.Integer(2))
    found = run(solver, problem, 1e-9)
    assert [(t.kind, t.time) for t in found.transitions] == [("crossing", pytest.approx(1.0, abs=1e-9))]
    assert found.end_state[0] == pytest.approx(3.0, abs=1e-8)


def test_heyoka_sees_a_cube_at_zero() -> None:
    # As a power, x**3 expands to NaN at x = 0 in heyoka 7.13: the guard is lost, and a field with it.
    x, s = sp.symbols("x s", real=True)
    system = FilippovSystem((x,), (s,), (x**3 + x - 2,), (sp.Rational(1, 2) + x**3,))
    found = run(HEYOKA, Problem(system, sp.Integer(0), (sp.Integer(0),), sp.Integer(2)), 1e-15)
    assert kinds(found) == ["crossing"]
    assert found.transitions[0].state[0] == pytest.approx(1.0, abs=1e-15)


def test_growth_beyond_1e12_is_not_blow_up() -> None:
    x, s = sp.symbols("x s", real=True)
    problem = Problem(FilippovSystem((x,), (s,), (x + 1,), (20 * x,)), sp.Integer(0), (sp.Integer(1),), sp.Integer(2))
    for solver in (HEYOKA, DOP853, ADAMS):
        found = run(solver, problem, 1e-12)
        assert found.status == "ok"
        assert found.end_state[0] == pytest.approx(math.exp(40), rel=1e-9)
