"""The Taylor tape: recurrences against derivatives taken symbolically, in every ring and in machine code."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import mpmath
import numpy as np
import pytest
import sympy as sp
from flint import arb
from test_expansion import run

from henon_ref.errors import ModelError
from henon_ref.taylor import series as taylor_series
from henon_ref.taylor.llvm.expansion import expansion_ir
from henon_ref.taylor.series import expand
from henon_ref.taylor.tape import INFINITE, TIME, build_tape

x, y = sp.symbols("x y", real=True)
a = sp.Symbol("a", real=True)
t = TIME
POINT = {x: sp.Rational(1, 5), y: -sp.Rational(2, 5), t: sp.Rational(3, 10)}

FUNCTIONS = [
    sp.sin(x) * sp.cos(y),
    sp.exp(-x / 3) * a,
    sp.log(2 + x**2),
    1 / (1 + y**2),
    sp.sqrt(3 + x),
    1 / sp.sqrt(3 + x * y),
    (2 + x) ** sp.Rational(3, 7),
    sp.tanh(y) + sp.tan(x / 4),
    sp.atan(x * y),
    sp.asin(x / 5) - sp.acos(y / 7),
    sp.sinh(x) * sp.cosh(y),
    t**2 * sp.sin(3 * t + 1),
    (x + y) ** 5 / 5 - x**3,
    (1 + x**2) ** y,
    (x - 1) / (y + 3) ** 2,
]


ORDER = 5
FIELD = [y - x / 2, sp.sin(t) - x * y]


@cache
def motion() -> list[list[mpmath.mpf]]:
    """Taylor coefficients of ``x`` and ``y`` from ``POINT`` along ``FIELD``, by derivatives of symbols."""
    found = []
    for f in (x, y):
        found.append([])
        for k in range(ORDER + 1):
            found[-1].append(mpmath.mpf(sp.N(f.subs(POINT), 60)) / math.factorial(k))
            f = sp.diff(f, t) + sp.diff(f, x) * FIELD[0] + sp.diff(f, y) * FIELD[1]
    return found


def exact_coefficients(f: sp.Expr) -> list[float]:
    """Those of a function along the motion, by differences of its values in 60 digits."""
    function = sp.lambdify([x, y, t], f, "mpmath")
    with mpmath.workdps(60):
        of_x, of_y = ([*reversed(row)] for row in motion())
        start = mpmath.mpf(POINT[t].p) / POINT[t].q
        series = mpmath.taylor(
            lambda s: function(mpmath.polyval(of_x, s), mpmath.polyval(of_y, s), start + s), 0, ORDER
        )
    return [float(value) for value in series]


@pytest.mark.parametrize("f", FUNCTIONS, ids=str)
def test_every_recurrence_is_the_derivative(f: sp.Expr) -> None:
    f = f.subs(a, sp.Rational(2, 3))
    tape = build_tape((x, y), FIELD, [f])
    constants = [float(c) for c in tape.constants]
    _, (series,) = expand(tape, constants, 0.3, [0.2, -0.4], ORDER)
    assert series == pytest.approx(exact_coefficients(f), rel=2e-13, abs=1e-14)


@pytest.mark.parametrize("f", FUNCTIONS, ids=str)
def test_machine_code_computes_what_the_tape_says(f: sp.Expr) -> None:
    f = f.subs(a, sp.Rational(2, 3))
    tape = build_tape((x, y), [f / 3 + t, x - y], [x * f])
    numbers = [float(c) for c in tape.constants]
    order, sigma = 9, 0.25
    states, outputs = expand(tape, numbers, 0.3, [0.2, -0.4], order)
    out = run(tape, [*numbers, *[0.0] * len(numbers)], (0.3, 0.0), [0.2, -0.4], order, sigma)
    expected = np.array(states + outputs) * sigma ** np.arange(order + 1)
    np.testing.assert_allclose(out[:3, : order + 1], expected, rtol=1e-12, atol=1e-15)


def test_the_same_tape_runs_in_multiprecision() -> None:
    tape = build_tape((x,), [x * sp.cos(t)], [])
    names = ("sin", "cos", "exp", "log", "sqrt")
    ring = {n: getattr(mpmath, n) for n in names} | {"power": mpmath.power}
    with mpmath.workdps(50):
        constants = [mpmath.mpf(str(c)) for c in tape.constants]
        (series,), _ = expand(tape, constants, mpmath.mpf(0), [mpmath.mpf(1)], 60, ring)
        assert mpmath.almosteq(mpmath.polyval(series[::-1], mpmath.mpf("0.5")), mpmath.exp(mpmath.sin("0.5")), 1e-40)


def test_a_phase_keeps_its_digits_at_late_times() -> None:
    """sin(w t) at t = 1e9: in plain double w t alone is wrong by 1e-7."""
    tape = build_tape((x,), [sp.sin(sp.pi * t / 3)], [])
    pairs = []
    for c in tape.constants:
        value = sp.N(c, 40)
        pairs.append((float(value), float(value - sp.Float(float(value), 50))))
    k = [p[0] for p in pairs] + [p[1] for p in pairs]
    high, low = 1e9, 3e-8
    out = run(tape, k, (high, low), [0.0], 2)
    exact = sp.N(sp.sin(sp.pi * (sp.Integer(10) ** 9 + sp.Float(low, 40)) / 3), 30)
    assert out[0, 1] == pytest.approx(float(exact), rel=1e-15)


def test_constants_are_folded_and_zeros_cost_nothing() -> None:
    tape = build_tape((x,), [3 * (x / 6 + a) * 2 - a], [])
    assert set(tape.counts) == {"state", "shift"}
    ir = expansion_ir(build_tape((x,), [sp.Integer(1) + 0 * x], []), 1, 20, "f")
    assert ir.count("fmul") <= 24  # the step's rates and the norms: no product is formed for a constant field


def test_a_field_with_a_jump_as_text_is_refused() -> None:
    with pytest.raises(ModelError, match="no Taylor recurrence for Abs"):
        build_tape((x,), [sp.Abs(x)], [])


def test_motion_that_is_a_polynomial_in_time_is_known_by_its_form() -> None:
    """y' = 2 t, x' = y^2: degrees 2 and 5; a function of a constant is one; states that feed on each other are none."""
    tape = build_tape((x, y), [y**2, 2 * t], [x * y - 3, sp.sin(y), (1 - y) ** 3 / 7])
    assert [tape.nodes[i].degree for i in (0, 1, *tape.outputs)] == [5, 2, 7, INFINITE, 6]
    still = build_tape((x, y), [sp.Integer(3), sp.Integer(0)], [x / (1 + a**2)])
    assert [still.nodes[i].degree for i in (0, *still.outputs)] == [1, 1]
    assert [node.degree for node in build_tape((x, y), [y, x], []).nodes] == [INFINITE, INFINITE]
    assert build_tape((x, y), (), [x * y]).nodes[0].degree == INFINITE  # of no field nothing is known


def test_an_expansion_has_the_unit_of_time_that_is_asked_for_and_ends_where_that_is_enough() -> None:
    tape = build_tape((x, y), [y**2 - t, 2 * t + a], [x * y - 3 * x**3, sp.exp(x), 1 - t * y])
    numbers = [arb(str(sp.N(c.subs(a, 5)))) for c in tape.constants]
    start, state, unit = arb("0.3"), [arb("0.2"), arb("-0.4")], arb(5) / 4
    ring = {"exp": arb.exp}
    states, _ = expand(tape, numbers, start, state, 20, ring, unit)
    plain, _ = expand(tape, numbers, start, state, 20, ring, enough=lambda x, _: len(x[0]) == 9)
    assert [len(series) for series in plain] == [9, 9]
    for series, scaled in zip(plain, states, strict=True):
        assert all((c * unit**k - scaled[k]).contains(0) for k, c in enumerate(series))


def test_what_is_linear_in_time_but_not_by_its_form_is_a_clock_without_time_in_its_numbers() -> None:
    hidden = (6 - 2 * t) / (t - 3) + 3
    tape = build_tape((x,), (hidden,), (x,))
    assert all(not constant.free_symbols for constant in tape.constants)
    assert tape.nodes[tape.field[0]].op in ("clock", "constant")


def test_a_part_of_a_tape_has_its_values_and_all_constants() -> None:
    outputs = [sp.sin(a * x) + 2, sp.cos(a * x) * y, sp.tanh(y) / 3, t * x, sp.Integer(5)]
    whole = build_tape((x, y), (), outputs)
    numbers = [float(c.subs(a, 0.7)) for c in whole.constants]
    values = [series[0] for series in expand(whole, numbers, 0.3, [0.2, -0.4], 0)[1]]
    for wanted in ([1], [4, 0], [3, 2], []):
        part = whole.part(wanted)
        assert part.constants == whole.constants
        assert len(part.nodes) < len(whole.nodes)
        assert [s[0] for s in expand(part, numbers, 0.3, [0.2, -0.4], 0)[1]] == [values[at] for at in wanted]


def test_products_are_as_long_as_the_degrees_of_their_factors(monkeypatch: pytest.MonkeyPatch) -> None:
    """x = t, so that a product with a polynomial in x has a few terms at each order, not as many as the order."""
    made, multiply = [], taylor_series.mul
    monkeypatch.setattr(taylor_series, "mul", lambda p, q: made.append(1) or multiply(p, q))
    tape = build_tape([x], [sp.Integer(1)], [x**2 * sp.exp(x) * (1 + x), sp.sin(x) / (2 + x), sp.exp(x) / sp.cos(x)])
    constants = [float(c) for c in tape.constants]
    expand(tape, constants, 0.0, [0.5], 40)
    few = len(made)
    whole = replace(tape, nodes=tuple(replace(node, degree=INFINITE) for node in tape.nodes))
    made.clear()
    assert expand(tape, constants, 0.0, [0.5], 40) == expand(whole, constants, 0.0, [0.5], 40)
    assert few * 3 < len(made) - few
