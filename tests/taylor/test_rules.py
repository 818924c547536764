"""Every rule of the Taylor recurrences is a true equation, and the tape gives it the factor that it names."""

from __future__ import annotations

import pytest
import sympy as sp

from henon_ref.taylor.rules import (
    RULES,
    IntegralOfProduct,
    IntegralOfQuotient,
    Linear,
    Power,
    Product,
    Quotient,
    Root,
)
from henon_ref.taylor.tape import build_tape

x, c, p, q = sp.symbols("x c p q", real=True)
A, B = sp.Function("A")(x), sp.Function("B")(x)

VALUES = {
    "add": A + B,
    "sub": A - B,
    "scale": c * A,
    "shift": A + c,
    "rsub": c - A,
    "mul": A * B,
    "square": A * A,
    "div": A / B,
    "recip": c / A,
    "sqrt": sp.sqrt(A),
    "power": A**c,
} | {op: getattr(sp, op)(A) for op in RULES if isinstance(RULES[op], IntegralOfProduct | IntegralOfQuotient)}
"""What each operation is, said once more and independently of the rules."""


def meaning(text: str, y: sp.Expr) -> sp.Expr:
    return sp.sympify(text).subs({"y": y, "a": A, "b": B, "c": c})


@pytest.mark.parametrize("op", RULES)
def test_a_rule_is_a_true_equation(op: str) -> None:
    y = VALUES[op]
    rates = sp.diff(y, x), sp.diff(A, x)
    match RULES[op]:
        case Linear(first, second, constant):
            value = first * A + second * B
            residue = y - {"none": value, "term": value + c, "factor": value * c}[constant]
        case Product(right):
            residue = y - A * meaning(right, y)
        case Quotient(above, below):
            residue = y - meaning(above, y) / meaning(below, y)
        case Root():
            residue = y * y - A
        case Power():
            residue = rates[0] * A - c * rates[1] * y
        case IntegralOfProduct(sign, factor):
            residue = rates[0] - sign * rates[1] * meaning(factor, y)
        case IntegralOfQuotient(sign, factor):
            residue = rates[0] * meaning(factor, y) - sign * rates[1]
    assert sp.simplify(residue) == 0


@pytest.mark.parametrize("op", [op for op, rule in RULES.items() if hasattr(rule, "factor")])
def test_the_tape_puts_the_factor_of_a_rule_where_the_rule_looks_for_it(op: str) -> None:
    tape = build_tape((x,), [getattr(sp, op)(x)])
    at = next(i for i, node in enumerate(tape.nodes) if node.op == op)
    rule, y = RULES[op], VALUES[op].subs(A, x)
    assert isinstance(rule, IntegralOfProduct | IntegralOfQuotient)
    values: dict[int, sp.Expr] = {at: y}
    for i, node in enumerate(tape.nodes):
        if i != at:
            put = {A: values.get(node.args[0], x), B: values.get(node.args[-1], x)} if node.op != "state" else {}
            number = {c: tape.constants[node.constants[0]]} if node.constants else {}
            values[i] = x if node.op == "state" else VALUES[node.op].subs(put).subs(number)
    factor = meaning(rule.factor, y).subs(A, x)
    assert sp.simplify(values[rule.place(at, tape.nodes[at].args)] - factor) == 0


def test_every_operation_with_a_factor_that_is_a_pair_is_the_factor_of_that_one() -> None:
    pairs = {op: rule.factor.partition("(")[0] for op, rule in RULES.items() if getattr(rule, "paired", False)}
    assert pairs == {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh"}
