"""Scenes: what is named is built, nothing else, against models written by hand, node for node of their tapes."""

from __future__ import annotations

from pathlib import Path

import pytest
import sympy as sp
from problems import HEAD, read_problem

from henon_ref.casefile.case import load_case, parse_case
from henon_ref.casefile.files import parse_yaml
from henon_ref.casefile.form import read_form
from henon_ref.casefile.schema import CaseForm
from henon_ref.modes.switched_field import Release
from henon_ref.modes.system import FilippovSystem
from henon_ref.system import connections
from henon_ref.system.connections import KINDS
from henon_ref.system.scene import build_scene
from henon_ref.system.source import Source
from henon_ref.taylor.tape import TIME, build_tape

CASES = Path(__file__).parents[2] / "cases"
DOCS = Path(__file__).parents[2] / "docs"
PARAMETERS = "{m: 2, M: 3, J: 5, k: 7, c: 11, F: 13, G: 17, d: 19, w: 23, u: 29}"
BODIES = """\
{a: {mass: m}, b: {mass: M}, r: {inertia: J}, q: {inertia: m}, wall: fixed, floor: {fixed: 3/2},
           belt: {velocity: u}, motor: {velocity: w*t}, base: {position: d*sin(w*t)}}"""
STATES = ("x_a", "v_a", "x_b", "v_b", "phi_r", "omega_r", "phi_q", "omega_q")
AT_REST = ("v_a", "0", "v_b", "0", "omega_r", "0", "omega_q", "0")


def read(connections: str, bodies: str = BODIES, parameters: str = PARAMETERS) -> FilippovSystem:
    text = f"""\
scene:
  parameters: {parameters}
  bodies: {bodies}
  connections: [{connections}]
initial: {{}}
until: 1
"""
    tree = parse_yaml(HEAD + text, file="case.yaml")
    source = Source(tree, "case.yaml")
    read_form(CaseForm, source)
    return build_scene(source).system()


def written(field: dict[str, str], surfaces: dict[str, str]) -> FilippovSystem:
    """A model written by hand: rates that are not those of a body that nothing acts on."""
    rates = [field.get(state, rest) for state, rest in zip(STATES, AT_REST, strict=True)]
    text = f"""\
system:
  state: [{", ".join(STATES)}]
  parameters: {PARAMETERS}
  surfaces: {surfaces or {"unused": "x_a"}}
  field: {rates}
initial: {{{", ".join(f"{state}: 0" for state in STATES)}}}
until: 1
"""
    return read_problem(text).system


def tape_of(system: FilippovSystem, sliding: frozenset[int] = frozenset()) -> object:
    equations = system.shared_equations(sliding)
    return build_tape(system.states, equations.field, [g.expression for g in equations.guards if g.kind != "valid"])


SPRING = "-k*(x_a - x_b)"
LOAD = "x_b*w + 1"
EVERY = [
    pytest.param("", {}, {}, id="nothing"),
    pytest.param("spring: {between: [a, wall], stiffness: k}", {"v_a": "-k*x_a/m"}, {}, id="spring"),
    pytest.param("spring: {between: [wall, a], stiffness: k}", {"v_a": "-k*x_a/m"}, {}, id="spring, turned"),
    pytest.param(
        "spring: {between: [a, floor], stiffness: k}", {"v_a": "-k*(x_a - 3/2)/m"}, {}, id="spring, elsewhere"
    ),
    pytest.param("spring: {between: [a, wall], cubic: c}", {"v_a": "-c*x_a^3/m"}, {}, id="spring, cubic"),
    pytest.param(
        "spring: {between: [a, base], stiffness: k, cubic: -c}",
        {"v_a": "(-k*(x_a - d*sin(w*t)) + c*(x_a - d*sin(w*t))^3)/m"},
        {},
        id="spring to a support that moves",
    ),
    pytest.param(
        "spring: {between: [a, b], stiffness: k}",
        {"v_a": f"{SPRING}/m", "v_b": "k*(x_a - x_b)/M"},
        {},
        id="spring between two",
    ),
    pytest.param(
        "spring: {between: [r, q], stiffness: k}",
        {"omega_r": "-k*(phi_r - phi_q)/J", "omega_q": "k*(phi_r - phi_q)/m"},
        {},
        id="spring, torsional",
    ),
    pytest.param(
        "damper: {between: [a, b], coefficient: c}",
        {"v_a": "-c*(v_a - v_b)/m", "v_b": "c*(v_a - v_b)/M"},
        {},
        id="damper",
    ),
    pytest.param("damper: {between: [r, motor], coefficient: c}", {"omega_r": "-c*(omega_r - w*t)/J"}, {}, id="drag"),
    pytest.param("force: {on: b, value: F*cos(2*t)}", {"v_b": "F*cos(2*t)/M"}, {}, id="force"),
    pytest.param("torque: {on: r, value: F*cos(2*t)}", {"omega_r": "F*cos(2*t)/J"}, {}, id="torque"),
    pytest.param(
        "friction: {between: [a, belt], law: coulomb, force: F}",
        {"v_a": "-F*s_a_belt/m"},
        {"s_a_belt": "v_a - u"},
        id="friction, coulomb",
    ),
    pytest.param(
        "friction: {between: [belt, a], law: coulomb, force: F, name: rub}",
        {"v_a": "F*rub/m"},
        {"rub": "u - v_a"},
        id="friction, turned and named",
    ),
    pytest.param(
        "friction: {between: [a, b], law: stribeck, force: F, slope: 3}",
        {
            "v_a": "-F*s_a_b/(1 + 3*s_a_b*(v_a - v_b))/m",
            "v_b": "F*s_a_b/(1 + 3*s_a_b*(v_a - v_b))/M",
        },
        {"s_a_b": "v_a - v_b"},
        id="friction, stribeck",
    ),
    pytest.param(
        "friction: {between: [r, motor], law: stribeck_exp, force: F, static: G, velocity: d, viscous: c}",
        {"omega_r": "(-s_r_motor*(F + (G - F)*exp(-s_r_motor*(omega_r - w*t)/d)) - c*(omega_r - w*t))/J"},
        {"s_r_motor": "omega_r - w*t"},
        id="friction, stribeck_exp",
    ),
    pytest.param(
        "friction: {between: [a, wall], law: stribeck_exp, force: F, velocity: d}",
        {"v_a": "-s_a_wall*F*exp(-s_a_wall*v_a/d)/m"},
        {"s_a_wall": "v_a"},
        id="friction, stribeck_exp to nothing",
    ),
    pytest.param(
        f"friction: {{between: [a, base], law: coulomb, force: F, normal: {LOAD}}}",
        {"v_a": f"-F*s_a_base*({LOAD})*(1 + kink1)/2/m"},
        {"s_a_base": "v_a - d*w*cos(w*t)", "kink1": LOAD},
        id="friction under a load",
    ),
    pytest.param(
        "friction: {between: [a, b], law: stribeck, force: F, slope: d, viscous: c}",
        {
            "v_a": "(-F*s_a_b/(1 + d*s_a_b*(v_a - v_b)) - c*(v_a - v_b))/m",
            "v_b": "(F*s_a_b/(1 + d*s_a_b*(v_a - v_b)) + c*(v_a - v_b))/M",
        },
        {"s_a_b": "v_a - v_b"},
        id="friction, viscous part",
    ),
    pytest.param(
        "friction: {between: [r, q], law: coulomb, force: F}",
        {"omega_r": "-F*s_r_q/J", "omega_q": "F*s_r_q/m"},
        {"s_r_q": "omega_r - omega_q"},
        id="friction between rotors",
    ),
    pytest.param(
        "friction: {between: [a, base], law: coulomb, force: F}",
        {"v_a": "-F*s_a_base/m"},
        {"s_a_base": "v_a - d*w*cos(w*t)"},
        id="friction on a support that moves",
    ),
    pytest.param(
        'friction: {between: [a, wall], law: coulomb, force: F, normal: "1 + abs(x_b)"}',
        {"v_a": "-F*s_a_wall*(1 + x_b*kink1)*(1 + kink2*(1 + kink1)/2 + kink3*(1 - kink1)/2)/2/m"},
        {"s_a_wall": "v_a", "kink1": "x_b", "kink2": "1 + x_b", "kink3": "1 - x_b"},
        id="friction under a load with a kink",
    ),
    pytest.param(
        "torque: {on: r, value: F*sign(sin(w*t))}",
        {"omega_r": "F*kink1/J"},
        {"kink1": "sin(w*t)"},
        id="torque, a square wave",
    ),
    pytest.param(
        "stop: {between: [wall, b], gap: -1/2, stiffness: k}",
        {"v_b": "k*(1/2 - x_b)*(1 - g_wall_b)/2/M"},
        {"g_wall_b": "1/2 - x_b"},
        id="stop, elastic",
    ),
    pytest.param(
        "stop: {between: [wall, b], gap: -1/2, restitution: 1}", {}, {"g_wall_b": "1/2 - x_b"}, id="stop, hard"
    ),
    pytest.param(
        "stop: {between: [r, q], gap: 0, stiffness: k}",
        {"omega_r": "-k*(phi_r - phi_q)*(1 - g_r_q)/2/J", "omega_q": "k*(phi_r - phi_q)*(1 - g_r_q)/2/m"},
        {"g_r_q": "phi_r - phi_q"},
        id="stop between rotors",
    ),
    pytest.param(
        "stop: {between: [a, wall], gap: 0, stiffness: k, damping: c}",
        {"v_a": "(-k*x_a*(1 - g_a_wall)/2 + (kink1*(-k*x_a - c*v_a)/2 - kink2*(c*v_a - k*x_a)/2)*(1 - g_a_wall)/2)/m"},
        {"g_a_wall": "x_a", "kink1": "-k*x_a - c*v_a", "kink2": "-k*x_a + c*v_a"},
        id="stop, damped",
    ),
]


@pytest.mark.parametrize(("connections", "field", "surfaces"), EVERY)
def test_what_is_named_is_built_and_nothing_else(
    connections: str, field: dict[str, str], surfaces: dict[str, str]
) -> None:
    system = read(connections)
    by_hand = written(field, surfaces)
    assert system.state_names == STATES
    assert dict(zip(system.sign_names, system.surfaces, strict=True)) == {
        name: h for name, h in zip(by_hand.sign_names, by_hand.surfaces, strict=True) if name in surfaces
    }
    if not surfaces:
        by_hand = FilippovSystem(by_hand.states, (), (), by_hand.field, by_hand.parameters)
    assert tape_of(system) == tape_of(by_hand)
    for sliding in (frozenset({i}) for i, name in enumerate(system.sign_names) if name.startswith(("s_", "rub"))):
        assert tape_of(system, sliding) == tape_of(by_hand, sliding)


def test_every_kind_of_connection_is_in_that_test() -> None:
    assert {param.values[0].split(":")[0] for param in EVERY} == {"", *KINDS}


def test_kinds_say_what_they_mean_in_which_units() -> None:
    for kind in KINDS.values():
        assert kind.meaning
        assert all(key.meaning and (key.words or (key.unit and key.angular)) for key in kind.keys)


def test_the_scene_of_the_documentation() -> None:
    lines = (DOCS / "scenes.md").read_text().splitlines()
    start = lines.index("    schema: 1")
    end = next(k for k in range(start, len(lines)) if not lines[k])
    system = parse_case("\n".join(line[4:] for line in lines[start:end])).readings[0].problem.system
    assert system.state_names == ("x_a", "v_a", "x_b", "v_b", "phi_rotor", "omega_rotor")
    assert system.sign_names == ("s_a_belt", "s_b_belt", "g_wall_b")
    assert set(system.overrides) == {0}
    assert system.effects[3] == "friction (a, belt)"


def test_the_kind_of_the_documentation_is_that_of_the_code() -> None:
    text = (DOCS / "scenes.md").read_text().replace("\n    ", "\n")
    code = Path(connections.__file__).read_text()
    for begin, end in (("def _spring", "\n\n\n"), ('    "spring": Kind(', '    ),\n    "stop')):
        assert code[code.index(begin) :].partition(end)[0] in text


def test_the_paper_s_oscillator_is_eq_18_term_by_term() -> None:
    (reading,) = [r for r in load_case(CASES / "fig8.yaml").readings if r.name == "equations"]
    system = reading.problem.system
    m, k1, k2, A, w, mu0, vp, x1, x2, s = sp.symbols("m k1 k2 A w mu0 vp x1 x2 s", real=True)
    z = x1 - A * sp.sin(w * TIME)
    assert system.states == (x1, x2)
    assert system.field == (x2, (-k1 * z + k2 * z**3 - mu0 * s / (1 + s * (x2 - vp))) / m)
    assert system.surfaces == (x2 - vp,)
    for sign, pole in ((-1, 1), (1, -1)):
        printed = (k2 * z**3 - k1 * z + mu0 / (vp - x2 + pole)) / m
        assert sp.simplify(system.field[1].xreplace({s: sp.Integer(sign)}) - printed) == 0


# -- static friction ------------------------------------------------------------------------------------

XA, VA, XB, VB, m, M, k, F, G, w, u = sp.symbols("x_a v_a x_b v_b m M k F G w u", real=True)


def held(between: str) -> FilippovSystem:
    bodies = "{a: {mass: m}, b: {mass: M}, wall: fixed, motor: {velocity: w*t}}"
    springs = "spring: {between: [a, wall], stiffness: k}, spring: {between: [b, wall], stiffness: u}"
    return read(f"{springs}, friction: {{between: {between}, law: coulomb, force: F, static: G}}", bodies)


def test_static_friction_holds_up_to_its_force_and_lets_go_to_both_sides() -> None:
    override = held("[a, motor]").overrides[0]
    load = -k * XA - m * w
    assert override.field == (w * TIME, w, VB, -u * XB / M)
    assert override.release == (Release(load - G, "rising", 1), Release(load + G, "falling", -1))
    assert override.entry == "inside"


def test_the_load_changes_its_sign_with_the_order_of_the_bodies() -> None:
    override = held("[motor, a]").overrides[0]
    load = k * XA + m * w
    assert override.field == (w * TIME, w, VB, -u * XB / M)
    assert override.release == (Release(load - G, "rising", 1), Release(load + G, "falling", -1))


def test_two_masses_that_hold_each_other_move_as_one() -> None:
    override = held("[a, b]").overrides[0]
    together = (-k * XA - u * XB) / (m + M)
    load = (-M * k * XA + m * u * XB) / (m + M)
    assert override.field == (VA, together, VA, together)
    assert override.release == (Release(load - G, "rising", 1), Release(load + G, "falling", -1))


def test_friction_that_slides_with_its_static_force_at_rest_holds_by_filippov_s_rule() -> None:
    bodies = "{a: {mass: m}, wall: fixed}"
    system = read("friction: {between: [a, wall], law: stribeck_exp, force: F, static: G, velocity: 1}", bodies)
    assert not system.overrides


def test_without_friction_and_stops_there_is_no_surface() -> None:
    system = read("spring: {between: [a, wall], stiffness: k}, damper: {between: [a, belt], coefficient: c}")
    assert (system.surfaces, system.signs) == ((), ())


def test_a_load_of_parameters_alone_has_no_kink_and_one_below_0_counts_as_0() -> None:
    bodies = "{a: {mass: m}, wall: fixed}"
    friction = "friction: {{between: [a, wall], law: coulomb, force: F, normal: {}}}"
    s = sp.Symbol("s_a_wall", real=True)
    assert read(friction.format("G"), bodies).field[1] == -F * G * s / m
    assert read(friction.format("-G"), bodies).field == (VA, 0)


def test_loads_that_are_equal_share_their_kink() -> None:
    friction = "friction: {{between: [{}, wall], law: coulomb, force: F, normal: {}}}"
    system = read(
        ", ".join(friction.format(*each) for each in (("a", "x_r"), ("b", "x_r"), ("r2", "x_a")))
        .replace("x_r", "1 - x_b")
        .replace("r2", "b, name: rub")
        .replace("[b, name: rub, wall]", "[b, wall], name: rub")
    )
    assert system.sign_names == ("s_a_wall", "kink1", "s_b_wall", "rub", "kink2")


def test_what_a_scene_wants_of_its_parameters() -> None:
    tree = parse_yaml(
        "scene: {parameters: {m: 1, F: 1, G: 2}, bodies: {a: {mass: m}, wall: fixed}, "
        "connections: [friction: {between: [a, wall], law: coulomb, force: F, static: G}]}"
    )
    assert build_scene(Source(tree)).conditions == (m, F, G, G - F)
