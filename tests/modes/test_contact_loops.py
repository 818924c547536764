"""Loops of contacts, whose loads statics does not settle: they hold while some distribution of the loads fits.

Closed forms of the instants at which the cut lets go that is the first to carry more than its contacts hold together
(see :mod:`henon_ref.modes.contact_loops`); blocks of 1 kg but where masses are given, at rest at first.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pytest
import sympy as sp
from contact_scenes import ALL_LIBRARIES, LIBRARIES, scene
from flint import ctx
from multiprecision import simulate
from often import daily
from problems import HEAD, read_problem

from henon_ref.enclosure.balls import enclose
from henon_ref.enclosure.run import certify
from henon_ref.harness.registry import solver
from henon_ref.modes.problem import Problem
from henon_ref.simulation.simulate import simulate as simulate_run
from henon_ref.simulation.system import System

ONE = "{mass: 1}"
AB = {"a": ONE, "b": ONE, "floor": "fixed"}
STATIC = [("a", "floor", "force: 1, static: 2"), ("b", "floor", "force: 1, static: 2")]
RUB = ("a", "b", "force: 0.5, static: 1")
RING = [(p, q, "force: 1, static: 2") for p, q in ("ab", "bc", "ca")]
PLAIN = [("a", "floor", "force: 1"), ("b", "floor", "force: 1"), ("a", "b", "force: 0.5")]
ABC = {"a": ONE, "b": ONE, "c": ONE}
CASES = {
    # The cut around both blocks: 2t = 2 + 2. They go on as one, the contact between them carries nothing.
    "two pulled alike": (scene(AB, [*STATIC, RUB], {"a": "t", "b": "t"}, "3"), 2, (1, 1, 0), [1.5, 1.5]),
    # Around a: t = 2 + 1; the floor still holds b, which a drags with 1/2.
    "one pulled": (scene(AB, [*STATIC, RUB], {"a": "t"}, "5"), 3, (1, 0, 1), [5, 0]),
    # Around a: t = 2 + 2; b and c are pulled alike.
    "a ring": (
        scene(ABC, RING, {"a": "t", "b": "-t/2", "c": "-t/2"}, "6"), 4, (1, 0, -1), [6, -3, -3]
    ),
    # Both contacts: t/2 = 2 + 1.
    "two contacts between two bodies": (
        scene({"a": ONE, "b": ONE}, [("a", "b", "force: 1, static: 2"), (*RUB[:2], RUB[2] + ", name: rub")],
              {"a": "t"}, "8"), 6, (1, 1), [20, 12],
    ),
    # One of them has no static friction: t = 2 + 1/2.
    "one of two contacts without static friction": (
        scene({"a": ONE, "floor": "fixed"}, [STATIC[0], ("a", "floor", "force: 0.5, name: rub")], {"a": "t"}, "5"),
        sp.Rational(5, 2), (1, 1), [5.625],
    ),
    # None has: t = 1 + 1/2, from which a speeds up from nothing.
    "no static friction": (scene(AB, PLAIN, {"a": "t"}, "5"), sp.Rational(3, 2), (1, 0, 1), [6.125, 0]),
    "no static friction, the other way": (
        scene(AB, PLAIN, {"a": "-t"}, "5"), sp.Rational(3, 2), (-1, 0, -1), [-6.125, 0]
    ),
    # Accelerations are no forces: without static friction a contact is known by these, which masses divide.
    "masses": (
        scene({"a": "{mass: 2}", "b": "{mass: 3}", "floor": "fixed"}, [STATIC[0], *PLAIN[1:]], {"a": "-t"}, "5"),
        sp.Rational(5, 2), (-1, 0, -1), [-2.8125, 0],
    ),
}  # fmt: skip
EVENTS = pytest.mark.parametrize(("problem", "time", "mode", "speeds"), CASES.values(), ids=list(CASES))


@EVENTS
@ALL_LIBRARIES
def test_the_first_cut_that_carries_too_much_lets_go(name, options, bound, problem, time, mode, speeds) -> None:  # type: ignore[no-untyped-def]
    run = solver(name).prepare(problem, **options)()
    assert run.status == "ok", run.reason
    slipping = [i for i, entry in enumerate(mode) if entry]
    assert [(t.kind, t.surface, t.to_mode) for t in run.transitions] == [("release", i, mode) for i in slipping]
    assert [t.time for t in run.transitions] == pytest.approx([float(time)] * len(slipping), abs=bound, rel=0)
    assert run.end_state[1::2] == pytest.approx(speeds, abs=10 * bound)


@EVENTS
def test_the_multiprecision_route_sees_it(problem, time, mode, speeds) -> None:  # type: ignore[no-untyped-def]
    run = simulate(problem, 256)
    assert (run.status, [e.after for e in run.events]) == ("ok", [mode]), run.reason
    with ctx.workprec(512):
        assert abs(run.events[0].time - enclose(sp.Rational(time))) < 1e-40


def test_the_proof_sees_it_where_a_force_jumps() -> None:
    problem, time, mode, _ = CASES["one pulled"]
    proof = certify(problem)
    assert proof.status == "certified", proof.reason
    assert [t.to_mode for t in proof.transitions] == [mode] * 2
    with ctx.workprec(2 * proof.bits):
        assert proof.transitions[0].time.overlaps(enclose(sp.Integer(time)))


@cache
def arrival() -> tuple[Problem, Any]:
    """With its run in multiprecision, which is made once for all solvers."""
    problem = scene(AB, [*STATIC, RUB], {}, "4", v_b="3")
    return problem, simulate(problem, 256)


@ALL_LIBRARIES
def test_a_loop_that_is_closed_by_an_arrival_holds(name, options, bound) -> None:  # type: ignore[no-untyped-def]
    """b slides to rest beside a, which stands: b' = -1 - 1/2. All three hold from there on, at one instant."""
    problem, truth = arrival()
    run = solver(name).prepare(problem, **options)()
    expected = [("stick", 1, (0, 0, 0)), ("stick", 2, (0, 0, 0))]
    assert [(t.kind, t.surface, t.to_mode) for t in run.transitions] == expected, run.reason
    assert [t.time for t in run.transitions] == pytest.approx([2, 2], abs=bound, rel=0)
    assert run.end_state == pytest.approx((0, 0, 3, 0), abs=10 * bound)
    assert [(e.before, e.after) for e in truth.events] == [((0, 1, -1), (0, 0, 0))]


@cache
def shaken() -> tuple[Problem, Any]:
    bodies = {"a": ONE, "b": "{mass: 2}", "c": ONE, "belt": "{velocity: 0.3*cos(t)}"}
    contacts = [
        ("a", "belt", "force: 0.5, static: 0.7"),
        ("b", "belt", "force: 0.5, static: 0.6"),
        ("a", "b", "force: 0.3, static: 0.4"),
        ("c", "b", "force: 0.3, static: 0.4"),
        ("c", "a", "force: 0.2"),
    ]
    problem = scene(bodies, contacts, {"a": "1.5*sin(t)", "b": "cos(1.7*t)", "c": "0.4*cos(2*t)"}, "7", v_c="1")
    return problem, simulate(problem, 256)


@pytest.mark.parametrize(
    ("name", "options", "bound"), daily(LIBRARIES, some=LIBRARIES[:2]), ids=[name for name, *_ in LIBRARIES]
)
def test_a_loop_on_a_belt_that_is_shaken_closes_and_opens(name, options, bound) -> None:  # type: ignore[no-untyped-def]
    """Speeds that are no whole numbers, so that nothing is at zero by its digits."""
    problem, truth = shaken()
    run = solver(name).prepare(problem, **options)()
    assert run.status == truth.status == "ok", (run.reason, truth.reason)
    assert list(dict.fromkeys(t.to_mode for t in run.transitions)) == list(dict.fromkeys(e.after for e in truth.events))
    times = sorted({t.time for t in run.transitions})
    assert times == pytest.approx([float(e.time) for e in truth.events], abs=100 * bound, rel=0)
    after = [e.after for e in truth.events]
    closed = after.index((-1, -1, 0, 0, 0))
    assert after[closed + 1] == (-1, -1, 1, 0, -1)


@cache
def full_cut() -> tuple[Problem, Any]:
    contacts = [("a", "floor", "force: 0.2, static: 1"), ("b", "floor", "force: 1, static: 2"),
                ("a", "b", "force: 1, static: 1.9")]  # fmt: skip
    problem = scene(AB, contacts, {"a": "t"}, "5")
    return problem, simulate(problem, 256)


@ALL_LIBRARIES
def test_what_a_full_cut_parts_slips_and_the_rest_holds(name, options, bound) -> None:  # type: ignore[no-untyped-def]
    """Around a: t = 1 + 1.9. The contact of b with the floor, which holds 2, then carries 1."""
    problem, truth = full_cut()
    run = solver(name).prepare(problem, **options)()
    assert [(t.surface, t.to_mode) for t in run.transitions] == [(0, (1, 0, 1)), (2, (1, 0, 1))], run.reason
    assert [t.time for t in run.transitions] == pytest.approx([2.9, 2.9], abs=bound, rel=0)
    assert [e.after for e in truth.events] == [(1, 0, 1)]


SYSTEM = """\
system:
  state: [v, w]
  surfaces: {{s: v, r: w, u: {surface}}}
  field: [{fields}]
initial: {{t: 0, v: 0, w: 0}}
until: 5
"""


@pytest.mark.parametrize(
    ("surface", "fields", "mode"),
    [
        ("v - w", '"t - s - u/2", "-r + u/2"', (1, 0, 1)),
        ('"2*(w - v)"', '"t - s + u/2", "-r - u/2"', (1, 0, -1)),
    ],
)
def test_surfaces_of_a_system_that_depend_on_each_other_are_a_loop(surface: str, fields: str, mode: object) -> None:
    problem = read_problem(SYSTEM.format(surface=surface, fields=fields))
    run, truth = solver("henon").prepare(problem, rtol=1e-13)(), simulate(problem, 256)
    assert [(t.to_mode, t.time) for t in run.transitions] == [(mode, pytest.approx(1.5, abs=1e-13))] * 2
    assert [(e.after, float(e.time)) for e in truth.events] == [(mode, pytest.approx(1.5, abs=1e-30))]


def test_signs_written_in_a_field_are_a_loop() -> None:
    """With a drag beside the friction: its kink is one of the same argument, and is continuous."""
    fields = '"t - sign(v) - sign(v - w)/2 - v*abs(v)", "-sign(w) + sign(v - w)/2"'
    text = f"system:\n  state: [v, w]\n  field: [{fields}]\ninitial: {{t: 0, v: 0, w: 0}}\nuntil: 2\n"
    problem = read_problem(text)
    run, truth = solver("henon").prepare(problem, rtol=1e-13)(), simulate(problem, 256)
    assert [(t.to_mode, t.time) for t in run.transitions] == [((1, 1, 0), pytest.approx(1.5, abs=1e-13))] * 2
    assert [e.after for e in truth.events] == [(1, 1, 0)]


def test_kinks_that_depend_on_each_other_are_no_contacts() -> None:
    """Drags between three bodies at rest: nothing slides, and nothing moves."""
    fields = '"-v*abs(v) - (v - w)*abs(v - w)", "-w*abs(w) - (w - v)*abs(v - w)"'
    text = f"system:\n  state: [v, w]\n  field: [{fields}]\ninitial: {{t: 0, v: 0, w: 0}}\nuntil: 2\n"
    problem = read_problem(text)
    assert not problem.system.overrides
    run, truth = solver("henon").prepare(problem, rtol=1e-13)(), simulate(problem, 256)
    assert (run.status, run.transitions, truth.status, truth.events) == ("ok", (), "ok", [])


def test_signs_that_are_no_force_and_counterforce_are_refused_with_their_surfaces() -> None:
    """u pushes v and not w: no friction of one body on another."""
    problem = read_problem(SYSTEM.format(surface="v - w", fields='"t - s - u", "-r"'))
    words = r"the surfaces of s, r, u depend on each other, and their signs do not act as action and reaction"
    truth = simulate(problem, 256)
    for run in [*(solver(name).prepare(problem, **options)() for name, options, _ in LIBRARIES), truth]:
        assert run.status == "failed", (run.status, run.reason)
        assert words in run.reason


def test_masses_may_be_given_to_a_run(tmp_path: Path) -> None:
    """One compiled system: without static friction what a contact adds to a cut is an acceleration times its mass."""
    text = """scene:
  parameters: {m: 1, n: 1}
  bodies: {a: {mass: m}, b: {mass: n}, floor: fixed}
  connections:
    - friction: {between: [a, floor], law: coulomb, force: 1, static: 2}
    - friction: {between: [b, floor], law: coulomb, force: 1}
    - friction: {between: [a, b], law: coulomb, force: 0.5}
    - force: {on: a, value: t}
initial: {x_a: 0, v_a: 0, x_b: 0, v_b: 0}
until: 5
"""
    (tmp_path / "loop.yaml").write_text(HEAD + text)
    system = System.from_case(tmp_path / "loop.yaml")
    for masses in ({"m": 2, "n": 3}, {"m": "1/3", "n": 7}):
        run = simulate_run(system, system.initial, until=5, rtol=1e-13, parameters=masses)
        assert run.status == "ok", run.message
        assert run.transitions.time_s.tolist() == pytest.approx([2.5, 2.5], abs=1e-12)
        assert run.final_mode == "s_a_floor=+1 s_b_floor=0 s_a_b=+1"


def test_a_ring_of_nine_contacts_lets_go_at_the_cut_that_is_full() -> None:
    """a is pulled and the others are not: around a and some neighbours beside it, t times what is left of 9 bodies."""
    bodies = dict.fromkeys("abcdefghi", ONE)
    contacts = [(p, q, "force: 1, static: 2") for p, q in zip("abcdefghi", "bcdefghia", strict=True)]
    problem = scene(bodies, contacts, {"a": "t"}, "5")
    run = solver("henon").prepare(problem, rtol=1e-13)()
    # Around a alone: t - t/9 = 2 + 2. The others, pulled by 1 + 1, move as one.
    assert [t.surface for t in run.transitions] == [0, 8], run.reason
    assert [t.time for t in run.transitions] == pytest.approx([4.5, 4.5], abs=1e-12)
    assert run.end_mode == (1, *(0,) * 7, -1)
