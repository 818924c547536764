"""What a scene is refused for, and the place that the error names."""

from __future__ import annotations

import pytest

from henon_ref.casefile.case import parse_case
from henon_ref.errors import CaseError

BAD = """\
schema: 1
name: bad
title: Bad
scene:
  parameters: {k: 1, n: -1}
  bodies:
    a: BODY
    b: {mass: 1}
    r: {inertia: 1}
    belt: {velocity: 1}
    wall: fixed
    floor: {fixed: 1}
  connections:
    - friction: {between: [b, belt], law: coulomb, force: 1}
    - CONNECTION
initial: {x_a: 0, v_a: 0, x_b: 0, v_b: 0, phi_r: 0, omega_r: 0}
until: 1
"""
FRICTION = "friction: {between: [a, belt], law: coulomb, force: 1"


def refusal(connection: str, body: str = "{mass: 1}", initial: str = "x_a: 0") -> CaseError:
    text = BAD.replace("BODY", body).replace("CONNECTION", connection).replace("x_a: 0", initial)
    with pytest.raises(CaseError) as caught:
        parse_case(text, file="case.yaml")
    return caught.value


@pytest.mark.parametrize(
    ("connection", "at", "says"),
    [
        ("spring: {between: [a, wal], stiffness: k}", "wal", "unknown body 'wal'; did you mean 'wall'"),
        ("spring: {between: [a, a], stiffness: k}", "a", "'a' cannot be connected to itself; name another body"),
        ("spring: {between: [wall, floor], stiffness: k}", "[wall, floor]", "both are fixed; name a mass or a rotor"),
        ("spring: {between: [wall, belt], stiffness: k}", "[wall, belt]", "the motion of both is given"),
        ("spring: {between: [a, r], stiffness: k}", "r", "connect two masses or two rotors"),
        ("spring: {between: [a], stiffness: k}", "[a]", "must name two bodies"),
        ("spring: {stiffness: k}", "", "requires 'between'"),
        ("spring: {between: [a, wall]}", "", "requires 'stiffness' [N/m, between rotors N m/rad]"),
        ("spring: {between: [a, wall], stifness: k}", "stifness", "did you mean 'stiffness'"),
        ("spring: {between: [a, wall], stiffness: q}", "q", "unknown name 'q'"),
        ("spring: {between: [a, wall], stiffness: t}", "t", "unknown name 't'"),
        ("spring: {between: [a, belt], stiffness: k}", "belt", "give its 'position' instead of its 'velocity'"),
        ("spring: k", "k", "must be a mapping"),
        ("sprng: {between: [a, wall], stiffness: k}", "", "did you mean 'spring'"),
        ("spring", "", "a connection is a kind with its keys"),
        ("damper: {between: [a, wall]}", "", "requires the key 'coefficient' [N s/m]"),
        ("damper: {between: [r, wall]}", "", "requires the key 'coefficient' [N m s/rad]"),
        ("force: {on: r, value: 1}", "r", "use a torque"),
        ("torque: {on: a, value: 1}", "a,", "use a force"),
        ("force: {on: wall, value: 1}", "wall", "its motion is given"),
        ("force: {on: a, value: 1/(k - 1)*t}", "/(k - 1)", "division by zero (with the values"),
        (FRICTION + ", static: 0.5}", "0.5", "'static' must not be smaller than 'force'"),
        (FRICTION + ", slope: 1}", "slope", "the law 'stribeck' has"),
        ("friction: {between: [a, belt], law: coulomb, force: n}", "n", "0 or larger"),
        ("friction: {between: [a, belt], law: coulom, force: 1}", "coulom", "did you mean 'coulomb'"),
        ("friction: {between: [a, belt], force: 1}", "", "requires the key 'law'"),
        (
            "friction: {between: [a, belt], law: stribeck, force: 1}",
            "",
            "requires 'slope' [s/m, between",
        ),
        ("friction: {between: [b, belt], law: coulomb, force: 1}", "", "give the friction another 'name'"),
        (FRICTION + ", name: s_b_belt}", "name", "'s_b_belt' is already the name of a connection"),
        (FRICTION + ", name: x_b}", "name", "'x_b' is already the name of a state"),
        (FRICTION + ", name: k}", "name", "'k' is already the name of a parameter"),
        (FRICTION + ", name: b}", "name", "'b' is already the name of a body"),
        (FRICTION + ", name: 3}", "name", "is not a name"),
        ("stop: {between: [wall, a], gap: 0, restitution: 1.5}", "1.5", "must be at most 1"),
        ("stop: {between: [wall, a], gap: 0, restitution: -1}", "-1", "0 or larger"),
        ("stop: {between: [wall, a], gap: 0, restitution: 0.8, stiffness: 1}", "stiffness", "not both"),
        ("stop: {between: [wall, a], gap: 0, stiffness: 1, restitution: 0.8}", "restitution", "not both"),
        ("stop: {between: [wall, a], gap: 0}", "", "(elastic)"),
        ("stop: {between: [wall, a], gap: 0, stiffness: 0}", "0", "larger than 0"),
        ("stop: {between: [wall, a], stiffness: 1}", "", "requires the key 'gap' [m]"),
        ("stop: {between: [wall, a], gap: 0, restitution: 0.8, damping: 1}", "damping", "has no 'damping'"),
        (
            "stop: {between: [belt, a], gap: 0, restitution: 0.8}",
            "belt",
            "give its 'position' instead of its 'velocity'",
        ),
    ],
)
def test_a_connection_that_cannot_be_built_is_refused_with_its_place(connection: str, at: str, says: str) -> None:
    """``at``: the text that the error points to, its last occurrence; none: the connection."""
    error = refusal(connection)
    assert says in error.message
    column = connection.rindex(at) if at else 0
    assert str(error).startswith(f"case.yaml:15:{7 + column}: ")


@pytest.mark.parametrize(
    ("body", "place", "says"),
    [
        ("{mass: -1}", "7:15", "'mass' [kg] of 'a' must be larger than 0"),
        ("{mass: 0}", "7:15", "larger than 0"),
        ("{inertia: n}", "7:18", "'inertia' [kg m^2] of 'a' must be larger than 0"),
        ("{mass: t}", "7:15", "unknown name 't'"),
        ("{mas: 1}", "7:9", "did you mean 'mass'"),
        ("{}", "7:5", "has no key that defines the body"),
        ("{mass: 1, inertia: 1}", "7:18", "'mass' and 'inertia'"),
        ("{position: t, velocity: 1}", "7:22", "'position' and 'velocity'"),
        ("fixd", "7:8", "a body is 'fixed' or has one of"),
        ("{mass: 1, states: [y]}", "7:26", "must be two names, as in [x1, x2]"),
        ("{mass: 1, states: [y, k]}", "7:30", "'k' is already a parameter"),
        ("{mass: 1, states: [y, y]}", "7:30", "'y' is already"),
        ("{mass: 1, states: [y, kind]}", "7:30", "another column of transitions.csv"),
        ("{mass: 1, states: [y, pi]}", "7:30", "is reserved"),
        ("{velocity: 1, states: [y, z]}", "7:22", "has no states"),
    ],
)
def test_a_body_that_cannot_be_built_is_refused_with_its_place(body: str, place: str, says: str) -> None:
    error = refusal("force: {on: b, value: 1}", body)
    assert says in error.message
    assert str(error).startswith(f"case.yaml:{place}: ")


def test_an_initial_value_of_no_state_is_refused() -> None:
    error = refusal("force: {on: b, value: 1}", initial="x_a: 0, x_belt: 0")
    assert "'x_belt' is not a state" in error.message
    assert str(error).startswith("case.yaml:16:19: ")


def test_a_body_named_twice_is_refused() -> None:
    assert "is given twice" in refusal("force: {on: b, value: 1}", body="{mass: 1}\n    b: {mass: 1}").message


def test_the_old_spelling_is_refused() -> None:
    text = BAD[: BAD.index("  bodies")] + "  body: belt_oscillator\n  effects: {}\n" + BAD[BAD.index("initial") :]
    with pytest.raises(CaseError, match="unknown key 'body'"):
        parse_case(text)
