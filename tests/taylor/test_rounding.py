"""Bounds of what an expression's own operations make of its value."""

from __future__ import annotations

import random

import numpy as np
import pytest
import sympy as sp
from flint import arb, ctx

from henon_ref.jit.ir_writer import declarations
from henon_ref.jit.native_module import NativeModule
from henon_ref.kernel.library import doubles, ffi
from henon_ref.taylor.llvm import rounding
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.llvm.rounding import UNDERFLOW, rounding_ir
from henon_ref.taylor.tape import build_tape

X, Y = STATES = sp.symbols("x y", real=True)
T = sp.Symbol("t", real=True)
HALF_UNIT = 2.0**-53


def values(outputs: list[sp.Expr], at: tuple[float, float], unit: float) -> tuple[list[float], list[float]]:
    """Values of expressions in double precision, and the bounds of their errors."""
    tape = build_tape(STATES, [sp.Integer(0), sp.Integer(0)], outputs)
    ir = declarations() + expansion_ir(tape, 2, 0, "value") + rounding_ir(tape, 2, "rounding")
    code = NativeModule(ir)
    constants = np.array([*map(float, tape.constants), *[0.0] * len(tape.constants), 0.0])
    found = []
    for name in ("value", "rounding"):
        out, point = np.zeros(2 + len(outputs)), np.array(at)
        call = ffi.cast("expand_code", code.address(name))
        call(0.5, 0.0, unit, doubles(point), doubles(constants), doubles(out))
        found.append(out[2:].tolist())
    return found[0], found[1]


def exact(expression: sp.Expr, at: tuple[float, float]) -> arb:
    """The value in balls, of numbers as the doubles are."""
    function = sp.lambdify((X, Y, T), expression, [{n: getattr(arb, n) for n in ("sin", "cos", "exp", "sqrt", "log")}])
    ctx.prec = 300
    try:
        return function(*map(arb, at), arb(0.5))
    finally:
        ctx.prec = 53


def random_expression(rng: random.Random, depth: int) -> sp.Expr:
    if depth == 0:
        return rng.choice([X, Y, T + X, sp.Integer(rng.randint(1, 9)) + Y, X * Y])
    a, b = random_expression(rng, depth - 1), random_expression(rng, depth - 1)
    one = sp.Mul(a, b, evaluate=False)
    return rng.choice(
        [one - a * b / 3, a - b * 7, a * b, a / (2 + b**2), sp.sqrt(1 + a**2), sp.sin(a), sp.cos(b), sp.exp(-(a**2))]
    )


@pytest.mark.parametrize("seed", range(40))
def test_no_value_is_off_by_more_than_the_bound(seed: int) -> None:
    rng = random.Random(seed)
    outputs = [random_expression(rng, 3) * X + 0 * Y for _ in range(3)]
    at = rng.uniform(-2, 2), rng.uniform(-2, 2)
    found, bounds = values(outputs, at, 2 * HALF_UNIT)
    for expression, value, bound in zip(outputs, found, bounds, strict=True):
        off = float(abs(arb(value) - exact(expression, at)))
        assert off <= bound + 2 * HALF_UNIT * abs(value)


@pytest.mark.parametrize("y", [1e-17, 1e-15, 1e-3, 1.0])
def test_terms_that_cancel_are_seen(y: float) -> None:
    """x (1 - y) - x is -x y: what it is off does not fall with y."""
    _, (bound,) = values([X * (1 - Y) - X], (3.0, y), HALF_UNIT)
    assert 3 * HALF_UNIT <= bound <= 20 * HALF_UNIT


def test_a_sum_of_states_has_no_rounding_of_its_own() -> None:
    _, bounds = values([X, -X, X - Y, X - sp.Rational(1, 3), 2 * X + T], (3.0, 2.0), HALF_UNIT)
    assert bounds == [0.0, *[UNDERFLOW] * 4]


def test_underflow_alone_is_what_it_may_be_times_what_follows() -> None:
    _, bounds = values([1e250 * X * Y * Y, Y**2 / (X * X), sp.sqrt(Y * Y + X * X)], (1e-100, 1e-170), 0.0)
    assert bounds[0] == pytest.approx(1e250 * 1e-100 * UNDERFLOW, rel=3)
    assert bounds[1] == pytest.approx(UNDERFLOW / 1e-200, rel=3)
    assert bounds[2] == pytest.approx(UNDERFLOW / 1e-100, rel=3)


def test_a_long_function_in_parts_gives_the_same_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = random.Random(7)
    outputs = [random_expression(rng, 3) * X for _ in range(7)]
    _, whole = values(outputs, (0.7, -1.3), 2 * HALF_UNIT)
    monkeypatch.setattr(rounding, "MOST_LINES", 0)
    monkeypatch.setattr(rounding, "ROWS", 4)
    assert "@rounding.8(" in rounding_ir(build_tape(STATES, [sp.Integer(0)] * 2, outputs), 2, "rounding")
    assert values(outputs, (0.7, -1.3), 2 * HALF_UNIT)[1] == whole
