"""Hard stops of a scene: Newton's impact law, rest, and what is said of what does not fit them."""

from __future__ import annotations

import pytest
import sympy as sp
from multiprecision import multiprecision
from problems import read_problem

from henon_ref.errors import CaseError
from henon_ref.harness.registry import solver
from henon_ref.modes.problem import Problem
from henon_ref.modes.switched_field import Release, Reset
from henon_ref.modes.system import FilippovSystem
from henon_ref.taylor.tape import TIME
from henon_ref.trajectory import Trajectory

XA, VA, XB, VB, e = sp.symbols("x_a v_a x_b v_b e", real=True)
TEXT = """\
scene:
  parameters: {e: 1/2}
  bodies: {a: {mass: 2}, b: {mass: 3}, wall: fixed, table: {position: sin(2*t)}}
  connections:
    - STOP
initial: {x_a: 1, v_a: 0, x_b: 0, v_b: 0}
until: 3
"""


def problem(stop: str, initial: str = "{x_a: 1, v_a: 0, x_b: 0, v_b: 0}", more: str = "") -> Problem:
    text = TEXT.replace("STOP", stop).replace("{x_a: 1, v_a: 0, x_b: 0, v_b: 0}", initial) + more
    return read_problem(text)


def system(between: str) -> FilippovSystem:
    return problem(f"stop: {{between: {between}, gap: -1, restitution: e}}").system


@pytest.mark.parametrize(
    ("between", "surface", "velocities"),
    [
        ("[a, wall]", XA + 1, {VA: -e * VA}),
        ("[wall, a]", 1 - XA, {VA: -e * VA}),
        ("[a, table]", XA + 1 - sp.sin(2 * TIME), {VA: -e * VA + (1 + e) * 2 * sp.cos(2 * TIME)}),
        ("[table, a]", sp.sin(2 * TIME) - XA + 1, {VA: -e * VA + (1 + e) * 2 * sp.cos(2 * TIME)}),
        ("[a, b]", XA - XB + 1, {VA: VA - 3 * (1 + e) * (VA - VB) / 5, VB: VB + 2 * (1 + e) * (VA - VB) / 5}),
    ],
)
def test_a_stop_throws_back_and_keeps_the_momentum(
    between: str, surface: sp.Expr, velocities: dict[sp.Symbol, sp.Expr]
) -> None:
    found = system(between)
    name = "g_" + between.strip("[]").replace(", ", "_")
    assert found.sign_names == (name,)
    assert sp.expand(found.surfaces[0] - surface) == 0
    assert found.resets[0].map.keys() == velocities.keys()
    for x, value in velocities.items():
        assert sp.expand(found.resets[0].map[x] - value) == 0


def test_two_masses_at_rest_on_each_other_move_as_one_until_they_are_parted() -> None:
    forces = "stop: {between: [a, b], gap: -1, restitution: e}\n    - force: {on: b, value: 6 - t}"
    override = problem(forces).system.overrides[0]
    together = (6 - TIME) / 5
    assert override.entry == "resting"
    assert [sp.expand(f - g) for f, g in zip(override.field, (VA, together, VB, together), strict=True)] == [0] * 4
    (release,) = override.release
    assert release == Release(release.when, "rising", 1)
    assert sp.expand(release.when + (6 - TIME) / 3) == 0  # b leaves where the force on it draws it away


def test_a_parameter_e_is_no_euler_number() -> None:
    text = TEXT.replace("scene:", "system:")
    head, tail = text.split("  bodies")[0], text[text.index("initial") :]
    written = head + '  state: [x, v]\n  surfaces: {s: "x"}\n  field: ["v", "-exp(0)"]\n'
    written += 'resets: {s: {map: {v: "-e*v"}}}\n' + tail.replace("{x_a: 1, v_a: 0, x_b: 0, v_b: 0}", "{x: 1, v: 0}")
    v = sp.Symbol("v", real=True)
    assert read_problem(written).system.resets == {0: Reset({v: -e * v})}
    undeclared = written.replace("{e: 1/2}", "{r: 1/2}")
    assert read_problem(undeclared).system.resets == {0: Reset({v: -sp.E * v})}


@pytest.mark.parametrize(
    ("stop", "initial", "more", "place", "says"),
    [
        ("[wall, a], gap: -1/2", "{x_a: 1, v_a: 0, x_b: 0, v_b: 0}", "", "9:1", "beyond the stop g_wall_a"),
        ("[wall, a], gap: -1", "{x_a: 1, v_a: 1, x_b: 0, v_b: 0}", "",
         "9:1", "on g_wall_a, which resets it, and moves into it"),
        ("[a, wall], gap: 0", "{x_a: 1, v_a: 0, x_b: 0, v_b: 0}",
         "resets: {g_a_wall: {map: {v_a: 1}}}\n", "11:10", "is a hard stop of the scene"),
        ("[a, wall], gap: 0", "{x_a: 1, v_a: 0, x_b: 0, v_b: 0}",
         "sliding: {g_a_wall: {field: [0, 0, 0, 0], release: [{when: x_a, direction: rising, to: 1}]}}\n",
         "11:11", "is a hard stop; its sliding mode (a body at rest) cannot be replaced"),
    ],
)  # fmt: skip
def test_what_does_not_fit_a_stop_is_refused_with_its_place(
    stop: str, initial: str, more: str, place: str, says: str
) -> None:
    with pytest.raises(CaseError) as caught:
        problem(f"stop: {{between: {stop}, restitution: e}}", initial, more)
    assert says in caught.value.message
    assert str(caught.value).startswith(f"case.yaml:{place}: ")


def run(problem: Problem, name: str) -> Trajectory:
    return solver(name).prepare(problem, rtol=1e-12)()


@pytest.mark.parametrize("name", ["henon", "scipy-dop853"])
def test_a_body_rests_at_a_stop_beside_a_block_that_static_friction_holds(name: str) -> None:
    connections = """stop: {between: [a, wall], gap: 0, restitution: 0}
    - force: {on: a, value: -4}
    - friction: {between: [b, wall], law: coulomb, force: 3, static: 4}
    - force: {on: b, value: 2*t - 1/2}"""
    # b: v' = (2 t - 1/2 - 3)/3 from -1/2 ... ; a falls from 1 with the acceleration -2 and lands at t = 1.
    found = run(problem(connections), name)
    told = [(t.kind, t.surface, t.to_mode) for t in found.transitions]
    assert found.status == "ok"
    assert told == [
        ("reset", 0, (1, 0)),
        ("stick", 0, (0, 0)),
        ("release", 1, (0, 1)),
    ]
    assert [t.time for t in found.transitions] == pytest.approx([1.0, 1.0, 2.25], abs=1e-10)


@pytest.mark.parametrize("name", ["henon", "henon-newton", "scipy-dop853", "heyoka"])
def test_a_body_that_a_belt_drives_to_a_stop_rests_there_and_slides_on_the_belt(name: str) -> None:
    text = TEXT.replace("wall: fixed,", "wall: fixed, belt: {velocity: 3},").replace("until: 3", "until: 8")
    stop = """stop: {between: [wall, a], gap: -2, restitution: e}
    - friction: {between: [a, belt], law: coulomb, force: 1}"""
    found = run(read_problem(text.replace("STOP", stop)), name)
    # v' = 1/2 from 1 to 2 takes 2 s; with restitution 1/2 all flights take 2 (1 + 2 (1/2 + 1/4 + ...)) = 6 s.
    *impacts, last = found.transitions
    assert (found.status, {t.kind for t in impacts}, found.end_mode) == ("ok", {"reset"}, (0, -1))
    assert (last.kind, last.surface, last.to_mode) == ("stick", 0, (0, -1))
    assert {t.to_mode for t in impacts} == {(1, -1)}
    assert last.time == pytest.approx(6.0, abs=1e-9)


@pytest.mark.parametrize("name", ["henon", "henon-newton", "heyoka", "scipy-dop853"])
@pytest.mark.parametrize("static", ["", ", static: 4"])
@pytest.mark.parametrize("restitution", [0.5, 1.0])
def test_friction_that_turns_round_in_flight_presses_a_body_to_rest(name: str, static: str, restitution: float) -> None:
    connections = f"""stop: {{between: [wall, a], gap: -2, restitution: {restitution}}}
    - friction: {{between: [a, wall], law: coulomb, force: 2{static}, name: rub}}
    - force: {{on: a, value: "6 - 2*max(0, t - 6)"}}"""
    found = run(read_problem(TEXT.replace("STOP", connections).replace("until: 3", "until: 12")), name)
    # From 1 to 2 with (6 - 2)/2 takes 1 s. Thrown back with v it is slowed by (6 + 2)/2 and comes on with (6 - 2)/2: a
    # flight ends with v sqrt(1/2) and lasts v (1/4 + sqrt(1/8)). From 6 s on the force falls, at 9 s it is 0, and at 10
    # or 11 s it draws with more than friction holds.
    part = restitution * 0.5**0.5
    limit = 1 + 2 * restitution * (0.25 + 0.125**0.5) / (1 - part)
    told = [(t.kind, t.surface, t.time) for t in found.transitions if t.kind in ("stick", "release")]
    assert (found.status, set(found.end_mode)) == ("ok", {1, -1})
    assert [(kind, surface) for kind, surface, _ in told] == [
        ("stick", 0),
        ("stick", 1),
        ("release", 0),
        ("release", 1),
    ]
    last = 11.0 if static else 10.0
    assert [time for *_, time in told] == pytest.approx(
        [limit, limit, last, last], abs=1e-9 if name.startswith("henon") else 2e-8
    )
    assert {t.kind for t in found.transitions if t.surface == 1 and t.time < last} == {"crossing", "stick"}


def test_multiprecision_has_the_limit_where_friction_turns_round_in_flight() -> None:
    connections = """stop: {between: [wall, a], gap: -2, restitution: e}
    - friction: {between: [a, wall], law: coulomb, force: 2, name: rub}
    - force: {on: a, value: 6}"""
    found = multiprecision(problem(connections))
    assert (found.status, [t.kind for t in found.transitions[-2:]]) == ("ok", ["stick", "stick"])
    limit = 1 + (0.25 + 0.125**0.5) / (1 - 0.125**0.5)
    assert [float(t.time) for t in found.transitions[-2:]] == pytest.approx([limit, limit], abs=1e-14)


@pytest.mark.parametrize("name", ["henon", "heyoka", "scipy-dop853"])
@pytest.mark.parametrize(
    ("contact", "stop", "sign"),
    [
        ("[a, wall]", "[a, wall], gap: 0", 1),
        ("[wall, a]", "[wall, a], gap: -1", 1),
        ("[wall, a]", "[a, wall], gap: 0", -1),
    ],
)
def test_static_friction_holds_a_body_at_a_stop_against_what_draws_it_off(
    name: str, contact: str, stop: str, sign: int
) -> None:
    """The force off the stop is t/10 + 1/10: it passes kinetic friction (3/10) at t = 2, static friction at t = 6."""
    away = -1 if stop.startswith("[wall") else 1
    connections = [
        f'force: {{on: a, value: "{away}*(0.1 + 0.1*t)"}}',
        f"friction: {{between: {contact}, law: coulomb, force: 0.3, static: 0.7}}",
        f"stop: {{between: {stop}, restitution: 0}}",
    ]
    head = "scene:\n  bodies: {a: {mass: 1}, wall: fixed}\n  connections:"
    text = "\n    - ".join([head, *connections])
    start = "{x_a: 1, v_a: -2}" if away > 0 else "{x_a: 0, v_a: 2}"
    own = read_problem(f"{text}\ninitial: {start}\nuntil: 8\n")
    run = solver(name).prepare(own, rtol=1e-12, atol=1e-12)()
    assert (run.status, run.reason) == ("ok", "")
    assert [t.kind for t in run.transitions] == ["stick", "reset", "stick", "release", "release"]
    assert run.transitions[2].to_mode == (0, 0)
    assert run.transitions[4].to_mode == (sign, 1)
    assert [t.time for t in run.transitions[3:]] == pytest.approx([6, 6], abs=1e-9)
    assert abs(run.end_state[0] - (0 if away > 0 else 1)) == pytest.approx(14 / 15, abs=1e-9)


@pytest.mark.parametrize("name", ["henon", "heyoka", "scipy-dop853"])
@pytest.mark.parametrize("contact", ["[a, wall]", "[wall, a]"])
@pytest.mark.parametrize("law", ["coulomb, force: 0.3", "stribeck, force: 0.3, slope: 0"])
def test_kinetic_friction_holds_a_body_at_a_stop_whatever_way_its_contact_is_written(
    name: str, contact: str, law: str
) -> None:
    """The force off the stop passes friction at t = 2, and then x = (t - 2)^3/60: 3.6 m at t = 8."""
    more = f"""stop: {{between: [a, wall], gap: 0, restitution: 0}}
    - force: {{on: a, value: 0.1 + 0.1*t}}
    - friction: {{between: {contact}, law: {law}}}"""
    text = TEXT.replace("STOP", more).replace("{mass: 2}, b: {mass: 3},", "{mass: 1},")
    text = text.replace("x_a: 1, v_a: 0, x_b: 0, v_b: 0", "x_a: 1, v_a: -2").replace("until: 3", "until: 8")
    found = run(read_problem(text), name)
    assert (found.status, found.reason) == ("ok", "")
    assert [t.time for t in found.transitions[-2:]] == pytest.approx([2, 2], abs=1e-9)
    assert found.end_mode == (1, 1 if contact == "[a, wall]" else -1)
    assert found.end_state == pytest.approx((3.6, 1.8), abs=1e-8)


@pytest.mark.parametrize("name", ["henon", "heyoka", "scipy-dop853"])
def test_a_block_sticks_on_a_body_that_rests_at_a_stop_and_leaves_with_it(name: str) -> None:
    """Forces t/10 - 3/2 on a alone: it leaves at t = 15, and b with it, both by (t/10 - 3/2)/2: 0.225 m in 3 s."""
    more = """stop: {between: [a, wall], gap: 0, restitution: 0}
    - force: {on: a, value: 0.1*t - 1.5}
    - friction: {between: [b, a], law: coulomb, force: 0.3}"""
    text = TEXT.replace("STOP", more).replace("{mass: 2}, b: {mass: 3}", "{mass: 1}, b: {mass: 1}")
    text = text.replace("x_a: 1, v_a: 0, x_b: 0, v_b: 0", "x_a: 1, v_a: -1, x_b: 0, v_b: -1").replace(
        "until: 3", "until: 18"
    )
    found = run(read_problem(text), name)
    assert (found.status, found.reason) == ("ok", "")
    assert [(t.kind, t.to_mode) for t in found.transitions[-2:]] == [("stick", (0, 0)), ("release", (1, 0))]
    assert found.transitions[-1].time == pytest.approx(15, abs=1e-9)
    assert (found.end_state[0], found.end_state[1]) == pytest.approx((0.225, 0.225), abs=1e-8)
