"""Observations against closed forms, and against one run at a time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from sweep_systems import belt, oscillator, sliding_block

from henon_ref.errors import ArgumentError
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.system import System
from henon_ref.sweeps import observe
from henon_ref.sweeps.points import continuation, grid
from henon_ref.sweeps.sweep import SweepTable, sweep

SPEEDS = np.linspace(0.1, 1, 7)


def swept(system: System, initial: Any, until: Any, grid: Any, *observed: Any, **how: Any) -> SweepTable:
    """A sweep in this process."""
    return sweep(system, initial, until=until, grid=grid, observe=list(observed), jobs=1, **how)


def test_a_block_stops_where_its_energy_is_spent() -> None:
    table = swept(
        sliding_block(),
        {"x": 0, "v": 1},
        10,
        {"F": [0.5, 2], "v": [1, -2]},
        observe.final_state(),
        observe.extremes("x"),
        observe.extremes("v", name="speed"),
    )
    force, speed = table["F"], table["v"]
    way = speed * abs(speed) / (2 * force)
    assert table["final_x"].to_numpy() == pytest.approx(way.to_numpy(), rel=1e-12)
    assert table["final_mode"].tolist() == ["s=0"] * 4
    assert table["max_x"].to_numpy() == pytest.approx(np.maximum(way, 0), abs=1e-12)
    assert table["min_x"].to_numpy() == pytest.approx(np.minimum(way, 0), abs=1e-12)
    assert table["max_speed"].to_numpy() == pytest.approx(np.maximum(speed, 0), abs=1e-12)


def test_sticks_are_counted_as_a_run_has_them() -> None:
    """``measure: {after: T}``: whole sticks that do not end before T; one that the horizon cuts off is none."""
    after = 31.0
    table = swept(belt(), {"x": 1.5, "v": 0}, 60, {"vb": SPEEDS}, observe.sticks(after=after, each=True), rtol=1e-9)
    frame = table.frames["sticks"]
    for k, speed in enumerate(SPEEDS):
        run = simulate(belt(), {"x": 1.5, "v": 0}, until=60, rtol=1e-9, parameters={"vb": float(speed)})
        whole = run.sticks[run.sticks["start_s"] + run.sticks["duration_s"] >= after]
        assert table["stick_count"][k] == len(whole)
        assert table["last_stick_duration"][k] == pytest.approx(whole["duration_s"].iloc[-1], abs=1e-7)
        assert frame[frame["point"] == k]["start_s"].to_numpy() == pytest.approx(whole["start_s"].to_numpy(), abs=1e-6)


def test_a_run_without_sticks_has_none_and_no_duration() -> None:
    table = swept(oscillator(), {"x": 1, "v": 0}, 5, {"w": [1, 2]}, observe.sticks())
    assert table["stick_count"].tolist() == [0, 0]
    assert table["last_stick_duration"].isna().all()


def test_a_stick_that_the_run_starts_in_begins_with_it() -> None:
    """x' = t - F s from x = 0: sliding until t = F."""
    slide = System(["x"], {"F": 1}, {"s": "x"}, ["t - F*s"])
    table = swept(slide, {"x": 0}, 5, {"F": [1, 2, 7]}, observe.sticks())
    assert table["stick_count"].tolist() == [1, 1, 0]
    assert table["last_stick_duration"].to_numpy()[:2] == pytest.approx([1, 2], abs=1e-12)
    late = swept(slide, {"x": 0}, 5, {"F": [1, 2]}, observe.sticks(after=1.5))
    assert late["stick_count"].tolist() == [0, 1]


def test_section_points_lie_where_the_solution_is_known() -> None:
    table = swept(
        oscillator(),
        {"x": 1, "v": 0},
        20,
        {"w": [1, 2]},
        observe.section("x", direction="rising"),
        observe.section("v - 1/2", after=4, most=2, name="other"),
    )
    frame = table.frames["section"]
    for k, w in enumerate((1, 2)):
        own = frame[frame["point"] == k]
        expected = np.arange(1.5 * math.pi / w, 20, 2 * math.pi / w)
        assert own["time_s"].to_numpy() == pytest.approx(expected, rel=1e-9)
        assert own["v"].to_numpy() == pytest.approx(w, rel=1e-9)
    other = table.frames["other"]
    assert other.groupby("point").size().tolist() == [2, 2]
    assert (other["time_s"] >= 4).all()
    assert other["v"].to_numpy() == pytest.approx(0.5, rel=1e-9)


def test_a_section_may_be_a_surface_and_is_oriented() -> None:
    """-2 (v - vb) is the surface of s, seen from the other side: nothing is added to the system."""
    arguments = {"until": 40, "grid": {"vb": SPEEDS}, "rtol": 1e-9, "jobs": 1}
    rising = observe.section("s", direction="rising")
    falling = observe.section("-2*(v - vb)", direction="falling", name="mirrored")
    frames = sweep(belt(), {"x": 1.5, "v": 0}, observe=[rising, falling], **arguments).frames
    assert len(frames["section"]) > 20
    assert frames["section"].equals(frames["mirrored"])


@pytest.mark.parametrize(("of", "direction"), [("s", "falling"), ("x", "both"), ("-2*x", "rising")])
def test_each_impact_on_a_section_is_a_point_of_it(of: str, direction: str) -> None:
    """A ball from 1 m hits the floor at sqrt(2/g), then after flights of 2 e^k sqrt(2/g)."""
    ball = System(["x", "v"], {"g": 10, "e": 0.8}, {"s": "x"}, ["v", "-g"], resets={"s": {"map": {"v": "-e*v"}}})
    sections = observe.section(of, direction=direction), observe.section("x", direction="rising", name="none")
    frames = swept(ball, {"x": 1, "v": 0}, 1.6, {"e": [0.6, 0.8]}, *sections).frames
    for point, e in enumerate((0.6, 0.8)):
        own = frames["section"][frames["section"]["point"] == point]
        times = math.sqrt(0.2) * (np.append(0, np.cumsum(2 * e ** np.arange(1, 12))) + 1)
        assert own["time_s"].to_numpy() == pytest.approx(times[times < 1.6], rel=1e-9)
        assert own["v"].to_numpy() == pytest.approx(math.sqrt(20) * e ** np.arange(1, len(own) + 1), rel=1e-9)
    assert frames["none"].empty


def test_an_impact_that_ends_in_a_stick_is_one_point() -> None:
    """A pushed mass without restitution lands, rests, and is lifted once a period."""
    mass = System(["x", "v"], {"e": 0}, {"s": "x"}, ["v", "20*sin(t) - 10"], resets={"s": {"map": {"v": "-e*v"}}})
    table = swept(
        mass, {"x": 1, "v": 0}, 25, {"x": [1]}, observe.section("s", after=5), observe.period("s", direction="falling")
    )
    assert len(table.frames["section"]) == 4
    assert table["period"][0] == pytest.approx(2 * math.pi, rel=1e-9)


def test_the_period_of_an_oscillator_is_known() -> None:
    table = swept(oscillator(), {"x": 1, "v": 0}, 60, {"w": [1, 2]}, observe.period("x"))
    assert table["period"].to_numpy() == pytest.approx([2 * math.pi, math.pi], rel=1e-8)
    assert table["period_returns"].tolist() == [1, 1]


def test_both_directions_make_two_returns_a_period() -> None:
    table = swept(oscillator(), {"x": 1, "v": 0}, 60, {"w": [1, 2]}, observe.period("x", direction="both"))
    assert table["period"].to_numpy() == pytest.approx([2 * math.pi, math.pi], rel=1e-8)
    assert table["period_returns"].tolist() == [2, 2]


def test_what_never_returns_has_no_period() -> None:
    table = swept(sliding_block(), {"x": 0, "v": 1}, 3, {"F": [1]}, observe.period("x"))
    assert table["period"].isna().all()


def test_extremes_of_an_expression_after_a_time() -> None:
    """x = cos(w t): of x + v/2 the largest value is sqrt(1 + w^2/4)."""
    table = swept(
        oscillator(),
        {"x": 1, "v": 0},
        20,
        {"w": [1, 2]},
        observe.extremes("x + v/2", name="sum"),
        observe.extremes("x", after=19.9, name="late"),
    )
    largest = [math.sqrt(1.25), math.sqrt(2)]
    assert table["max_sum"].to_numpy() == pytest.approx(largest, rel=1e-9)
    assert table["min_sum"].to_numpy() == pytest.approx([-m for m in largest], rel=1e-9)
    ends = [sorted((math.cos(19.9 * w), math.cos(20 * w))) for w in (1, 2)]
    assert table["min_late"].to_numpy() == pytest.approx([e[0] for e in ends], abs=1e-9)
    assert table["max_late"].to_numpy() == pytest.approx([e[1] for e in ends], abs=1e-9)


def test_the_largest_exponent_of_a_damped_oscillator() -> None:
    damped = System(["x", "v"], {"c": 0.2}, {"s": "x"}, ["v", "-x - c*v"])
    table = swept(damped, {"x": 1, "v": 0}, 1, {"c": [0.2, 0.4]}, observe.lyapunov(span=300))
    assert table["lyapunov"].to_numpy() == pytest.approx([-0.1, -0.2], abs=2e-3)


def test_the_largest_exponent_beside_a_much_smaller_one() -> None:
    stiff = System(["x", "y"], {"k": 20}, {"s": "x - 5"}, ["-x", "-k*y + x"])
    found = swept(stiff, {"x": 1, "y": 1}, 1, {"k": [20, 200]}, observe.lyapunov(span=50))
    assert found["lyapunov"].to_numpy() == pytest.approx([-1, -1], abs=1e-5)


def test_a_function_of_ones_own_sees_each_run() -> None:
    threshold = 0.25

    def late_times(run):
        return {
            "last": run.transitions["time_s"].iloc[-1],
            "beyond": threshold < abs(run.y[0, -1]),
            "mode": run.final_mode,
        }

    grid_ = {"F": [0.5, 1, 4]}
    table = sweep(
        sliding_block(), {"x": 0, "v": 1}, until=9, grid=grid_, observe=[observe.function(late_times)], jobs=2
    )
    assert table["last"].to_numpy() == pytest.approx([2, 1, 0.25], rel=1e-12)
    assert table["beyond"].tolist() == [1, 1, 0]
    assert table["mode"].tolist() == ["s=0"] * 3


def test_runs_that_do_not_end_at_the_horizon_are_rows_that_say_so() -> None:
    """x' = c x^2 from x = 1 blows up at t = 1/c."""
    growth = System(["x"], {"c": 1}, {"s": "x + 5"}, ["c*x**2"])
    table = swept(growth, {"x": 1}, 0.5, {"c": [1, 4]}, observe.status(), observe.final_state())
    assert table["status"].tolist() == ["ok", "diverged"]
    assert table["end_time"][1] == pytest.approx(0.25, rel=1e-6)
    assert "leaves every bound" in table["message"][1]
    assert table["final_x"][0] == pytest.approx(2, rel=1e-9)


def test_a_start_that_the_fields_leave_open_is_a_row_and_has_no_mode() -> None:
    apart = System(["x"], {"F": 1}, {"s": "x"}, ["F*s"])
    table = swept(apart, {"x": 0}, 1, {"x": [0, 1]}, observe.final_state())
    assert table["status"].tolist() == ["nonunique", "ok"]
    assert table["final_mode"].isna().tolist() == [True, False]
    settled = swept(apart, {"x": 0}, 1, {"F": [1, 2]}, observe.final_state(), mode={"s": 1})
    assert settled["final_x"].to_numpy() == pytest.approx([1, 2], rel=1e-12)


def test_a_chain_starts_where_its_neighbour_ended() -> None:
    """A block with friction 1/2 that a spring of stiffness 1 pulls: it rests up to 1/2 from the spring's end p."""
    pulled = System(["x", "v"], {"p": 0}, {"s": "v"}, ["v", "p - x - 2*v - s/2"])
    points = continuation({"p": [0, 1, 2, 3]})
    table = swept(pulled, {"x": 0, "v": 0}, 60, points, observe.final_state())
    assert table["direction"].tolist() == ["up"] * 4 + ["down"] * 4
    up, down = table["final_x"][:4].to_numpy(), table["final_x"][4:].to_numpy()[::-1]
    assert up == pytest.approx([0, 0.5, 1.5, 2.5], abs=1e-6)  # it follows half behind
    assert down[:3] == pytest.approx([0.5, 1.5, 2.5], abs=1e-6)
    assert (down - up)[:3] == pytest.approx([0.5, 1, 1], abs=1e-6)


def test_parameters_that_are_expressions_in_swept_ones_follow() -> None:
    system = System(["x", "v"], {"a": 1, "F": "2*a", "G": "F/2 + a"}, {"s": "v"}, ["v", "-F*s + 0*G"])
    table = swept(system, {"x": 0, "v": 1}, 5, {"a": [1, 2]}, observe.final_state())
    assert table["final_x"].to_numpy() == pytest.approx([0.25, 0.125], rel=1e-12)


def test_a_parameter_in_an_exponent_makes_another_system() -> None:
    """x' = x^a from x = 1: (1 + t/2)^2 for a = 1/2, exp(t), and 1/(1 - t) for a = 2."""
    power = System(["x"], {"a": 1, "b": "2*a"}, {"s": "x - 100"}, ["x**(b/2)"])
    points = {"a": [2, 0.5, 1], "x": [1, 4]}
    table = swept(power, {"x": 1}, 0.2, points, observe.final_state(), observe.section("x - 1.1"))
    exact = [1 / 0.8, 4 / 0.2, 1.1**2, 2.1**2, math.exp(0.2), 4 * math.exp(0.2)]
    assert table["final_x"].to_numpy() == pytest.approx(exact, rel=1e-8)
    reached = table.frames["section"]
    assert reached["point"].tolist() == [0, 2, 4]
    assert reached["time_s"].to_numpy() == pytest.approx([1 - 1 / 1.1, 2 * (1.1**0.5 - 1), math.log(1.1)], rel=1e-8)


def test_a_parameter_in_an_exponent_of_a_reset_makes_another_system() -> None:
    """A ball falls from 1 at g = 2 and leaves the ground at t = 1 with the speed 2^p / 4."""
    ball = System(["x", "v"], {"p": 1}, {"s": "x"}, ["v", "-2"], resets={"s": {"map": {"v": "(-v)**p/4"}}})
    table = swept(ball, {"x": 1, "v": 0}, 1.25, {"p": [2, 1]}, observe.final_state())
    runs = [simulate(ball, {"x": 1, "v": 0}, until=1.25, parameters={"p": p}) for p in (1, 2)]
    assert table["final_v"].to_numpy() == pytest.approx([1 - 0.5, 0.5 - 0.5], abs=1e-12)
    assert [run.y[1, -1] for run in runs] == pytest.approx([0.5 - 0.5, 1 - 0.5], abs=1e-12)


def test_times_and_initial_values_in_parameters_follow_swept_ones() -> None:
    """One period of x = a cos(w t), whatever w is."""
    table = swept(
        oscillator(),
        {"x": "2*w", "v": 0},
        "pi/w",
        {"w": [1, 2]},
        observe.final_state(),
        observe.status(),
        observe.extremes("x"),
        start="-pi/w",
    )
    assert table["end_time"].to_numpy() == pytest.approx([math.pi, math.pi / 2], rel=1e-15)
    assert table["final_x"].to_numpy() == pytest.approx([2, 4], rel=1e-9)
    assert table["min_x"].to_numpy() == pytest.approx([-2, -4], rel=1e-9)


@pytest.mark.parametrize(
    "make",
    [
        lambda: observe.sticks(after="late"),
        lambda: observe.sticks(surface="nothing"),
        lambda: observe.section("y"),
        lambda: observe.section("vb"),
        lambda: observe.section("x", direction="up"),
        lambda: observe.section("x", direction=["rising"]),
        lambda: observe.section("x", most=0),
        lambda: observe.section("x", name="a b"),
        lambda: observe.section("abs(x)"),
        lambda: observe.period("x", tolerance=0),
        lambda: observe.extremes("vb"),
        lambda: observe.lyapunov(span=0),
        lambda: observe.function(3),
        lambda: observe.sticks(after=1000),
    ],
)
def test_what_cannot_be_observed_is_refused(make, tmp_path) -> None:
    with pytest.raises(ArgumentError):
        swept(belt(), {"x": 1.5, "v": 0}, 5, {"vb": [0.5]}, make(), out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_two_results_of_one_name_are_refused() -> None:
    for pair in ([observe.sticks(), observe.sticks(after=1)], [observe.section("x"), observe.section("v")]):
        with pytest.raises(ArgumentError, match="two results"):
            sweep(belt(), {"x": 1.5, "v": 0}, until=5, grid=grid({"vb": [0.5]}), observe=pair, jobs=1)
