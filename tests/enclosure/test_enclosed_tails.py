"""Coefficients and tail bounds of the certified route: every operation against its own long series."""

from __future__ import annotations

import pytest
import sympy as sp
from flint import arb, ctx

from henon_ref.enclosure.balls import enclose, proves_zero
from henon_ref.enclosure.enclosure import Curve, Tail, UndecidedError, expand
from henon_ref.enclosure.tail_bounds import Program, Tails, magnitudes
from henon_ref.taylor.tape import TIME, build_tape

X, Y = sp.symbols("x y", real=True)
ORDER, LONG = 10, 120
FIELDS = {
    "mul": X**2 / 3 - X * sp.sin(TIME),
    "square": X**2,
    "recip": 1 / (X + 1),
    "div": sp.sin(TIME) / (X + 2),
    "sqrt": sp.sqrt(X + TIME),
    "exp": sp.exp(-X),
    "log": sp.log(X + TIME),
    "sin": sp.sin(X) + sp.cos(2 * X),
    "sinh": sp.sinh(X) - sp.cosh(X / 2),
    "tan": sp.tan(X / 2),
    "tanh": sp.tanh(X),
    "atan": sp.atan(X + TIME),
    "asin": sp.asin(X / 3) + sp.acos(X / 4),
    "power": X ** sp.Rational(1, 3),
    "negative power": X ** sp.Rational(-5, 3),
}


@pytest.mark.parametrize("name", FIELDS)
def test_tail_bound_exceeds_the_true_tail_norm(name: str) -> None:
    """The tail's norm, summed to far higher order, lies below the proven bound for state and output."""
    field = FIELDS[name]
    program = Program(build_tape([X], [field], [sp.sin(X) / (1 + X**2)]))
    with ctx.workprec(100):
        start = [arb(1)]
        short = program.run(100, arb(0), start, ORDER, arb(1))
        long = program.run(100, arb(0), start, LONG, arb(1))
        radius = 1.0
        while (proven := Tails(program, program.numbers(100), magnitudes(short), radius, 1.0).validate()) is None:
            radius /= 1.25
        assert radius > 0.02
        for index, bound in zip(program.states + program.outputs, proven[0] + proven[1], strict=True):
            tail = sum((abs(c) * arb(radius) ** k for k, c in enumerate(long[index]) if k > ORDER), arb(0))
            assert 0 < tail < bound
            assert bound < 1e4 * float(tail), "a bound far from the truth makes steps needlessly short"


def test_coefficients_are_those_of_the_geometric_series() -> None:
    with ctx.workprec(80):
        series = Program(build_tape([X], [X**2])).run(80, arb(0), [arb(1)], 20, arb(1))[0]
        assert all(c.contains(1) and c.rad() < 1e-20 for c in series)


def test_expansion_encloses_the_solution_within_its_disc() -> None:
    """x' = x^2 from 1 is 1/(1 - t): also near the rim of the disc, where the tail is all that is known."""
    with ctx.workprec(120):
        expansion = expand(Program(build_tape([X], [X**2])), arb(0), [arb(1)], 30, 1.0)
        assert 0.5 < expansion.radius < 1
        for s in (0.01, 0.3, 0.99 * expansion.radius, -0.99 * expansion.radius):
            value = expansion.state(0).at(arb(s))
            assert value.contains(1 / (1 - arb(s)))
        assert expansion.state(0).slope(arb(0.4)).contains(1 / (1 - arb(0.4)) ** 2)


def test_unit_of_time_changes_nothing_but_the_scale() -> None:
    """A field a billion times as fast has a disc a billion times smaller, found by another unit."""
    with ctx.workprec(120):
        fast = expand(Program(build_tape([X], [10**9 * X**2])), arb(0), [arb(1)], 30, 1.0)
        assert 0.3e-9 < fast.unit * fast.radius < 1e-9


def test_a_pole_at_the_start_has_no_enclosure() -> None:
    with ctx.workprec(120), pytest.raises(UndecidedError, match="undefined or unbounded"):
        expand(Program(build_tape([X], [1 / X])), arb(0), [arb(0)], 20, 1.0)


def test_recentred_curve_is_the_same_function() -> None:
    with ctx.workprec(120):
        curve = Curve.of([arb(1), arb(-3), arb(0.5), arb(2)], [Tail(4, 1e-3, 2.0)])
        moved = curve.recentred(0.7)
        for s in (0.1, 0.69, 1.3):
            assert moved.at(arb(s)).overlaps(curve.at(arb(s)))
            assert moved.slope(arb(s)).overlaps(curve.slope(arb(s)))
            assert moved.at(arb(s)).rad() < 2 * curve.at(arb(s)).rad()


def test_exact_numbers_are_enclosed_without_floats() -> None:
    z = 2 / sp.sqrt(3) * sp.sin(sp.pi / 18)
    with ctx.workprec(300):
        value = enclose(z**3 - z + sp.sqrt(3) / 9)
        assert value.contains(0)
        assert value.rad() < 1e-85
        assert enclose(sp.Rational(1, 10)).contains(arb(1) / 10)
        assert enclose(sp.Float(0.1)).overlaps(arb(0.1))
        assert enclose(X**2, {X: arb(0, 1)}).contains(0)


def test_zero_is_proven_by_algebra_only() -> None:
    z = 2 / sp.sqrt(3) * sp.sin(sp.pi / 18)
    assert proves_zero(z**3 - z + sp.sqrt(3) / 9)
    seventh = sp.pi / 7
    assert proves_zero(sp.cos(seventh) - sp.cos(2 * seventh) + sp.cos(3 * seventh) - sp.Rational(1, 2))
    assert proves_zero((X + Y) ** 2 - X**2 - 2 * X * Y - Y**2)
    assert not proves_zero(z**3 - z + sp.sqrt(3) / 9 + sp.Rational(1, 10**40))
    assert not proves_zero(X - Y)
