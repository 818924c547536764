"""Contacts of one relative velocity, and friction that only holds."""

from __future__ import annotations

import math

import pytest
from problems import read_problem
from runs import run as simulated

TEXT = """\
scene:
  bodies:
    a: {mass: 1}
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
SHARED = "friction: {between: [r, floor], law: coulomb, force: 1FIRST, name: rub}"


@pytest.mark.parametrize("between", ["[r, floor]", "[floor, r]", "[r, wall]"])
@pytest.mark.parametrize(
    ("first", "second"), [(", static: 2", ", static: 2"), (", static: 2", ""), ("", ", static: 2")]
)
def test_two_contacts_of_one_velocity_with_static_friction_hold_the_sum(between: str, first: str, second: str) -> None:
    one = SHARED.replace("FIRST", first)
    two = f"friction: {{between: {between}, law: coulomb, force: 1{second}, name: rub2}}"
    text = TEXT.replace("CONNECTION", f"{one}\n    - {two}")
    system = read_problem(text).system
    held = [system.sign_names.index(name) for name in ("rub", "rub2")]
    ends = [g for g in system.shared_equations(frozenset(held)).guards if g.kind == "release"]
    limit = sum(2 if own else 1 for own in (first, second))
    assert [system.numeric(g.expression) for g in ends] == [limit, limit]


def test_two_contacts_of_one_velocity_without_static_friction_slide_and_stick_as_one() -> None:
    rubs = [
        f"friction: {{between: [{pair}], law: coulomb, force: 0.2, name: {name}}}"
        for pair, name in (("a, wall", "p"), ("wall, a", "q"))
    ]
    text = TEXT.replace("CONNECTION", "\n    - ".join(rubs)).replace("v_a: 0", "v_a: 1")
    assert len(read_problem(text).system.surfaces) == 3


def test_friction_that_slides_free_and_holds_is_a_right_run() -> None:
    """A block on a spring and on ground that holds it with 0.7 and lets it slide with nothing: cosines and rests."""
    text = """
scene:
  bodies: {m: {mass: 1}, belt: {velocity: 0.5}, wall: fixed}
  connections:
    - spring: {between: [m, wall], stiffness: 1}
    - friction: {between: [m, belt], law: coulomb, force: 0, static: 0.7, name: s}
initial: {t: 0, x_m: START, v_m: 0}
until: 10
"""
    fast = simulated(read_problem(text.replace("START", "1")))
    assert [(t.kind, t.surface) for t in fast.transitions] == [("crossing", 0)] * 3
    assert [t.time for t in fast.transitions] == pytest.approx(
        [7 * math.pi / 6, 11 * math.pi / 6, 19 * math.pi / 6], abs=1e-12
    )
    slow = simulated(read_problem(text.replace("START", "0.6")))
    stuck = math.pi + math.asin(0.5 / 0.6)
    place = 0.6 * math.cos(stuck)
    assert [t.kind for t in slow.transitions[:2]] == ["stick", "release"]
    assert [t.time for t in slow.transitions[:2]] == pytest.approx([stuck, stuck + (0.7 - place) / 0.5], abs=1e-12)
