"""Double-double arithmetic and the Taylor expansion in it, against balls of 300 bits."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction

import numpy as np
import pytest
import sympy as sp
from flint import arb, ctx
from numpy.typing import NDArray

from henon_ref.henon import doubledouble as dd
from henon_ref.henon import fine
from henon_ref.henon import program as lowered
from henon_ref.henon.apart import load, table
from henon_ref.henon.compiled import quad_double
from henon_ref.henon.registers import A_START, I_APART, I_SIZE
from henon_ref.henon.views import row_of
from henon_ref.jit import njit
from henon_ref.model.equations import TIME
from henon_ref.taylor.expand import Ring, expand
from henon_ref.taylor.tape import build_tape

x, y = sp.symbols("x y", real=True)
a = sp.Symbol("a", real=True)
t = TIME
NAMES = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan", "exp", "log", "sqrt")
ARB = Ring({name: getattr(arb, name) for name in NAMES}, arb.__pow__)
FUNCTIONS = {name: getattr(lowered, name.upper()) for name in NAMES if name != "sqrt"} | {"power": lowered.POWER}
ADD, MULTIPLY, DIVIDE, ROOT = range(4)
Pair = tuple[float, float]


@pytest.fixture(autouse=True)
def bits() -> Iterator[None]:
    with ctx.workprec(300):
        yield


@njit()
def started(op, arguments, exponent, results):  # type: ignore[no-untyped-def]
    """An elementary function of many pairs."""
    for i in range(len(arguments)):
        results[i, 0], results[i, 1] = fine.start(op, arguments[i, 0], arguments[i, 1], exponent[0], exponent[1])


@njit()
def expanded(  # type: ignore[no-untyped-def]
    integers, codes, constants, field, outputs, t, t_low, x, x_low, unit, unit_low, order, least, high, low, sizes
):
    """The interpreter, for Python."""
    return fine.expand_fine(
        row_of(integers), codes, constants, field, outputs, t, t_low, x, x_low, unit, unit_low, order, least, high, low,
        sizes,
    )  # fmt: skip


@njit()
def combined(op, arguments, others, results):  # type: ignore[no-untyped-def]
    """An operation on many pairs."""
    for i in range(len(arguments)):
        p, p_low, q, q_low = arguments[i, 0], arguments[i, 1], others[i, 0], others[i, 1]
        if op == ADD:
            results[i, 0], results[i, 1] = dd.add(p, p_low, q, q_low)
        elif op == MULTIPLY:
            results[i, 0], results[i, 1] = dd.multiply(p, p_low, q, q_low)
        elif op == DIVIDE:
            results[i, 0], results[i, 1] = dd.divide(p, p_low, q, q_low)
        else:
            results[i, 0], results[i, 1] = dd.square_root(p, p_low)


def ball(pair: Sequence[float]) -> arb:
    return arb(float(pair[0])) + arb(float(pair[1]))


def pairs(highs: Sequence[float]) -> NDArray[np.float64]:
    """Numbers, each with a random low part of up to half a unit of its last place."""
    source = random.Random(2)
    return np.array([(h, source.uniform(-0.5, 0.5) * math.ulp(h)) for h in highs])


def spread(low: float, high: float, signed: bool = True, count: int = 200) -> list[float]:
    """Random sizes, even in their logarithm."""
    source = random.Random(1)
    sizes = [math.exp(source.uniform(math.log(low), math.log(high))) for _ in range(count)]
    return [s * source.choice((-1, 1)) for s in sizes] if signed else sizes


def worst(results: NDArray[np.float64], exact: Sequence[arb], scales: Sequence[arb]) -> float:
    """Largest error relative to the scales; the low parts must be small, too."""
    assert np.all(np.abs(results[:, 1]) <= np.spacing(np.abs(results[:, 0])))
    errors = [abs(ball(r) - e) / s for r, e, s in zip(results, exact, scales, strict=True)]
    return max(float(e.mid()) for e in errors)


@pytest.mark.parametrize(
    ("op", "exact"),
    [
        (ADD, lambda p, q: p + q),
        (MULTIPLY, lambda p, q: p * q),
        (DIVIDE, lambda p, q: p / q),
        (ROOT, lambda p, q: p.sqrt()),
    ],
)
def test_operations_are_accurate_relative_to_their_result(op: int, exact: Callable[[arb, arb], arb]) -> None:
    first, second = pairs(spread(1e-9, 1e9, signed=op != ROOT)), pairs(spread(1e-20, 1e20)[::-1])
    if op == ADD:  # half of them cancel almost wholly
        second[:100] = -first[:100] * [1, 1 + 1e-3] + np.array([1e-17, 0]) * first[:100, :1]
    results = np.empty_like(first)
    combined(op, first, second, results)
    expected = [exact(ball(p), ball(q)) for p, q in zip(first, second, strict=True)]
    assert worst(results, expected, [abs(e) for e in expected]) < 5e-32


def test_sums_and_products_lose_nothing_that_a_pair_can_hold() -> None:
    third = float(Fraction(1, 3))
    numbers, results = np.array([[third, 0.0]]), np.empty((1, 2))
    combined(MULTIPLY, numbers, numbers, results)
    assert sum(map(Fraction, results[0].tolist())) == Fraction(third) ** 2
    combined(ADD, numbers, np.array([[1e-20, 0.0]]), results)
    assert sum(map(Fraction, results[0].tolist())) == pytest.approx(Fraction(third) + Fraction(1e-20), abs=0, rel=1e-32)
    combined(ROOT, np.zeros((1, 2)), numbers, results)
    assert results.tolist() == [[0.0, 0.0]]


NEAR_TURNS = [n * math.pi / 2 * (1 + d) for n in (1, 2, 3, 7, 100, 6000) for d in (0, 1e-15, -1e-12, 1e-7)]
ANGLES = [*spread(1e-12, 10), *spread(1, 3000), *NEAR_TURNS, 1e-200, 0.7853981633974483, -0.7853981633974484]
INSIDE = [*spread(1e-12, 0.999), 1 - 1e-6, -1 + 1e-9, 1 - 1e-15, 1e-150, 0.5]
LARGE = [*spread(1e-12, 20), *spread(1, 300), 700.0, -600.0, 1e-200, 0.34657359027997264, -0.35]
POSITIVE = [*spread(1e-9, 1e9, signed=False), 1.0, 1 - 1e-16, *(1 + d for d in spread(1e-15, 0.3)), 1e-300, 1e300]
HARD = {
    **dict.fromkeys(("sin", "cos", "tan"), ANGLES),
    **dict.fromkeys(("sinh", "cosh", "tanh", "exp"), LARGE),
    **dict.fromkeys(("asin", "acos"), INSIDE),
    **dict.fromkeys(("log", "power"), POSITIVE),
    "atan": [*spread(1e-12, 1e12), 1.0, -1e100, 1e-200],
}
EXPONENT = (0.4, -2.2204460492503132e-17)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_elementary_functions_are_accurate_relative_to_their_result(name: str) -> None:
    """A power relative to its logarithm, too: that is rounded before it is raised."""
    arguments = pairs(HARD[name])
    results = np.empty_like(arguments)
    started(FUNCTIONS[name], arguments, np.array(EXPONENT), results)
    if name == "power":
        exponent = ball(EXPONENT)
        expected = [ball(p) ** exponent for p in arguments]
        scales = [abs(e) * (1 + abs(ball(p).log())) for e, p in zip(expected, arguments, strict=True)]
    else:
        expected = [getattr(ball(p), name)() for p in arguments]
        scales = [abs(e) for e in expected]
    assert worst(results, expected, scales) < 1e-31


@pytest.mark.parametrize(
    ("name", "argument"),
    [("sin", 2e6), ("cos", math.inf), ("log", -1.0), ("exp", 1e3), ("exp", 1e200), ("sinh", -1e3), ("acos", 1.5)],
)
def test_what_has_no_value_is_not_finite(name: str, argument: float) -> None:
    results = np.zeros((1, 2))
    started(FUNCTIONS[name], np.array([[argument, 0.0]]), np.array(EXPONENT), results)
    assert not np.isfinite(results[0, 0])


@pytest.mark.parametrize(("name", "limit"), [("exp", 0.0), ("tanh", -1.0)])
def test_far_out_an_exponential_is_gone(name: str, limit: float) -> None:
    results = np.ones((1, 2))
    started(FUNCTIONS[name], np.array([[-1e200, 0.0]]), np.array(EXPONENT), results)
    assert results.tolist() == [[limit, 0.0]]


class Expansion:
    """What the interpreter makes of a field and outputs in x and y at time 0.3 + 1e-18, x = 0.2, y = -0.4 + 1e-18."""

    def __init__(
        self, field: Sequence[sp.Expr], outputs: Sequence[sp.Expr], order: int, least: int, unit: Pair = (0.25, 1e-18)
    ) -> None:
        self.tape = build_tape((x, y), field, outputs)
        self.numbers = [quad_double(c) for c in self.tape.constants]
        self.unit, self.order = unit, order
        made = lowered.program(self.tape, self.numbers)
        self.high, self.low = (np.full((made.rows, order + 1), np.nan) for _ in range(2))
        self.sizes = np.empty(made.rows)
        self.state = np.array([0.2, -0.4]), np.array([0.0, 1e-18])
        arrays = made.codes, made.constants, made.field, made.outputs
        work = self.high, self.low, self.sizes
        load(A_START)
        integers = np.zeros(I_SIZE, dtype=np.int64)
        integers[I_APART] = table()
        self.last = expanded(integers, *arrays, 0.3, 1e-18, *self.state, *unit, order, least, *work)
        self.rows = [0, 1, *made.outputs.tolist()]

    def errors(self) -> list[float]:
        """Of every series, the largest error of a coefficient relative to the series' size."""
        numbers = [ball(pair) for pair in self.numbers]
        state = [ball(pair) for pair in zip(*self.state, strict=True)]
        states, outputs = expand(self.tape, numbers, ball((0.3, 1e-18)), state, self.order, ARB)
        unit, result = ball(self.unit), []
        for row, series in zip(self.rows, [*states, *outputs], strict=True):
            exact = [c * unit**k for k, c in enumerate(series)]
            size = sum((abs(c) for c in exact), arb(0))
            assert self.sizes[row] == pytest.approx(float(size.mid()), rel=1e-14)
            made = zip(self.high[row], self.low[row], exact, strict=False)
            errors = [abs(ball((high, low)) - c) for k, (high, low, c) in enumerate(made) if k <= self.last]
            result.append(float((max(errors, key=lambda e: e.mid()) / size).mid()))
        return result


TAPES = {
    "polynomial": ([y - x / 2, -x * y + x**2 / 3], [(x + y) ** 5 / 5 - x**3, x - y]),
    "quotients": ([y / (3 + x), 1 / (1 + y**2)], [(x - 1) / (y + 3) ** 2, 2 / (x + 4)]),
    "roots and powers": ([sp.sqrt(3 + x), 1 / sp.sqrt(3 + x * y)], [(2 + x) ** sp.Rational(3, 7), (2 + x * y) ** a]),
    "exponentials": ([sp.exp(-x / 3) * y, -sp.log(2 + x**2)], [(1 + x**2) ** y, 1 - sp.exp(t)]),
    "turns": ([sp.sin(x) * sp.cos(y), sp.tan(x / 4) - sp.sin(3 * t + 1)], [t**2 * sp.sin(t), sp.cos(x + y)]),
    "hyperbolic": ([sp.sinh(x) * sp.cosh(y), sp.tanh(y) - x], [sp.tanh(x * y), sp.cosh(x)]),
    "inverse": ([sp.atan(x * y), sp.asin(x / 5)], [sp.acos(y / 7), sp.atan(t)]),
    "time": ([sp.Integer(1), t + y], [3 * t - 1, (t - 1) ** 3, x * t, t * sp.sin(t)]),
}


@pytest.mark.parametrize("name", TAPES)
def test_every_recurrence_is_that_of_the_rings(name: str) -> None:
    field, outputs = ([e.subs(a, sp.Rational(-5, 3)) for e in part] for part in TAPES[name])
    made = Expansion(field, outputs, order=30, least=30)
    assert made.last == 30
    assert max(made.errors()) < 1e-30


def test_the_tapes_above_use_every_operation() -> None:
    used = set().union(*(build_tape((x, y), *parts).counts for parts in TAPES.values()))
    assert used == {*lowered._PLAIN, *lowered._PRODUCT, *lowered._QUOTIENT, "power"}


def test_it_ends_once_nothing_counts_any_more() -> None:
    made = Expansion([y, -sp.sin(x)], [x * y], order=60, least=5)
    assert 25 < made.last < 40
    assert max(made.errors()) < 1e-30
    counts = np.abs(made.high[made.rows]) > fine.NEGLIGIBLE * made.sizes[made.rows, None]
    assert counts[:, made.last - fine.QUIET].any()
    assert not counts[:, made.last - fine.QUIET + 1 : made.last + 1].any()
    assert np.isnan(made.high[made.rows, made.last + 1 :][2]).all()
    assert Expansion([y, -sp.sin(x)], [x * y], order=60, least=made.last + 3).last == made.last + 3


def test_a_series_that_does_not_end_is_cut_at_the_order() -> None:
    made = Expansion([y, -sp.sin(x)], [], order=8, least=5)
    assert made.last == 8
    assert max(made.errors()) < 1e-30


def test_a_polynomial_is_exact_and_short() -> None:
    made = Expansion([y, -sp.Rational(981, 100)], [x], order=45, least=19, unit=(0.5, 0.0))
    assert made.last == 2 + fine.QUIET
    assert made.high[0, :4].tolist() == [0.2, -0.2, -9.81 / 8, 0.0]
    assert max(made.errors()) < 1e-32


@pytest.mark.parametrize("output", [1 / (x - sp.Rational(0.2)), sp.log(y), sp.sin(10**7 * t), sp.exp(5000 * t)])
def test_what_is_not_finite_is_refused(output: sp.Expr) -> None:
    assert Expansion([y, -x], [output], order=30, least=5).last == -1
