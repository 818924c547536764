"""Modes decided in ball arithmetic, where doubles would not do or a case is rare; the others: tests/modes."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import sympy as sp
from flint import arb, ctx

from henon_ref.harness.truth.multiprecision.points import SeriesEvaluation
from henon_ref.modes.equations import Guard
from henon_ref.modes.problem import Problem
from henon_ref.modes.selection import after_event, initial_mode
from henon_ref.modes.switched_field import SlidingOverride
from henon_ref.modes.system import FilippovSystem

X, V, S, U = sp.symbols("x v s u", real=True)
ZERO = sp.Integer(0)


@pytest.fixture(autouse=True)
def _precision() -> Iterator[None]:
    with ctx.workprec(160):
        yield


def initial(system: FilippovSystem, *state: sp.Expr) -> tuple[str, object]:
    problem = Problem(system, ZERO, tuple(sp.sympify(v) for v in state), sp.Integer(1))
    decision = initial_mode(SeriesEvaluation(system, 128).at_start(problem), problem)
    return decision.status, decision.mode


def line(field: sp.Expr) -> FilippovSystem:
    return FilippovSystem((X,), (S,), (X,), (field,))


def test_rest_at_the_very_limit_of_friction_is_rest() -> None:
    """At x = F the equivalent sign stays -1: neither slip ever leaves, and sliding holds."""
    coulomb = FilippovSystem((X, V), (S,), (V,), (V, -X - S))
    assert initial(coulomb, 1, ZERO) == ("unique", (0,))
    assert initial(coulomb, 1 + sp.Rational(1, 10**30), ZERO) == ("unique", (-1,))


def test_a_tie_within_the_radius_counts_as_a_tie() -> None:
    guard = Guard("surface", 0, -1, X)
    within = SeriesEvaluation(line(2 - S), 128).at(arb(0), [arb("1e-35", arb("1e-30"))])
    assert after_event(within, (1,), [guard]).mode == (1,)


@pytest.mark.parametrize("surface", [(X - 1) ** 3, X - 1 - sp.sin(X - 1), (X - 1) ** 5 * (1 + X)])
def test_where_the_gradient_vanishes_fields_that_lead_through_the_surface_cross(surface: sp.Expr) -> None:
    """x' = 2 + s: x(t) is one and only, whatever expression's sign s is. A slide would have the sign -2 (0/0 here)."""
    for field, mode in ((2 + S, (1,)), (-S, (0,))):
        at = SeriesEvaluation(FilippovSystem((X,), (S,), (surface,), (field,)), 128).at(arb(1), [arb(1)])
        decision = after_event(at, (-1,), [Guard("surface", 0, 1, -surface)])
        assert (decision.status, decision.mode) == ("unique", mode)


def test_two_surfaces_at_once() -> None:
    system = FilippovSystem((X, V), (S, U), (X, V), (-S, 2 - U))
    assert initial(system, ZERO, ZERO) == ("unique", (0, 1))


def test_an_overridden_stick_begins_where_both_fields_point_in() -> None:
    override = SlidingOverride((V, ZERO), ())
    belt = FilippovSystem((X, V), (S,), (V,), (V, -X - S), overrides={0: override})
    assert initial(belt, sp.Rational(1, 2), ZERO) == ("unique", (0,))
    assert initial(belt, 2, ZERO) == ("unique", (-1,))


def test_a_field_that_is_not_finite_has_no_mode() -> None:
    assert initial(line(-S / X), ZERO)[0] == "none"


def test_the_end_of_the_model_is_invalid() -> None:
    system = FilippovSystem((X,), (S,), (X - 5,), (S,), valid=(X,))
    assert initial(system, -1) == ("invalid", None)
    guard = Guard("valid", 0, 0, X, ends="invalid")
    assert after_event(SeriesEvaluation(system, 128).at(arb(0), [arb(0)]), (-1,), [guard]).status == "invalid"
