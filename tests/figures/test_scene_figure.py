"""The schematic of a scene: every body and connection is in it, and its words are free of each other."""

from __future__ import annotations

from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from henon_ref.casefile.case import load_case, parse_case
from henon_ref.figures.scene import MOST_BODIES, draw_scene

CASES = Path(__file__).parents[2] / "cases"
EXAMPLE = """\
schema: 1
name: scene
title: Scene
scene:
  bodies:
    a: {mass: 1}
    b: {mass: 1}
    rotor: {inertia: 1}
    motor: {velocity: 1}
    belt: {velocity: 1}
    wall: fixed
  connections:
    - spring: {between: [a, wall], stiffness: 1}
    - spring: {between: [a, b], stiffness: 1}
    - damper: {between: [a, b], coefficient: 1}
    - friction: {between: [a, belt], law: coulomb, force: 1}
    - friction: {between: [rotor, motor], law: coulomb, force: 1, name: rub}
    - stop: {between: [wall, b], gap: 0, stiffness: 1}
    - force: {on: b, value: 1}
    - torque: {on: rotor, value: 1}
initial: {x_a: 0, v_a: 0, x_b: 0, v_b: 0, phi_rotor: 0, omega_rotor: 0}
until: 1
"""


def words(text: str) -> list[str]:
    scene = parse_case(text).readings[0].scene
    assert scene is not None
    figure = draw_scene(scene)
    assert figure is not None
    (axes,) = figure.axes
    FigureCanvasAgg(figure).draw()
    boxes = [label.get_window_extent() for label in axes.texts if label.get_text()]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    frame = figure.bbox
    assert all(frame.x0 <= box.x0 and box.x1 <= frame.x1 for box in boxes)
    labels = [label.get_window_extent() for label in axes.texts if label.get_text() not in ("", *scene.bodies)]
    for line in axes.lines:  # no label stands over a symbol
        points = axes.transData.transform(line.get_xydata())
        points = np.concatenate([np.linspace(a, b, 50) for a, b in pairwise(points)])
        assert not any(box.count_contains(points) for box in labels)
    return [label.get_text().replace("\n", " ") for label in axes.texts if label.get_text()]


def test_every_body_and_every_connection_is_drawn() -> None:
    bodies = ["a", "b", "rotor", "motor", "belt", "wall"]
    connections = [
        "spring",
        "spring",
        "damper",
        "friction s_a_belt",
        "friction rub",
        "stop g_wall_b",
        "force",
        "torque",
    ]
    assert sorted(words(EXAMPLE)) == sorted(bodies + connections)


def test_a_long_label_stands_beside_the_next_spring() -> None:
    text = EXAMPLE.partition("    b: {mass: 1}\n")[0] + "    belt: {velocity: 1}\n    wall: fixed\n  connections:\n"
    text += "    - spring: {between: [a, wall], stiffness: 1}\n"
    text += "    - friction: {between: [a, belt], law: coulomb, force: 1, name: s_block_belt}\n"
    assert "friction s_block_belt" in words(f"{text}initial: {{x_a: 0, v_a: 0}}\nuntil: 1\n")


@pytest.mark.parametrize("name", ["stribeck_belt", "moving_belt", "static_belt"])
def test_scenes_of_the_suite_are_drawn(name: str) -> None:
    assert sorted(words((CASES / f"{name}.yaml").read_text())) == ["belt", "block", "friction s", "spring", "wall"]


def test_a_body_that_nothing_is_connected_to_is_drawn_too() -> None:
    assert "idle" in words(EXAMPLE.replace("wall: fixed", "wall: fixed\n    idle: {fixed: 1}"))


def test_a_scene_of_many_bodies_is_not_drawn() -> None:
    bodies = "\n    ".join(f"c{k}: {{mass: 1}}" for k in range(MOST_BODIES))
    start = ", ".join(f"x_c{k}: 0, v_c{k}: 0" for k in range(MOST_BODIES))
    text = EXAMPLE.replace("a: {mass: 1}", f"a: {{mass: 1}}\n    {bodies}").replace(
        "initial: {", f"initial: {{{start}, "
    )
    scene = parse_case(text).readings[0].scene
    assert scene is not None
    assert draw_scene(scene) is None


def test_a_case_with_equations_has_no_scene() -> None:
    assert load_case(CASES / "rig_periodic.yaml").readings[0].scene is None
