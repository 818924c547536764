"""Expressions: exact values, Python's precedence, and every refusal with its place."""

from __future__ import annotations

import math
from fractions import Fraction
from operator import add, mul, sub, truediv

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from henon_ref.errors import ExpressionError
from henon_ref.expressions.evaluation import parse_expression, parse_number
from henon_ref.expressions.grammar import FUNCTIONS, MAX_NESTING, name_problem

NAMES = {name: sp.Symbol(name, real=True) for name in ("t", "x", "x1", "vp", "s")}
T, X, X1, VP, S = NAMES.values()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0.1", sp.Rational(1, 10)),
        ("1e-3", sp.Rational(1, 1000)),
        (".5E2", sp.Integer(50)),
        ("007.50", sp.Rational(15, 2)),
        ("sqrt(3)/9", sp.sqrt(3) / 9),
        ("pi*e", sp.pi * sp.E),
        ("3*pi/2/1.2364", sp.pi * sp.Rational(30000, 24728)),
        ("abs(-3) + atan2(1, -1)", 3 + 3 * sp.pi / 4),
        ("0.1234567890123456789012345678901234567890", sp.Rational("0.1234567890123456789012345678901234567890")),
    ],
)
def test_a_number_is_exact(text: str, expected: sp.Expr) -> None:
    assert parse_number(text, {}) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2^3^2", sp.Integer(512)),
        ("-x^2", -(X**2)),
        ("2*x^2", 2 * X**2),
        ("x^-1", 1 / X),
        ("x**2^2", X**4),
        ("1 - x - s", 1 - X - S),
        ("1/x/t", 1 / (X * T)),
        ("1 - -x", 1 + X),
        ("x1\n  + vp", X1 + VP),
        ("-(x)", -X),
    ],
)
def test_both_powers_bind_as_in_python(text: str, expected: sp.Expr) -> None:
    assert parse_expression(text, NAMES) == expected


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_of_the_contract_is_known(name: str) -> None:
    value = float(parse_number(f"{name}(0.5)", {}))
    assert value == pytest.approx(getattr(math, name)(0.5), rel=1e-14)


def test_no_function_outside_the_list_is_left_in_a_field() -> None:
    # SymPy makes -cot(x) of it, which has no Taylor recurrence.
    assert parse_expression("tan(x + pi/2)", NAMES) == -sp.cos(X) / sp.sin(X)


@pytest.mark.parametrize(
    ("text", "offset", "says"),
    [
        ("t - G*s", 4, "unknown name 'G'"),
        ("vq*x", 0, "unknown name"),
        ("sinn(x)", 0, "did you mean 'sin'"),
        ("__import__('os').system('true')", 0, "unknown name '__import__'"),
        ("x.real", 1, "'.' is not allowed"),
        ("x if s else t", 2, "operator is missing"),
        ("[x]", 0, "write ("),
        ("x − 1", 2, "write -"),
        ("2x", 1, "a product is written with *"),
        ("2(x)", 1, "a product is written with *"),
        ("x(1)", 1, "'x' is not a function"),
        ("(x + 1", 0, "never closed"),
        ("x + 1)", 5, "without a '('"),
        ("x +", 3, "ends after '+'"),
        ("* x", 0, "missing before '*'"),
        ("sin", 0, "needs its argument"),
        ("sin x", 0, "needs its argument"),
        ("sin()", 4, "missing between"),
        ("log(x, 2)", 5, "takes 1 argument"),
        ("0,5", 1, "','"),
        ("", 0, "empty"),
        ("1_000", 1, "operator is missing"),
        ("2j", 1, "operator is missing"),
        ("x = 1", 2, "'=' is not allowed"),
        ("s*abs(x)", 2, "allowed in 'field' and 'surfaces' (in a scene in 'value' and 'normal')"),
        ("sign(x)", 0, "allowed in 'field' and 'surfaces' (in a scene in 'value' and 'normal')"),
        ("sqrt(x^2)", 0, "kink"),
        ("nan", 0, "finite"),
    ],
)
def test_a_refusal_says_where_and_what(text: str, offset: int, says: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse_expression(text, NAMES)
    assert says in caught.value.message
    assert caught.value.offset == offset


@pytest.mark.parametrize(
    "text",
    [
        "9**9**9**9",
        "(9**64)**64**64",
        "((((9^9)^9)^9)^9)^9",
        "2**-1e9",
        "x**100000",
        "x**64*x**64",
        "((x + t + s + vp)^16)^4",
        "(x + t + s + vp + x1)^60",
        "exp(1e9*log(9))",
        "exp(1e9*log(9*x))",
        "9^(1e9*(1 - t))",
        "2^(x - 1e300)*3",
        "asin((1e-300)^(1e-300))",
        "exp(exp(exp(100)))",
        "1e401",
        "1e400*1e400",
        "sin(1e300)",
        "-" * 2000 + "x",
        "(" * 1500 + "x" + ")" * 1500,
        "x**" * 900 + "x",
        "x+" * 10_000 + "x",
        "1" * 500,
    ],
)
def test_what_would_never_end_is_refused_at_once(text: str) -> None:
    with pytest.raises(ExpressionError):
        parse_expression(text, NAMES)


@pytest.mark.parametrize(
    ("inner", "outer", "offset"),
    [("sin(", ")", 4 * 16), ("x^(", ")", 3 * 16), ("x^", "", 2 * 16), ("(", "^t)", 17), ("exp(x + (", "))", 9 * 16)],
)
def test_functions_and_powers_nest_no_deeper_than_every_solver_can_use(inner: str, outer: str, offset: int) -> None:
    def nest(depth: int) -> str:
        return inner * depth + "x" + outer * depth

    assert parse_expression(nest(MAX_NESTING), NAMES).has(X)
    with pytest.raises(ExpressionError, match=f"nest deeper than {MAX_NESTING}") as caught:
        parse_expression(nest(MAX_NESTING + 1), NAMES)
    assert caught.value.offset == offset


def test_a_long_sum_is_no_deep_nest() -> None:
    assert parse_expression(" + ".join(["x"] * 900), NAMES) == 900 * X


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1/0", "division by zero"),
        ("1/(2 - 2)", "division by zero"),
        ("log(0)", "not finite"),
        ("tan(pi/2)", "not finite"),
        ("atan2(0, 0)", "not finite"),
        ("sqrt(-2)", "'sqrt' of -2 is not a real number"),
        ("(-8)^(1/3)", "the power 1/3 of -8 is not a real number"),
        ("log(-1)", "'log' of -1 is not a real number"),
        ("asin(2)", "not a real number"),
        ("acos(1 + 1e-60)", "not a real number"),
        ("1/(sin(1)^2 + cos(1)^2 - 1)", "cannot be distinguished from zero"),
        ("1e200*1e200", "largest double"),
        ("x", "unknown name"),
    ],
)
def test_a_number_is_real_and_finite(text: str, says: str) -> None:
    with pytest.raises(ExpressionError, match=says):
        parse_number(text, {})


@pytest.mark.parametrize("name", ["t", "pi", "e", "mode", "sin", "abs", "lambda", "2x", "_x", "x y", "é", ""])
def test_names_that_would_hide_something_are_refused(name: str) -> None:
    assert name_problem(name)


Valued = tuple[str, Fraction | None]
"""A text and its value; None: it divides by zero."""


def _combined(left: Valued, operator: str, right: Valued) -> Valued:
    text = f"({left[0]}){operator}({right[0]})"
    if left[1] is None or right[1] is None or (operator == "/" and right[1] == 0):
        return text, None
    return text, _OPERATORS[operator](left[1], right[1])


_OPERATORS = {"+": add, "-": sub, "*": mul, "/": truediv}
_whole = st.integers(0, 99).map(lambda n: (str(n), Fraction(n)))
_decimal = st.decimals(0, 99, places=2).map(lambda d: (str(d), Fraction(d)))
_arithmetic = st.recursive(
    _whole | _decimal,
    lambda inner: (
        st.builds(_combined, inner, st.sampled_from("+-*/"), inner)
        | inner.map(lambda e: (f"-({e[0]})", None if e[1] is None else -e[1]))
    ),
    max_leaves=12,
)


@given(_arithmetic)
@settings(max_examples=200)
def test_arithmetic_is_exact(valued: Valued) -> None:
    text, value = valued
    if value is None:
        with pytest.raises(ExpressionError, match="zero"):
            parse_number(text, {})
    else:
        assert parse_number(text, {}) == sp.Rational(value.numerator, value.denominator)


_tokens = st.lists(
    st.sampled_from(
        ["1", "9", "0", "0.1", "1e300", "pi", "x", "t", "s", "vp", "(", ")", "+", "-", "*", "/", "^", "**", ","]
        + [f"{f}(" for f in ("sin", "asin", "exp", "log", "sqrt", "tanh", "abs", "atan2")]
        + ["'", ".", "_", "[", "import", "é"]
    ),
    max_size=25,
).map("".join)


@given(_tokens)
@settings(max_examples=200)
def test_any_text_is_an_expression_or_an_expression_error(text: str) -> None:
    offset, symbols = 0, set()
    try:
        symbols = parse_expression(text, NAMES).free_symbols
    except ExpressionError as error:
        offset = error.offset
    assert 0 <= offset <= len(text)
    assert symbols <= set(NAMES.values())
