"""Jumps of the state from Python: systems with ``resets``, their dense output, and sweeps over a restitution."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import henon_ref as hr
from henon_ref.errors import HenonRefError
from henon_ref.sweeps.sweep_file import load_sweep

FALL = 0.2**0.5
"""A ball's first fall, from 1 under gravity 10 [s]."""


@pytest.fixture(scope="module")
def ball() -> hr.System:
    return hr.System(
        state=["x", "v"],
        parameters={"g": 10, "e": 0.8},
        surfaces={"s": "x"},
        field=["v", "-g"],
        resets={"s": {"when": "falling", "map": {"v": "-e*v"}}},
    )


def test_a_reset_s_time_stands_twice_before_and_after(ball: hr.System) -> None:
    run = hr.simulate(ball, {"x": 1, "v": 0}, until=1, rtol=1e-12)
    (place,) = np.flatnonzero(np.diff(run.t) == 0.0)
    assert run.t[place] == run.t[place + 1] == pytest.approx(FALL, abs=1e-15)
    assert run.y[:, place] == pytest.approx([0.0, -10 * FALL], abs=1e-14)
    assert run.y[:, place + 1] == pytest.approx([0.0, 8 * FALL], abs=1e-14)
    assert run.sol is not None
    assert run.sol(run.t[place])[1] == pytest.approx(8 * FALL)
    assert run.sol(np.nextafter(run.t[place], 0.0))[1] == pytest.approx(-10 * FALL)
    assert list(run.transitions["kind"]) == ["reset"]
    assert run.transitions["v"][0] == pytest.approx(8 * FALL)


def test_dense_output_leads_over_the_limit_of_impacts_to_the_rest(ball: hr.System) -> None:
    run = hr.simulate(ball, {"x": 1, "v": 0}, until=5, rtol=1e-12)
    last = run.transitions.iloc[-1]
    assert (last["kind"], last["time_s"]) == ("stick", pytest.approx(9 * FALL, abs=1e-10))
    assert run.sol is not None
    times = np.linspace(4, 5, 2001)
    heights, speeds = run.sol(times)
    assert np.all(heights >= -1e-15)
    assert np.all(heights[times < 4.02] <= 1e-3)
    assert np.all(np.abs(heights[times > 9 * FALL]) <= 1e-24)  # where it was landed
    assert np.all(speeds[times > 9 * FALL] == 0.0)
    assert np.all(np.diff(run.t) >= 0.0)


def test_another_restitution_compiles_nothing_and_is_that_restitution(ball: hr.System) -> None:
    for e in (0.5, 0.0, 1.0):
        run = hr.simulate(ball, {"x": 1, "v": 0}, until=1.3, parameters={"e": e}, rtol=1e-12)
        kinds = list(run.transitions["kind"])
        if e == 0.0:
            assert kinds == ["reset", "stick"]
            assert list(run.transitions["time_s"]) == pytest.approx([FALL, FALL], abs=1e-15)
        else:
            exact = FALL * (1 + 2 * np.cumsum(e ** np.arange(1, len(kinds) + 1))[: len(kinds) - 1])
            assert set(kinds) == {"reset"}
            assert list(run.transitions["time_s"])[1:] == pytest.approx(list(exact), abs=1e-13)


def test_systems_with_other_resets_are_other_systems(ball: hr.System) -> None:
    def made(value: str) -> hr.System:
        return hr.System(
            state=["x", "v"], parameters={"g": 10, "e": 0.8}, surfaces={"s": "x"}, field=["v", "-g"],
            resets={"s": {"map": {"v": value}}},
        )  # fmt: skip

    assert made("-e*v") == ball != made("-e*v/2")
    with pytest.raises(HenonRefError, match="'w' is not a state"):
        hr.System(
            state=["x"], parameters={}, surfaces={"s": "x"}, field=["-1"], resets={"s": {"map": {"w": 1}}}
        )  # fmt: skip


def test_a_sweep_over_the_restitution(ball: hr.System, tmp_path: Path) -> None:
    table = hr.sweep(
        ball, {"x": 1, "v": 0}, until=4, grid={"e": [0.2, 0.5, 0.7]}, observe=[hr.observe.final_state()], rtol=1e-10
    )
    assert list(table["status"]) == ["ok"] * 3
    text = """schema: 1
name: restitutions
title: Restitutions
system: {state: [x, v], parameters: {g: 10, e: 0.8}, surfaces: {s: x}, field: [v, -g]}
resets: {s: {map: {v: "-e*v"}}}
initial: {x: 1, v: 0}
until: 4
points: {grid: {e: [0.2, 0.5]}}
observe: [{final_state: {}}]
"""
    (tmp_path / "sweep.yaml").write_text(text)
    assert len(load_sweep(tmp_path / "sweep.yaml").points) == 2


def test_a_cascade_stands_in_the_solution_map_by_map_and_in_sweeps_with_the_same_bits() -> None:
    """What https://github.com/sbmlteam/sbml-test-suite asks of events that trigger events."""
    system = hr.System(
        ["x", "a", "b"], {"k": 1}, {"first": "1 - x", "second": "1/2 - a"}, ["k", "0", "0"],
        resets={"first": {"map": {"x": "0", "a": "a + 1"}}, "second": {"map": {"a": "0", "b": "b + 1"}}},
    )  # fmt: skip
    start = {"x": 0, "a": 0, "b": 0}
    run = hr.simulate(system, start, until=1.5)
    at = run.t == 1.0
    assert run.y[:, at].T.tolist() == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    assert run.sol is not None
    assert run.sol(1.0).tolist() == [0.0, 0.0, 1.0]
    assert run.transitions[["kind", "surface"]].values.tolist() == [["reset", "first"], ["reset", "second"]]
    values = [0.7, 1.0, 1.3, 2.1]
    table = hr.sweep(system, start, until=3.5, grid={"k": values}, observe=[hr.observe.final_state()], jobs=1)
    alone = [hr.simulate(system, start, until=3.5, parameters={"k": k}).y[:, -1].tolist() for k in values]
    columns = [name for name in table.columns if name.startswith("final_")][:3]
    assert table[columns].to_numpy().tolist() == alone


@pytest.mark.parametrize(
    ("status", "speed", "acceleration", "valid"),
    [("invalid", 5, "-10", ["4 - v"]), ("nonunique", 5, "-10 + 20*u", []), ("diverged", 1e201, "-10", [])],
)
def test_a_jump_that_no_mode_follows_has_no_row(status: str, speed: float, acceleration: str, valid: list[str]) -> None:
    """A speed of 5 is beyond the model, or on a surface that repels on both sides, or without bound."""
    surfaces, resets = {"h": "x", "u": "v - 5"}, {"h": {"map": {"v": "w"}}}
    ball = hr.System(["x", "v"], {"w": speed}, surfaces, ["v", acceleration], resets=resets, valid=valid)
    run = hr.simulate(ball, {"x": 5, "v": 0}, until=9)
    assert (run.status, len(run.transitions), run.y[1, -1]) == (status, 0, speed)
    events = hr.stream(ball, {"x": 5, "v": 0}, until=9)
    assert (list(events), events.outcome.message) == ([], run.message)
    observed = [hr.observe.final_state(), hr.observe.section("h")]
    table = hr.sweep(ball, {"x": 5, "v": 0}, until=9, grid={"w": [speed]}, observe=observed, jobs=1)
    assert table[["status", "final_v"]].to_numpy().tolist() == [[status, speed]]
    assert table.frames["section"].empty


@pytest.mark.parametrize("amplitude", ["0.35", "0.5", "0.6"])
def test_a_ball_is_thrown_off_a_shaken_table_at_every_tolerance(amplitude: str) -> None:
    """At rest the ball is off the table by the error of the run; its speed there is no speed at which it leaves."""
    table = hr.System.from_case("inelastic_ball")
    thrown = np.arcsin(10 / (float(amplitude) * 4 * np.pi**2)) / (2 * np.pi)
    kinds = None
    for k in range(12, 3, -1):
        for rtol in (10.0**-k, 3 * 10.0**-k):
            run = hr.simulate(table, parameters={"A": amplitude}, rtol=rtol, until=5)
            releases = run.transitions.time_s[run.transitions.kind == "release"]
            assert releases.tolist() == pytest.approx(thrown + np.round(releases - thrown).to_numpy(), abs=20 * rtol)
            assert run.transitions.kind.tolist() == (kinds or run.transitions.kind.tolist())
            assert run.undecided_after == {}
            kinds = run.transitions.kind.tolist()
