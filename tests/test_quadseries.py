"""Quad-double arithmetic, functions and expansions against ball arithmetic."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest
import sympy as sp
from flint import arb, ctx
from numpy.typing import NDArray

from henon_ref.henon import quaddouble as qd
from henon_ref.henon import quadseries
from henon_ref.henon.compiled import quad_double
from henon_ref.henon.program import ADD, DIV, EXP, MUL, SCALE, SIN, SQRT, program
from henon_ref.henon.quadfunctions import exponential, sine_cosine
from henon_ref.jit import njit
from henon_ref.model.equations import TIME
from henon_ref.taylor.expand import Ring, expand
from henon_ref.taylor.tape import build_tape

X, Y = sp.symbols("x y", real=True)
BITS = 2.0**-203
"""What is asked of an operation, relative to its size."""


@pytest.fixture(autouse=True)
def bits() -> Iterator[None]:
    with ctx.workprec(300):
        yield


@njit()
def done(op, a, b, results):  # type: ignore[no-untyped-def]
    for i in range(len(a)):
        p, q = (a[i, 0], a[i, 1], a[i, 2], a[i, 3]), (b[i, 0], b[i, 1], b[i, 2], b[i, 3])
        if op == MUL:
            y = qd.multiply(p, q)
        elif op == DIV:
            y = qd.divide(p, q)
        elif op == SCALE:
            y = qd.scale(p, q[0])
        elif op == SQRT:
            y = qd.square_root(p)
        elif op == EXP:
            y = exponential(p)
        elif op == SIN:
            y = sine_cosine(p)[0]
        elif op == ADD:
            y = qd.add(p, q)
        else:
            y = sine_cosine(p)[1]
        results[i, 0], results[i, 1], results[i, 2], results[i, 3] = y


@njit()
def expanded(codes, constants, field, output, row, t, t_low, x, x_low, unit, unit_low, least, rows, sizes):  # type: ignore[no-untyped-def]
    return quadseries.expand(
        codes, constants, field, output, row, t, t_low, x, x_low, unit, unit_low, least, rows, sizes
    )


def ball(parts: Sequence[float]) -> arb:
    return sum((arb(float(part)) for part in parts), arb(0))


def numbers(seed: int, largest: int = 10**10) -> NDArray[np.float64]:
    source = random.Random(seed)
    whole = 10**70
    rational = [
        sp.Rational(source.randint(-whole, whole), whole) * largest * sp.Rational(1, 10 ** source.randint(0, 12))
        for _ in range(300)
    ]
    return np.array([quad_double(number) for number in rational])


@pytest.mark.parametrize("op", [ADD, MUL, DIV, SCALE])
def test_sums_products_and_quotients_have_sixty_digits(op: int) -> None:
    first, second = numbers(1), numbers(2)
    second[::3] = -first[::3]
    second[::3, 2:] *= 1 + 1e-9  # sums that cancel down to their last parts
    results = np.zeros_like(first)
    done(op, first, second, results)
    for p, q, y in zip(first, second, results, strict=True):
        a, b = ball(p), ball(q)
        exact = {ADD: a + b, MUL: a * b, DIV: a / b, SCALE: a * float(q[0])}[op]
        size = abs(a) + abs(b) if op == ADD else abs(exact)
        assert abs(ball(y) - exact) <= BITS * size
        assert (np.abs(y[1:]) <= 2.0**-52 * np.abs(y[0])).all()


FUNCTIONS: list[tuple[int, Callable[[arb], arb], int]] = [
    (SQRT, arb.sqrt, 10**10), (EXP, arb.exp, 500), (EXP, arb.exp, 1), (SIN, arb.sin, 1), (SIN, arb.sin, 1000),
    (-1, arb.cos, 1), (-1, arb.cos, 1000),
]  # fmt: skip


@pytest.mark.parametrize(("op", "function", "largest"), FUNCTIONS)
def test_functions_have_sixty_digits(op: int, function: Callable[[arb], arb], largest: int) -> None:
    a = numbers(3, largest)
    if op == SQRT:
        a *= np.sign(a[:, :1])
    results = np.zeros_like(a)
    done(op, a, a, results)
    for p, y in zip(a, results, strict=True):
        exact = function(ball(p))
        # Of a sine's size the argument is a part, of an exponential's error it is a factor.
        scale = max(1.0, abs(p[0])) if op in (SIN, -1, EXP) else 1.0
        size = abs(exact) if op in (SQRT, EXP) else arb(1)
        assert abs(ball(y) - exact) <= 64 * BITS * scale * size


def test_functions_of_quarter_turns_and_zero() -> None:
    a = np.array([quad_double(sp.pi * n / 2) for n in range(-5, 6)])
    for op, function in ((SIN, arb.sin), (-1, arb.cos), (EXP, arb.exp)):
        results = np.zeros_like(a)
        done(op, a, a, results)
        for p, y in zip(a, results, strict=True):
            exact = function(ball(p))
            assert abs(ball(y) - exact) <= 2.0**-196 * max(1.0, float(abs(exact)))
    zero = np.zeros((1, 4))
    done(SQRT, zero, zero, results)
    assert (results[0] == 0.0).all()


@pytest.mark.parametrize(("op", "number"), [(EXP, 601.0), (EXP, -1e9), (SIN, 1e7), (-1, np.nan), (SQRT, -1.0)])
def test_what_is_out_of_reach_is_not_a_number(op: int, number: float) -> None:
    a, results = np.array([[number, 0.0, 0.0, 0.0]]), np.zeros((1, 4))
    done(op, a, a, results)
    assert not np.isfinite(results[0, 0])


MOTIONS = [
    ((Y, sp.Rational(-981, 100)), X**3 - X * Y + sp.sqrt(2)),
    ((1 - 2 * TIME, X + TIME / 3), (X - Y) ** 2 / 7 - X),
    ((sp.Integer(1), X), 5 - Y * X**2),
    ((Y, -X), 1 - X),
    ((sp.Integer(1), X), sp.exp(X / 3) * (X - 1) ** 2),
    ((Y, sp.cos(3 * TIME) - X / 2 - Y / 5), X * Y - 1 / (3 + X)),
    ((Y * X, sp.sqrt(2 + X) - sp.sin(X * Y)), X / (4 - Y) + sp.exp(-X)),
]


@pytest.mark.parametrize(("field", "output"), MOTIONS)
def test_a_motion_is_expanded_as_in_balls(field: tuple[sp.Expr, ...], output: sp.Expr) -> None:
    tape = build_tape((X, Y), field, (X, output))
    codes, constants, rates, outputs, rows = program(tape, [quad_double(c) for c in tape.constants])
    made, sizes = np.zeros((rows, quadseries.WIDTH)), np.zeros(rows)
    needed = [i for i, state in enumerate((X, Y)) if any(state in e.free_symbols for e in (output, *field))]
    made[[i for i in (0, 1) if i not in needed]] = np.nan
    start, unit = ((0.3, 1e-18), ((0.7, -2e-17), (-1.1, 1e-17))), (0.0625, 3e-18)
    x, low = np.array([s[0] for s in start[1]]), np.array([s[1] for s in start[1]])
    last = expanded(codes, constants, rates, 1, outputs[1], *start[0], x, low, *unit, 8, made, sizes)
    assert 2 <= last <= quadseries.ORDER
    exact_constants = [arb(str(sp.N(c, 80))) for c in tape.constants]
    ring = Ring({name: getattr(arb, name) for name in ("sin", "cos", "exp", "sqrt")}, arb.__pow__)
    x_balls = [*map(ball, start[1])]
    states, values = expand(tape, exact_constants, ball(start[0]), x_balls, last, ring, ball(unit), lambda *_: False)
    assert np.isnan(made[[i for i in (0, 1) if i not in needed]]).all()
    for row, exact in (*((i, states[i]) for i in needed), (outputs[1], values[1])):
        size = sum((abs(c) for c in exact), arb(0))
        for at, c in enumerate(exact):
            assert abs(ball(made[row, 4 * at : 4 * at + 4]) - c) <= 2.0**-192 * size
        if last > 15:  # what is left out does not count
            assert abs(exact[-1]) <= 1e-62 * size


@pytest.mark.parametrize("field", [sp.log(X), sp.tanh(X), X ** sp.Rational(5, 2), 1 / (X - 1), sp.exp(9 * X)])
def test_a_motion_that_cannot_be_expanded_is_left_alone(field: sp.Expr) -> None:
    """Functions that are not here; a pole; terms that count for too long."""
    tape = build_tape((X,), (field,), (X,))
    codes, constants, rates, outputs, rows = program(tape, [quad_double(c) for c in tape.constants])
    made, sizes = np.zeros((rows, quadseries.WIDTH)), np.zeros(rows)
    ones = np.ones(1)
    assert expanded(codes, constants, rates, 0, outputs[0], 0.0, 0.0, ones, 0 * ones, 1.0, 0.0, 8, made, sizes) == -1


def test_what_the_function_asked_for_does_not_need_is_not_expanded() -> None:
    tape = build_tape((X, Y), (Y, sp.Integer(-1)), (X - 1, sp.log(X), sp.tan(Y) + X))
    codes, constants, rates, outputs, rows = program(tape, [quad_double(c) for c in tape.constants])
    made, sizes = np.zeros((rows, quadseries.WIDTH)), np.zeros(rows)
    x = np.array([0.5, 1.0])
    found = [
        expanded(codes, constants, rates, i, row, 0.0, 0.0, x, 0 * x, 1.0, 0.0, 8, made, sizes)
        for i, row in enumerate(outputs)
    ]
    assert found == [2, -1, -1]
