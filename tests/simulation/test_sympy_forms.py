"""A system in SymPy is the one of the same text: its equations, its tape, and the bits of its runs."""

from __future__ import annotations

import random
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import sympy as sp

import henon_ref as hr
from henon_ref.system.tree import as_written
from henon_ref.taylor.tape import build_tape

x, v, t, force, mu, s = sp.symbols("x v t F μ s")
PARAMETERS = {"F": 0.5, "μ": Fraction(1, 3)}
ONE, OTHER = sp.Symbol("x", positive=True), sp.Symbol("x", real=True)

WRITTEN: list[tuple[Any, str]] = [
    (-x - force * s, "-x - F*s"),
    (sp.Abs(x - 1), "abs(x - 1)"),
    (v * sp.Abs(v), "v*abs(v)"),
    (sp.Max(0, x - 1), "max(0, x - 1)"),
    (sp.Min(x, v), "min(v, x)"),
    (sp.Max(x, 2 * v, 1), "max(1, 2*v, x)"),
    (sp.sign(v) * x, "x*sign(v)"),
    (sp.Heaviside(x - 1), "piecewise(1, x - 1 > 0, 0)"),
    (sp.Heaviside(ONE - 1), "piecewise(1, x - 1 > 0, 0)"),
    (sp.Heaviside(x, 1) * t, "t*piecewise(1, x > 0, 0)"),
    (sp.Piecewise((1, x > 2), (2, True)), "piecewise(1, x > 2, 2)"),
    (sp.Piecewise((x, v <= 0), (v, x >= 1), (2, True)), "piecewise(x, v <= 0, v, x >= 1, 2)"),
    (sp.Piecewise((1, (x > 0) & (v < 1)), (0, True)), "piecewise(piecewise(1, v < 1, 0), x > 0, 0)"),
    (sp.Piecewise((1, (x > 0) | (v < 1)), (0, True)), "piecewise(1, x > 0, piecewise(1, v < 1, 0))"),
    (sp.Abs(sp.Max(x, v) - 1), "abs(max(v, x) - 1)"),
    (sp.sqrt(x**2), "sqrt(x^2)"),
    (sp.sqrt((x - v) ** 2 + 1), "sqrt((x - v)^2 + 1)"),
    (1 / sp.sqrt(x**2 + 1), "1/sqrt(x^2 + 1)"),
    ((x**2 + 1) ** sp.Rational(-3, 2), "(x^2 + 1)^(-3/2)"),
    (sp.exp(-(x**2)) * sp.sin(v + t), "exp(-x^2)*sin(v + t)"),
    (sp.E**x, "exp(x)"),
    (sp.tan(x) / (1 + sp.E), "tan(x)/(1 + e)"),
    (sp.tan(x + sp.pi / 2), "tan(x + pi/2)"),
    (sp.cos(sp.sin(sp.tanh(x))), "cos(sin(tanh(x)))"),
    (sp.Rational(2, 3) * x - sp.pi * v, "2/3*x - pi*v"),
    (sp.Float(0.1) * x, "0.1*x"),
    (0.1 * x + 1e-3 * v, "0.1*x + 0.001*v"),
    (sp.Float("0.1", 40) * x, "0.1*x"),
    (np.float64(0.3) * x, "0.3*x"),
    (np.int64(3) * x, "3*x"),
    (sp.nsimplify("1/7") * x, "x/7"),
    (mu * x**2 - mu, "μ*x^2 - μ"),
    (ONE + OTHER, "2*x"),
    (ONE * x - OTHER**2, "0"),
    (sp.Dummy("x") + v, "x + v"),
    (x ** sp.Symbol("F"), "x^F"),
    (2**x, "2^x"),
    (sp.log(x + 3) / sp.log(2), "log(x + 3)/log(2)"),
    ((x + 1) / (v**2 + 1) / 2, "(x + 1)/(v^2 + 1)/2"),
    (-2 * (x - 1) * (v + 1), "(2 - 2*x)*(v + 1)"),
    (sp.asin(x / 9) + sp.acos(x / 9) * sp.atan(v), "asin(x/9) + acos(x/9)*atan(v)"),
    (sp.sinh(x) - sp.cosh(v), "sinh(x) - cosh(v)"),
    (sp.sqrt(3) / 9 * x, "sqrt(3)/9*x"),
    (sp.Add(x, x, evaluate=False), "x + x"),
    (sp.Mul(2, sp.Add(x, v, evaluate=False), evaluate=False), "2*(x + v)"),
    (sp.Integer(0), "0"),
    (3, "3"),
    (0.25, "1/4"),
    (Fraction(1, 3), "1/3"),
]


def grown(rng: random.Random, depth: int) -> tuple[sp.Expr, str]:
    """A smooth expression as SymPy, symbols with any assumptions, and as text."""
    kind = rng.randrange(12) if depth else 0
    if kind == 0:
        assumed = rng.choice([{}, {"real": True}, {"finite": True}, {"commutative": True}])
        name = rng.choice(["x", "v", "t", "F", "μ", "s", "s"])
        return sp.Symbol(name, **assumed), name
    if kind == 1:  # a number times a sum is multiplied out by SymPy, before anybody sees it
        (left, one), number = grown(rng, depth - 1), Fraction(rng.randrange(-9, 9), rng.randrange(1, 9))
        return left + sp.Rational(number), f"({one}) + ({number})"
    (left, one), (right, other) = grown(rng, depth - 1), grown(rng, depth - 1)
    match kind:
        case 2 | 3:
            return left + right, f"({one}) + ({other})"
        case 4 | 5:
            return left - right, f"({one}) - ({other})"
        case 6 | 7 | 8:
            return left * right, f"({one})*({other})"
        case 9:
            return left / (right**2 + 1), f"({one})/(({other})^2 + 1)"
        case 10:
            function = rng.choice(["sin", "cos", "tanh", "atan"])
            return getattr(sp, function)(left), f"{function}({one})"
        case _:
            power = rng.choice([2, 3])
            return left**power, f"({one})^{power}"


GROWN = [grown(random.Random(seed), 1 + seed % 4) for seed in range(512 - len(WRITTEN))]


def system(rate: Any) -> hr.System:
    return hr.System(["x", "v"], PARAMETERS, {"s": "v - 1"}, ["v", rate])


def test_sympy_and_text_are_one_system() -> None:
    """Equal systems are one, with one tape and one code."""
    for made, text in (*WRITTEN, *GROWN):
        assert system(made).content == system(text).content, text


def test_they_have_one_tape() -> None:
    for made, text in WRITTEN[:16]:
        one, other = (system(rate).model for rate in (made, text))
        tapes = [build_tape(m.states, [*m.field, *m.surfaces]) for m in (one, other)]
        assert tapes[0] == tapes[1], text


@pytest.mark.parametrize("form", WRITTEN[1:8:3], ids=lambda form: form[1])
def test_their_runs_have_the_same_bits(form: tuple[Any, str]) -> None:
    runs = [hr.simulate(system(rate), {"x": 0.3, "v": 0.2}, until=2) for rate in form]
    assert runs[0].y.tolist() == runs[1].y.tolist()
    assert runs[0].transitions.values.tolist() == runs[1].transitions.values.tolist()


def test_every_argument_may_be_sympy() -> None:
    h, w, g = sp.symbols("h w g", positive=True)
    made = hr.System(
        [h, w], {g: sp.Integer(10), "e": sp.Rational(1, 2), "m": 2 * g}, {s: h}, [w, -g], [5 - h],
        resets={s: {"map": {w: -sp.Symbol("e") * w}}},
    )  # fmt: skip
    text = {"m": "2*g", "g": 10, "e": "1/2"}
    same = hr.System(["h", "w"], {k: text[k] for k in ("g", "e", "m")}, {"s": "h"}, ["w", "-g"], ["5 - h"],
                     resets={"s": {"map": {"w": "-e*w"}}})  # fmt: skip
    assert made == same
    assert made.with_parameters({"g": 5}).parameters["m"] == 10
    assert made.with_parameters({"m": g / 2}).parameters["m"] == 5
    run, other = (hr.simulate(one, {"h": sp.Rational(1, 2) * 2, "w": 0}, until=1) for one in (made, same))
    assert run.y.tolist() == other.y.tolist()


def test_a_system_in_sympy_is_kept_as_text_in_a_file(tmp_path: Any) -> None:
    """Read back it is the same; what SymPy multiplies out as it reads is multiplied out once."""
    for made, text in WRITTEN:
        one = system(made)
        again = hr.System(**as_written(one.tree)["system"])  # type: ignore[arg-type,call-overload,index]
        assert again == one, text
    run = hr.simulate(system(WRITTEN[1][0]), {"x": 0.3, "v": 0.2}, until=1)
    run.save(tmp_path / "run")
    assert hr.load_run(tmp_path / "run").system == run.system


REFUSED: list[tuple[Any, str]] = [
    (x + sp.Symbol("q"), "in 'field': unknown name 'q'"),
    (sp.Function("f")(x), "unknown name 'f'"),
    (sp.floor(x), "it jumps infinitely often"),
    (sp.Derivative(sp.Function("f")(x), x), "unknown name 'f'|unknown name 'Derivative'|not an expression"),
    (sp.I * x, "unknown name 'I'"),
    (sp.oo, "a number must be finite"),
    (sp.zoo, "unknown name 'zoo'"),
    (sp.Symbol("x y"), "is not a name"),
    (1 / (sp.Symbol("F") - sp.Rational(1, 2)), "division by zero .*with the values of the parameters"),
    (x / (s - 1), r"division by zero \(at s = \+1\)"),
    (x**1000, "the exponent 1000 is too large"),
    (sp.Integer(10) ** 500 * x, "holds a number of more than 400 digits"),
    (sp.Pow(sp.Integer(9), sp.Pow(9, 9, evaluate=False), evaluate=False), "too large"),
    (sp.Piecewise((1, x > 0)), "end it with"),
    (sp.Piecewise((1, sp.Ne(x, 0)), (0, True)), "a condition must compare with"),
    (sp.besselj(0, x), "unknown name 'besselj'"),
    (sp.atan2(x, v), "'atan2' is allowed in parameters, initial values and times only"),
    (sp.Matrix([x]), "must be a number or an expression"),
]


@pytest.mark.parametrize(("rate", "says"), REFUSED, ids=lambda part: str(part)[:30])
def test_what_is_refused_is_refused_as_of_text(rate: Any, says: str) -> None:
    with pytest.raises(hr.ArgumentError, match=says):
        system(rate)


def nested(depth: int) -> sp.Expr:
    found = x
    for _ in range(depth):
        found = sp.sin(found)
    return found


def test_what_would_never_end_is_refused_at_once() -> None:
    tower = x
    for _ in range(60):
        tower = sp.sin(tower) * sp.cos(tower)  # 2^60 operations, written out
    for rate, says in (
        (tower, "more than 10000 operations"),
        (nested(17), "nest deeper than 16"),
        (nested(99), "deep"),
    ):
        with pytest.raises(hr.ArgumentError, match=says):
            system(rate)
