"""The text of a problem has the same values as the system's own expressions."""

from __future__ import annotations

import math
import random

import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from programs import ramp
from resets import ball

from henon_ref import load_case
from henon_ref.baselines.protocol.problem_text import infix, problem_text, renamed
from henon_ref.errors import UnsupportedError
from henon_ref.expressions.grammar import FUNCTIONS
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem

X, V, P = sp.symbols("x v p", real=True)
SMOOTH = (sp.sin, sp.cos, sp.tan, sp.asin, sp.acos, sp.atan, sp.sinh, sp.cosh, sp.tanh, sp.exp, sp.log, sp.sqrt)
NAMES = {name: getattr(math, name) for name in (*FUNCTIONS, "pow")}


def value(text: str, **point: float) -> float:
    return float(eval(text, {"__builtins__": {}}, {**NAMES, **point}))


def expressions() -> st.SearchStrategy[sp.Expr]:
    numbers = st.builds(sp.Rational, st.integers(-9, 9), st.integers(1, 9))
    leaves = st.sampled_from([X, V, P]) | numbers
    powers = st.sampled_from(
        [sp.Integer(2), sp.Integer(3), sp.Integer(7), sp.Integer(-1), sp.Integer(-2), sp.Rational(1, 2)]
    )
    return st.recursive(
        leaves,
        lambda inner: (
            st.builds(sp.Add, inner, inner)
            | st.builds(sp.Mul, inner, inner)
            | st.builds(sp.Pow, inner, powers)
            | st.builds(lambda f, e: f(e), st.sampled_from(SMOOTH), inner)
        ),
        max_leaves=8,
    )


@given(expressions(), st.floats(0.1, 2.0), st.floats(-2.0, -0.1), st.floats(0.1, 1.0))
def test_text_has_the_expression_s_value(expression: sp.Expr, x: float, v: float, p: float) -> None:
    exact = expression.subs({X: sp.Float(x, 40), V: sp.Float(v, 40), P: sp.Float(p, 40)}).evalf(30)
    if (
        expression.has(sp.Abs, sp.re, sp.im, sp.arg)
        or not exact.is_number
        or not exact.is_real
        or not exact.is_finite
        or not 1e-6 < abs(exact) < 1e6
    ):
        return
    try:
        found = value(infix(expression), x=x, v=v, p=p)
    except (ValueError, OverflowError, ZeroDivisionError):
        return  # a branch that doubles do not reach: sqrt(x - x)
    assert found == pytest.approx(float(exact), rel=1e-6)


def test_every_number_is_a_double() -> None:
    text = infix(X / 2 + sp.Rational(3, 4) * V**2 - 2 * P - sp.Integer(7))
    assert value(text, x=1.0, v=2.0, p=0.5) == 0.5 + 3.0 - 1.0 - 7.0
    digits = renamed(text, dict.fromkeys(("x", "v", "p"), "")).replace(".", "")
    assert all("." in word for word in text.replace("*", " ").replace("/", " ").split() if word[0].isdigit())
    assert digits


def test_a_function_that_the_protocol_lacks_is_refused() -> None:
    with pytest.raises(UnsupportedError, match="no function erf"):
        infix(sp.erf(X))


def test_names_are_replaced_whole() -> None:
    assert renamed("x + xx*x1 - exp(x)/1e5", {"x": "y[0]"}) == "y[0] + xx*x1 - exp(y[0])/1e5"


@pytest.mark.parametrize("name", ["fig8", "stribeck_belt", "static_belt", "free_coulomb", "hard/nan_region"])
def test_modes_fields_guards_and_slopes_are_those_of_the_system(name: str) -> None:
    problem = load_case(name).readings[0].problem
    system, text = problem.system, problem_text(problem, (1,))
    draw = random.Random(3)
    assert [mode.mode for mode in text.modes] == ([-1, 1] if name == "hard/nan_region" else [-1, 0, 1])
    for mode in text.modes:
        own = system.equations((mode.mode,))
        point = {str(x): draw.uniform(0.1, 0.9) for x in system.states} | {"t": 0.3}
        at = point | text.parameters

        def exact(expression: sp.Expr, point: dict[str, float] = point) -> float:
            return float(
                system.numeric(expression).subs({s: point[s.name] for s in expression.free_symbols if s.name in point})
            )

        assert [value(f, **at) for f in mode.field] == pytest.approx([exact(f) for f in own.field], rel=1e-12)
        for guard, expression in zip(mode.guards, own.guards, strict=True):
            assert value(guard.expression, **at) == pytest.approx(exact(expression.expression), rel=1e-12)
            before, after = (
                value(guard.expression, **at | {"t": 0.3 + h} | _moved(point, mode, at, h)) for h in (-1e-6, 1e-6)
            )
            assert value(guard.rate, **at) == pytest.approx((after - before) / 2e-6, rel=1e-4, abs=1e-6)


def _moved(point: dict[str, float], mode: object, at: dict[str, float], h: float) -> dict[str, float]:
    """The point a time h later along the mode's field."""
    states = [name for name in point if name != "t"]
    rates = [value(f, **at) for f in mode.field]  # type: ignore[attr-defined]
    return {name: point[name] + h * rate for name, rate in zip(states, rates, strict=True)}


def followers(problem: Problem, side: int, guard: int, **point: float) -> tuple[int | None, str | None]:
    """What the text says follows a guard at a point."""
    text = problem_text(problem, (1,))
    mode = next(mode for mode in text.modes if mode.mode == side)
    for successor in mode.guards[guard].successors:
        if all(value(when, **point, **text.parameters) >= 0 for when in successor.when):
            return successor.mode, successor.ends
    return None, None


@pytest.mark.parametrize(
    ("below", "above", "follows"),
    [(2, 1, (1, None)), (-2, -1, (-1, None)), (1, -1, (0, None)), (-1, 1, (None, "nonunique")), (1, 0, (0, None))],
)
def test_two_normal_velocities_decide_what_follows(below: int, above: int, follows: object) -> None:
    s = sp.Symbol("s", real=True)
    field = sp.Rational(above + below, 2) + sp.Rational(above - below, 2) * s
    problem = Problem(FilippovSystem((X,), (s,), (X,), (field,)), sp.Integer(0), (sp.Integer(1),), sp.Integer(1))
    assert followers(problem, 1, 0, x=0.0, t=0.0) == follows


def test_a_slide_ends_into_the_side_that_the_equivalent_sign_reached() -> None:
    problem = load_case("fig8").readings[0].problem
    text = problem_text(problem, (1,))
    (slide,) = [mode for mode in text.modes if mode.mode == 0]
    assert [[s.mode for s in guard.successors] for guard in slide.guards] == [
        [guard.to_sign] for guard in problem.system.equations((0,)).guards
    ]


def test_one_surface_is_handed_over_and_no_more() -> None:
    with pytest.raises(UnsupportedError, match="one surface, not 2"):
        problem_text(load_case("two_blocks").readings[0].problem, (1, 1))
    assert problem_text(ramp(), (-1,)).surface.gradient == ["1.0"]


def test_jumps_of_the_state_are_not_handed_over() -> None:
    with pytest.raises(UnsupportedError, match="does not support jumps"):
        problem_text(ball(sp.Integer(3), sp.Rational(4, 5)), (1,))
