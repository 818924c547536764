"""Groups of contacts with static friction that act on each other at once: stacks of blocks on a floor, in closed form.

Block a (1 kg) stands on the floor, b (1 kg) on a; a force t pulls a. Both are at rest at first.
"""

from __future__ import annotations

from itertools import pairwise

import pytest
import sympy as sp
from contact_scenes import ALL_LIBRARIES, LIBRARIES, scene
from flint import arb, ctx
from multiprecision import simulate
from often import daily
from problems import read_problem
from random_stacks import runs

from henon_ref.enclosure.balls import enclose
from henon_ref.enclosure.run import certify
from henon_ref.errors import ModelError
from henon_ref.harness.registry import solver
from henon_ref.harness.truth.multiprecision.points import SeriesEvaluation
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import initial_mode
from henon_ref.modes.switched_field import Release, SlidingOverride
from henon_ref.modes.system import FilippovSystem


def stack(
    statics: list[str], forces: list[str], kinetic: list[str], until: str = "3", velocities: list[str] | None = None
) -> Problem:
    """Blocks of 1 kg, one on the other, from the floor up; a force on each."""
    blocks = [f"b{i}" for i in range(len(statics))]
    contacts = [
        (b, below, f"force: {force}, static: {static}")
        for (below, b), static, force in zip(pairwise(["floor", *blocks]), statics, kinetic, strict=True)
    ]
    pulls = {b: f for b, f in zip(blocks, forces, strict=True) if f != "0"}
    speeds = {f"v_{b}": v for b, v in zip(blocks, velocities or [], strict=False)}
    bodies = {**dict.fromkeys(blocks, "{mass: 1}"), "floor": "fixed"}
    return scene(bodies, contacts, pulls, until, **speeds)


def first_mode(problem: Problem) -> Mode | None:
    """The mode at the start by the multiprecision truth, whose run finds nothing else."""
    run = simulate(problem, 256)
    assert (run.status, run.events) == ("ok", []), run.reason
    return initial_mode(SeriesEvaluation(problem.system, 256).at_start(problem), problem).mode


SETS_OFF = stack(["2", "2/5"], ["t", "0"], ["1", "3/10"]), [sp.Integer(2)] * 2, [(1, -1)] * 2
"""At t = 2 the floor lets go; what b needs to follow, (2 - 1)/2, is more than 2/5: it is left behind at once."""
FOLLOWS = stack(["2", "3/5"], ["t", "0"], ["1", "3/10"]), [sp.Integer(2), sp.Rational(11, 5)], [(1, 0), (1, -1)]
"""Up to (t - 1)/2 = 3/5 it follows."""
PULLED = stack(["21/10", "2"], ["0", "t"], ["3/2", "1"]), [sp.Integer(2)], [(0, 1)]
"""The upper one is pulled, both loads are t: at t = 2 b can be held no more. It slips, and the floor carries 1."""
EVENTS = pytest.mark.parametrize(
    ("problem", "times", "modes"), [SETS_OFF, FOLLOWS, PULLED], ids=["sets off", "follows", "pulled"]
)


@EVENTS
@ALL_LIBRARIES
def test_a_stick_that_lets_go_sets_off_its_neighbour_where_that_cannot_follow(  # type: ignore[no-untyped-def]
    name, options, bound, problem, times, modes
) -> None:
    run = solver(name).prepare(problem, **options)()
    assert run.status == "ok", run.reason
    assert [(t.kind, t.to_mode) for t in run.transitions] == [("release", mode) for mode in modes]
    assert [t.time for t in run.transitions] == pytest.approx([float(t) for t in times], abs=bound, rel=0)
    assert len({t.surface for t in run.transitions}) == len(times)


@EVENTS
def test_both_truths_see_it(problem, times, modes) -> None:  # type: ignore[no-untyped-def]
    proof, second = certify(problem), simulate(problem, 256)
    assert proof.status == "certified", proof.reason
    assert [t.to_mode for t in proof.transitions] == modes
    with ctx.workprec(2 * proof.bits):
        assert all(t.time.overlaps(enclose(e)) for t, e in zip(proof.transitions, times, strict=True))
    assert [e.after for e in second.events] == sorted(set(modes), key=modes.index)


def test_what_slips_falls_to_kinetic_friction_and_may_let_others_hold() -> None:
    """At rest 23/10 is on the floor and 1 on b, more than either holds; at their limits both move with 1/5, as one.

    So the floor slips, and beneath it a block that moves with (23/10 - 1/5)/2 carries b along.
    """
    problem = stack(["19/10", "4/5"], ["13/10", "1"], ["1/5", "1/2"], "1")
    for name, options, _ in LIBRARIES:
        run = solver(name).prepare(problem, **options)()
        assert (run.status, list(run.transitions), run.end_mode) == ("ok", [], (1, 0)), (name, run.reason)
    assert first_mode(problem) == (1, 0)


def test_a_stack_that_arrives_holds_what_it_can() -> None:
    """a comes to rest under b, which slides on it: the floor carries the friction of b, then everything."""
    problem = stack(["2", "1"], ["0", "0"], ["3/2", "1"], "4", ["1", "3"])
    run, proof = solver("henon").prepare(problem, rtol=1e-13)(), certify(problem)
    # a' = -3/2 + 1, b' = -1: a stands at t = 2, b at t = 3.
    assert [(t.kind, t.surface, t.to_mode) for t in run.transitions] == [("stick", 0, (0, 1)), ("stick", 1, (0, 0))]
    assert [t.time for t in run.transitions] == pytest.approx([2, 3], abs=1e-13)
    assert [t.to_mode for t in proof.transitions] == [(0, 1), (0, 0)]
    assert run.end_state == pytest.approx((1, 0, 4.5, 0), abs=1e-12)


def test_loads_of_a_stack_that_holds_are_those_of_statics() -> None:
    system = stack(["5", "4", "3"], ["t", "2*t", "-t/2"], ["1", "1", "1"]).system
    guards = system.equations((0, 0, 0)).guards
    t = sp.Symbol("t", real=True)
    (time,) = guards[0].expression.free_symbols
    loads = [sp.Rational(5, 2) * t, sp.Rational(3, 2) * t, -t / 2]
    expected = [e for limit, load in zip((5, 4, 3), loads, strict=True) for e in (limit - load, limit + load)]
    assert [sp.expand(g.expression.xreplace({time: t}) - e) for g, e in zip(guards, expected, strict=True)] == [0] * 6


@pytest.mark.parametrize("count", daily([9, 12], some=[9]))
def test_many_contacts_of_one_group_are_decided(count: int) -> None:
    """The floor lets go at t = 12; contact k then carries (count - k)/count of t - 6, less than 6 for some time."""
    problem = stack(["12"] + ["6"] * (count - 1), ["t"] + ["0"] * (count - 1), ["6"] * count, "25/2")
    run = solver("henon").prepare(problem, rtol=1e-13)()
    assert [(t.kind, t.to_mode) for t in run.transitions] == [("release", (1, *(0,) * (count - 1)))]
    assert run.transitions[0].time == pytest.approx(12, abs=1e-12)


@pytest.mark.parametrize(
    ("forces", "kinetic", "time", "modes", "speeds"),
    [
        (["t", "0"], ["0", "1"], 2, [(1, 0)], (1.25, 1.25)),  # (9 - 4)/4
        (["t", "0"], ["1", "0"], 2, [(1, 0)], (0.75, 0.75)),
        (["0", "t"], ["1", "0"], 2, [(0, 1)], (0, 2.5)),
    ],
)
def test_contacts_that_hold_and_slide_without_friction(forces, kinetic, time, modes, speeds) -> None:  # type: ignore[no-untyped-def]
    problem = stack(["2", "2"], forces, kinetic)
    for name, options, bound in LIBRARIES:
        run = solver(name).prepare(problem, **options)()
        assert [t.to_mode for t in run.transitions] == modes, (name, run.reason)
        assert run.transitions[0].time == pytest.approx(time, abs=bound)
        assert run.end_state[1::2] == pytest.approx(speeds, abs=10 * bound)
    assert [e.after for e in simulate(problem, 256).events] == modes


def test_a_group_at_rest_on_a_kink_holds_beside_it() -> None:
    """The elastic stop is just touched. At t = 2 both loads are at their limits; a then carries what it slides with."""
    text = """scene:
  bodies: {a: {mass: 1}, b: {mass: 1}, floor: fixed}
  connections:
    - friction: {between: [a, floor], law: coulomb, force: 1, static: 2}
    - friction: {between: [b, a], law: coulomb, force: 1, static: 2}
    - force: {on: b, value: t}
    - stop: {between: [a, floor], gap: 0, stiffness: 100}
initial: {t: 0, x_a: 0, v_a: 0, x_b: 0, v_b: 0}
until: 3
"""
    problem = read_problem(text)
    for name, options, bound in LIBRARIES:
        run = solver(name).prepare(problem, **options)()
        assert [t.to_mode for t in run.transitions] == [(0, 1, 1)], (name, run.reason)
        assert run.end_state[1::2] == pytest.approx((0, 1.5), abs=10 * bound)


MIXED = """\
scene:
  bodies: {{c: {{mass: 1}}, wall: fixed, belt: {{velocity: "-0.35*t^{power}"}}}}
  connections:
    - friction: {{between: [c, wall], law: coulomb, force: 1.4, static: {wall}}}
    - friction: {{between: [c, belt], law: coulomb, force: 1{belt}}}
    - force: {{on: c, value: -1.2}}
initial: {{t: 0, x_c: 0, v_c: 0}}
until: 0.5
"""


@pytest.mark.parametrize("power", [1, 2, 3])
@pytest.mark.parametrize(
    ("wall", "belt", "mode"),
    [
        ("2.4", "", (0, 1)),
        ("2.4", ", static: 1.0000001", (0, 1)),
        ("2", "", (-1, 0)),  # of the 2.2 that the belt and the force pull with it holds 2 and then 1.4
        ("2", ", static: 1.0000001", (-1, 0)),
    ],
)
def test_a_block_between_drives_that_pull_apart(power: int, wall: str, belt: str, mode: tuple[int, int]) -> None:
    """They part with the acceleration 0.35, or from none: then the first derivative tells that is not zero."""
    problem = read_problem(MIXED.format(power=power, wall=wall, belt=belt))
    runs = [solver(name).prepare(problem, **options)() for name, options, _ in LIBRARIES]
    speed = -0.35 * 0.5**power if mode[0] else 0.0
    for run in runs:
        assert (run.status, list(run.transitions), run.end_mode) == ("ok", [], mode), run.reason
        assert run.end_state[1] == pytest.approx(speed, abs=1e-6)
    assert first_mode(problem) == mode
    assert certify(problem).mode in (mode, None)  # where derivatives tell what slips it is not proven


def test_an_override_that_is_no_balance_of_forces_does_not_hold_beside_others() -> None:
    v, w, s, u = sp.symbols("v w s u", real=True)
    field = (-s - u + 3, u - 1)

    def held(rate: sp.Expr) -> FilippovSystem:
        own = [
            SlidingOverride((rate, u - 1), _ends(3 - u), "inside"),
            SlidingOverride(_both(s), _ends(sp.S(1)), "inside"),
        ]
        return FilippovSystem((v, w), (s, u), (v, w - v), field, overrides=dict(enumerate(own)))

    assert held(sp.Integer(0)).equations((0, 0)).field == (0, 0)
    with pytest.raises(ModelError, match="contradicts the balance of forces"):
        held(sp.Integer(2)).equations((0, 0))


def _both(s: sp.Symbol) -> tuple[sp.Expr, sp.Expr]:
    return (2 - s) / 2, (2 - s) / 2


def _ends(load: sp.Expr) -> tuple[Release, Release]:
    return Release(load - 5, "rising", 1), Release(load + 5, "falling", -1)


def test_a_ball_that_holds_zero_is_undecided_not_told() -> None:
    """A load exactly at its limit, that grows: the proof knows the zero by algebra, and the slip follows."""
    problem = stack(["2", "2"], ["2 + t", "0"], ["1", "1"], "1/10")
    proof = certify(problem)
    assert (proof.status, proof.mode) == ("certified", (1, 0))
    assert proof.time.overlaps(arb("0.1"))


def test_random_stacks_run_to_their_end() -> None:
    """The first of those that docs/scenes.md counts."""
    assert [run.status for run in runs(12)] == ["ok"] * 12
