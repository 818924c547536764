"""A bad scene in the command: line and column of the wrong key or entry, what is allowed, exit status 2."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import run

SCENE = """\
schema: 1
name: bad
title: A bad scene
scene:
  parameters: {k: 1}
  bodies:
    a: {mass: 1}
    b: {mass: 1}
    belt: {velocity: 1}
    wall: fixed
    floor: {fixed: 1}
  connections:
    - spring: {between: [a, wall], stiffness: k}
    - spring: {between: [b, wall], stiffness: k}
    - friction: {between: [b, belt], law: coulomb, force: 1}
    - stop: {between: [wall, a], gap: -1, stiffness: 10}
initial: {t: 0, x_a: 0, v_a: 0, x_b: 0, v_b: 0}
until: 1
"""
SPRING = "spring: {between: [a, wall], stiffness: k}"
FRICTION = "friction: {between: [b, belt], law: coulomb, force: 1}"
STOP = "stop: {between: [wall, a], gap: -1, stiffness: 10}"

BAD = {
    "an unknown body": (SPRING, "spring: {between: [a, @wal], stiffness: k}", "did you mean 'wall'"),
    "a connection to itself": (SPRING, "spring: {between: [a, @a], stiffness: k}", "name another body"),
    "between two fixed bodies": (
        SPRING,
        "spring: {between: @[wall, floor], stiffness: k}",
        "both are fixed; name a mass or a rotor",
    ),
    "a negative mass": ("a: {mass: 1}", "a: {mass: @-1}", "'mass' [kg] of 'a' must be larger than 0"),
    "a restitution of 1.5": (STOP, "stop: {between: [wall, a], gap: -1, restitution: @1.5}", "must be at most 1"),
    "static below force": (
        FRICTION,
        "friction: {between: [b, belt], law: coulomb, force: 1, static: @0.5}",
        "'static' must not be smaller than 'force'",
    ),
    "restitution beside stiffness": (
        STOP,
        "stop: {between: [wall, a], gap: -1, stiffness: 10, @restitution: 0.8}",
        "'restitution' (hard) or 'stiffness' (elastic), not both",
    ),
    "stiffness beside restitution": (
        STOP,
        "stop: {between: [wall, a], gap: -1, restitution: 0.8, @stiffness: 10}",
        "'restitution' (hard) or 'stiffness' (elastic), not both",
    ),
    "neither restitution nor stiffness": (STOP, "@stop: {between: [wall, a], gap: -1}", "(elastic)"),
    "a misspelt kind": (SPRING, "@sprng: {between: [a, wall], stiffness: k}", "did you mean 'spring'"),
    "one name twice, of two contacts": (
        FRICTION,
        f"{FRICTION}\n    - @{FRICTION}",
        "'s_b_belt' is already the name of a connection; give the friction another 'name'",
    ),
    "one name twice, given": (
        FRICTION,
        "friction: {between: [b, belt], law: coulomb, force: 1, @name: x_a}",
        "'x_a' is already the name of a state; give the friction another 'name'",
    ),
    "one name twice, of two bodies": ("b: {mass: 1}", "@a: {mass: 1}", "'a' is given twice"),
    "an initial value of no state": ("x_b: 0, v_b: 0", "x_b: 0, v_b: 0, @v_belt: 1", "'v_belt' is not a state"),
}
"""What is replaced, by what (``@`` before the wrong key or entry), and a part of the message."""


@pytest.mark.parametrize(("old", "new", "says"), BAD.values(), ids=BAD)
def test_a_bad_scene_is_refused_with_place_and_mend(
    old: str, new: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case, out = tmp_path / "bad.yaml", tmp_path / "out"
    assert old in SCENE
    marked = SCENE.replace(old, new, 1)
    before = marked[: marked.index("@")].splitlines()
    case.write_text(marked.replace("@", ""))
    assert run(case, "--out", out, "--solvers", "henon", "--no-figures") == 2
    captured = capsys.readouterr()
    (message,) = captured.err.strip().splitlines()
    assert f"bad.yaml:{len(before)}:{len(before[-1]) + 1}: " in message
    assert says in message
    assert captured.out == ""
    assert not out.exists()


def test_the_scene_that_they_are_made_from_is_a_good_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = tmp_path / "bad.yaml"
    case.write_text(SCENE)
    assert run(case, "--check") == 0
    assert "friction (b, belt)" in capsys.readouterr().out
