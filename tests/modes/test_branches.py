"""Branches that a mode does not use have no part in it: runs reach where such a branch begins, by closed forms.

Solvers and the truth are in ``test_kinks_in_unused_branches``. Contact forces with a power of the indentation, which
has no value out of contact, are what Hertz's contact is.
"""

from __future__ import annotations

import math

import pytest
import sympy as sp

import henon_ref as hr
from henon_ref.expressions.algebra import leaves_out

X, V, S = sp.symbols("x v s", real=True)
FALL = math.sqrt(2 / 9.81)
"""Free fall from x = 1 [s]."""
FORCES = [
    "piecewise(0, x > 0, K*(-x)^(3/2))",
    "piecewise(0, x > 0, sqrt(-x))",
    "piecewise(0, x > 0, log(-x))",
    "max(0, -x)^(3/2)",
    "piecewise(0, x > 0, max(0, -v)*(-x)^(3/2))",
]


@pytest.mark.parametrize("force", FORCES)
def test_the_fall_is_free_up_to_the_contact(force: str) -> None:
    system = hr.System(["x", "v"], {"K": 1e5}, {}, ["v", f"-9.81 + {force}"])
    before = hr.simulate(system, {"x": 1, "v": 0}, until=0.45)
    assert before.status == "ok"
    assert before.y[0, -1] == pytest.approx(1 - 9.81 * 0.45**2 / 2, abs=1e-14)
    on = hr.simulate(system, {"x": 1, "v": 0}, until=1)
    assert on.transitions.time_s.tolist()[:1] == pytest.approx([FALL], abs=1e-15)
    assert on.status == "ok" or "singular" in on.message or "not finite" in on.message


@pytest.mark.parametrize("field", ["(1 - s)/2*sqrt(-x)", "sqrt(-x) - s*sqrt(-x)", "(1 - s)*(v + exp(-x*1000)*x^3)"])
def test_a_declared_sign_that_leaves_a_branch_out(field: str) -> None:
    system = hr.System(["x", "v"], {}, {"s": "x"}, ["v", f"-1 + {field}"])
    assert hr.simulate(system, {"x": 1, "v": 0}, until=1.25).y[0, -1] == pytest.approx(1 - 1.25**2 / 2, abs=1e-15)


def test_what_overflows_in_a_branch_that_is_not_used_counts_for_nothing() -> None:
    system = hr.System(["x", "v"], {}, {}, ["v", "piecewise(0, x > 0, x^64)"])
    assert hr.simulate(system, {"x": 1e10, "v": 100}, until=1).y[:, -1].tolist() == [1e10 + 100, 100]


def test_many_surfaces_each_with_two_branches() -> None:
    """x' = -1 - sqrt(x) from 1: 2 (sqrt(x) - ln(1 + sqrt(x))) falls by t."""
    names = "abcd"
    system = hr.System(list(names), {}, {}, [f"-1 - piecewise(sqrt({x}), {x} > 0, -sqrt(-{x}))" for x in names])
    run = hr.simulate(system, dict.fromkeys(names, 1), until=0.3)
    root = math.sqrt(run.y[0, -1])
    assert 2 * (root - math.log1p(root)) == pytest.approx(2 * (1 - math.log(2)) - 0.3, abs=1e-10)
    assert run.y[:, -1].tolist() == [run.y[0, -1]] * 4


@pytest.mark.parametrize(
    ("shared", "side", "lacks"),
    [
        (X * (1 - S), 1, False),
        (X * V * (1 - S), 1, True),
        (X * V * (1 - S), -1, False),
        (sp.sqrt(-X) * (1 - S) / 2 + X, 1, True),
        (sp.sqrt(-X) - S * sp.sqrt(-X), 1, True),
        (S / (1 + S * V), -1, False),
        (sp.exp(-S * V) * S, -1, False),
        (sp.sin(S * X), -1, False),
        (sp.Pow(-X * (1 - S) / 2, sp.Rational(3, 2)), 1, True),
    ],
)
def test_what_a_sign_leaves_out(shared: sp.Expr, side: int, lacks: bool) -> None:
    put = {S: sp.Integer(side)}
    assert leaves_out(shared, shared.xreplace(put), put, {X, V}) is lacks


def test_a_sweep_runs_the_same_bits() -> None:
    system = hr.System(["x", "v"], {"K": 1e5}, {}, ["v", f"-9.81 + {FORCES[0]}"])
    table = hr.sweep(system, [1, 0], until=0.45, grid={"K": [1, 1e5]}, observe=[hr.observe.final_state()], jobs=1)
    assert table.status.tolist() == ["ok", "ok"]
    assert table.final_x.tolist() == [hr.simulate(system, [1, 0], until=0.45).y[0, -1]] * 2
