"""Kinks and jumps as people write them, and the surfaces that they become."""

from __future__ import annotations

from itertools import product

import pytest
import sympy as sp
from problems import read_problem

import henon_ref as hr
from henon_ref.errors import ExpressionError
from henon_ref.expressions.evaluation import FIELD, evaluated
from henon_ref.expressions.kinks import Kinks
from henon_ref.expressions.operations import Work

X, V, T, K = sp.symbols("x v t k", real=True)
K1, K2, K3 = sp.symbols("kink1 kink2 kink3", real=True)
NAMES = {"x": X, "v": V, "t": T, "k": K}


def read(*texts: str) -> tuple[list[sp.Expr], dict[sp.Symbol, sp.Expr]]:
    kinks = Kinks({K: sp.Integer(-2)})
    found = [kinks.resolved(*evaluated(text, NAMES, Work(), FIELD)) for text in texts]
    return found, kinks.surfaces


@pytest.mark.parametrize(
    ("text", "expected", "surfaces"),
    [
        ("abs(x)", X * K1, [X]),
        ("-k*abs(x - v)", -K * (X - V) * K1, [X - V]),
        ("sign(sin(t))", K1, [sp.sin(T)]),
        ("max(0, x)", X * (1 - K1) / 2, [-X]),
        ("max(x, v)", X * (1 + K1) / 2 + V * (1 - K1) / 2, [X - V]),
        ("min(x, v)", V * (1 + K1) / 2 + X * (1 - K1) / 2, [X - V]),
        ("piecewise(x, v < 1, 0)", X * (1 + K1) / 2, [1 - V]),
        ("piecewise(x, v >= 1, 0)", X * (1 + K1) / 2, [V - 1]),
        ("abs(3)", 3, []),
        ("abs(k)", -K, []),
        ("max(x, x)", X, []),
        ("piecewise(x, 1 < 2, v)", X, []),
        ("0*abs(x) + v", V, []),
    ],
)
def test_what_is_written_is_what_it_is_with_a_sign(text: str, expected: sp.Expr, surfaces: list[sp.Expr]) -> None:
    (found,), made = read(text)
    assert found == expected
    assert list(made.values()) == surfaces


def test_branches_are_chosen_in_turn() -> None:
    (found,), made = read("piecewise(1, t < 1, x, t < 2, v)")
    assert list(made.values()) == [1 - T, 2 - T]
    values = {(1, 1): 1, (1, -1): 1, (-1, 1): X, (-1, -1): V}
    assert {at: found.xreplace({K1: sp.Integer(at[0]), K2: sp.Integer(at[1])}) for at in values} == values


def test_kinks_are_numbered_as_they_appear_and_an_equal_argument_counts_once() -> None:
    (one, two), made = read("abs(2*x - 2*v) + sign(t - 1)", "max(v, x) - abs(1 - t) + abs(v)")
    assert made == {K1: 2 * X - 2 * V, K2: T - 1, K3: V}
    assert one == K1 * (2 * X - 2 * V) + K2
    assert sp.expand(two - (V * (1 - K1) / 2 + X * (1 + K1) / 2 + K2 * (1 - T) + K3 * V)) == 0


@pytest.mark.parametrize("text", ["abs(abs(x) - 1)", "max(x, v, 1)", "min(x, 2, -v, t)", "sign(max(x, abs(v)) - 1)"])
def test_kinks_of_kinks_are_branches_whose_values_are_right(text: str) -> None:
    (found,), made = read(text)
    plain = {"abs": abs, "max": max, "min": min, "sign": lambda u: (u > 0) - (u < 0)}
    for x, v, t in product((-2.5, -0.75, 0.25, 1.75), (-1.5, -0.5, 1.25), (-3.25, 0.125)):
        at = {X: x, V: v, T: t}
        signs = {sign: sp.sign(surface.xreplace(at)) for sign, surface in made.items()}
        assert not any(surface.has(*made) for surface in made.values())
        assert float(found.xreplace(signs).xreplace(at)) == eval(text, plain, {"x": x, "v": v, "t": t})


@pytest.mark.parametrize(
    ("text", "offset", "says"),
    [
        ("sign(abs(x) + abs(v) + abs(t) + abs(x - 1) + abs(x - 2) - 9)", 0, "more than 4 kinks"),
        ("piecewise(1, x, 2)", 14, "a condition has one comparison"),
        ("piecewise(1, 0 < x < 2, 2)", 19, "a condition has one comparison"),
        ("piecewise(1, x < 2)", 0, "the value otherwise"),
        ("piecewise(1, x < 2, 3, x < 4)", 0, "the value otherwise"),
        ("piecewise(1, < 2, 3)", 13, "missing before '<'"),
        ("x < 1", 2, "in a condition of 'piecewise' only"),
        ("piecewise(x < 1, x < 1, 2)", 12, "in a condition of 'piecewise' only"),
        ("max(x)", 0, "takes two arguments or more"),
        ("abs(x, 2)", 5, "takes 1 argument"),
        ("floor(x)", 0, "jumps infinitely often"),
        ("mod(x, 2)", 0, "jumps infinitely often"),
        ("heaviside(x)", 0, "write piecewise(1, x > 0, 0)"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_place(text: str, offset: int, says: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        evaluated(text, NAMES, Work(), FIELD)
    assert says in caught.value.message
    assert caught.value.offset == offset


@pytest.mark.parametrize(
    "text",
    [
        "piecewise(sign(v), abs(v) > 0, 2)",
        "piecewise(2, abs(v) <= 0, sign(v))",
        "piecewise(1, v > 0, -1, v < 0, 2)",
        "sign(v)*piecewise(1, abs(v) > 0, 2)",
    ],
)
def test_a_value_on_a_surface_that_neither_side_has_is_refused(text: str) -> None:
    with pytest.raises(ExpressionError, match=r"where v is 0, this expression is 2.*'static'"):
        evaluated(text, NAMES, Work(), FIELD)


TAKEN = {
    "piecewise(1, v > 0, -1, v < 0, 0)": "sign(v)",
    "piecewise(sign(v), abs(v) > 0, 0)": "sign(v)",
    "piecewise(1, v >= 0, -1, v < 0, 7)": "sign(v)",
    "piecewise(1, v > 0, -1)": "sign(v)",
    "piecewise(x, x > 0, 0)": "Max(x, 0)",
    "piecewise(v - 2, abs(v - 2) > 0, 0)": "v - 2",
    "piecewise(x*(v - 2*x), abs(v - 2*x) > 0, 0)": "x*(v - 2*x)",
    "piecewise(0, x > 0, log(-x))": "Piecewise((0, x > 0), (log(-x), True))",
    "piecewise(1, x < 1, 2, x < 2, 3)": "Piecewise((1, x < 1), (2, x < 2), (3, True))",
    "piecewise(1, abs(v) > 0.001, 1000*v)": "1",
}
"""What is written, and the same in SymPy's words wherever the tests look."""


@pytest.mark.parametrize("text", TAKEN)
def test_a_value_on_a_surface_that_changes_nothing_is_taken(text: str) -> None:
    """Beside its surfaces the field has the values that are written."""
    written = sp.sympify(TAKEN[text], locals=NAMES)
    (found,), made = read(text)
    for x, v in product((sp.Rational(-5, 2), sp.Rational(3, 2), sp.Rational(5, 2)), repeat=2):
        at = {X: x, V: v}
        signs = {sign: sp.sign(surface.xreplace(at)) for sign, surface in made.items()}
        assert found.xreplace(signs).xreplace(at) == written.xreplace(at)


def test_the_least_of_300_terms_is_read_and_stays_short() -> None:
    (found,), made = read(f"min({', '.join(f'{k}*x' for k in range(1, 301))})")
    assert list(made.values()) == [-X]
    values = [found.xreplace({K1: sp.Integer(side)}) for side in (1, -1)]
    assert [sp.expand(value) for value in values] == [300 * X, X]


# -- kinks that are surfaces ----------------------------------------------------------------------------

x, v, vb, F, d, s = sp.symbols("x v vb F d s", real=True)
SPEEDS = [
    "abs(v - vb)",
    "abs(vb - v)",
    "abs(2*(v - vb))/2",
    "2*abs(vb/2 - v/2)",
    "sqrt((v - vb)^2)",
    "((v - vb)^2)^(1/2)",
    "sqrt((2*vb - 2*v)^2)/2",
    "max(v - vb, vb - v)",
    "-min(v - vb, vb - v)",
    "sign(v - vb)*(v - vb)",
    "(v - vb)*sign(4*v - 4*vb)",
    "piecewise(v - vb, v >= vb, vb - v)",
    "exp(-x)*abs(exp(x)*(v - vb))",
    "abs((1 + x^2)*(v - vb))/(1 + x^2)",
    "abs(exp(d)*v - exp(d)*vb)*exp(-d)",
    sp.Abs(v - vb),
    sp.Max(v - vb, vb - v),
    sp.Piecewise((v - vb, v > vb), (vb - v, True)),
    sp.sqrt((sp.Symbol("v") - sp.Symbol("vb")) ** 2),
]
"""The speed of sliding on a belt beside its surface."""


def belt_with(speed: object, sign: str = "s") -> hr.System:
    rate = f"-x - F*{sign}/(1 + d*({speed}))" if isinstance(speed, str) else -x - F * s / (1 + d * speed)
    return hr.System(["x", "v"], {"F": 1, "d": 3, "vb": 0.5}, {"s": "v - vb"}, ["v", rate])


@pytest.mark.parametrize("speed", SPEEDS, ids=str)
def test_a_kink_that_is_a_surface_up_to_a_factor_has_its_sign(speed: object) -> None:
    """Friction laws as people write them, ``abs(v - vb)`` beside the surface ``v - vb``, in the seven forms or more."""
    hand, system = belt_with("s*(v - vb)"), belt_with(speed)
    assert system.model.surfaces == hand.model.surfaces
    assert not system.model.kinks
    runs = [hr.simulate(each, {"x": 0, "v": 0}, until=20) for each in (hand, system)]
    exact = str(speed).count("exp") == 0 and "x" not in str(speed)  # else what is written rounds otherwise
    if exact:
        assert runs[0].y.tolist() == runs[1].y.tolist()
        assert runs[0].transitions.equals(runs[1].transitions)
    assert runs[0].transitions["kind"].tolist() == runs[1].transitions["kind"].tolist()
    assert runs[1].transitions["time_s"].to_numpy() == pytest.approx(runs[0].transitions["time_s"].to_numpy(), rel=1e-9)


def test_so_has_a_load_beside_the_surface_and_a_jump_there() -> None:
    """max(0, v - vb) of a damper that acts one way, and friction of two sizes: convex combinations slide."""
    hand = belt_with("s*(v - vb)").model
    one_way = belt_with("s*(v - vb) + max(0, v - vb)").model
    assert one_way.surfaces == hand.surfaces
    assert sp.expand(one_way.field[1] - (-x - F * s / (1 + d * (s * (v - vb) + (v - vb) * (1 + s) / 2)))) == 0
    sizes = hr.System(["v"], {"vb": 1}, {"s": "v - vb"}, ["2 - s*piecewise(3, v > vb, 1)"])
    assert sizes.model.surfaces == (v - vb,)
    run = hr.simulate(sizes, {"v": 0}, until=2)  # dv/dt is 3 below and -1 above
    assert run.transitions[["time_s", "kind"]].to_numpy().tolist() == [[pytest.approx(1 / 3), "stick"]]


@pytest.mark.parametrize(
    ("argument", "merged"),
    [
        ("d*(v - vb)", False),  # d may be made negative
        ("(d^2 + 1)*(v - vb)", True),
        ("(1 - sqrt(2))*(v - vb)", True),
        ("v - vb + 1/1000", False),
        ("v^2 - vb^2", False),
        ("x*(v - vb)", False),
        ("(x - 1)*(v - vb) - x*(v - vb)", True),
        ("d*v - d*vb", False),
    ],
)
def test_a_factor_counts_where_its_sign_is_certain(argument: str, merged: bool) -> None:
    system = hr.System(["x", "v"], {"d": 3, "vb": 0.5}, {"s": "v - vb"}, ["v", f"-x - s - abs({argument})"])
    assert bool(system.model.kinks) is not merged


def test_kinks_of_one_form_are_one() -> None:
    (one, two), made = read("abs(exp(t)*(x - v))", "abs((v - x)/(1 + t^2))")
    assert list(made) == [K1]
    assert sp.simplify(one - K1 * sp.exp(T) * (X - V)) == 0
    assert sp.simplify(two - K1 * (X - V) / (1 + T**2)) == 0


@pytest.mark.parametrize("order", [("rub", "grip"), ("grip", "rub")])
def test_a_load_that_has_the_kink_of_another_contact_s_surface_has_its_sign(order: tuple[str, str]) -> None:
    """Whichever of the two connections the scene names first."""
    connections = {
        "rub": "friction: {between: [a, belt], law: coulomb, force: 0.2, name: rub}",
        "grip": "friction: {between: [a, wall], law: coulomb, force: 0.1, normal: '1 + abs(v_a - 1/2)', name: grip}",
    }
    text = f"""\
scene:
  bodies:
    a: {{mass: 1}}
    wall: fixed
    belt: {{velocity: 1/2}}
  connections:
    - spring: {{between: [a, wall], stiffness: 1}}
    - {connections[order[0]]}
    - {connections[order[1]]}
initial: {{x_a: 1, v_a: 0}}
until: 10
"""
    model = read_problem(text).system
    speed = model.surfaces[model.sign_names.index("rub")]
    assert {model.surfaces[i] for i in model.kinks} == {1 + speed, 1 - speed}  # where max(0, load) begins
    acceleration = model.field[1].xreplace(dict.fromkeys(model.signs, sp.S.One))
    assert sp.expand(acceleration) == sp.expand(-model.states[0] - sp.Rational(1, 5) - (1 + speed) / 10)
