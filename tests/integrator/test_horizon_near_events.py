"""A horizon may lie anywhere next to an event: what is left there moves guards by less than the states' rounding."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import henon_ref as hr
from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import load_case
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory


def run(problem: Problem, until: float, rtol: float, samples: list[float] | None = None) -> Trajectory:
    times = None if samples is None else np.array(samples)
    return HENON_SOLVER.prepare(replace(problem, until=until), rtol=rtol, sample_times=times)()


@pytest.mark.parametrize(
    ("name", "rtol"),
    [("hard/steep_friction", 1e-9), ("hard/steep_friction", 1e-12), ("moving_belt", 1e-9), ("stribeck_belt", 1e-9)],
)
def test_the_run_up_to_a_horizon_is_the_start_of_the_longer_one(name: str, rtol: float) -> None:
    problem = load_case(name).readings[0].problem
    whole = HENON_SOLVER.prepare(problem, rtol=rtol)()
    transitions = list(whole.transitions)
    for event in transitions[2::3]:
        times = [math.nextafter(event.time, side) for side in (-math.inf, math.inf)]
        for until in (*times, event.time, *(event.time + off for off in (-1e-13, 1e-13, 4.5e-10, 1e-8, 1e-6))):
            found = run(problem, until, rtol)
            assert (found.status, found.end_time) == ("ok", until), found.reason
            assert all(since > until - 1e-11 for _, since in found.undecided_after)
            surely = sum(t.time < until - 10 * rtol for t in transitions)
            assert surely <= len(found.transitions) <= sum(t.time < until + 10 * rtol for t in transitions)
            assert [(t.kind, t.surface) for t in found.transitions] == [
                (t.kind, t.surface) for t in transitions[: len(found.transitions)]
            ]
            assert [t.time for t in found.transitions] == pytest.approx(
                [t.time for t in transitions[: len(found.transitions)]], abs=100 * rtol
            )


def test_what_was_found_4_5e_minus_10_s_after_a_release() -> None:
    problem = load_case("hard/steep_friction").readings[0].problem
    for rtol in (1e-6, 1e-9, 1e-12):
        assert run(problem, 31.41620159235604, rtol).status == "ok"


def test_samples_and_dense_output_reach_such_a_horizon() -> None:
    problem = load_case("hard/steep_friction").readings[0].problem
    whole = HENON_SOLVER.prepare(problem, rtol=1e-12)()
    until = [t for t in whole.transitions if t.kind == "release"][2].time
    found = run(problem, until, 1e-12, [until - 1e-3, until - 1e-14, until])
    assert found.samples is not None
    assert np.isfinite(found.samples).all()
    assert found.samples[-1] == pytest.approx(found.end_state, abs=1e-15)
    system = hr.System.from_case("hard/steep_friction")
    dense = hr.simulate(system, {"x": 1, "v": 0.2}, until=until, rtol=1e-12, dense_output=True)
    assert dense.status == "ok"
    assert dense.sol is not None
    assert dense.sol(until) == pytest.approx(dense.y[:, -1], abs=1e-15)


@pytest.mark.parametrize("behind", [1e-15, 1e-14, 1e-13, 1e-12, 1e-9])
def test_a_singularity_next_to_the_horizon_still_ends_a_run(behind: float) -> None:
    """x' = -1/(2x) from 1 ends near t = 1, where its tolerance puts it."""
    system = hr.System(["x"], {}, {"s": "x + 5"}, ["-1/(2*x)"])
    end = hr.simulate(system, {"x": 1}, until=1 + 1e-9)
    found = re.search(r"t = (\S+): the field of x is singular", end.message)
    assert found
    assert hr.simulate(system, {"x": 1}, until=float(found[1]) + behind).status == "failed"


def test_no_more_steps_are_taken_before_a_horizon_next_to_an_event() -> None:
    """A step that the horizon cuts has not grown: held against an expansion made anew it was shortened 900 times."""
    system = hr.System.from_case("steep_friction")
    whole = hr.simulate(system, dense_output=False)
    for event in whole.trajectory.transitions[:4]:
        run = hr.simulate(system, until=event.time + 1e-9, dense_output=False)
        assert run.status == "ok"
        assert run.counts.steps <= whole.counts.steps
