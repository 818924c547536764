"""Several contacts with static friction: any of them holds while others slide, where none acts on another at once.

Blocks on a belt, coupled by springs and dampers, each pulled by its own spring to the wall.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import pytest
import sympy as sp
from flint import arb, ctx
from multiprecision import simulate
from problems import read_problem

from henon_ref.enclosure.balls import enclose
from henon_ref.enclosure.run import certify
from henon_ref.harness.registry import solver
from henon_ref.harness.truth.multiprecision.points import SeriesEvaluation
from henon_ref.modes.mode_evaluation import in_doubles
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import initial_mode

LIBRARIES = [("scipy-dop853", {"rtol": 1e-12}, 1e-9), ("heyoka", {"rtol": 1e-16}, 1e-12)]


@cache
def chain(starts: tuple[str, ...], until: str, coupling: str, speed: str = "0.2") -> Problem:
    """Blocks on a belt at rest on it, at these positions."""
    blocks = [f"b{i}" for i in range(len(starts))]
    lines = ["scene:", f"  parameters: {{k: 1, kc: {coupling}, Fs: 1.3, Fk: 1, vb: {speed}}}", "  bodies:"]
    lines += [f"    {b}: {{mass: 1}}" for b in blocks]
    lines += ["    belt: {velocity: vb}", "    wall: fixed", "  connections:"]
    lines += [f"    - spring: {{between: [{b}, wall], stiffness: k}}" for b in blocks]
    lines += [f"    - spring: {{between: [{a}, {b}], stiffness: kc}}" for a, b in pairwise(blocks)]
    lines += [f"    - friction: {{between: [{b}, belt], law: coulomb, force: Fk, static: Fs}}" for b in blocks]
    initial = ", ".join(f"x_{b}: {x}, v_{b}: vb" for b, x in zip(blocks, starts, strict=True))
    text = "\n".join([*lines, f"initial: {{t: 0, {initial}}}", f"until: {until}"])
    return read_problem(text + "\n")


def test_blocks_stick_slide_and_let_go_in_any_combination() -> None:
    problem = chain(("0.3", "0.5", "-0.1"), "10", "1.2")
    proof, second = certify(problem), simulate(problem, 256)
    assert proof.status == "certified", proof.reason
    modes = [t.to_mode for t in proof.transitions]
    assert len(modes) == 5
    assert any(0 in mode and any(mode) and mode.count(0) == 2 for mode in modes)
    assert [e.after for e in second.events] == modes
    with ctx.workprec(288):
        assert all(abs(e.time - t.time) < arb(1e-12) for e, t in zip(second.events, proof.transitions, strict=True))
    for name, options, bound in [("henon", {"rtol": 1e-13}, 1e-12), *LIBRARIES]:
        run = solver(name).prepare(problem, **options)()
        assert (run.status, [t.to_mode for t in run.transitions]) == ("ok", modes), (name, run.reason)
        expected = [float(t.time) for t in proof.transitions]
        assert [t.time for t in run.transitions] == pytest.approx(expected, abs=bound, rel=0)


def test_uncoupled_blocks_let_go_each_at_its_own_limit() -> None:
    """The load is k x; it grows as vb t up to Fs: block i lets go at (Fs - x_i)/vb."""
    problem = chain(("1.1", "1.2", "1.0"), "3/2", "0")
    times = [sp.Rational(1, 2), sp.Integer(1), sp.Rational(3, 2)]
    proof = certify(problem)
    assert [t.to_mode for t in proof.transitions][:2] == [(0, -1, 0), (-1, -1, 0)]
    with ctx.workprec(2 * proof.bits):
        assert all(t.time.overlaps(enclose(e)) for t, e in zip(proof.transitions, times, strict=False))
    run = solver("henon").prepare(problem, rtol=1e-13)()
    assert [t.time for t in run.transitions][:2] == pytest.approx([0.5, 1.0], abs=1e-13)


def test_two_blocks_that_let_go_at_once_have_a_row_each() -> None:
    """Alike but for the one between them, which holds on: both reach Fs at t = 1/2."""
    problem = chain(("1.2", "0", "1.2"), "0.7", "0")
    run, second = solver("henon").prepare(problem, rtol=1e-13)(), simulate(problem, 256)
    assert run.status == second.status == "ok"
    assert [(t.kind, t.to_mode) for t in run.transitions] == [("release", (-1, 0, -1))] * 2
    assert [t.time for t in run.transitions] == pytest.approx([0.5, 0.5], abs=1e-13)
    assert {e.after for e in second.events} == {(-1, 0, -1)}


def test_a_block_that_stops_on_another_one_at_rest_holds_until_its_load_is_static_friction() -> None:
    """The load 0.2 t - 0.3 is 0.5 at t = 4. Both speeds are that of the belt then, and no speed is left in the loads:

    one that rounding has put off by 1e-17 had a time scale of its own there, of 1e17 s, beside which the loads were 0.
    """
    connections = [
        "force: {on: b, value: 0.2*t - 0.3}",
        "friction: {between: [b, a], law: stribeck_exp, force: 0.4, velocity: 0.2, static: 0.5}",
        "friction: {between: [a, belt], law: coulomb, force: 0.8, static: 1.1}",
    ]
    lines = ["scene:", "  bodies: {a: {mass: 1}, b: {mass: 1}, belt: {velocity: 0.114}}", "  connections:"]
    lines += [f"    - {one}" for one in connections]
    lines += ["initial: {x_a: 0, v_a: 0.3, x_b: 0, v_b: 0.5}", "until: 5", ""]
    problem = read_problem("\n".join(lines))
    made = problem.system.equations((0, 0))
    speeds = {problem.system.states[1], problem.system.states[3]}
    assert (made.field[1], made.field[3]) == (0, 0)
    assert not any(g.expression.free_symbols & speeds for g in made.guards)
    run = solver("henon").prepare(problem, rtol=1e-13)()
    assert (run.status, [t.kind for t in run.transitions]) == ("ok", ["stick", "stick", "release"])
    assert run.transitions[-1].time == pytest.approx(4, abs=1e-13)


def test_more_blocks_than_are_tried_exhaustively_are_searched() -> None:
    problem = chain(("1.2", "1.5", "-1.6", "0", "1.4", "-1.2"), "1", "0")
    expected = (0, -1, 1, 0, -1, 0)
    assert initial_mode(in_doubles(problem.system).at_start(problem), problem).mode == expected
    with ctx.workprec(256):
        assert initial_mode(SeriesEvaluation(problem.system, 256).at_start(problem), problem).mode == expected


def test_friction_without_a_static_limit_on_friction_without_one_on_a_held_block() -> None:
    """Before, the equations kept a sign: the first contact without a static limit is told by the second one's."""
    text = """scene:
  bodies: {wall: fixed, a: {mass: 1}, b: {mass: 2}, c: {mass: 3}}
  connections:
    - friction: {between: [a, wall], law: coulomb, force: 4, static: 5}
    - friction: {between: [a, b], law: coulomb, force: 2}
    - friction: {between: [b, c], law: coulomb, force: 1}
    - force: {on: c, value: t}
initial: {x_a: 0, v_a: 0, x_b: 0, v_b: 0, x_c: 0, v_c: 0}
until: 3
"""
    run = solver("henon").prepare(read_problem(text), rtol=1e-12)()
    assert [(t.kind, t.surface, t.to_mode) for t in run.transitions] == [("release", 2, (0, 0, -1))], run.reason
    assert run.transitions[0].time == pytest.approx(1, abs=1e-12)
    assert run.end_state[5] == pytest.approx(2 / 3, abs=1e-12)  # of (t - 1)/3
