"""Guards that lie below their own rounding decide nothing."""

from __future__ import annotations

import math
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
import sympy as sp
from derivatives import fundamental_matrix
from problems import make_problem

import henon_ref as hr
from henon_ref.integrator import mode_changes
from henon_ref.modes.decision import Decision

TOLERANCES = pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-11, 1e-15])
PID = ["v", "-4*(x - 1) - 2*z - 2*v - s", "x - 1"]


def kinds(run: Any) -> list[str]:
    return [t.kind for t in run.trajectory.transitions]


def assert_each_mode_follows(run: Any) -> None:
    """Each transition begins in the mode in which the last one ends, and the run ends in the last mode."""
    transitions = run.trajectory.transitions
    later = [(one, other) for one, other in pairwise(transitions) if one.time < other.time]
    assert all(one.to_mode == other.from_mode for one, other in later)
    assert transitions[-1].to_mode == run.trajectory.end_mode


@TOLERANCES
def test_a_speed_that_decays_below_its_rounding_is_no_stick(rtol: float) -> None:
    """A mass under PID control (arXiv 2006.08977): the exact speed stays below zero after the release."""
    system = hr.System(["x", "v", "z"], {}, {"s": "v"}, PID)
    run = hr.simulate(system, {"x": 0, "v": 0, "z": 0}, until=200, rtol=rtol)
    assert (run.status, kinds(run), run.final_mode) == ("ok", ["stick", "release"], "s=-1")
    assert 50 < run.undecided_after["s"] < 70
    assert run.y[:, -1] == pytest.approx([1, 0, 0.5], abs=1e-13)


def test_a_surface_that_was_below_its_rounding_goes_on_to_act() -> None:
    """A push at 100 s: the motion is the one that begins shortly before it."""
    field = [PID[0], f"{PID[1]} + 5*exp(-(t - 100)^2)", PID[2]]
    system = hr.System(["x", "v", "z"], {}, {"s": "v"}, field)
    run = hr.simulate(system, {"x": 0, "v": 0, "z": 0}, until=110)
    late = hr.simulate(system, {"x": 1, "v": -1e-9, "z": "1/2"}, start=90, until=110)
    assert kinds(late) == ["stick", "release", "crossing", "stick", "release"]
    assert (run.status, kinds(run)) == ("ok", ["stick", "release", *kinds(late)])
    assert 90 < run.transitions.time_s[2] < 98  # the speed before the push is far below its rounding
    assert run.transitions.time_s[3:].tolist() == pytest.approx(late.transitions.time_s[1:].tolist(), abs=1e-8)
    assert_each_mode_follows(run)
    assert run.y[:, -1] == pytest.approx(late.y[:, -1], abs=1e-9)
    assert run.final_mode == late.final_mode


@TOLERANCES
def test_impacts_after_an_undecided_touch_are_told(rtol: float) -> None:
    """The ball touches at t = 1, is pushed away up to t = 2, falls, comes to rest, and is lifted off at t = 4."""
    force = "piecewise(2/3, t < 2, piecewise(-6, t < 4, 1))"
    ball = hr.System(["x", "v"], {"e": "1/2"}, {"s": "x"}, ["v", force], resets={"s": {"map": {"v": "-e*v"}}})
    initial = {"x": "1/3", "v": "-2/3"}
    run = hr.simulate(ball, initial, until=5, rtol=rtol)
    resets, (crossing, *others) = run.transitions[run.transitions.kind == "reset"], kinds(run)
    assert (run.status, crossing) == ("ok", "crossing")
    assert others == [*["reset"] * len(resets), "stick", "release", "crossing"]
    assert run.undecided_after == {"s": pytest.approx(1, abs=1e-7)}
    first, flight = 2 + (1 + math.sqrt(10)) / 9, 2 * math.sqrt(10) / 9
    times = [first + flight * (1 - 0.5**k) for k in range(len(resets))]
    assert len(times) > 20
    assert resets.time_s.tolist() == pytest.approx(times, abs=1e-9)
    assert run.sticks.iloc[0].to_list() == [pytest.approx(first + flight), pytest.approx(4 - first - flight), "s"]
    assert_each_mode_follows(run)
    assert run.y[:, -1] == pytest.approx([0.5, 1], abs=1e-9)
    assert hr.simulate(ball, initial, until=5, stop={"s": "falling"}).t[-1] == pytest.approx(first)
    swept = hr.sweep(ball, initial, until=5, rtol=rtol, grid={"e": [0.25, 0.5]}, observe=[hr.observe.sticks()], jobs=1)
    assert swept.stick_count.tolist() == [1, 1]
    assert swept.last_stick_duration[1] == pytest.approx(run.sticks.duration_s[0], abs=1e-9)


def touching(rest: str, below: str) -> tuple[hr.System, dict[str, str]]:
    """x - 1/3 = (t - 1)^2 times a polynomial above the surface; the crossing of c uses up the digits of the start."""
    height = sp.sympify(f"(t - 1)^2*({rest})".replace("^", "**"), rational=True)
    speed, force = (sp.diff(height, "t", k) for k in (1, 2))
    field = ["v", f"(1 + s)/2*({force}) + (1 - s)/2*({below})"]
    start = {"x": str(height.subs("t", 0) + sp.Rational(1, 3)), "v": str(speed.subs("t", 0))}
    return hr.System(["x", "v"], {}, {"c": "t - 1/2", "s": "x - 1/3"}, field), start


@pytest.mark.parametrize(
    ("rest", "crossing", "ends"),
    [("3 - t", 3.0, -4.5), ("(3 - t)^3", 3.0, -0.5)],  # with a speed of -4; at a root of third order
)
def test_a_crossing_on_the_step_behind_an_undecided_touch_changes_the_mode(
    rest: str, crossing: float, ends: float
) -> None:
    system, start = touching(rest, "-1")
    run = hr.simulate(system, start, until=4)
    assert (run.status, kinds(run)) == ("ok", ["crossing", "crossing"])
    assert run.undecided_after == {"s": pytest.approx(1, abs=1e-7)}
    assert run.transitions.time_s[1] == pytest.approx(crossing, abs=1e-4)
    assert run.y[0, -1] == pytest.approx(1 / 3 + ends, abs=1e-4)
    assert (run.final_mode, run.mode(3.5)) == ("c=+1 s=-1", {"c": 1, "s": -1})


@pytest.mark.parametrize("gap", ["1e-3", "1e-4", "1e-5", "1e-6"])
def test_a_close_pair_behind_an_undecided_touch_is_told(gap: str) -> None:
    """x crosses at 3 -+ gap, and lies at most 4 gap^2 below the surface."""
    height = f"(t - 3)^2 - {gap}^2"
    force = str(sp.diff(sp.sympify(f"(t - 1)**2*({height})".replace("^", "**"), rational=True), "t", 2))
    system, start = touching(height, force)
    run = hr.simulate(system, start, until=3.5)
    assert (run.status, kinds(run)) == ("ok", ["crossing"] * 3)
    assert run.undecided_after == {"s": pytest.approx(1, abs=1e-7)}
    off = float(gap)
    assert run.transitions.time_s[1:].tolist() == pytest.approx([3 - off, 3 + off], abs=1e-4 * off + 1e-14 / off)


def test_derivatives_know_of_transitions_behind_an_undecided_touch() -> None:
    """The derivative by the start: free motions, and the saltation at t = 3, where the force jumps by 7 at speed -4."""
    field = ["v", "(1 + s)/2*(10 - 6*t) - (1 - s)/2"]
    problem = make_problem("x v", field, {"c": "t - 1/2", "s": "x - 1/3"}, ["10/3", -7], 4)
    found, rank = fundamental_matrix(problem, sp.Integer(0), sp.Integer(4), tolerance=1e-14)
    assert rank == 2
    assert found == pytest.approx(np.array([[-3 / 4, -5 / 4], [-7 / 4, -17 / 4]]), abs=1e-9)


@pytest.mark.parametrize("centre", ["1", "1/3", "1e5"])
def test_a_damped_oscillation_about_a_surface_is_told_down_to_rounding(centre: str) -> None:
    """x - c = -c exp(-t/10) (...): a crossing each half period, pi/sqrt(0.99)."""
    system = hr.System(["x", "v"], {"c": centre}, {"s": "x - c"}, ["v", "-(x - c) - v/5"])
    run = hr.simulate(system, {"x": 0, "v": 0}, until=1000)
    times = run.transitions.time_s.to_numpy()
    first = (math.pi - math.acos(0.1)) / math.sqrt(0.99)
    assert run.status == "ok"
    assert times[:60] == pytest.approx([first + k * math.pi / math.sqrt(0.99) for k in range(60)], abs=1e-6)
    assert 250 < times[-1] < run.undecided_after["s"] < 400


def test_a_threshold_that_is_approached_for_ever_is_not_crossed() -> None:
    """A neuron whose current just does not suffice, its voltage decaying along two directions."""
    field = ["1 - u + (w - 1)/3", "(1 - w)/2"]
    neuron = hr.System(["u", "w"], {}, {"s": "1 - u"}, field, resets={"s": {"map": {"u": "0"}}})
    run = hr.simulate(neuron, {"u": 0, "w": 0}, until=200)
    assert (run.status, kinds(run)) == ("ok", [])
    assert run.y[0, -1] == pytest.approx(1, abs=1e-13)


@pytest.mark.parametrize("scale", [1, 1e-9, 1e12])
def test_ordinary_runs_are_decided_whatever_their_units(scale: float) -> None:
    system = hr.System(["x", "v"], {"a": scale}, {"s": "v"}, ["v", "-x - a*s"])
    run = hr.simulate(system, {"x": 10.5 * scale, "v": 0}, until=30)
    assert (kinds(run), run.undecided_after) == ([*["crossing"] * 4, "stick"], {})


@TOLERANCES
@pytest.mark.parametrize(("initial", "touches"), [((1, 0), 15), ((0, 1), 16)])
def test_touches_that_repeat_are_all_told(initial: tuple[int, int], touches: int, rtol: float) -> None:
    """x = cos t, or sin t, touches 1 once a period; multiprecision has the digits as long as the first mode lasts."""
    system = hr.System(["x", "v"], {}, {"s": "x - 1"}, ["v", "-x + 3*(1 + s)/10"])
    run = hr.simulate(system, dict(zip("xv", initial, strict=True)), until=100, rtol=rtol)
    assert (run.status, kinds(run)) == ("ok", ["graze"] * touches)
    first = math.pi / 2 if initial[0] == 0 else 2 * math.pi
    times = [first + 2 * math.pi * k for k in range(touches)]
    assert run.transitions.time_s.tolist() == pytest.approx(times, rel=1e-15)


def test_a_touch_behind_a_change_of_mode_is_told_always_or_never() -> None:
    """What the last bits make of its height is no answer."""
    system = hr.System(["x", "v"], {}, {"c": "t - 1", "s": "x - 1"}, ["v", "-x"])
    run = hr.simulate(system, {"x": 0, "v": 1}, until=30, rtol=1e-15)
    assert (run.status, kinds(run)) == ("ok", ["crossing"])
    assert run.undecided_after == {"s": pytest.approx(math.pi / 2, abs=0.1)}


@TOLERANCES
def test_a_touch_at_a_visible_two_fold_is_not_unique(rtol: float) -> None:
    """y = x^2/2 meets y = 0 at x = 0, from where the arc below and a repelling slide lead on as well."""
    field = ["1", "(1 + s)/2*x - (1 - s)/2*x"]
    run = hr.simulate(hr.System(["x", "y"], {}, {"s": "y"}, field), {"x": -1, "y": "1/2"}, until=2, rtol=rtol)
    assert (run.status, run.trajectory.end_time) == ("nonunique", pytest.approx(1, abs=1e-12))


@pytest.mark.parametrize(
    ("below", "status"), [("-1", "nonunique"), ("-x", "nonunique"), ("1", "ok"), ("x", "ok"), ("1 + x", "ok")]
)
def test_a_touch_is_unique_unless_the_other_side_leads_away(below: str, status: str) -> None:
    field = ["1", f"(1 + s)/2*x + (1 - s)/2*({below})"]
    run = hr.simulate(hr.System(["x", "y"], {}, {"s": "y"}, field), {"x": -1, "y": "1/2"}, until=2)
    assert run.status == status
    assert kinds(run) == (["graze"] if status == "ok" else [])


@pytest.mark.parametrize("force", [1, 1e100, 1e155, 1e160, 1e200, 1.7e308])
def test_a_block_stops_where_it_does_whatever_the_force(force: float) -> None:
    """After v^2/(2 F): times and states far below 1 are powers of a unit that would be no doubles."""
    block = hr.System(["x", "v"], {"F": 0.5}, {"s": "v"}, ["v", "-F*s"])
    run = hr.simulate(block, {"x": 0, "v": 1}, until=9, parameters={"F": force})
    assert (run.status, kinds(run)) == ("ok", ["stick"])
    assert run.y[0, -1] == pytest.approx(0.5 / force, rel=1e-9)


@pytest.mark.parametrize("speed", [5e-324, 1e-310, 1e-300])
def test_the_smallest_speeds_stick_at_once(speed: float) -> None:
    block = hr.System(["x", "v"], {"F": 1}, {"s": "v"}, ["v", "-F*s"])
    run = hr.simulate(block, {"x": 0, "v": speed}, until=9)
    assert (run.status, kinds(run)) == ("ok", ["stick"])
    assert all(map(math.isfinite, run.y.ravel().tolist()))


@pytest.mark.parametrize("until", [1.0, 2.0])  # the jump is at the horizon, or before it
def test_a_jump_to_what_no_double_holds_is_not_ok(until: float) -> None:
    system = hr.System(["x", "v"], {}, {"s": "x"}, ["-1", "0"], resets={"s": {"map": {"x": "1", "v": "1e200*v*1e200"}}})
    run = hr.simulate(system, {"x": 1, "v": 1}, until=until)
    assert run.status == "diverged"


@pytest.mark.parametrize(
    "surface",
    [
        "x*(1 - y) - x",
        "1e13*(x*(1 - y) - x)",
        "exp(y)*x - x",
        pytest.param("sqrt(1 + y)*x - x", marks=pytest.mark.slow),  # 18 s of multiprecision; daily: the others
        "(x + y)^2 - x^2",
        "sin(x + y) - sin(x)*cos(y)",
    ],
)
def test_terms_that_cancel_in_a_surface_decide_nothing_below_their_rounding(surface: str) -> None:
    """y decays to exp(-100) and keeps its sign, and so does what is y times a number in exact arithmetic."""
    system = hr.System(["x", "y"], {}, {"s": surface}, ["x*cos(t)/3", "-y"])
    run = hr.simulate(system, {"x": 3, "y": 1}, until=100)
    assert (run.status, kinds(run)) == ("ok", [])
    assert 33 < run.undecided_after["s"] < 42
    assert run.y[0, -1] == pytest.approx(3 * math.exp(math.sin(100) / 3), rel=1e-9)


def test_crossings_of_terms_that_cancel_are_told_down_to_their_rounding() -> None:
    """x (1 - y) - x is -x y, and y = exp(-t/5) cos(t)."""
    system = hr.System(["x", "y", "z"], {}, {"s": "x*(1 - y) - x"}, ["x*cos(t)/3", "z - y/5", "-y - z/5"])
    run = hr.simulate(system, {"x": 3, "y": 1, "z": 0}, until=400)
    times = run.transitions.time_s.to_numpy()
    assert (run.status, set(kinds(run))) == ("ok", {"crossing"})
    assert times[:40] == pytest.approx([math.pi / 2 + k * math.pi for k in range(40)], abs=1e-4)
    assert 150 < times[-1] < run.undecided_after["s"] < 180


@pytest.mark.parametrize("rtol", [10.0**-k for k in range(3, 14)])
def test_a_function_that_rounding_makes_zero_is_told(rtol: float) -> None:
    """v - 1 = -exp(-10 t) (1 + 1e-18) + 1e-18 reaches 0, and sticks, at 1.8 ln 10 s; 1 + 1e-17/10 is 1 in doubles."""
    fields, others = (
        ("-10*(v - 1) - s/10^17", "-10*(v - 1)"),
        ({}, {"u": "x - 99"}, {f"u{k}": f"x - 9{k}" for k in range(4)}),
    )
    for field, other in product(fields, others):
        system = hr.System(["v", "x"], {}, {"s": "v - 1", **other}, [field, "v"])
        run = hr.simulate(system, {"v": 0, "x": 0}, until=10, rtol=rtol)
        assert (run.status, kinds(run)) == ("ok", [])
        assert 3.5 < run.undecided_after["s"] < 4.1


def test_a_range_of_validity_that_is_reached_within_rounding_is_named() -> None:
    """1 - x decays to rounding: at t = ln(2^53) = 36.7 at the latest no sign of it is known."""
    system = hr.System(["x"], {}, {"s": "x - 2"}, ["1 - x"], valid=["1 - x", "x + 1"])
    run = hr.simulate(system, {"x": 0}, until=60)
    assert (run.status, list(run.undecided_after)) == ("ok", ["valid"])
    assert 30 < run.undecided_after["valid"] < 45
    assert "decided until t = " in repr(run)


@pytest.mark.parametrize("rtol", [1e-4, 1e-9])
def test_a_section_on_which_a_mode_slides_is_not_undecided(rtol: float) -> None:
    """Its function stays zero while two bodies stick together."""
    system = hr.System(["v", "w"], {}, {"s": "v - w", "u": "v - w"}, ["sin(t)/3 - s - v/7", "s/3 - w/27"])
    run = hr.simulate(system, {"v": 1, "w": 0}, until=20, rtol=rtol)
    assert (run.status, run.undecided_after) == ("ok", {})


@pytest.mark.parametrize(
    ("surface", "field", "start"),
    [
        ("v", ["1", "0"], (0, 0)),  # zero in exact arithmetic, whatever the rounding of x
        ("x", ["v", "-x"], (0, 0)),
        ("x - 1", ["v", "-x"], (1, 0)),  # the start of a fall
        ("x - 1/3", ["v", "v"], ("1/3", "1e-9")),
    ],
)
def test_a_start_on_a_surface_that_is_decided_is_not_undecided(surface: str, field: list[str], start: tuple) -> None:
    run = hr.simulate(hr.System(["x", "v"], {}, {"s": surface}, field), dict(zip("xv", start, strict=True)), until=3)
    assert (run.status, run.undecided_after) == ("ok", {})


@pytest.mark.parametrize("rtol", [2e-3, 1e-3, 2e-7, 1e-7, 1e-10])
def test_a_section_ends_no_run(rtol: float) -> None:
    """The energy of a circular orbit drifts by more than rounding, and its sign is in no force."""
    energy = "(u^2 + w^2)/2 - 1/sqrt(x^2 + y^2) + 1/2"
    orbit = hr.System(["x", "y", "u", "w"], {}, {"s": energy}, ["u", "w", *(f"-{x}/(x^2 + y^2)^(3/2)" for x in "xy")])
    run = hr.simulate(orbit, {"x": 1, "y": 0, "u": 0, "w": 1}, until=2, rtol=rtol)
    assert (run.status, run.undecided_after) == ("ok", {"s": 0.0})
    assert run.y[:2, -1] == pytest.approx([math.cos(2), math.sin(2)], abs=10 * rtol)


@pytest.mark.parametrize("unit", [1.0, 1e-13])
def test_a_run_that_ends_beyond_a_surface_of_its_mode_is_not_ok(unit: float, monkeypatch: pytest.MonkeyPatch) -> None:
    # No decision is known to be wrong, so one is made wrong: it keeps the mode in which both surfaces are reached.
    monkeypatch.setattr(mode_changes, "after_event", lambda at, mode, hits, **_: Decision("unique", mode))
    field = [f"(3 + u)/2/{unit!r}", f"((3 + s)/2 + y - x)/{unit!r}"]
    system = hr.System(["x", "y"], {}, {"s": "x", "u": "y"}, field)
    run = hr.simulate(system, {"x": -1, "y": -1}, until=2 * unit)
    assert (run.status, run.final_mode, run.y[:, -1].tolist()) == ("failed", "s=-1 u=-1", [1, 1])
    assert "is beyond a surface of its mode" in run.message
    swept = hr.sweep(system, {"x": -1, "y": -1}, until=2 * unit, grid={"y": [-1, -1]}, jobs=1)
    assert swept["status"].tolist() == ["failed", "failed"]
