"""Sections, and kinks, that are zero while a mode slides or a body rests: the run goes on as without them."""

from __future__ import annotations

import numpy as np
import pytest

import henon_ref as hr

BLOCK = ["v", "-x - F*s + A*cos(w*t)"]
"""A block on a spring, its friction, and a force."""
QUIET = {"F": 1, "A": 0, "w": 1, "vb": 0}


def block(sections: dict[str, str], field: list[str] = BLOCK, **values: float) -> hr.System:
    """The block on a belt of speed vb = 0: "v - vb" and "v" are the same surface, which only the numbers show."""
    return hr.System(["x", "v"], {**QUIET, **values}, {"s": "v - vb", **sections}, field)


def assert_same_motion(one: hr.Solution, other: hr.Solution) -> None:
    """Assert that two runs have the same end, and the same transitions of the surface s."""
    assert one.status == other.status == "ok"
    assert one.y[:, -1] == pytest.approx(other.y[:, -1], abs=1e-9)
    mine, theirs = (run.transitions[run.transitions.surface == "s"] for run in (one, other))
    assert mine.kind.tolist() == theirs.kind.tolist()
    assert mine.time_s.to_numpy() == pytest.approx(theirs.time_s.to_numpy(), abs=1e-9)


@pytest.mark.parametrize("section", ["v", "2*v", "sin(v/9)", "v*(1 + x**2)", "v**3"])
def test_a_slide_on_the_section_goes_on(section: str) -> None:
    for start, crossings in ((1.5, 0), (3.7, 1), (10.3, 4)):  # each half cycle takes pi, and 2 F of the amplitude
        run = hr.simulate(block({"q": section}), {"x": start, "v": 0}, until=30)
        assert (run.status, run.mode(30)["s"], run.undecided_after) == ("ok", 0, {})
        halves = crossings + 1
        assert run.y[:, -1] == pytest.approx([(-1) ** halves * (start - 2 * halves), 0], abs=1e-11)
        times = run.transitions.time_s[run.transitions.surface == "q"].to_numpy()
        assert len(times) - crossings in (0, 1)  # rounding decides whether the slide begins just before the section
        assert times == pytest.approx(np.pi * np.arange(1, len(times) + 1), abs=1e-9)


def test_the_section_is_crossed_again_after_the_slide() -> None:
    start = {"x": 1.3, "v": 0}
    for forces in ({"A": 1.2, "w": 0.7}, {"A": 1.1, "w": 1.3}, {"A": 2, "w": 0.5}):
        run = hr.simulate(block({"q": "v"}, **forces), start, until=60)
        assert_same_motion(run, hr.simulate(block({}, **forces), start, until=60))
        sides, due = [], []
        for row in run.transitions[run.transitions.surface == "s"].itertuples():
            side = int(row.to_mode.split()[0].removeprefix("s="))
            if side and sides[-1:] == [-side]:
                due.append(row.time_s)
            sides += [side] if side else []
        crossed = run.transitions[run.transitions.surface == "q"]
        assert len(run.sticks) > 5
        assert run.undecided_after == {}
        times = crossed.time_s.to_numpy()
        assert times[-len(due) :] == pytest.approx(due, abs=1e-6)
        assert len(times) - len(due) in (0, 1)  # the start is on the section


@pytest.mark.parametrize("drag", ["0.3*v*abs(v)", "0.2*max(v, 0)"])
def test_a_slide_on_a_kink_goes_on(drag: str) -> None:
    field = ["v", f"{BLOCK[1]} - {drag}"]
    for start in (1.5, 4.4, 7.1, 10.3):
        run = hr.simulate(block({}, field), {"x": start, "v": 0}, until=30)
        assert (run.status, run.mode(30)["s"], run.undecided_after) == ("ok", 0, {})
        assert run.y[1, -1] == pytest.approx(0, abs=1e-11)


@pytest.mark.parametrize("section", ["v", "w", "v - w", "v*w"])
def test_two_slides_on_sections_go_on(section: str) -> None:
    field = ["v", "-2*x + y - F*s", "w", "x - 2*y + 1.5*cos(0.7*t) - F*c"]
    for start in (1.5, 4.3):
        runs = [
            hr.simulate(
                hr.System(["x", "v", "y", "w"], {"F": 1, "vb": 0}, {"s": "v - vb", "c": "w - vb", **sections}, field),
                {"x": start, "v": 0, "y": 1, "w": 0},
                until=40,
            )
            for sections in ({}, {"q": section})
        ]
        assert_same_motion(runs[1], runs[0])


def bounces(ratio: float, sections: dict[str, str]) -> hr.Solution:
    """A ball that is dropped on the floor."""
    ball = hr.System(
        ["x", "v"],
        {"g": 10, "e": ratio},
        {"s": "x", **sections},
        ["v", "-g"],
        resets={"s": {"when": "falling", "map": {"v": "-e*v"}}},
    )
    return hr.simulate(ball, {"x": 1, "v": 0}, until=5)


@pytest.mark.parametrize("ratio", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("section", ["v + x", "v - x", "sin(v)", "v**3", "x**2", "v*x"])
def test_impacts_accumulate_beside_a_section(ratio: float, section: str) -> None:
    run = bounces(ratio, {"q": section})
    assert_same_motion(run, bounces(ratio, {}))
    assert run.mode(5)["s"] == 0


@pytest.mark.parametrize("ratio", [0.3, 0.5, 0.8])
def test_the_section_is_crossed_in_each_flight_and_impact(ratio: float) -> None:
    run = bounces(ratio, {"q": "v + x"})
    impacts = (run.transitions.kind == "reset").sum()
    crossed = run.transitions[run.transitions.surface == "q"]
    assert crossed.to_mode.str[-2:].tolist() == ["-1", "+1"] * impacts
    speed = np.sqrt(20) * ratio ** np.arange(impacts)  # at the impacts; v + x = 0 in the flight before each
    up = np.concatenate([[np.nan], ratio * speed[:-1]])
    start = np.concatenate([[0], np.sqrt(0.2) + np.cumsum(2 * up[1:] / 10) - 2 * up[1:] / 10])
    # x + v = u tau - 5 tau^2 + u - 10 tau, and 1 - 5 tau^2 - 10 tau in the first flight
    tau = np.where(np.isnan(up), -1 + np.sqrt(1.2), (up - 10 + np.sqrt((up - 10) ** 2 + 20 * up)) / 10)
    assert crossed.time_s.to_numpy()[::2] == pytest.approx(start + tau, abs=1e-11)


def test_a_section_that_the_last_flights_leave_changes_its_side_at_rest() -> None:
    run = bounces(0.5, {"q": "v - 1e-9"})  # above zero after each impact, and below it at rest
    last = run.transitions.iloc[-2:]
    assert sorted(zip(last.surface, last.kind, strict=True)) == [("q", "crossing"), ("s", "stick")]
    assert run.final_mode == "s=0 q=-1"


def test_a_sweep_with_such_sections_ends_no_run() -> None:
    table = hr.sweep(
        block({}),
        {"x": 1.5, "v": 0},
        until=30,
        grid={"vb": [0, 0.2], "x": np.linspace(1.2, 7, 12)},
        observe=[hr.observe.section("v")],
        jobs=1,
    )
    assert set(table.status) == {"ok"}
