"""Contacts that hold together with bodies that rest on stops: closed forms of what lets go, when, and how it moves on.

Body a rests on a stop before a wall, x_a = 0, kept at x_a >= 0; masses are 2 kg (a), 3 kg (b, c), 1 kg (d).
"""

from __future__ import annotations

import pytest
import sympy as sp
from contact_scenes import scene
from flint import ctx
from multiprecision import simulate
from problems import read_problem

import henon_ref as hr
from henon_ref.enclosure.balls import enclose
from henon_ref.enclosure.run import certify
from henon_ref.harness.registry import solver
from henon_ref.modes.problem import Problem

SOLVERS = [("henon", 1e-13, 1e-12), ("heyoka", 1e-16, 1e-11), ("scipy-dop853", 1e-12, 1e-9)]
ALL_SOLVERS = pytest.mark.parametrize(("name", "rtol", "bound"), SOLVERS, ids=[name for name, *_ in SOLVERS])
MASSES = {"a": 2, "b": 3, "c": 3, "d": 1}


def resting(
    contacts: list[tuple[str, str, str]],
    forces: dict[str, str],
    until: str,
    start: str = "0",
    stops: tuple[str, ...] = ("[a, wall]",),
    **initial: str,
) -> Problem:
    """Contacts between two with keys, forces, hard stops without restitution at a gap of 0; states that are not 0."""
    bodies = [b for b in MASSES if any(b in contact[:2] for contact in contacts) or f"[{b}, a]" in stops]
    given = {"wall": "fixed", **{b: f"{{mass: {MASSES[b]}}}" for b in bodies}}
    return scene(given, contacts, forces, until, start=start, stops=stops, **initial)


STATIC = ("b", "a", "force: 1, static: 2")
RING = [("c", "wall", "force: 3/2, static: 2"), ("c", "a", "force: 1/2, static: 1")]
PLAIN = [("c", "wall", "force: 2"), ("c", "a", "force: 1")]
R = sp.Rational
# Rows (kind, surface) at their times, the mode then, and the speeds at the end, body by body.
CASES = {
    # Static friction carries 2, then b moves on by (t - 1)/3.
    "a block lets go of a body at rest": (
        resting([STATIC], {"a": "-5", "b": "t"}, "4"),
        [("release", 1, 2, (0, 1))], [0, R(4, 3)],
    ),
    # The reaction is 5 - t; then both move by (t - 5)/5.
    "a body lifts off by what it is held with": (
        resting([("b", "a", "force: 8, static: 9")], {"a": "-5", "b": "t"}, "7"),
        [("release", 0, 5, (1, 0))], [R(2, 5), R(2, 5)],
    ),
    # The reaction is t - 3/2 and would be 1 - 3/2 as b slides: a goes with 1/4, b with (1 - t)/3.
    "a block lets go and the body lifts off at once": (
        resting([STATIC], {"a": "3/2", "b": "-t"}, "4", "8/5"),
        [("release", 0, 2, (1, -1)), ("release", 1, 2, (1, -1))], [R(1, 2), R(-4, 3)],
    ),
    # b slides with (t + 2)/3 from -5/6 to 0 at t = 1.
    "a block comes to rest on it": (
        resting([("b", "a", "force: 2, static: 9")], {"a": "-5", "b": "t"}, "7", v_b="-5/6"),
        [("stick", 1, 1, (0, 0)), ("release", 0, 5, (1, 0))], [R(2, 5), R(2, 5)],
    ),
    # Contacts of c hold 2 + 1 together while a is pressed on; then c moves by (t - 2)/3.
    "a loop lets go by the cut around a block": (
        resting(RING, {"a": "-5", "c": "t"}, "6"),
        [("release", 1, 3, (0, 1, 1)), ("release", 2, 3, (0, 1, 1))], [0, R(5, 2)],
    ),
    "a loop, the other way": (
        resting(RING, {"a": "-5", "c": "-t"}, "6"),
        [("release", 1, 3, (0, -1, -1)), ("release", 2, 3, (0, -1, -1))], [0, R(-5, 2)],
    ),
    # Off the wall go both where t = 2 + 3/4, by (t - 9/4)/5.
    "a loop lets go by the cut through the stop": (
        resting(RING, {"a": "-3/4", "c": "t"}, "14/5"),
        [("release", 0, R(11, 4), (1, 1, 0)), ("release", 1, R(11, 4), (1, 1, 0))], [R(21, 4000), R(21, 4000)],
    ),
    # Into the wall c alone can go.
    "a loop weakly pressed on, the other way": (
        resting(RING, {"a": "-3/4", "c": "-t"}, "6"),
        [("release", 1, 3, (0, -1, -1)), ("release", 2, 3, (0, -1, -1))], [0, R(-5, 2)],
    ),
    # Drawn off with t, a is held by 1, and through it by no more: the cut around a.
    "a loop lets go by the cut around the body at rest": (
        resting(RING, {"a": "t"}, "3"),
        [("release", 0, 1, (1, 0, -1)), ("release", 2, 1, (1, 0, -1))], [R(3, 2), 0],
    ),
    # Without static friction: v_c = 1/4 - 2 t/3 to rest at 3/8, held up to 2 + 1.
    "a loop without static friction": (
        resting(PLAIN, {"a": "-5", "c": "t"}, "6", v_c="5/6"),
        [("stick", 1, 1, (0, 0, 0)), ("stick", 2, 1, (0, 0, 0)),
         ("release", 1, 3, (0, 1, 1)), ("release", 2, 3, (0, 1, 1))], [0, R(3, 2)],
    ),
    # Friction on c slows a's fall to (9/2 - 1/2)/2: at t = 1 it stops at c, which the wall holds.
    "a body that stops in a loop": (
        resting(RING, {"a": "-9/2", "c": "t"}, "6", x_a="1"),
        [("reset", 0, 1, (1, 0, 1)), ("stick", 0, 1, (0, 0, 0)), ("stick", 2, 1, (0, 0, 0)),
         ("release", 1, 3, (0, 1, 1)), ("release", 2, 3, (0, 1, 1))], [0, R(5, 2)],
    ),
    # a and b fall as one by 2, 1 m in 1 s; b slides on, slowed by 7/3 from -2, and comes to rest.
    "a body stops under a block that is stuck on it": (
        resting([("b", "a", "force: 7, static: 8")], {"a": "-10"}, "4", x_a="1"),
        [("reset", 0, 1, (1, -1)), ("release", 1, 1, (1, -1)), ("stick", 0, 1, (0, -1)),
         ("stick", 1, R(13, 7), (0, 0))], [0, 0],
    ),
    # d slides on b, which holds on a: it drags with 1/2, the reaction is 5 - t - 1/2; both lift off at 9/2.
    "a third body slides on the block": (
        resting([("b", "a", "force: 8, static: 9"), ("d", "b", "force: 1/2")], {"a": "-5", "b": "t"}, "5", v_d="9"),
        [("release", 0, R(9, 2), (1, 0, 1))], [R(1, 40), R(1, 40), R(13, 2)],
    ),
    # d is stuck on b by friction without a static limit, and moves with both.
    "a third body stuck on the block": (
        resting([("b", "a", "force: 8, static: 9"), ("d", "b", "force: 1/2")], {"a": "-5", "b": "t"}, "7"),
        [("release", 0, 5, (1, 0, 0))], [R(1, 3), R(1, 3), R(1, 3)],
    ),
    # b rests on a, a on the wall; c is held on a with t: the reaction of the wall is 8 - t, b rests on.
    "bodies that rest on each other": (
        resting([("c", "a", "force: 7, static: 9")], {"a": "-5", "b": "-3", "c": "t"}, "9",
              stops=("[a, wall]", "[b, a]")),
        [("release", 0, 8, (1, 0, 0))], [R(1, 16), R(1, 16), R(1, 16)],
    ),
    # The contact of a with the wall is in a loop with the stop: 5 + 2 - t is left, then (t - 1 - 5)/5.
    "a body held by the wall besides": (
        resting([("a", "wall", "force: 1, static: 2"), ("b", "a", "force: 8, static: 9")], {"a": "-5", "b": "t"}, "8"),
        [("release", 0, 7, (1, 1, 0)), ("release", 1, 7, (1, 1, 0))], [R(3, 10), R(3, 10)],
    ),
}  # fmt: skip
EVENTS = pytest.mark.parametrize(("problem", "rows", "speeds"), CASES.values(), ids=list(CASES))


@EVENTS
@ALL_SOLVERS
def test_what_lets_go_with_a_body_at_rest(name, rtol, bound, problem, rows, speeds) -> None:  # type: ignore[no-untyped-def]
    run = solver(name).prepare(problem, rtol=rtol, atol=rtol)()
    assert run.status == "ok", run.reason
    assert [(t.kind, t.surface, t.to_mode) for t in run.transitions] == [(k, i, mode) for k, i, _, mode in rows]
    assert [t.time for t in run.transitions] == pytest.approx([float(time) for _, _, time, _ in rows], abs=bound, rel=0)
    assert run.end_state[1::2] == pytest.approx([float(v) for v in speeds], abs=10 * bound)


@EVENTS
def test_the_multiprecision_route_sees_it(problem, rows, speeds) -> None:  # type: ignore[no-untyped-def]
    run = simulate(problem, 256)
    assert run.status == "ok", run.reason
    told = [(event.time, event.after) for event in run.events]
    with ctx.workprec(512):
        for _, _, time, mode in rows:
            assert any(abs(at - enclose(sp.sympify(time))) < 1e-30 and after == mode for at, after in told)


TIED = {
    "a loop without static friction": "a tie",  # two surfaces are reached at once
    "a body that stops in a loop": "the side of s_c_a after the reset cannot be decided",
}


@pytest.mark.parametrize("case", CASES)
def test_the_proof_sees_it_where_no_two_surfaces_are_reached_at_once(case: str) -> None:
    problem, rows, _ = CASES[case]
    proof = certify(problem)
    if case in TIED:
        assert proof.status != "certified"
        assert TIED[case] in proof.reason
        return
    assert proof.status == "certified", proof.reason
    assert [(t.kind, t.surface, t.to_mode) for t in proof.transitions] == [(k, i, mode) for k, i, _, mode in rows]


HAND = """\
system:
  state: [x, v, u]
  surfaces: {g: 2*x, s: v - u}
  field: [v, -5 - 3*s, "t + 3*s"]
resets: {g: {map: {v: 0}}}
SLIDING
initial: {t: 0, x: 0, v: 0, u: 0}
until: 4
"""
SLIDING = """\
sliding:
  s:
    field: [v, (t - 5)/2, (t - 5)/2]
    release: [{when: (-5 - t)/2 - 4, direction: rising, to: 1}, {when: (-5 - t)/2 + 4, direction: falling, to: -1}]
    entry: inside
"""


def test_a_surface_of_a_system_that_a_body_rests_on_beside_friction() -> None:
    """In the unit of 2 x, and without static friction: u goes with t - 3 from t = 3 on."""
    problem = read_problem(HAND.replace("SLIDING\n", ""))
    for name in ("henon", "scipy-dop853"):
        run = solver(name).prepare(problem, rtol=1e-12)()
        assert [(t.kind, t.surface, t.to_mode) for t in run.transitions] == [("release", 1, (0, -1))], run.reason
        assert run.transitions[0].time == pytest.approx(3, abs=1e-9)
        assert run.end_state == pytest.approx((0, 0, 0.5), abs=1e-9)


def test_a_sliding_written_by_hand_does_not_say_what_a_reaction_adds_to_its_load() -> None:
    problem = read_problem(HAND.replace("SLIDING\n", SLIDING))
    run = solver("henon").prepare(problem, rtol=1e-12)()
    assert run.status == "failed"
    assert "the effect of the reaction on a body at rest on the load of s is unknown" in run.reason


def test_a_stop_that_depends_on_a_holding_contact_by_a_parameter_does_not_release_it() -> None:
    """The belt stands still, vb = 0, so that body and stop never separate while the belt holds the load of 1 N."""
    at_rest = hr.Scene(parameters={"vb": 0})
    block, belt = at_rest.body("a", mass=1), at_rest.prescribed("belt", velocity="vb")
    at_rest.friction(block, belt, law="coulomb", force="2/3", static="7/6", name="f")
    at_rest.stop(block, at_rest.wall, gap=0, restitution=0, name="g")
    at_rest.force(block, 1)
    run = hr.simulate(at_rest.system(), {"x_a": 0, "v_a": 0}, until=1)
    assert run.status == "failed"
    assert "the loads of contacts that hold together are not determined: f, g" in run.message
