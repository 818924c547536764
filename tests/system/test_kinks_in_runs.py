"""Runs of models with kinks and jumps, of every kind of solver, against closed forms."""

from __future__ import annotations

import math

import pytest
import sympy as sp
from problems import read_problem

from henon_ref.errors import CaseError
from henon_ref.harness.registry import solver
from henon_ref.harness.report.model import kink_notes
from henon_ref.modes.kinks import continuous
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory

X = sp.Symbol("x", real=True)
SOLVERS = pytest.mark.parametrize("name", ["henon", "scipy-dop853"])


def run_of(name: str, problem: Problem) -> Trajectory:
    """A run at tight tolerances that comes to its end."""
    run = solver(name).prepare(problem, rtol=1e-13, atol=1e-14)()
    assert run.status == "ok"
    return run


def times_of(run: Trajectory) -> list[float]:
    return [float(t.time) for t in run.transitions]


def problem_of(rate: str, initial: str = "x: 1, v: 0", until: str = "5") -> Problem:
    text = f"""\
system:
  state: [x, v]
  field: [v, "{rate}"]
initial: {{{initial}}}
until: {until}
"""
    return read_problem(text)


LANDED = [
    pytest.param(problem_of("-abs(x)", until="2"), [("crossing", math.pi / 2)], id="abs"),
    pytest.param(
        problem_of("-sign(x)"), [("crossing", math.sqrt(2)), ("crossing", 3 * math.sqrt(2))], id="sign of a position"
    ),
    pytest.param(problem_of("-2*sign(v) + 1", "x: 0, v: 3"), [("stick", 3.0)], id="sign of a velocity sticks"),
    pytest.param(
        problem_of("-100*max(0, x - 1/2)", "x: 0, v: 1", "1"),
        [("crossing", 0.5), ("crossing", 0.5 + math.pi / 10)],
        id="max, in and out",
    ),
    pytest.param(problem_of("min(x, 2 - x)", "x: 0, v: 1", "1"), [("crossing", math.asinh(1))], id="min"),
    pytest.param(
        problem_of("1 + abs(abs(t - 2) - 1)", "x: 0, v: 0", "4"),
        [("crossing", 1.0), ("crossing", 2.0), ("crossing", 3.0)],
        id="of a kink",
    ),
    pytest.param(
        problem_of("-x + sign(sin(3*t))", until="3"),
        [("crossing", math.pi / 3), ("crossing", 2 * math.pi / 3)],
        id="square wave",
    ),
    pytest.param(
        problem_of("piecewise(0, t < 1, -1, t < 2, 0)", until="3"), [("crossing", 1.0), ("crossing", 2.0)], id="pulse"
    ),
]


@SOLVERS
@pytest.mark.parametrize(("problem", "expected"), LANDED)
def test_kinks_are_landed_on(name: str, problem: Problem, expected: list[tuple[str, float]]) -> None:
    run = run_of(name, problem)
    assert [t.kind for t in run.transitions] == [kind for kind, _ in expected]
    assert times_of(run) == pytest.approx([t for _, t in expected], rel=2e-12, abs=0)


@SOLVERS
def test_an_elastic_stop_is_gone_into_and_out_of(name: str) -> None:
    """Free fall from 1 onto a spring of stiffness 100: x = -1/100 + (1/100) cos(10 t) - (sqrt(2)/10) sin(10 t)."""
    text = """\
scene:
  bodies: {ball: {mass: 1}, floor: fixed}
  connections:
    - force: {on: ball, value: -1}
    - stop: {between: [ball, floor], gap: 0, stiffness: 100}
initial: {x_ball: 1, v_ball: 0}
until: 2
"""
    run = run_of(name, read_problem(text))
    down = math.sqrt(2)
    contact = 2 * (math.pi - math.atan(10 * math.sqrt(2))) / 10
    assert [(t.kind, t.to_mode) for t in run.transitions] == [("crossing", (-1,)), ("crossing", (1,))]
    assert times_of(run) == pytest.approx([down, down + contact], rel=2e-12, abs=0)


def test_a_damped_stop_does_not_pull_and_takes_energy() -> None:
    """The ball comes in with speed sqrt(2); its damping is limited at first, let go of, and limited at the end."""
    text = """\
scene:
  bodies: {ball: {mass: 1}, floor: fixed}
  connections:
    - force: {on: ball, value: -1}
    - stop: {between: [ball, floor], gap: 0, stiffness: 100, damping: 4}
initial: {x_ball: 1, v_ball: 0}
until: 2
"""
    problem = read_problem(text)
    assert problem.system.sign_names == ("g_ball_floor", "kink1", "kink2")
    runs = [run_of(name, problem) for name in ("henon", "scipy-dop853")]
    for run in runs:
        assert [(t.kind, t.surface) for t in run.transitions] == [("crossing", k) for k in (0, 2, 1, 0)]
        speeds = [abs(float(t.state[1])) for t in run.transitions]
        assert speeds[0] == pytest.approx(math.sqrt(2), abs=1e-11)
        assert 0 < speeds[3] < 0.8 * speeds[0]
        # From where it would pull until it is out of the stop gravity alone acts.
        (free, out) = run.transitions[2:]
        assert float(out.time) - float(free.time) == pytest.approx(free.state[1] - out.state[1], abs=1e-10)
    assert runs[0].transitions[3].time == pytest.approx(float(runs[1].transitions[3].time), abs=1e-10)


def test_a_square_wave_may_drive_a_scene() -> None:
    text = """\
scene:
  parameters: {w: pi}
  bodies: {a: {mass: 1}, floor: fixed}
  connections:
    - force: {on: a, value: 3*sign(sin(w*t))}
    - friction: {between: [a, floor], law: coulomb, force: 1}
initial: {x_a: 0, v_a: 0}
until: 3
"""
    problem = read_problem(text)
    assert problem.system.sign_names == ("kink1", "s_a_floor")
    run = solver("henon").prepare(problem, rtol=1e-12)()
    # Faster by 2 a second until 1, slower by 4 until 3/2, backward from there.
    assert [float(t.time) for t in run.transitions[:3]] == pytest.approx([1, 1.5, 2], abs=1e-12)


def test_a_system_with_kinks_needs_no_surfaces_and_its_own_come_first() -> None:
    text = """\
system: {state: [x], surfaces: {s: x - 2}, field: [1 - s*abs(x)]}
initial: {x: 1}
until: 1
"""
    system = read_problem(text).system
    assert system.sign_names == ("s", "kink1")
    assert system.surfaces == (X - 2, X)


@SOLVERS
def test_a_guard_may_have_a_kink(name: str) -> None:
    """Inside abs(x) < 1 nothing acts; beyond it a spring pulls back, on either side."""
    text = """\
system:
  state: [x, v]
  surfaces: {s: abs(x) - 1}
  field: [v, -x*(1 + s)/2]
initial: {x: 0, v: 1/2}
until: 9
"""
    system = read_problem(text).system
    assert [str(h) for h in system.surfaces] == ["x - 1", "-x - 1", "x"]
    assert system.sign_names == ("s", "s_2", "kink1")
    run = run_of(name, read_problem(text))
    # Out at x = 1 with v = 1/2 it is on x = cos(t) + sin(t)/2, back at 1 with -1/2 after 2 atan(1/2).
    out = 2.0
    back = out + 2 * math.atan(0.5)
    assert [(t.kind, t.surface) for t in run.transitions] == [("crossing", k) for k in (0, 0, 1, 1)]
    assert times_of(run) == pytest.approx([out, back, back + 4, back + 4 + 2 * math.atan(0.5)], abs=1e-10)


SIGNED = """\
system:
  state: [x, v]
  surfaces: {{s: "{surface}"}}
  field: [v, "{rate}"]
initial: {{x: 1, v: 0}}
until: 3
"""


@SOLVERS
@pytest.mark.parametrize(
    ("surface", "rate", "surfaces", "expected"),
    [
        # s = -1: x'' = -abs(x + 1), x = 2 cos(t) - 1 until x = -1, faster from there.
        ("v - 1/10", "-abs(x - s)", ["v - 1/10", "x - 1", "x + 1"], [(2, math.pi / 2)]),
        # s = -1: x'' = -2 x, and -x from where v = 1/10 on.
        (
            "v - 1/10",
            "-piecewise(x, s > 0, 2*x)",
            ["v - 1/10"],
            [(0, (math.pi + math.asin(0.05**0.5 / 10**0.5)) / 2**0.5)],
        ),
        ("v + 1/10", "-abs(s)*x", ["v + 1/10"], [(0, math.asin(0.1))]),
        ("v - 1/10", "-x*max(0, s)", ["v - 1/10"], []),
    ],
)
def test_a_kink_may_hold_signs(
    name: str, surface: str, rate: str, surfaces: list[str], expected: list[tuple[int, float]]
) -> None:
    problem = read_problem(SIGNED.format(surface=surface, rate=rate))
    assert [str(h) for h in problem.system.surfaces] == surfaces
    run = run_of(name, problem)
    assert [t.surface for t in run.transitions] == [i for i, _ in expected]
    assert times_of(run) == pytest.approx([t for _, t in expected], abs=1e-10)


def test_a_kink_of_more_signs_than_can_be_tried_is_refused_with_its_place() -> None:
    text = SIGNED.format(surface="v", rate="-abs(x - s - a - b - c - d)")
    text = text.replace('s: "v"', "s: v, a: x - 2, b: x - 3, c: x - 4, d: x - 5")
    with pytest.raises(CaseError, match="the argument of a kink has more than 4 signs") as caught:
        read_problem(text)
    assert str(caught.value).startswith("case.yaml:7:14: ")


@SOLVERS
@pytest.mark.parametrize(
    ("section", "expected"),
    [
        ("abs(x) - 1/2", [(0, math.pi / 3), (1, 2 * math.pi / 3), (1, 4 * math.pi / 3), (0, 5 * math.pi / 3)]),
        # v = 0 at pi does not count, where max(x, v) is v: it does; x = 0 at 3 pi/2, where it is v = 1, does not.
        ("max(x, v)", [(1, math.pi / 2), (0, math.pi)]),
        ("min(x, v)", [(0, 3 * math.pi / 2), (1, 2 * math.pi)]),
    ],
)
def test_a_section_may_have_kinks(name: str, section: str, expected: list[tuple[int, float]]) -> None:
    """x = cos(t), v = -sin(t): zeros of the section itself, not of branches that are not chosen there."""
    text = SIGNED.format(surface=section, rate="-x").replace("until: 3", "until: 13/2")
    problem = read_problem(text)
    run = run_of(name, problem)
    assert [(t.kind, t.surface) for t in run.transitions] == [("crossing", i) for i, _ in expected]
    assert times_of(run) == pytest.approx([t for _, t in expected], abs=1e-10)


def test_a_report_does_not_call_a_section_s_branches_jumps() -> None:
    system = read_problem(SIGNED.format(surface="abs(x) - 1/2", rate="-x + sign(v)")).system
    assert system.sign_names == ("s", "s_2", "kink1", "kink2")
    assert kink_notes(system) == ["`kink2`: a jump of the field"]


LOADED = """\
scene:
  bodies: {{a: {{mass: 1}}, r: {{mass: 1}}, floor: fixed}}
  connections:
    - friction: {{between: [a, floor], law: coulomb, force: 1, normal: "{load}"}}
initial: {{x_a: 0, v_a: 3, x_r: -1, v_r: 1}}
until: 4
"""


@SOLVERS
@pytest.mark.parametrize(
    ("load", "stop", "kinks"),
    [
        # Slower by 1 until t = 1, then by 2.
        ("piecewise(1, t < 1, 2)", 2.0, [1.0]),
        # abs(t - 1): 3 = 1/2 + (t - 1)^2/2.
        ("abs(x_r)", 1 + math.sqrt(5), [1.0]),
        # Nothing until t = 1.
        ("max(x_r, 0)", 1 + math.sqrt(6), [1.0]),
        ("2 + sign(x_r)", 1 + 2 / 3, [1.0]),
    ],
)
def test_a_load_may_have_kinks(name: str, load: str, stop: float, kinks: list[float]) -> None:
    problem = read_problem(LOADED.format(load=load))
    run = run_of(name, problem)
    rows = [(t.kind, float(t.time)) for t in run.transitions]
    assert [time for kind, time in rows if kind == "crossing"] == pytest.approx(kinks, abs=1e-10)
    assert [time for kind, time in rows if kind == "stick"] == pytest.approx([stop], abs=1e-9)


def test_what_is_continuous_is_told_from_what_jumps() -> None:
    text = """\
system:
  state: [x, v]
  surfaces: {section: x - 5}
  field: [v, "abs(x - v) + max(0, sin(t)) + piecewise(x^2, x < 1, 2*x - 1) + piecewise(0, v < 1, 1) + x*sign(v)"]
initial: {x: 0, v: 0}
until: 1
"""
    system = read_problem(text).system
    assert system.kinks == {1, 2, 3, 4, 5}
    assert continuous(system) == {1, 2, 3}
    assert kink_notes(system) == [
        "`section`: a section; no force depends on its sign, and it is always crossed",
        *(f"`kink{k}`: a kink of a continuous field; it is always crossed, without sliding" for k in (1, 2, 3)),
        *(f"`kink{k}`: a jump of the field" for k in (4, 5)),
    ]
