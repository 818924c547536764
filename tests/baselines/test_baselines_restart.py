"""Each library with each restart, if a guard starts at zero.

The ball: x' = v, v' = -1 above the surface x = 0 from (0, 1): it comes back at t = 2 exactly. A library that
fires at once never leaves; one that is told a direction may never see the ball come down. The slide: a
tangential release, after which the guard starts at zero with no slope.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
import sympy as sp
import systems

from henon_ref.baselines import heyoka_taylor
from henon_ref.baselines.heyoka_taylor import HEYOKA
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import dips, lift, quiet_until
from henon_ref.baselines.scipy_ivp import BDF, DOP853, LSODA, RADAU, RK45
from henon_ref.baselines.sundials import ADAMS, IDA
from henon_ref.baselines.sundials import BDF as CVODE_BDF
from henon_ref.casefile.case import load_case
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem

X, V, S = sp.symbols("x v s", real=True)
ALL = (RK45, DOP853, RADAU, BDF, LSODA, ADAMS, CVODE_BDF, IDA, HEYOKA)


def ball(start: int = 0, speed: int = 1, until: int = 3) -> Problem:
    """Above the surface it falls back; below it nothing pushes."""
    system = FilippovSystem((X, V), (S,), (X,), (V, -(1 + S) / 2))
    return Problem(system, sp.Integer(0), (sp.Integer(start), sp.Integer(speed)), sp.Integer(until))


def times(solver: Any, problem: Problem, rtol: float = 1e-9) -> list[float]:
    found = solver.prepare(problem, rtol=rtol, atol=rtol, deadline=20)()
    return [t.time for t in found.transitions] if found.status == "ok" else [found.status]


@pytest.mark.parametrize("solver", ALL, ids=lambda s: s.name)
def test_by_default_the_ball_comes_down_once(solver: Any) -> None:
    assert times(solver, ball()) == pytest.approx([2.0], abs=1e-7)


@pytest.mark.parametrize("policy", ["offset", "event-free-step"])
@pytest.mark.parametrize("solver", [DOP853, ADAMS, IDA, HEYOKA], ids=lambda s: s.name)
def test_every_library_takes_both_robust_policies(solver: Any, policy: str) -> None:
    assert times(replace(solver, restart=policy), ball()) == pytest.approx([2.0], abs=1e-7)


def test_heyoka_with_a_direction_alone_never_sees_the_ball_come_down() -> None:
    # The guard has been stepped over: the driver says so instead of returning a wrong state.
    found = replace(HEYOKA, restart="direction").prepare(ball(), rtol=1e-15)()
    assert found.status == "failed"
    assert "stepped over" in found.reason


def test_heyoka_takes_an_event_free_step_where_it_has_lost_an_early_root(monkeypatch: pytest.MonkeyPatch) -> None:
    """The guard is below zero without an event then; nobody would know otherwise than by the driver's word."""
    problem = load_case("hard/quick_restick").reading("slow").problem
    assert times(HEYOKA, problem) == pytest.approx([1.0, 1.002], abs=0.01)
    monkeypatch.setattr(heyoka_taylor._Mode, "_is_lost", lambda *_: False)
    found = HEYOKA.prepare(problem, rtol=1e-9)()
    assert (found.status, "stepped over" in found.reason) == ("failed", True)


@pytest.mark.parametrize("solver", [HEYOKA, DOP853], ids=lambda s: s.name)
def test_without_a_policy_the_event_fires_again_where_it_is(solver: Any) -> None:
    found = replace(solver, restart="none").prepare(ball(), rtol=1e-12, atol=1e-12, deadline=20)()
    assert found.status == "failed"
    assert "accumulate" in found.reason
    assert found.end_time == 0.0


def test_cvode_takes_an_exact_zero_out_of_play_by_itself() -> None:
    assert times(replace(ADAMS, restart="direction"), ball()) == pytest.approx([2.0], abs=1e-7)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("solver", ALL, ids=lambda s: s.name)
def test_a_tangential_release_is_not_taken_for_a_stick(solver: Any, rtol: float) -> None:
    found = solver.prepare(systems.leaving_slide(), rtol=rtol, atol=rtol, deadline=20)()
    assert [(t.kind, t.time) for t in found.transitions] == [("release", pytest.approx(1.0, abs=10 * rtol))]
    assert found.end_state[0] == pytest.approx(2.0, abs=20 * rtol)


def test_at_a_loose_tolerance_heyoka_finds_a_tangential_release_off_by_it_and_still_leaves() -> None:
    # Without the lift for the dip there are 130 transitions at 1e-3 here, 4 of them false.
    found = HEYOKA.prepare(systems.fig8(), rtol=1e-3)()
    assert len(found.transitions) == 126


def test_the_lift_is_a_few_roundings_and_covers_the_dip_of_a_release_found_late() -> None:
    mode = ModeFunctions(ball().system, (1,))
    crossing = lift(mode, (0, 2.0, 2.0), 0.0, (0.0, 1.0), 1.0)
    assert 0.0 < crossing < 1e-20
    away = lift(mode, (0, 2.0, 2.0), 0.0, (3.0, 1.0), 1.0)
    assert away == pytest.approx(8 * EPSILON * 3.0, rel=1e-6)
    # x'' = +1 below the surface: the guard -x starts with slope -1e-5 and bend +1: it dips by 5e-11.
    rising = FilippovSystem((X, V), (S,), (X,), (V, sp.Integer(1)))
    late = lift(ModeFunctions(rising, (1,)), (0, 1.0, -1e-5), 0.0, (0.0, -1e-5), 1.0)
    assert late == pytest.approx(1e-10, rel=1e-6)
    assert not dips(1.0, -1e-13)


def test_the_event_free_step_is_as_long_as_the_guard_stays_in_the_noise() -> None:
    mode = ModeFunctions(ball().system, (1,))
    (crossing,) = quiet_until(mode, [(0, 1.0, 1.0)], 0.0, (0.0, 1.0), [1e-9], 1.0)
    assert crossing == pytest.approx(16e-9, rel=1e-6)  # x = t
    (tangent,) = quiet_until(mode, [(0, 1.0, 0.0)], 0.0, (0.0, 0.0), [1e-9], 1.0)
    assert tangent == pytest.approx((16e-9 / 0.5) ** 0.5, rel=1e-6)  # x = -t^2 / 2
    (longest,) = quiet_until(mode, [(0, 1.0, 0.0)], 0.0, (0.0, 0.0), [1e9], 1.0)
    assert longest == 1.0


def test_an_event_free_step_is_made_where_all_modes_have_one_set_of_equations() -> None:
    """A number that tells the modes of a chain apart stands in guards alone: the twin has no such parameter."""
    chain = load_case("classic/block_chain").readings[0].problem
    problem = replace(chain, until=sp.Integer(1))
    found, own = (replace(HEYOKA, restart=way).prepare(problem, rtol=1e-9)() for way in ("event-free-step", "offset"))
    assert [t.to_mode for t in found.transitions] == [t.to_mode for t in own.transitions] != []
    assert [t.time for t in found.transitions] == pytest.approx([t.time for t in own.transitions], abs=1e-9)
