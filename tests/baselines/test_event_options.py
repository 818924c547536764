"""Options of the libraries' own event location: the arguments that they set, and a run with each of them."""

from __future__ import annotations

from dataclasses import replace

import pytest
import sympy as sp
import systems

from henon_ref.baselines.heyoka_taylor import HEYOKA
from henon_ref.baselines.library import Work
from henon_ref.baselines.mode_functions import ModeFunctions
from henon_ref.baselines.scipy_ivp import DOP853, RK45
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem

X, S = sp.symbols("x s", real=True)


def early_root() -> tuple[Problem, float]:
    """x' = -(1 + x + x^2/2) from 1e-9, and when x is zero: 2 (atan(1 + 1e-9) - atan(1)) = 1e-9 - 5e-19."""
    system = FilippovSystem((X,), (S,), (X,), (-(1 + X + X**2 / 2) * (S + 3) / 4,))
    return Problem(system, sp.Integer(0), (sp.Rational(1, 10**9),), sp.Integer(1)), 9.999999995e-10


@pytest.mark.parametrize("solver", [RK45, DOP853], ids=lambda s: s.name)
def test_a_root_below_the_library_s_absolute_tolerance_is_located_to_rounding(solver) -> None:
    """Its own ``xtol`` of 4 eps is 1e-6 of this time."""
    problem, exact = early_root()
    own, again = (
        each.prepare(problem, rtol=1e-3, atol=1e-3)().transitions[0].time
        for each in (solver, replace(solver, root_tolerance=1e-300))
    )
    assert abs(again / exact - 1) < 1e-14 < abs(own / exact - 1)


def test_a_later_root_is_located_again_where_it_was() -> None:
    problem = systems.leaving_slide()
    own, again = (each.prepare(problem, rtol=1e-9)() for each in (DOP853, replace(DOP853, root_tolerance=1e-300)))
    assert [t.to_mode for t in own.transitions] == [t.to_mode for t in again.transitions]
    assert [t.time for t in again.transitions] == pytest.approx([t.time for t in own.transitions], abs=1e-15)


@pytest.mark.parametrize(("cooldown", "seconds"), [("none", 0.0), ("automatic", -1.0)])
def test_heyoka_s_cooldown_is_none_or_its_own(cooldown: str, seconds: float) -> None:
    pytest.importorskip("heyoka")
    solver = replace(HEYOKA, cooldown=cooldown)
    problem = systems.leaving_slide()
    library = solver.library(1e-9, 1e-9)
    flow = library.flow(ModeFunctions(problem.system, (1,)), Work(None), 3.0)
    assert [event.cooldown for event in flow._taylor.t_events] == [seconds] * len(flow._taylor.t_events) != []
    found, plain = (each.prepare(problem, rtol=1e-12)() for each in (solver, HEYOKA))
    assert found.status == "ok"
    assert [t.time for t in found.transitions] == pytest.approx([t.time for t in plain.transitions], abs=1e-12)
