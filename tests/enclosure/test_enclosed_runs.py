"""Certified runs: closed forms lie inside the enclosures, and what cannot be proven is said to be so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import pytest
import sympy as sp
import systems
from flint import arb, ctx
from problems import make_problem

from henon_ref.enclosure import run as enclosed
from henon_ref.enclosure.balls import enclose
from henon_ref.enclosure.event import Hit
from henon_ref.enclosure.flow import ValidatedFlow
from henon_ref.enclosure.run import CertifiedRun, certify
from henon_ref.modes.problem import Problem

RADIUS = 1e-30


def check_times(run: CertifiedRun, exact: Sequence[sp.Expr]) -> None:
    """Every exact time lies in its enclosure, and there are as many."""
    assert run.status == "certified", run.reason
    assert len(run.transitions) == len(exact)
    assert run.radius <= RADIUS
    with ctx.workprec(2 * run.bits):
        for transition, time in zip(run.transitions, exact, strict=True):
            assert transition.time.overlaps(enclose(time)), (transition.time, time)


def test_free_coulomb_turns_and_sticks_for_good() -> None:
    run = certify(systems.free_coulomb())
    check_times(run, [sp.pi, 2 * sp.pi, 3 * sp.pi, 4 * sp.pi])
    assert [t.kind for t in run.transitions] == ["crossing", "crossing", "crossing", "stick"]
    assert run.mode == (0,)
    assert run.state[0].contains(arb(1) / 2)
    assert run.transitions[-1].state[1] == 0, "the surface is linear in v: v is exactly zero on it"


def test_leaving_slide() -> None:
    run = certify(systems.leaving_slide())
    check_times(run, [sp.Integer(1)])
    assert run.transitions[0].kind == "release"
    assert run.state[0].contains(2), "x(3) = (3 - 1)^2 / 2"


def test_static_belt_releases_where_the_override_says() -> None:
    slip, stick = 3 * sp.pi / 2, sp.Integer(2)
    run = certify(systems.static_belt("14"))
    check_times(run, [slip, slip + stick, 2 * slip + stick, 2 * slip + 2 * stick])
    assert [t.kind for t in run.transitions] == ["stick", "release"] * 2


def test_crossing_on_a_curved_surface() -> None:
    run = certify(systems.rotating_crossing())
    check_times(run, [sp.Integer(1)])
    assert run.transitions[0].state[0].contains(1)
    assert run.transitions[0].state[1].contains(0)


def test_twisting_crosses_two_surfaces_in_turn() -> None:
    """From (0, v0): x1 turns after v0/3, comes back after v0/sqrt(3), and so on with v0 q."""
    run = certify(systems.twisting("2.2"))
    first, ratio = sp.Rational(3, 2), 1 / sp.sqrt(3)
    turn, back = first / 3, first / 3 + first / sp.sqrt(3)
    again = (first * ratio) / 3
    check_times(run, [turn, back, back + again, back * (1 + ratio)])


def test_relay_feedback_first_release(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first release is a Lambert W expression; the digits are those of FACTS."""
    monkeypatch.setattr(enclosed, "MAX_TRANSITIONS", 4)
    run = certify(systems.relay_feedback("5.4"))
    assert run.ended == "budget"
    assert float(run.transitions[0].time) == pytest.approx(2.812403376023301, abs=1e-15)
    assert [t.kind for t in run.transitions] == ["release", "stick", "release", "stick"]
    assert run.radius <= RADIUS


def test_forced_coulomb_on_its_orbit() -> None:
    """Den Hartog's orbit without stops: from (x0, 0) the turns are at k pi / 2."""
    # With P = 1, W = 2, F = 1/5: V = -1/3, U = 1/2.
    start = "sqrt(1/9 - 1/100)"
    drive = f"-3*{start}*cos(2*t) - 3/10*sin(2*t)"
    made = make_problem("x v", ["v", f"-x + {drive} - s/5"], {"s": "v"}, [start, 0], 6)
    run = certify(made)
    check_times(run, [sp.pi / 2, sp.pi, 3 * sp.pi / 2])


def test_radius_asked_is_met_by_more_bits() -> None:
    belt = systems.stribeck_belt("13")
    coarse, fine = certify(belt, radius=1e-12), certify(belt, radius=1e-70)
    assert fine.bits > coarse.bits
    assert fine.radius <= 1e-70
    assert coarse.radius <= 1e-12
    for a, b in zip(coarse.transitions, fine.transitions, strict=True):
        assert a.time.contains(b.time)
    with ctx.workprec(300):
        landing, release = (t.time for t in fine.transitions)
        assert float(release - landing) == pytest.approx(7.705031769350, abs=1e-12)


def test_fig8_start_at_a_tangent_point_is_decided_exactly() -> None:
    """h = h' = 0 at the start of Fig. 8: an algebraic identity in sin(pi/18), told by algebra and not by digits."""
    run = certify(systems.fig8("equations", "1"))
    assert run.status == "certified"
    assert [t.from_mode for t in run.transitions] == [(1,)]
    limit = certify(systems.fig8("listing_limit", "1.5"))
    assert [(t.kind, t.to_mode) for t in limit.transitions] == [("release", (-1,)), ("crossing", (1,))]


def test_radius_does_not_wrap() -> None:
    """An undamped oscillator for 200 time units: the set turns, its size grows no faster than the rounding adds up."""
    x, v, s = systems.X, systems.V, systems.S
    system = systems.FilippovSystem((x, v), (s,), (x - 2,), (v, -x + 0 * s))
    run = certify(Problem(system, sp.Integer(0), (sp.Integer(1), sp.Integer(0)), sp.Integer(200)))
    assert run.status == "certified"
    with ctx.workprec(300):
        assert run.state[0].contains(enclose(sp.cos(200)))
    assert float(run.state[0].rad()) < 1e-37


def ballistic(gap: sp.Expr, until: object = 2) -> Problem:
    """x = 2 t - t^2 under a surface ``gap`` below its top: roots at 1 -+ sqrt(gap)."""
    system = systems.FilippovSystem(
        (systems.X, systems.V), (systems.S,), (systems.X - 1 + gap,), (systems.V, sp.Integer(-2))
    )
    return Problem(system, sp.Integer(0), (sp.Integer(0), sp.Integer(2)), sp.sympify(until))


def test_grazing_is_not_provable() -> None:
    run = certify(ballistic(sp.Integer(0)))
    assert (run.status, run.ended) == ("not provable", "undecided")
    assert "graze" in run.reason
    assert "t = 1" in run.reason
    assert run.transitions == ()


def test_near_grazes_are_told_apart() -> None:
    gap = sp.Rational(1, 10**24)
    hit, missed = certify(ballistic(gap)), certify(ballistic(-gap))
    check_times(hit, [1 - sp.sqrt(gap), 1 + sp.sqrt(gap)])
    check_times(missed, [])


def test_an_event_at_the_horizon_is_a_tie() -> None:
    run = certify(ballistic(sp.Rational(1, 4), sp.Rational(1, 2)))
    assert run.status == "not provable"
    assert "at the horizon" in run.reason


def test_two_guards_at_once_are_a_tie() -> None:
    run = certify(make_problem("x y", ["1", "2"], {"a": "x - 1", "b": "y - 2"}, [0, 0], 2))
    assert run.status == "not provable"
    assert "tie" in run.reason


def test_a_spontaneous_switch_is_proven_not_unique() -> None:
    run = certify(systems.spontaneous_switch())
    assert (run.status, run.ended) == ("not provable", "nonunique")
    assert "not unique" in run.reason


def test_blow_up_ends_with_its_time() -> None:
    run = certify(systems.blow_up(), radius=1e-15)
    assert run.ended == "budget"
    assert "singularity" in run.reason
    assert float(run.time) == pytest.approx(1, abs=1e-20)


def test_the_model_ends_with_proof() -> None:
    run = certify(make_problem("x", ["-1"], {"s": "x + 1"}, [1], 3, valid=["x - 1/3"]))
    assert (run.status, run.ended) == ("certified", "invalid")
    assert run.time.contains(arb(2) / 3) or abs(run.time - arb(2) / 3) < 1e-15


def test_deadline_and_budget_return_what_is_proven(monkeypatch: pytest.MonkeyPatch) -> None:
    late = certify(systems.fig8("equations", "70"), deadline=0.0)
    assert (late.status, late.ended) == ("not provable", "budget")
    assert "deadline" in late.reason
    monkeypatch.setattr(enclosed, "MAX_TRANSITIONS", 2)
    few = certify(systems.free_coulomb())
    assert len(few.transitions) == 2


@pytest.mark.parametrize(
    ("first", "later", "busy", "reason"),
    [
        pytest.param(59.0, 1e-4, 1.0, "stopped after 1 transitions", id="slow preparation"),
        pytest.param(0.0, 25.0, 0.01, "the deadline passed at t = ", id="other work on the machine"),
        pytest.param(0.0, 3.0, 1.0, "at the pace up to t = ", id="slow steps"),
    ],
)
def test_pace_is_that_of_the_steps_after_the_first(
    monkeypatch: pytest.MonkeyPatch, first: float, later: float, busy: float, reason: str
) -> None:
    """A minute is allowed. ``busy``: part of the steps' time for which the proof has a processor."""
    now, step = [0.0, 0.0], ValidatedFlow.step

    def timed(flow: ValidatedFlow, horizon: arb) -> Hit | None:
        taken = later if flow.steps else first
        now[:] = now[0] + taken, now[1] + busy * taken
        return step(flow, horizon)

    monkeypatch.setattr(enclosed, "clock", SimpleNamespace(monotonic=lambda: now[0], thread_time=lambda: now[1]))
    monkeypatch.setattr(ValidatedFlow, "step", timed)
    monkeypatch.setattr(enclosed, "MAX_TRANSITIONS", 1)
    run = certify(systems.fig8("equations", "70"), deadline=60.0)
    assert run.ended == "budget"
    assert reason in run.reason


def test_units_of_a_billionth_change_no_digit() -> None:
    """The Stribeck belt with time and length scaled: the transitions scale with it."""
    plain = certify(systems.stribeck_belt("9"))
    scaled = make_problem(
        "x v",
        ["v", "-10**18*x - 10**9*s/(1 + 3*10**0*s*(v - 1/5))"],
        {"s": "v - 1/5"},
        ["10**(-9)", "1/5"],
        "9/10**9",
    )
    run = certify(scaled, radius=1e-39)
    assert run.status == "certified", run.reason
    with ctx.workprec(300):
        for a, b in zip(plain.transitions, run.transitions, strict=True):
            assert a.time.overlaps(b.time * 10**9)


def test_accumulating_events_are_called_so() -> None:
    run = certify(systems.twisting())
    assert (run.status, run.ended) == ("not provable", "budget")
    assert run.reason.startswith("events accumulate at t = 3.23205080757")
    assert len(run.transitions) > 50
    assert run.radius <= RADIUS


def test_an_override_that_leaves_its_surface_is_refused() -> None:
    """All that follows a stick takes the surface for zero, so that it has to be."""
    belt = systems.static_belt("14")
    stick = belt.system.overrides[0]
    drifting = replace(stick, field=(stick.field[0], sp.Rational(1, 100)))
    wrong = replace(belt, system=replace(belt.system, overrides={0: drifting}))
    run = certify(wrong)
    assert run.status == "not provable"
    assert "not proven to keep its surface" in run.reason


def test_a_start_outside_the_model_is_told() -> None:
    run = certify(make_problem("x", ["-1"], {"s": "x + 1"}, [1], 3, valid=["x - 2"]))
    assert run.ended == "invalid"
    assert run.transitions == ()


def test_release_from_an_intersection() -> None:
    """x' = t - a - 3b/10, y' = -b - 3a/10 slides on both surfaces until a reaches 1, at t = 91/100.

    The normal velocity after the release is zero by continuity of the field, and by nothing that algebra on the
    surfaces alone could tell.
    """
    run = certify(make_problem("x y", ["t - a - 3*b/10", "-b - 3*a/10"], {"a": "x", "b": "y"}, [0, 0], 2))
    check_times(run, [sp.Rational(91, 100)])
    assert [(t.kind, t.surface, t.to_mode) for t in run.transitions] == [("release", 0, (1, 0))]
    with ctx.workprec(200):
        assert run.state[0].contains(enclose((2 - sp.Rational(91, 100)) ** 2 / 2))
