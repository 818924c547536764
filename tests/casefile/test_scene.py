"""Scenes: each effect adds its own term and no other, against equations written by hand."""

from __future__ import annotations

import pytest
import sympy as sp

from henon_ref.casefile.case import parse_case
from henon_ref.casefile.scene import BODIES, build_scene
from henon_ref.casefile.source import Source
from henon_ref.casefile.validation import validated
from henon_ref.casefile.yaml_file import parse_yaml
from henon_ref.errors import CaseError
from henon_ref.filippov.system import FilippovSystem, Release
from henon_ref.taylor.tape import TIME

X1, X2, X3, X4, S, M, K, F, VP = sp.symbols("x1 x2 x3 x4 s m k F vp", real=True)


def oscillator(effects: str, parameters: str = "m: 2, k: 3, F: 0.5, vp: 0.4") -> FilippovSystem:
    text = f"""\
schema: 1
name: scene
title: Scene
scene:
  body: belt_oscillator
  parameters: {{{parameters}}}
  effects: {{{effects}}}
initial: {{x1: 1, x2: 0}}
until: 1
"""
    tree = parse_yaml(text, file="case.yaml")
    form = validated(tree, file="case.yaml")
    assert form.scene is not None
    system, _ = build_scene(Source(tree, "case.yaml"), form.scene)
    return system


def same(left: sp.Expr, right: sp.Expr) -> bool:
    return sp.simplify(left - right) == 0


@pytest.mark.parametrize(
    ("effects", "force"),
    [
        ("", 0),
        ("linear_spring: {stiffness: k}", -K * X1),
        ("cubic_spring: {stiffness: -k}", K * X1**3),
        ("viscous_damping: {coefficient: k}", -K * X2),
        (
            "linear_spring: {stiffness: k}, harmonic_base: {amplitude: F, frequency: 2}",
            -K * (X1 - F * sp.sin(2 * TIME)),
        ),
        (
            "harmonic_base: {amplitude: F, frequency: 2, phase: pi/2}, linear_spring: {stiffness: k}",
            -K * (X1 - F * sp.cos(2 * TIME)),
        ),
        ("coulomb_friction: {force: F}", -F * S),
        ("coulomb_friction: {force: F}, moving_belt: {velocity: vp}", -F * S),
        ("stribeck_friction: {force: F, slope: 3}", -F * S / (1 + 3 * S * X2)),
        (
            "stribeck_friction: {force: F, slope: 3}, moving_belt: {velocity: vp*cos(t)}",
            -F * S / (1 + 3 * S * (X2 - VP * sp.cos(TIME))),
        ),
    ],
)
def test_an_effect_adds_its_term_and_no_other(effects: str, force: sp.Expr) -> None:
    system = oscillator(effects)
    velocity, acceleration = system.field
    assert velocity == X2
    assert same(acceleration, force / M)
    assert acceleration.free_symbols == (sp.sympify(force) / M).free_symbols
    assert system.effects == tuple(part.split(":")[0] for part in effects.replace("}, ", "}|").split("|") if part)


def test_the_surface_is_the_sliding_velocity_and_only_friction_makes_one() -> None:
    smooth = oscillator("linear_spring: {stiffness: k}, moving_belt: {velocity: vp}")
    assert (smooth.surfaces, smooth.signs) == ((), ())
    assert oscillator("coulomb_friction: {force: F}").surfaces == (X2,)
    swinging = oscillator("coulomb_friction: {force: F}, moving_belt: {velocity: vp*sin(t)}")
    assert swinging.surfaces == (X2 - VP * sp.sin(TIME),)


def test_the_scene_of_fig_8_is_eq_18() -> None:
    system = oscillator(
        "linear_spring: {stiffness: k1}, cubic_spring: {stiffness: -k2}, harmonic_base: {amplitude: A, frequency: w},"
        "moving_belt: {velocity: vp}, stribeck_friction: {force: mu0, slope: 1}",
        "m: 0.1, k1: 1, k2: 1, A: 0.4, w: 3.8, vp: 0.4, mu0: 0.2",
    )
    k1, k2, A, w, mu0 = sp.symbols("k1 k2 A w mu0", real=True)
    z = X1 - A * sp.sin(w * TIME)
    for sign, pole in ((-1, 1), (1, -1)):
        printed = (k2 * z**3 - k1 * z + mu0 / (VP - X2 + pole)) / M
        assert same(system.field[1].xreplace({S: sp.Integer(sign)}), printed)


def test_static_friction_holds_up_to_its_force_and_lets_go_to_both_sides() -> None:
    system = oscillator(
        "linear_spring: {stiffness: k}, moving_belt: {velocity: vp*t}, coulomb_friction: {force: F},"
        "static_friction: {force: 2*F}"
    )
    load = -K * X1 - M * VP
    override = system.overrides[0]
    assert override.field == (VP * TIME, VP)
    assert override.release == (Release(load - 2 * F, "rising", 1), Release(load + 2 * F, "falling", -1))


RIG = """\
schema: 1
name: rig
title: Rig
scene:
  body: two_dof_rig
  parameters: {m: 2, k1: 3, k2: 5, k3: 7, a: 1.1, b: 1.3, r: 0.7, c1: 0.01, c2: 0.02, mu0: 0.5, delta: 3, vp: 0.4}
  effects:
    block_spring: {stiffness: k1}
    coupling_spring: {stiffness: k2}
    bracket_spring: {stiffness: k3}
    coupling_damper: {coefficient: c1}
    bracket_damper: {coefficient: c2}
    load_coupling: {friction: mu0, stiffness: k3, coefficient: c2}
    moving_belt: {velocity: vp}
    stribeck_friction: {force: mu0, slope: delta}
initial: {x1: 0, x2: 0, x3: 0.1, x4: 0}
until: 1
readings:
  corrected: {}
  printed: {scene: {effects: {signs_as_printed: {}}}}
"""


def test_the_effects_of_the_rig_add_up_to_eq_27_corrected_and_printed() -> None:
    case = parse_case(RIG)
    m, k1, k2, k3, a, b, r, c1, c2, mu0, delta = sp.symbols("m k1 k2 k3 a b r c1 c2 mu0 delta", real=True)
    omega = sp.sqrt((k1 + k2) / m)
    inertia = m * (a**2 + b**2) / 3
    xi1, xi2, xi3 = k2 / (omega**2 * m), c1 * omega / k2, k2 * r**2 / (omega**2 * inertia)
    xi4, xi5 = (k2 + k3) / k2, omega * (c1 + c2) / k2
    y = 1 - mu0 * k3 / k2 * X3 - omega * c2 * mu0 / k2 * X4
    T = S * y * mu0 / (1 + delta * S * (X2 - VP))
    bracket = xi3 * (-X1 - xi2 * X2 - xi4 * X3 - xi5 * X4)
    corrected = -X1 - xi1 * (xi2 * (X2 + X4) + X3 + T)
    printed = -X1 - xi1 * (xi2 * (X2 + X4) - X3 - T)
    for name, block in (("corrected", corrected), ("printed", printed)):
        system = case.reading(name).problem.system
        assert system.field[0] == X2
        assert system.field[2] == X4
        assert same(system.numeric(system.field[1]), system.numeric(block))
        assert same(system.numeric(system.field[3]), system.numeric(bracket))
        assert same(system.valid[0], y)


def test_the_rig_without_load_coupling_has_no_contact_to_lose() -> None:
    load = "    load_coupling: {friction: mu0, stiffness: k3, coefficient: c2}\n"
    assert load in RIG
    system = parse_case(RIG.replace(load, "")).readings[0].problem.system
    assert system.valid == ()


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES.keys())
def test_every_effect_says_what_it_means_in_which_units(body) -> None:  # type: ignore[no-untyped-def]
    for thing in (*body.effects, *body.parameters, *(p for effect in body.effects for p in effect.parameters)):
        assert thing.name
        assert thing.meaning
    assert all(parameter.unit for effect in body.effects for parameter in effect.parameters)


@pytest.mark.parametrize(
    ("effects", "parameters", "place", "says"),
    [
        ("linear_sprng: {stiffness: k}", "m: 1, k: 1", "7:13", "did you mean 'linear_spring'"),
        ("linear_spring: {}", "m: 1, k: 1", "7:13", "lacks its parameter 'stiffness' [N/m]"),
        ("linear_spring: {stifness: k}", "m: 1, k: 1", "7:29", "did you mean 'stiffness'"),
        ("linear_spring: {stiffness: q}", "m: 1, k: 1", "7:40", "unknown name 'q'"),
        ("linear_spring: {stiffness: t}", "m: 1, k: 1", "7:40", "unknown name 't'"),
        ("linear_spring: k", "m: 1, k: 1", "7:28", "must be a mapping"),
        ("linear_spring: {stiffness: k}", "k: 1", "6:3", "needs the parameter 'm' [kg]"),
        ("linear_spring: {stiffness: k}", "m: 0, k: 1", "6:19", "larger than 0"),
        ("linear_spring: {stiffness: k}", "m: 1, k: 1, x1: 3", "6:28", "is a state"),
        ("coulomb_friction: {force: -1}", "m: 1", "7:39", "0 or larger"),
        ("static_friction: {force: 1}", "m: 1", "7:13", "needs one of coulomb_friction, stribeck_friction"),
        ("static_friction: {force: 1}, coulomb_friction: {force: 2}", "m: 1", "7:38", "smaller than kinetic"),
        ("moving_belt: {velocity: 1/(k-1)}", "m: 1, k: 1", "7:38", "division by zero (with the values"),
    ],
)
def test_a_scene_that_cannot_be_built_is_refused_with_its_place(
    effects: str, parameters: str, place: str, says: str
) -> None:
    with pytest.raises(CaseError) as caught:
        oscillator(effects, parameters)
    assert says in caught.value.message
    assert str(caught.value).startswith(f"case.yaml:{place}: ")


def test_an_unknown_body_is_refused() -> None:
    with pytest.raises(CaseError, match="did you mean 'two_dof_rig'"):
        parse_case(RIG.replace("two_dof_rig", "two_dof_rigg"))
