"""Steps kept for dense output, and runs that end on a surface."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from problems import make_problem

from henon_ref.casefile.case import load_case
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.run import Run
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory

CASES = Path(__file__).parents[2] / "cases"


def values(steps: np.ndarray, times: np.ndarray) -> np.ndarray:
    """States at times, shape (m, n), each from the last step that begins no later."""
    at = np.searchsorted(steps["time"], times, side="right") - 1
    tau = (times - steps["time"][at] - steps["time_low"][at]) / steps["unit"][at]
    powers = tau[:, None] ** np.arange(steps["coefficients"].shape[2])
    return np.einsum("mk,mik->mi", powers, steps["coefficients"][at])


def run(problem: Problem, dense: int = 0, tolerance: float = 1e-12, **changes: int) -> tuple[Trajectory, Run]:
    integrator = Integrator(problem.system, 16)
    start = integrator.start(problem, tolerance=tolerance, **changes)
    made = Run(integrator, start, dense=dense)
    return made.to_horizon(), made


@pytest.mark.parametrize("rows", [1, 7, 1000])
def test_the_steps_are_the_motion(rows: int) -> None:
    """x'' = -x - s on the surface v = 0: half a turn round 1, half a turn round -1, then a stick at 0."""
    problem = make_problem("x v", ["v", "-x - s"], {"s": "v"}, [4, 0], 10)
    end, made = run(problem, dense=rows)
    steps = made.steps
    times = np.linspace(0, 10, 301)
    found = values(steps, times)
    assert end.status == "ok"
    first, last = times < np.pi, times > 2 * np.pi
    second = ~first & ~last
    assert found[first, 0] == pytest.approx(1 + 3 * np.cos(times[first]), abs=1e-11)
    assert found[second, 0] == pytest.approx(-1 + np.cos(times[second]), abs=1e-11)
    assert found[last, 0] == pytest.approx(np.zeros(last.sum()), abs=1e-11)
    modes = [made.integrator.mode_table.modes[row] for row in steps["mode"]]
    assert sorted(set(modes)) == [(-1,), (0,), (1,)]
    ends = steps["time"] + steps["length"]
    assert ends[:-1] == pytest.approx(steps["time"][1:], abs=1e-14)
    assert (steps["time"][0], ends[-1]) == (0.0, pytest.approx(10.0, abs=1e-14))


@pytest.mark.parametrize(
    ("path", "reading"),
    [("hard/grazing_ballistic.yaml", "exact"), ("hard/two_roots.yaml", None), ("two_blocks.yaml", "default")],
)
def test_keeping_steps_changes_no_bit_and_leaves_no_gap(path: str, reading: str | None) -> None:
    """Events located in multiprecision end a step as others do."""
    case = load_case(CASES / path)
    problem = (case.reading(reading) if reading else case.readings[0]).problem
    alone, _ = run(problem)
    kept, made = run(problem, dense=64)
    steps = made.steps
    assert list(kept.transitions) == list(alone.transitions)
    assert (kept.end_state, kept.end_mode, kept.counts) == (alone.end_state, alone.end_mode, alone.counts)
    assert len(steps) == kept.counts.steps
    ends = steps["time"] + steps["length"]
    assert ends[:-1] == pytest.approx(steps["time"][1:], rel=1e-14)
    assert ends[-1] == pytest.approx(kept.end_time, rel=1e-14)
    times = np.array([t.time for t in kept.transitions])
    states = np.array([t.state for t in kept.transitions])
    assert values(steps, times) == pytest.approx(states, abs=1e-9)


@pytest.mark.parametrize(
    ("stop", "time"), [({"stop_falling": 1}, np.pi / 2), ({"stop_rising": 1}, 3 * np.pi / 2), ({}, 20.0)]
)
def test_a_run_ends_on_a_surface_in_the_direction_that_is_wanted(stop: dict[str, int], time: float) -> None:
    problem = make_problem("x v", ["v", "-x"], {"s": "x"}, [1, 0], 20)
    end, made = run(problem, dense=10, **stop)
    assert (end.status, end.end_time) == ("ok", pytest.approx(time, abs=1e-13))
    assert made.steps["time"][-1] + made.steps["length"][-1] == pytest.approx(time, abs=1e-13)
    if stop:
        assert end.transitions[-1].time == end.end_time
        assert end.end_state[0] == pytest.approx(0.0, abs=1e-13)


def test_a_stick_ends_a_run_too_and_neither_a_release_nor_a_graze_does() -> None:
    problem = make_problem("x", ["t - 3*s"], {"s": "x"}, [1], 9)  # sticks from above, released at t = 3
    assert run(problem, stop_falling=1)[0].end_mode == (0,)
    assert run(problem, stop_rising=1)[0].end_time == 9.0
    touch = make_problem("x v", ["v", "2"], {"s": "x"}, [1, -2], 3)
    end, _ = run(touch, stop_falling=1)
    assert (end.end_time, [t.kind for t in end.transitions]) == (3.0, ["graze"])


def test_of_two_surfaces_the_one_that_is_named_ends_it() -> None:
    problem = make_problem("x y", ["-1 - s/10", "-1 - u/20"], {"s": "x", "u": "y"}, [1, 2], 9)
    for bit, time in ((1, 1 / 1.1), (2, 2 / 1.05)):
        end, _ = run(problem, stop_falling=bit)
        assert end.end_time == pytest.approx(time, abs=1e-13)
