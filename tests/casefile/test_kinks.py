"""Kinks and jumps as people write them: the surfaces they become, and where runs land on them, by closed forms."""

from __future__ import annotations

import math
from itertools import pairwise, product
from pathlib import Path

import pytest
import sympy as sp

import henon_ref as hr
from henon_ref.casefile.case import parse_case
from henon_ref.casefile.expressions import parse_field
from henon_ref.casefile.kinks import Kinks
from henon_ref.casefile.work import Work
from henon_ref.errors import CaseError, ExpressionError
from henon_ref.harness.registry import solver
from henon_ref.harness.report.text.model import kink_notes
from henon_ref.harness.truth.compute import compute, stored_truth, truth_for
from henon_ref.modes.kinks import continuous
from henon_ref.modes.problem import Problem

X, V, T, K = sp.symbols("x v t k", real=True)
K1, K2, K3 = sp.symbols("kink1 kink2 kink3", real=True)
NAMES = {"x": X, "v": V, "t": T, "k": K}


def read(*texts: str) -> tuple[list[sp.Expr], dict[sp.Symbol, sp.Expr]]:
    kinks = Kinks({K: sp.Integer(-2)})
    found = [kinks.resolved(*parse_field(text, NAMES, Work())) for text in texts]
    return found, kinks.surfaces


@pytest.mark.parametrize(
    ("text", "expected", "surfaces"),
    [
        ("abs(x)", X * K1, [X]),
        ("-k*abs(x - v)", -K * (X - V) * K1, [X - V]),
        ("sign(sin(t))", K1, [sp.sin(T)]),
        ("max(0, x)", X * (1 - K1) / 2, [-X]),
        ("max(x, v)", X * (1 + K1) / 2 + V * (1 - K1) / 2, [X - V]),
        ("min(x, v)", V * (1 + K1) / 2 + X * (1 - K1) / 2, [X - V]),
        ("piecewise(x, v < 1, 0)", X * (1 + K1) / 2, [1 - V]),
        ("piecewise(x, v >= 1, 0)", X * (1 + K1) / 2, [V - 1]),
        ("abs(3)", 3, []),
        ("abs(k)", -K, []),
        ("max(x, x)", X, []),
        ("piecewise(x, 1 < 2, v)", X, []),
        ("0*abs(x) + v", V, []),
    ],
)
def test_what_is_written_is_what_it_is_with_a_sign(text: str, expected: sp.Expr, surfaces: list[sp.Expr]) -> None:
    (found,), made = read(text)
    assert found == expected
    assert list(made.values()) == surfaces


def test_branches_are_chosen_in_turn() -> None:
    (found,), made = read("piecewise(1, t < 1, x, t < 2, v)")
    assert list(made.values()) == [1 - T, 2 - T]
    values = {(1, 1): 1, (1, -1): 1, (-1, 1): X, (-1, -1): V}
    assert {at: found.xreplace({K1: sp.Integer(at[0]), K2: sp.Integer(at[1])}) for at in values} == values


def test_kinks_are_numbered_as_they_appear_and_an_equal_argument_counts_once() -> None:
    (one, two), made = read("abs(2*x - 2*v) + sign(t - 1)", "max(v, x) - abs(1 - t) + abs(v)")
    assert made == {K1: 2 * X - 2 * V, K2: T - 1, K3: V}
    assert one == K1 * (2 * X - 2 * V) + K2
    assert sp.expand(two - (V * (1 - K1) / 2 + X * (1 + K1) / 2 + K2 * (1 - T) + K3 * V)) == 0


@pytest.mark.parametrize("text", ["abs(abs(x) - 1)", "max(x, v, 1)", "min(x, 2, -v, t)", "sign(max(x, abs(v)) - 1)"])
def test_kinks_of_kinks_are_branches_whose_values_are_right(text: str) -> None:
    (found,), made = read(text)
    plain = {"abs": abs, "max": max, "min": min, "sign": lambda u: (u > 0) - (u < 0)}
    for x, v, t in product((-2.5, -0.75, 0.25, 1.75), (-1.5, -0.5, 1.25), (-3.25, 0.125)):
        at = {X: x, V: v, T: t}
        signs = {sign: sp.sign(surface.xreplace(at)) for sign, surface in made.items()}
        assert not any(surface.has(*made) for surface in made.values())
        assert float(found.xreplace(signs).xreplace(at)) == eval(text, plain, {"x": x, "v": v, "t": t})


@pytest.mark.parametrize(
    ("text", "offset", "says"),
    [
        ("sign(abs(x) + abs(v) + abs(t) + abs(x - 1) + abs(x - 2) - 9)", 0, "more than 4 kinks of its own"),
        ("piecewise(1, x, 2)", 14, "a condition has one comparison"),
        ("piecewise(1, 0 < x < 2, 2)", 19, "a condition has one comparison"),
        ("piecewise(1, x < 2)", 0, "the value otherwise"),
        ("piecewise(1, x < 2, 3, x < 4)", 0, "the value otherwise"),
        ("piecewise(1, < 2, 3)", 13, "missing before '<'"),
        ("x < 1", 2, "in a condition of 'piecewise' only"),
        ("piecewise(x < 1, x < 1, 2)", 12, "in a condition of 'piecewise' only"),
        ("max(x)", 0, "takes two arguments or more"),
        ("abs(x, 2)", 5, "takes 1 argument"),
        ("floor(x)", 0, "jumps without end"),
        ("mod(x, 2)", 0, "jumps without end"),
        ("heaviside(x)", 0, "write piecewise(1, x > 0, 0)"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_place(text: str, offset: int, says: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse_field(text, NAMES, Work())
    assert says in caught.value.message
    assert caught.value.offset == offset


# -- landed on by closed forms --------------------------------------------------------------------------


def problem_of(rate: str, initial: str = "x: 1, v: 0", until: str = "5") -> Problem:
    text = f"""\
schema: 1
name: kinks
title: Kinks
system:
  state: [x, v]
  field: [v, "{rate}"]
initial: {{{initial}}}
until: {until}
"""
    return parse_case(text).readings[0].problem


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
SOLVERS = pytest.mark.parametrize("name", ["henon", "scipy-dop853"])


@SOLVERS
@pytest.mark.parametrize(("problem", "expected"), LANDED)
def test_kinks_are_landed_on(name: str, problem: Problem, expected: list[tuple[str, float]]) -> None:
    run = solver(name).prepare(problem, rtol=1e-13, atol=1e-14)()
    assert run.status == "ok"
    assert [t.kind for t in run.transitions] == [kind for kind, _ in expected]
    assert [float(t.time) for t in run.transitions] == pytest.approx([t for _, t in expected], rel=2e-12, abs=0)


@SOLVERS
def test_an_elastic_stop_is_gone_into_and_out_of(name: str) -> None:
    """Free fall from 1 onto a spring of stiffness 100: x = -1/100 + (1/100) cos(10 t) - (sqrt(2)/10) sin(10 t)."""
    text = """\
schema: 1
name: ball
title: A ball on an elastic stop
scene:
  bodies: {ball: {mass: 1}, floor: fixed}
  connections:
    - force: {on: ball, value: -1}
    - stop: {between: [ball, floor], gap: 0, stiffness: 100}
initial: {x_ball: 1, v_ball: 0}
until: 2
"""
    run = solver(name).prepare(parse_case(text).readings[0].problem, rtol=1e-13, atol=1e-14)()
    down = math.sqrt(2)
    contact = 2 * (math.pi - math.atan(10 * math.sqrt(2))) / 10
    assert [(t.kind, t.to_mode) for t in run.transitions] == [("crossing", (-1,)), ("crossing", (1,))]
    assert [float(t.time) for t in run.transitions] == pytest.approx([down, down + contact], rel=2e-12, abs=0)


def test_a_damped_stop_does_not_pull_and_takes_energy() -> None:
    """The ball comes in with speed sqrt(2); its damping is limited at first, let go of, and limited at the end."""
    text = """\
schema: 1
name: ball
title: A ball on a damped stop
scene:
  bodies: {ball: {mass: 1}, floor: fixed}
  connections:
    - force: {on: ball, value: -1}
    - stop: {between: [ball, floor], gap: 0, stiffness: 100, damping: 4}
initial: {x_ball: 1, v_ball: 0}
until: 2
"""
    problem = parse_case(text).readings[0].problem
    assert problem.system.sign_names == ("g_ball_floor", "kink1", "kink2")
    runs = [solver(name).prepare(problem, rtol=1e-12, atol=1e-13)() for name in ("henon", "scipy-dop853")]
    for run in runs:
        assert run.status == "ok"
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
schema: 1
name: driven
title: A block that is pushed to and fro
scene:
  parameters: {w: pi}
  bodies: {a: {mass: 1}, floor: fixed}
  connections:
    - force: {on: a, value: 3*sign(sin(w*t))}
    - friction: {between: [a, floor], law: coulomb, force: 1}
initial: {x_a: 0, v_a: 0}
until: 3
"""
    problem = parse_case(text).readings[0].problem
    assert problem.system.sign_names == ("kink1", "s_a_floor")
    run = solver("henon").prepare(problem, rtol=1e-12)()
    # Faster by 2 a second until 1, slower by 4 until 3/2, backward from there.
    assert [float(t.time) for t in run.transitions[:3]] == pytest.approx([1, 1.5, 2], abs=1e-12)


def test_a_system_with_kinks_needs_no_surfaces_and_its_own_come_first() -> None:
    text = """\
schema: 1
name: both
title: Both
system: {state: [x], surfaces: {s: x - 2}, field: [1 - s*abs(x)]}
initial: {x: 1}
until: 1
"""
    system = parse_case(text).readings[0].problem.system
    assert system.sign_names == ("s", "kink1")
    assert system.surfaces == (X - 2, X)


@SOLVERS
def test_a_guard_may_have_a_kink(name: str) -> None:
    """Inside abs(x) < 1 nothing acts; beyond it a spring pulls back, on either side."""
    text = """\
schema: 1
name: well
title: Well
system:
  state: [x, v]
  surfaces: {s: abs(x) - 1}
  field: [v, -x*(1 + s)/2]
initial: {x: 0, v: 1/2}
until: 9
"""
    system = parse_case(text).readings[0].problem.system
    assert [str(h) for h in system.surfaces] == ["x - 1", "-x - 1", "x"]
    assert system.sign_names == ("s", "s_2", "kink1")
    run = solver(name).prepare(parse_case(text).readings[0].problem, rtol=1e-12, atol=1e-13)()
    # Out at x = 1 with v = 1/2 it is on x = cos(t) + sin(t)/2, back at 1 with -1/2 after 2 atan(1/2).
    out = 2.0
    back = out + 2 * math.atan(0.5)
    assert run.status == "ok"
    assert [(t.kind, t.surface) for t in run.transitions] == [("crossing", k) for k in (0, 0, 1, 1)]
    assert [float(t.time) for t in run.transitions] == pytest.approx(
        [out, back, back + 4, back + 4 + 2 * math.atan(0.5)], abs=1e-10
    )


SIGNED = """\
schema: 1
name: signed
title: Kinks of what holds a sign
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
    problem = parse_case(SIGNED.format(surface=surface, rate=rate)).readings[0].problem
    assert [str(h) for h in problem.system.surfaces] == surfaces
    run = solver(name).prepare(problem, rtol=1e-12, atol=1e-13)()
    assert run.status == "ok"
    assert [t.surface for t in run.transitions] == [i for i, _ in expected]
    assert [float(t.time) for t in run.transitions] == pytest.approx([t for _, t in expected], abs=1e-10)


def test_a_kink_of_more_signs_than_can_be_tried_is_refused_with_its_place() -> None:
    text = SIGNED.format(surface="v", rate="-abs(x - s - a - b - c - d)")
    text = text.replace('s: "v"', "s: v, a: x - 2, b: x - 3, c: x - 4, d: x - 5")
    with pytest.raises(CaseError, match="a kink of what holds more than 4 signs") as caught:
        parse_case(text, file="case.yaml")
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
    problem = parse_case(text).readings[0].problem
    run = solver(name).prepare(problem, rtol=1e-12, atol=1e-13)()
    assert run.status == "ok"
    assert [(t.kind, t.surface) for t in run.transitions] == [("crossing", i) for i, _ in expected]
    assert [float(t.time) for t in run.transitions] == pytest.approx([t for _, t in expected], abs=1e-10)


def test_a_report_does_not_call_a_section_s_branches_jumps() -> None:
    system = parse_case(SIGNED.format(surface="abs(x) - 1/2", rate="-x + sign(v)")).readings[0].problem.system
    assert system.sign_names == ("s", "s_2", "kink1", "kink2")
    assert kink_notes(system) == ["`kink2`: a jump of the field"]


LOADED = """\
schema: 1
name: loaded
title: A block under a load
scene:
  bodies: {{a: {{mass: 1}}, r: {{mass: 1}}, floor: fixed}}
  connections:
    - friction: {{between: [a, floor], law: coulomb, force: 1, normal: "{load}"}}
initial: {{x_a: 0, v_a: 3, x_r: -1, v_r: 1}}
until: 3
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
    problem = parse_case(LOADED.format(load=load).replace("until: 3", "until: 4")).readings[0].problem
    run = solver(name).prepare(problem, rtol=1e-12, atol=1e-13)()
    assert run.status == "ok"
    rows = [(t.kind, float(t.time)) for t in run.transitions]
    assert [time for kind, time in rows if kind == "crossing"] == pytest.approx(kinks, abs=1e-10)
    assert [time for kind, time in rows if kind == "stick"] == pytest.approx([stop], abs=1e-9)


HIDDEN = "piecewise(2*sign(t - 1), x > 2, 0) - piecewise(0, x > 2, sign(t - 3))"
"""While x > 2 the jump at 3 is none, and until then that at 1 is none."""


@SOLVERS
def test_a_kink_that_another_branch_hides_is_none(name: str) -> None:
    """From 0 with speed 1, x'' = 1: x = t + t^2/2 is 2 at sqrt(5) - 1; x'' is 2 from there, and stays so at 3."""
    run = solver(name).prepare(problem_of(HIDDEN, "x: 0, v: 1", "4"), rtol=1e-12, atol=1e-13)()
    assert run.status == "ok"
    assert [(t.kind, t.surface) for t in run.transitions] == [("crossing", 0)]
    assert float(run.transitions[0].time) == pytest.approx(math.sqrt(5) - 1, abs=1e-11)


def test_a_method_of_fixed_steps_leaves_it_out_too() -> None:
    run = solver("henon-rk4").prepare(problem_of(HIDDEN, "x: 0, v: 1", "4"), step=1e-2)()
    assert [(t.kind, t.surface) for t in run.transitions] == [("crossing", 0)]


def test_simulate_leaves_it_out_too() -> None:
    system = hr.System(["x", "v"], {}, {}, ["v", HIDDEN])
    run = hr.simulate(system, {"x": 0, "v": 1}, until=4)
    assert run.transitions["surface"].tolist() == ["kink1"]
    assert run.transitions["time_s"].tolist() == pytest.approx([math.sqrt(5) - 1], abs=1e-9)


def test_a_stream_leaves_it_out_too() -> None:
    system = hr.System(["x", "v"], {}, {}, ["v", HIDDEN])
    run = hr.stream(system, {"x": 0, "v": 1}, until=4)
    assert [(row.surface, row.to_mode) for row in run] == [("kink1", "kink1=+1 kink2=+1 kink3=+1")]
    assert run.outcome is not None
    assert run.outcome.success


def test_a_section_by_the_name_of_a_kink_leaves_it_out_and_one_by_its_expression_does_not() -> None:
    """From -10 the run does not come to 2: the jump at t = 3 is one there, that at t = 1 is not."""
    system = hr.System(["x", "v"], {}, {}, ["v", HIDDEN])
    sections = [hr.observe.section(of, name=name) for of, name in (("kink3", "named"), ("t - 3", "written"))]
    table = hr.sweep(system, {"x": 0, "v": 1}, until=4, grid={"x": [-10, 0]}, observe=sections, jobs=1)
    assert table.frames["named"]["point"].tolist() == [0]
    assert table.frames["written"]["point"].tolist() == [0, 1]
    assert table.frames["written"]["time_s"].tolist() == pytest.approx([3, 3], abs=1e-12)


@SOLVERS
def test_a_kink_is_there_where_its_branch_is(name: str) -> None:
    run = solver(name).prepare(problem_of(HIDDEN, "x: -10, v: 1", "4"), rtol=1e-12, atol=1e-13)()
    assert [(t.kind, t.surface) for t in run.transitions] == [("crossing", 2)]
    assert float(run.transitions[0].time) == pytest.approx(3, abs=1e-12)


def test_what_is_continuous_is_told_from_what_jumps() -> None:
    text = """\
schema: 1
name: all
title: All
system:
  state: [x, v]
  surfaces: {section: x - 5}
  field: [v, "abs(x - v) + max(0, sin(t)) + piecewise(x^2, x < 1, 2*x - 1) + piecewise(0, v < 1, 1) + x*sign(v)"]
initial: {x: 0, v: 0}
until: 1
"""
    system = parse_case(text).readings[0].problem.system
    assert system.kinks == {1, 2, 3, 4, 5}
    assert continuous(system) == {1, 2, 3}
    assert kink_notes(system) == [
        *(
            f"`kink{k}`: a kink, the field is continuous there; it is crossed, and nothing slides on it"
            for k in (1, 2, 3)
        ),
        *(f"`kink{k}`: a jump of the field" for k in (4, 5)),
    ]


def test_the_truth_leaves_hidden_kinks_out_too() -> None:
    text = f"""\
schema: 1
name: hidden
title: Hidden
system:
  state: [x, v]
  field: [v, "{HIDDEN}"]
initial: {{x: 0, v: 1}}
until: 4
"""
    case = parse_case(text)
    found = compute(case, case.readings[0])
    assert found.status == "ok"
    assert [(t.kind, t.surface) for t in found.transitions] == [("crossing", 0)]
    assert float(found.transitions[0].time_digits) == pytest.approx(math.sqrt(5) - 1, abs=1e-15)


DAMPED = """\
schema: 1
name: between
title: Between two damped stops
scene:
  bodies: {a: {mass: 1}, frame: fixed}
  connections:
    - stop: {between: [a, frame], gap: -1/2, stiffness: 10, damping: 3/2}
    - stop: {between: [frame, a], gap: -1/2, stiffness: 10, damping: 3/2}
initial: {x_a: 2, v_a: 0}
until: 2
"""


@SOLVERS
def test_modes_follow_on_each_other_though_hidden_kinks_change_their_signs(name: str) -> None:
    """From the middle of the flight on the damping's limits at the stop that was left change their signs."""
    run = solver(name).prepare(parse_case(DAMPED).readings[0].problem, rtol=1e-12, atol=1e-13)()
    assert [t.surface for t in run.transitions] == [4, 3, 0, 2, 1, 0]
    for before, after in pairwise(run.transitions):
        assert before.to_mode == after.from_mode
    assert run.end_mode == run.transitions[-1].to_mode == (1, 1, 1, 1, 1, 1)


def test_a_truth_whose_hidden_kinks_change_their_signs_is_stored_and_read_again(tmp_path: Path) -> None:
    case = parse_case(DAMPED)
    found = truth_for(case, case.readings[0], folder=tmp_path)
    assert found.certified
    assert [t.surface for t in found.transitions] == [4, 3, 0, 2, 1, 0]
    stored = stored_truth(case, case.readings[0], tmp_path)
    assert stored is not None
    assert stored.transitions == found.transitions


@pytest.mark.parametrize(
    "text",
    [
        "piecewise(sign(v), abs(v) > 0, 2)",
        "piecewise(2, abs(v) <= 0, sign(v))",
        "piecewise(1, v > 0, -1, v < 0, 2)",
        "sign(v)*piecewise(1, abs(v) > 0, 2)",
    ],
)
def test_a_value_on_a_surface_that_neither_side_has_is_refused(text: str) -> None:
    with pytest.raises(ExpressionError, match=r"where v is 0 this is 2.*'static'"):
        parse_field(text, NAMES, Work())


TAKEN = {
    "piecewise(1, v > 0, -1, v < 0, 0)": "sign(v)",
    "piecewise(sign(v), abs(v) > 0, 0)": "sign(v)",
    "piecewise(1, v >= 0, -1, v < 0, 7)": "sign(v)",
    "piecewise(1, v > 0, -1)": "sign(v)",
    "piecewise(x, x > 0, 0)": "Max(x, 0)",
    "piecewise(0, x > 0, log(-x))": "Piecewise((0, x > 0), (log(-x), True))",
    "piecewise(1, x < 1, 2, x < 2, 3)": "Piecewise((1, x < 1), (2, x < 2), (3, True))",
    "piecewise(1, abs(v) > 0.001, 1000*v)": "1",
}
"""What is written, and the same in SymPy's words wherever the tests look."""


@pytest.mark.parametrize("text", TAKEN)
def test_a_value_on_a_surface_that_changes_nothing_is_taken(text: str) -> None:
    """Beside its surfaces the field has the values that are written."""
    written = sp.sympify(TAKEN[text], locals=NAMES)
    (found,), made = read(text)
    for x, v in product((sp.Rational(-5, 2), sp.Rational(3, 2), sp.Rational(5, 2)), repeat=2):
        at = {X: x, V: v}
        signs = {sign: sp.sign(surface.xreplace(at)) for sign, surface in made.items()}
        assert found.xreplace(signs).xreplace(at) == written.xreplace(at)


def test_the_least_of_300_terms_is_read_and_stays_short() -> None:
    (found,), made = read(f"min({', '.join(f'{k}*x' for k in range(1, 301))})")
    assert list(made.values()) == [-X]
    values = [found.xreplace({K1: sp.Integer(side)}) for side in (1, -1)]
    assert [sp.expand(value) for value in values] == [300 * X, X]


# -- kinks that are surfaces ----------------------------------------------------------------------------

x, v, vb, F, d, s = sp.symbols("x v vb F d s", real=True)
SPEEDS = [
    "abs(v - vb)",
    "abs(vb - v)",
    "abs(2*(v - vb))/2",
    "2*abs(vb/2 - v/2)",
    "sqrt((v - vb)^2)",
    "((v - vb)^2)^(1/2)",
    "sqrt((2*vb - 2*v)^2)/2",
    "max(v - vb, vb - v)",
    "-min(v - vb, vb - v)",
    "sign(v - vb)*(v - vb)",
    "(v - vb)*sign(4*v - 4*vb)",
    "piecewise(v - vb, v >= vb, vb - v)",
    "exp(-x)*abs(exp(x)*(v - vb))",
    "abs((1 + x^2)*(v - vb))/(1 + x^2)",
    "abs(exp(d)*v - exp(d)*vb)*exp(-d)",
    sp.Abs(v - vb),
    sp.Max(v - vb, vb - v),
    sp.Piecewise((v - vb, v > vb), (vb - v, True)),
    sp.sqrt((sp.Symbol("v") - sp.Symbol("vb")) ** 2),
]
"""The speed of sliding on a belt beside its surface."""


def belt_with(speed: object, sign: str = "s") -> hr.System:
    rate = f"-x - F*{sign}/(1 + d*({speed}))" if isinstance(speed, str) else -x - F * s / (1 + d * speed)
    return hr.System(["x", "v"], {"F": 1, "d": 3, "vb": 0.5}, {"s": "v - vb"}, ["v", rate])


@pytest.mark.parametrize("speed", SPEEDS, ids=str)
def test_a_kink_that_is_a_surface_up_to_a_factor_has_its_sign(speed: object) -> None:
    """Friction laws as people write them, ``abs(v - vb)`` beside the surface ``v - vb``, in the seven forms or more."""
    hand, system = belt_with("s*(v - vb)"), belt_with(speed)
    assert system.model.surfaces == hand.model.surfaces
    assert not system.model.kinks
    runs = [hr.simulate(each, {"x": 0, "v": 0}, until=20) for each in (hand, system)]
    exact = str(speed).count("exp") == 0 and "x" not in str(speed)  # else what is written rounds otherwise
    if exact:
        assert runs[0].y.tolist() == runs[1].y.tolist()
        assert runs[0].transitions.equals(runs[1].transitions)
    assert runs[0].transitions["kind"].tolist() == runs[1].transitions["kind"].tolist()
    assert runs[1].transitions["time_s"].to_numpy() == pytest.approx(runs[0].transitions["time_s"].to_numpy(), rel=1e-9)


def test_so_has_a_load_beside_the_surface_and_a_jump_there() -> None:
    """max(0, v - vb) of a damper that acts one way, and friction of two sizes: convex combinations slide."""
    hand = belt_with("s*(v - vb)").model
    one_way = belt_with("s*(v - vb) + max(0, v - vb)").model
    assert one_way.surfaces == hand.surfaces
    assert sp.expand(one_way.field[1] - (-x - F * s / (1 + d * (s * (v - vb) + (v - vb) * (1 + s) / 2)))) == 0
    sizes = hr.System(["v"], {"vb": 1}, {"s": "v - vb"}, ["2 - s*piecewise(3, v > vb, 1)"])
    assert sizes.model.surfaces == (v - vb,)
    run = hr.simulate(sizes, {"v": 0}, until=2)  # dv/dt is 3 below and -1 above
    assert run.transitions[["time_s", "kind"]].to_numpy().tolist() == [[pytest.approx(1 / 3), "stick"]]


@pytest.mark.parametrize(
    ("argument", "merged"),
    [
        ("d*(v - vb)", False),  # d may be made negative
        ("(d^2 + 1)*(v - vb)", True),
        ("(1 - sqrt(2))*(v - vb)", True),
        ("v - vb + 1/1000", False),
        ("v^2 - vb^2", False),
        ("x*(v - vb)", False),
        ("(x - 1)*(v - vb) - x*(v - vb)", True),
        ("d*v - d*vb", False),
    ],
)
def test_a_factor_counts_where_its_sign_is_certain(argument: str, merged: bool) -> None:
    system = hr.System(["x", "v"], {"d": 3, "vb": 0.5}, {"s": "v - vb"}, ["v", f"-x - s - abs({argument})"])
    assert bool(system.model.kinks) is not merged


def test_kinks_of_one_form_are_one() -> None:
    (one, two), made = read("abs(exp(t)*(x - v))", "abs((v - x)/(1 + t^2))")
    assert list(made) == [K1]
    assert sp.simplify(one - K1 * sp.exp(T) * (X - V)) == 0
    assert sp.simplify(two - K1 * (X - V) / (1 + T**2)) == 0


@pytest.mark.parametrize("order", [("rub", "grip"), ("grip", "rub")])
def test_a_load_that_has_the_kink_of_another_contact_s_surface_has_its_sign(order: tuple[str, str]) -> None:
    """Whichever of the two connections the scene names first."""
    connections = {
        "rub": "friction: {between: [a, belt], law: coulomb, force: 0.2, name: rub}",
        "grip": "friction: {between: [a, wall], law: coulomb, force: 0.1, normal: '1 + abs(v_a - 1/2)', name: grip}",
    }
    text = f"""\
schema: 1
name: loads
title: Loads
scene:
  bodies:
    a: {{mass: 1}}
    wall: fixed
    belt: {{velocity: 1/2}}
  connections:
    - spring: {{between: [a, wall], stiffness: 1}}
    - {connections[order[0]]}
    - {connections[order[1]]}
initial: {{x_a: 1, v_a: 0}}
until: 10
"""
    model = parse_case(text).readings[0].problem.system
    speed = model.surfaces[model.sign_names.index("rub")]
    assert {model.surfaces[i] for i in model.kinks} == {1 + speed, 1 - speed}  # where max(0, load) begins
    acceleration = model.field[1].xreplace(dict.fromkeys(model.signs, sp.S.One))
    assert sp.expand(acceleration) == sp.expand(-model.states[0] - sp.Rational(1, 5) - (1 + speed) / 10)
