"""Many points in one compiled call: each with the same bits as its run alone, whatever it is done together with."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from numpy.typing import NDArray
from problems import make_problem

import henon_ref as hr
from henon_ref.casefile.case import load_case
from henon_ref.errors import ModelError
from henon_ref.integrator import points
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.points import Keep, PointRuns
from henon_ref.integrator.records import LANDINGS
from henon_ref.integrator.run import Run
from henon_ref.integrator.run_result import KINDS
from henon_ref.kernel.library import kernel
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.trajectory import Trajectory

CASES = Path(__file__).parents[2] / "cases"
TOLERANCE = 1e-10


@pytest.fixture(autouse=True, params=["one run after another", "steps taken together"])
def together(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Every test is done in one lane and in many."""
    found: bool = request.param == "steps taken together"
    monkeypatch.setattr(points, "STEPS_ALONE", 0 if found else 10**9)
    return found


def without_values(problem: Problem) -> Integrator:
    return Integrator(replace(problem.system, parameters={}), 16)


def problem_of(path: str, reading: str | None = None) -> Problem:
    case = load_case(CASES / path)
    return (case.reading(reading) if reading else case.readings[0]).problem


def values_of(integrator: Integrator, problem: Problem) -> list[float]:
    return [float(problem.system.parameters[symbol]) for symbol in integrator.parameters]


def outcome(runs: PointRuns, blocks: Sequence[NDArray[Any]], point: int) -> tuple[Any, ...]:
    """All that is said of a point, in a form that does not depend on rows of modes."""
    modes = runs.integrator.mode_table.modes
    rows = [row for block in blocks for row in block[block["point"] == point]]
    transitions = [
        (
            KINDS[row["kind"]], int(row["surface"]), modes[row["from_mode"]], modes[row["to_mode"]],
            float(row["time"]), float(row["time_low"]), LANDINGS[row["landing"]], tuple(row["state"].tolist()),
        )
        for row in rows
    ]  # fmt: skip
    end = runs.ends[point]
    status, _ = runs.status(point)
    mode = runs.others[point].end_mode if point in runs.others else modes[end["mode"]]
    return status, transitions, float(end["time"]), tuple(runs.states[point].tolist()), mode


def alone(end: Trajectory) -> tuple[Any, ...]:
    transitions = [
        (t.kind, t.surface, t.from_mode, t.to_mode, t.time, t.time_low, t.landing, t.state) for t in end.transitions
    ]
    return end.status, transitions, end.end_time, end.end_state, end.end_mode


def spread(problem: Problem, integrator: Integrator, count: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Values and initial states round those of a problem; the first is the problem's own."""
    rng = np.random.default_rng(3)
    values, initial = np.array(values_of(integrator, problem)), np.array([float(v) for v in problem.initial])
    factors = 1 + 0.1 * rng.uniform(-1, 1, (count, len(values)))
    shifts = 0.1 * rng.uniform(-1, 1, (count, len(initial)))
    factors[0], shifts[0] = 1, 0
    return values * factors, initial + shifts


@pytest.mark.parametrize(
    ("path", "reading", "until"),
    [
        ("stribeck_belt.yaml", None, 30),
        ("two_blocks.yaml", "default", 20),
        ("classic/three_blocks.yaml", "default", 10),
        ("hard/two_roots.yaml", None, 2),
        ("hard/grazing_ballistic.yaml", "exact", 2),
        ("hard/repelling.yaml", None, 3),
    ],
)
def test_every_point_has_the_bits_of_its_run_alone(
    path: str, reading: str | None, until: float, together: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Points that start on a surface, need modes not compiled yet, or graze are among them."""
    problem = problem_of(path, reading)
    start = float(problem.start)
    first, second = without_values(problem), without_values(problem)
    values, initial = spread(problem, first, 24)
    runs = PointRuns(first, values, initial, start=start, until=start + until, tolerance=TOLERANCE, keep=Keep())
    blocks = list(runs)
    if path.startswith(("stribeck", "two_blocks", "classic")):
        assert len(runs.others) < 6, "most are done in compiled code"
        assert (first.mode_table.compiled.records["mode"]["lanes"] != 0).all() == together
    monkeypatch.setattr(points, "AT_ONCE", 5)
    monkeypatch.setattr(points, "BUFFER", points.CHUNK + 10)
    monkeypatch.setattr(points, "MEMORY", 3 * first.programs.loop().bytes_a_point)
    monkeypatch.setattr(points, "STEPS_ALONE", first.steps_of_points + 50)  # the first runs are in progress
    again = PointRuns(first, values, initial, start=start, until=start + until, tolerance=TOLERANCE, keep=Keep())
    parts = list(again)
    for point in range(len(initial)):
        run = Run(
            second,
            second.begin(
                tuple(values[point].tolist()), initial[point].tolist(),
                start=start, until=start + until, tolerance=TOLERANCE,
            ),
        )  # fmt: skip
        expected = alone(run.to_horizon())
        assert outcome(runs, blocks, point) == expected
        assert outcome(again, parts, point) == expected
        assert runs.ends["transitions"][point] == len(expected[1])


def oscillator() -> Integrator:
    """x'' = a - x - s on the surface v = 0."""
    base = make_problem("x v", ["v", "-x - s"], {"s": "v"}, [4, 0], 10).system
    x, _ = base.states
    a = sp.Symbol("a", real=True)
    return Integrator(replace(base, field=(base.field[0], a - x - base.signs[0])), 12)


def test_only_what_is_wanted_is_kept() -> None:
    """From x = a - 9.5 the block turns at every multiple of pi and sticks at the fifth turn."""
    integrator = oscillator()
    values, initial = [[0.0], [2.0]], [[-9.5, 1e-3], [-7.5, 1e-3]]

    def kept(keep: Keep) -> list[tuple[int, int, float]]:
        runs = PointRuns(integrator, values, initial, until=30.0, tolerance=TOLERANCE, keep=keep)
        return [(int(r["point"]), int(r["kind"]), float(r["time"])) for block in runs for r in block]

    everything = kept(Keep())
    assert {kind for _, kind, _ in everything} == {kernel.CROSSING, kernel.STICK}
    assert kept(Keep(after=10.0)) == [row for row in everything if row[2] >= 10.0]
    assert kept(points.NOTHING) == []


def test_a_stick_that_is_open_is_kept_with_its_begin() -> None:
    problem = problem_of("stribeck_belt.yaml")
    integrator = without_values(problem)
    values, initial = spread(problem, integrator, 6)

    def kept(keep: Keep) -> list[tuple[int, int, float]]:
        runs = PointRuns(integrator, values, initial, until=60.0, tolerance=TOLERANCE, keep=keep)
        rows = [(int(r["point"]), int(r["kind"]), float(r["time"])) for block in runs for r in block]
        return sorted(rows, key=lambda row: (row[0], row[2]))

    everything, open_ones = kept(Keep()), 0
    for after in np.linspace(20, 40, 9):
        whole = kept(Keep(after=after, open_sticks=True))
        for point in range(6):
            own = [row for row in everything if row[0] == point]
            late = [row for row in own if row[2] >= after]
            if late and late[0][1] == kernel.RELEASED:
                begin = [row for row in own if row[2] < after and row[1] == kernel.STICK]
                late, open_ones = [*begin[-1:], *late], open_ones + bool(begin)
            assert [row for row in whole if row[0] == point] == late
    assert open_ones > 3


def test_more_transitions_than_the_buffer_holds_are_all_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """x' = 1 through sin(x): a point crosses every pi, 2,000 times and more; time is the closed form."""
    monkeypatch.setattr(points, "BUFFER", points.CHUNK + 2)
    problem = make_problem("x y", ["1", "s"], {"s": "sin(x)"}, [1, 0], 1)
    integrator = Integrator(problem.system, 12)
    runs = PointRuns(integrator, np.zeros((1, 0)), [[0.5, 0], [1.0, 0]], until=8000.0, tolerance=1e-9, keep=Keep())
    rows = np.concatenate(list(runs))
    for point, x in enumerate((0.5, 1.0)):
        own = rows[rows["point"] == point]
        assert len(own) == int((8000 + x) / np.pi) == runs.ends["transitions"][point]
        assert own["time"] == pytest.approx(np.pi * np.arange(1, len(own) + 1) - x, abs=1e-9)


def test_ends_say_what_came_of_each_point() -> None:
    problem = make_problem("x", ["a*x*x - s/9"], {"s": "x + 9"}, [1], 2)
    x, a = problem.system.states[0], sp.Symbol("a", real=True)
    system: FilippovSystem = replace(problem.system, field=(a * x**2 - problem.system.signs[0] / 9,))
    integrator = Integrator(system, 12)
    runs = PointRuns(integrator, [[0.25], [1.0]], [[1.0], [1.0]], until=2.0, tolerance=1e-9)
    assert not list(runs)
    assert runs.status(0) == ("ok", "")
    assert runs.ends["time"][0] == 2.0
    assert runs.status(1)[0] == "diverged"
    assert list(runs.others) == [1]


def test_a_limit_of_steps_is_exact_and_the_same_alone() -> None:
    integrator = oscillator()
    runs = PointRuns(integrator, [[0.0]], [[40.0, 1.0]] * 3, until=[1.0, 40.0, 50.0], tolerance=1e-9, most_steps=30)
    list(runs)
    assert [runs.status(k)[0] for k in range(3)] == ["ok", "failed", "failed"]
    assert runs.ends["steps"][1] == runs.ends["steps"][2] == 30
    end = Run(integrator, runs.start(1)).to_horizon()
    assert end.reason == runs.status(1)[1]
    assert end.reason.startswith("stopped after 30 steps, as many as max_steps allows, at t = ")
    assert (end.status, end.counts.steps, end.end_state) == ("failed", 30, tuple(runs.states[1]))


def test_runs_end_on_a_surface() -> None:
    integrator = oscillator()
    runs = PointRuns(integrator, [[0.0]], [[4.0, -1e-9], [4.0, 1.0]], until=10.0, tolerance=1e-12, stop_rising=1)
    list(runs)
    assert runs.ends["time"][0] == pytest.approx(np.pi, abs=1e-8)
    assert runs.states[0] == pytest.approx([-2, 0], abs=1e-8)
    assert np.pi < runs.ends["time"][1] < 5


def test_parts_in_several_threads_are_the_same() -> None:
    problem = problem_of("two_blocks.yaml", "default")
    integrator, other = without_values(problem), without_values(problem)
    values, initial = spread(problem, integrator, 32)

    def part(integrator: Integrator, points: slice) -> list[tuple[Any, ...]]:
        own = PointRuns(integrator, values[points], initial[points], until=20.0, tolerance=TOLERANCE, keep=Keep())
        blocks = list(own)
        return [outcome(own, blocks, k) for k in range(len(own.states))]

    expected = part(other, slice(0, 32))
    with ThreadPoolExecutor(4) as pool:
        parts = pool.map(lambda k: part(integrator, slice(8 * k, 8 * k + 8)), range(4))
        assert [each for done in parts for each in done] == expected


def test_a_system_with_values_of_its_parameters_is_refused() -> None:
    problem = problem_of("stribeck_belt.yaml")
    with pytest.raises(ModelError, match="values of its parameters"):
        list(PointRuns(Integrator(problem.system, 8), [[1.0]], [[1.0, 0.0]], until=1.0, tolerance=1e-6))


def test_a_stack_without_static_friction_beside_a_contact_with_it_is_decided() -> None:
    """Blocks a and b slide against each other where a turns; c is held by 3/2 after its slide."""
    scene = hr.Scene()
    a, b, c = (scene.body(name, mass=1) for name in "abc")
    scene.spring(a, scene.wall, stiffness=1)
    scene.friction(a, scene.wall, law="coulomb", force=1)
    scene.friction(b, a, law="coulomb", force=0.5)
    scene.friction(c, scene.wall, law="coulomb", force=1, static=1.5)
    system, initial = scene.system(), {"x_a": 0, "v_a": -2, "x_b": 0, "v_b": 1, "x_c": 0, "v_c": 1}
    run = hr.simulate(system, initial, until=5, rtol=TOLERANCE)
    assert run.transitions["kind"].tolist() == ["crossing", "stick", "stick", "stick"]
    assert run.transitions["time_s"].tolist()[:2] == pytest.approx([np.arcsin(0.8), 1], abs=1e-9)
    assert run.counts.decisions.mode_selections == 0
    table = hr.sweep(
        system, initial, until=5, grid={"v_b": [1, 2]}, observe=[hr.observe.final_state()], rtol=TOLERANCE, jobs=1
    )
    for point, speed in enumerate([1, 2]):
        alone = hr.simulate(system, {**initial, "v_b": speed}, until=5, rtol=TOLERANCE)
        assert [table[f"final_{x}"][point] for x in system.state] == alone.y[:, -1].tolist()
