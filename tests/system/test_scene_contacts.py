"""Contacts of one relative velocity, and friction that only holds."""

from __future__ import annotations

import math

import pytest
from runs import run as simulated

from henon_ref.casefile.case import parse_case

TEXT = """\
schema: 1
name: contacts
title: Contacts of one relative velocity
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
    system = parse_case(text).readings[0].problem.system
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
    assert len(parse_case(text).readings[0].problem.system.surfaces) == 3


def test_friction_that_slides_free_and_holds_is_a_right_run() -> None:
    """A block on a spring and on ground that holds it with 0.7 and lets it slide with nothing: cosines and rests."""
    text = """
schema: 1
name: free_or_held
title: Friction that holds and does not brake
scene:
  bodies: {m: {mass: 1}, belt: {velocity: 0.5}, wall: fixed}
  connections:
    - spring: {between: [m, wall], stiffness: 1}
    - friction: {between: [m, belt], law: coulomb, force: 0, static: 0.7, name: s}
initial: {t: 0, x_m: START, v_m: 0}
until: 10
"""
    fast = simulated(parse_case(text.replace("START", "1")).readings[0].problem)
    assert [(t.kind, t.surface) for t in fast.transitions] == [("crossing", 0)] * 3
    assert [t.time for t in fast.transitions] == pytest.approx(
        [7 * math.pi / 6, 11 * math.pi / 6, 19 * math.pi / 6], abs=1e-12
    )
    slow = simulated(parse_case(text.replace("START", "0.6")).readings[0].problem)
    stuck = math.pi + math.asin(0.5 / 0.6)
    place = 0.6 * math.cos(stuck)
    assert [t.kind for t in slow.transitions[:2]] == ["stick", "release"]
    assert [t.time for t in slow.transitions[:2]] == pytest.approx([stuck, stuck + (0.7 - place) / 0.5], abs=1e-12)
