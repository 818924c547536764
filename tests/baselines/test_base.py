"""A new library is an adapter with its names, and one method that integrates a smooth mode until a guard stops it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import sympy as sp
from numpy.typing import NDArray

from baselines.base import Adapter, CallbackFlow, ConfiguredLibrary
from baselines.flow import Stop
from baselines.mode_functions import ModeFunctions
from baselines.work import Work
from henon_ref.errors import UnavailableError, UnsupportedError
from henon_ref.filippov.problem import Problem
from henon_ref.filippov.system import FilippovSystem
from henon_ref.solver import Solver

X, S = sp.symbols("x s", real=True)
STICKS_AT_2 = Problem(FilippovSystem((X,), (S,), (X,), (-S,)), sp.Integer(0), (sp.Integer(2),), sp.Integer(5))


@dataclass(frozen=True)
class Lines(Adapter):
    """Straight lines, which are exact where the field is constant; each guard's root by its secant."""

    landing = "secant"
    distribution = "a package that is not installed"
    least_rtol = 1e-13

    def load(self) -> Any:
        if self.name == "missing":
            raise ImportError
        return None

    def location_error(self, t: float) -> float:
        return 1e-15 * abs(t)

    def flow(self, library: ConfiguredLibrary, model: ModeFunctions, work: Work, horizon: float) -> CallbackFlow:
        return _Flow(library, model, work, horizon)


class _Flow(CallbackFlow):
    def solve(self, t: float, x: Sequence[float], until: float, wanted: NDArray[np.float64] | None) -> Stop:
        begin, rates = np.array(x), np.array(self.model.field(t, *x))
        self.work.steps += 1
        roots = {}
        for k, guard in enumerate([*self.gates.watchers(self.work.count_event), self.last.value]):
            first, last = guard(t, begin), guard(until, begin + (until - t) * rates)
            if last < 0.0 < first:
                roots[k] = t + (until - t) * first / (first - last)
        end = min(roots.values(), default=until)
        point = tuple((begin + (end - t) * rates).tolist())
        return self.stopped(end, point, [k for k, root in roots.items() if root == end] or None)


def test_a_library_that_fills_in_one_method_is_a_solver() -> None:
    solver = Lines("lines")
    assert isinstance(solver, Solver)
    found = solver.prepare(STICKS_AT_2, rtol=1e-9)()
    assert [(event.kind, event.time, event.landing) for event in found.transitions] == [("stick", 2.0, "secant")]
    assert (found.status, found.end_time, found.counts.steps) == ("ok", 5.0, 2)


def test_tolerances_below_the_librarys_limit_are_raised_to_it() -> None:
    assert Lines("lines").library(1e-16, 1e-16).accuracy == (1e-13, 1e-16)


def test_a_state_that_is_not_finite_is_a_failure_where_it_was_last_finite() -> None:
    grows = FilippovSystem((X,), (S,), (X - 3,), (sp.Integer(1),))
    flow = _Flow(Lines("lines").library(1e-9, 1e-9), ModeFunctions(grows, (-1,)), Work(None), 1.0)
    flow.last.start(0.5, (1.0,))
    stop = flow.stopped(1.0, (np.inf,), None)
    assert (stop.status, stop.t, stop.x) == ("failed", 0.5, (1.0,))


def test_a_library_that_is_not_installed_and_a_step_are_refused() -> None:
    assert Lines("missing").version == ""
    with pytest.raises(UnavailableError, match="a package that is not installed is not installed"):
        Lines("missing").prepare(STICKS_AT_2, rtol=1e-9)
    with pytest.raises(UnsupportedError, match="chooses its own steps"):
        Lines("lines").prepare(STICKS_AT_2, step=1e-3)
