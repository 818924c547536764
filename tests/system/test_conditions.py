"""What a scene wants of its parameters, as expressions in them."""

from __future__ import annotations

from pathlib import Path

import pytest
import sympy as sp

import henon_ref as hr

CASES = Path(__file__).parents[2] / "cases"


def negative(system: hr.System, **values: int) -> list[str]:
    """Conditions that are below zero with these values of some parameters, the case's own for the others."""
    own = {sp.Symbol(name, real=True): values.get(name, value) for name, value in system.parameters.items()}
    return [str(c) for c in system.conditions if c.subs(own) < 0]


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
