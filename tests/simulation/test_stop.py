"""Runs that end on a surface."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import henon_ref as hr

CASES = Path(__file__).parents[2] / "cases"
WAVE = hr.System(["x", "v"], {}, {"s": "x", "u": "x - 1/2"}, ["v", "-x"])
"""x = cos t: 1/2 is passed at pi/3 (falling) and 5 pi/3 (rising), 0 at pi/2 and 3 pi/2."""
BELT = hr.System(["x", "v"], {"F": 1, "d": 3, "vb": 0.5}, {"s": "v - vb"}, ["v", "-x - F*s/(1 + d*s*(v - vb))"])


@pytest.mark.parametrize("dense", [True, False])
@pytest.mark.parametrize(
    ("stop", "time"),
    [
        ({"s": "falling"}, math.pi / 2),
        ({"s": "rising"}, 3 * math.pi / 2),
        ({"u": "falling"}, math.pi / 3),
        ({"u": "rising"}, 5 * math.pi / 3),
        ({"s": "rising", "u": "rising"}, 3 * math.pi / 2),
        ({"s": "falling", "u": "falling"}, math.pi / 3),
    ],
)
def test_it_ends_where_the_surface_is_reached_in_that_direction(stop: dict[str, str], time: float, dense: bool) -> None:
    run = hr.simulate(WAVE, {"x": 1, "v": 0}, until=20, stop=stop, dense_output=dense)
    assert run.t[-1] == pytest.approx(time, rel=1e-13)
    assert run.y[:, -1] == pytest.approx([math.cos(time), -math.sin(time)], abs=1e-11)
    assert (run.status, run.success) == ("ok", True)
    assert run.transitions.time_s.iloc[-1] == run.t[-1]
    assert f"surface of {run.transitions.surface.iloc[-1]}" in run.message


def test_a_list_of_surfaces_is_refused_with_an_example() -> None:
    with pytest.raises(hr.ArgumentError, match=r"'stop' must be a mapping, as in \{'s': 'falling'\}"):
        hr.simulate(WAVE, {"x": 1, "v": 0}, until=20, stop=["s"])


def test_a_touch_ends_no_run() -> None:
    """x = sin t touches 1 from below."""
    swing = hr.System(["x", "v"], {}, {"s": "x - 1"}, ["v", "-x"])
    run = hr.simulate(swing, {"x": 0, "v": 1}, until=7, stop={"s": "rising"})
    assert (run.t[-1], run.transitions.kind.tolist()) == (7.0, ["graze"])


def test_a_stick_reaches_the_surface_too_and_a_release_does_not() -> None:
    whole = hr.simulate(BELT, {"x": 1.5, "v": 0}, until=20)
    crossing, stick = whole.transitions.time_s[:2]
    assert hr.simulate(BELT, {"x": 1.5, "v": 0}, until=20, stop={"s": "rising"}).t[-1] == crossing
    falling = hr.simulate(BELT, {"x": 1.5, "v": 0}, until=20, stop={"s": "falling"})
    assert (falling.t[-1], falling.final_mode) == (stick, "s=0")
    late = hr.simulate(BELT, {"x": 0, "v": 0.5}, until=3.5, stop={"s": "falling"})
    assert (late.t[-1], late.transitions.kind.tolist()) == (3.5, ["release"])


def test_a_run_that_does_not_come_there_goes_to_its_horizon() -> None:
    run = hr.simulate(WAVE, {"x": 1, "v": 0}, until=1.5, stop={"s": "falling"})
    assert (run.t[-1], run.message) == (1.5, "the run reached its horizon")


def test_what_comes_before_is_that_of_a_run_without_it() -> None:
    case = hr.System.from_case(CASES / "two_blocks.yaml")
    whole = hr.simulate(case, case.initial, until=case.until)
    name = case.model.sign_names[1]
    run = hr.simulate(case, case.initial, until=case.until, stop={name: "rising"})
    count = len(run.transitions)
    assert 0 < count < len(whole.transitions)
    assert run.transitions.equals(whole.transitions[:count])
    assert run.transitions.surface.iloc[-1] == name
    before = np.linspace(0, run.t[-1], 50)
    assert (run.sol(before) == whole.sol(before)).all()


def test_an_event_that_double_precision_leaves_undecided_ends_it_too() -> None:
    """The second of two crossings 2e-7 s apart."""
    dip = hr.System(["x", "v"], {}, {"s": "x"}, ["v", "2"])
    run = hr.simulate(dip, {"x": "1 - 1e-14", "v": -2}, until=2, stop={"s": "rising"})
    assert len(run.transitions) == 2
    assert run.t[-1] == pytest.approx(1 + 1e-7, rel=1e-15)


@pytest.mark.parametrize(
    ("stop", "time", "name"),
    [
        ({"h": "falling"}, 1, "h"),
        ({"u": "rising"}, 1, "u"),
        ({"u": "falling"}, 1.2, "u"),
        ({"u": "rising", "h": "falling"}, 1, "h"),
    ],
)
def test_a_jump_of_the_state_reaches_all_surfaces_that_it_crosses(stop: dict[str, str], time: float, name: str) -> None:
    """A ball leaves the ground at 5, beyond the speed 3 of a surface: the last row of the instant is that surface's."""
    ball = hr.System(["x", "v"], {}, {"h": "x", "u": "v - 3"}, ["v", "-10"], resets={"h": {"map": {"v": "-v/2"}}})
    how = {"until": 9, "stop": stop}
    run, events = hr.simulate(ball, {"x": 5, "v": 0}, **how), hr.stream(ball, {"x": 5, "v": 0}, **how)
    assert run.t[-1] == pytest.approx(time)
    rows = [("reset", "h"), ("crossing", "u"), ("crossing", "u")][: 2 if time == 1 else 3]
    assert [(row.kind, row.surface) for row in events] == rows
    assert list(zip(run.transitions.kind, run.transitions.surface, strict=True)) == rows
    message = f"the run stopped at a transition of the surface of {name}, as requested"
    assert run.message == events.outcome.message == message


def test_a_stream_ends_there() -> None:
    events = hr.stream(WAVE, {"x": 1, "v": 0}, until=1e9, stop={"s": "rising"})
    assert [row.surface for row in events] == ["u", "s", "s"]
    assert "surface of s" in events.outcome.message
