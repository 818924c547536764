"""What equations require of the parameters, as expressions in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import henon_ref as hr

CASES = Path(__file__).parents[2] / "cases"


def negative(system: hr.System, **values: int) -> list[str]:
    """Conditions that are below zero with these values of some parameters, the case's own for the others."""
    own = {sp.Symbol(name, real=True): values.get(name, value) for name, value in system.parameters.items()}
    return [str(c) for c in system.model.conditions if c.subs(own) < 0]


def test_each_is_larger_than_zero_or_zero_in_a_case() -> None:
    for name in ("stribeck_belt", "moving_belt", "static_belt", "rig_chaotic"):
        assert negative(hr.System.from_case(CASES / f"{name}.yaml")) == []


@pytest.mark.parametrize("name", ["m", "F"])
def test_a_value_out_of_range_is_below_zero(name: str) -> None:
    scene = hr.System.from_case(CASES / "stribeck_belt.yaml")
    assert negative(scene, **{name: -1}) == [name]
    with pytest.raises(hr.HenonRefError):
        scene.with_parameters({name: -1})


def test_static_friction_is_not_smaller_than_kinetic_friction(tmp_path: Path) -> None:
    path = tmp_path / "held.yaml"
    path.write_text(
        "schema: 1\nname: held\ntitle: held\n"
        "scene:\n  parameters: {m: 1, k: 1, Fk: 1, Fs: 3/2}\n"
        "  bodies: {a: {mass: m}, belt: {velocity: 1}, wall: fixed}\n"
        "  connections:\n    - spring: {between: [a, wall], stiffness: k}\n"
        "    - friction: {between: [a, belt], law: coulomb, force: Fk, static: Fs}\n"
        "initial: {x_a: 0, v_a: 0}\nuntil: 5\n"
    )
    scene = hr.System.from_case(path)
    assert negative(scene) == []
    assert negative(scene, Fk=2) == ["-Fk + Fs"]
    with pytest.raises(hr.HenonRefError, match="'static' must not be smaller"):
        scene.with_parameters({"Fk": 2})


@pytest.mark.parametrize("a", [-1, -0.25, 0, 0.25, 3])
def test_kinks_that_meet_at_a_parameter_are_in_the_order_of_its_value(a: float) -> None:
    """Branches x and x - a of a minimum have the sign of a: min(x, abs(x - a)) is x for a < 0 < x."""
    system, start = hr.System(["x"], {"a": 1}, {}, ["min(x, abs(x - a))"]), {"x": 1}
    assert negative(system, a=-1) == ["a"]
    own = hr.simulate(hr.System(["x"], {"a": a}, {}, ["min(x, abs(x - a))"]), start, until=1).y[0, -1]
    if a <= 0:
        assert own == pytest.approx(np.e)
    assert [hr.simulate(system, start, until=1, parameters={"a": a}).y[0, -1] for _ in range(3)] == [own] * 3
    table = hr.sweep(
        system, start, until=1, grid={"a": [2, a, 1, a]}, observe=[hr.observe.final_state()], jobs=1
    )  # as the system itself, as the point, and again
    assert table["status"].tolist() == ["ok"] * 4
    assert table["final_x"].tolist()[1::2] == [own] * 2


def test_kinks_in_a_scene_follow_a_swept_parameter_too() -> None:
    scene = hr.Scene({"a": 1})
    scene.force(scene.body("b", mass=1), "min(t, abs(t - a))")
    table = hr.sweep(
        scene.system(), {"x_b": 0, "v_b": 0}, until=1, grid={"a": [1, -1]}, observe=[hr.observe.final_state()], jobs=1
    )
    assert table["final_v_b"].tolist() == pytest.approx([1 / 4, 1 / 2])
