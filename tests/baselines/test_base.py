"""An adapter for a library: its names, and one method that integrates a smooth mode until a guard stops it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from numpy.typing import NDArray

from henon_ref.baselines.adapter import Adapter, ModeSolver
from henon_ref.baselines.library import Stop, Work
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import STOPPED
from henon_ref.baselines.smooth_mode import SmoothMode
from henon_ref.errors import ContractError, UnavailableError, UnsupportedError
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.solver import Solver

X, S, U = sp.symbols("x s u", real=True)
STICKS_AT_2 = Problem(FilippovSystem((X,), (S,), (X,), (-S,)), sp.Integer(0), (sp.Integer(2),), sp.Integer(5))


class _Flow(SmoothMode):
    def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
        begin, rates = x, np.array(self.model.field(t, *x.tolist()))
        self.work.steps += 1
        roots = {}
        for k, guard in enumerate([*self.watchers, self.divergence]):
            first, last = guard(t, begin), guard(until, begin + (until - t) * rates)
            if last < 0.0 < first:
                roots[k] = t + (until - t) * first / (first - last)
        end = min(roots.values(), default=until)
        point = tuple((begin + (end - t) * rates).tolist())
        return self.stopped(end, point, [k for k, root in roots.items() if root == end] or None)


@dataclass(frozen=True)
class Lines(Adapter):
    """Straight lines, which are exact where the field is constant; each guard's root by its secant."""

    mode = _Flow
    landing = "secant"
    distribution = "a package that is not installed"
    least_rtol = 1e-13

    def load(self) -> Any:
        if self.name == "missing":
            raise ImportError
        return None


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
    flow.last = 0.5, (1.0,)
    stop = flow.stopped(1.0, (np.inf,), None)
    assert (stop.status, stop.t, stop.x) == ("failed", 0.5, (1.0,))


def test_a_library_that_is_not_installed_and_a_step_are_refused() -> None:
    assert Lines("missing").version == ""
    with pytest.raises(UnavailableError, match="a package that is not installed is not installed"):
        Lines("missing").prepare(STICKS_AT_2, rtol=1e-9)
    for asked in ({"step": 1e-3}, {"rtol": 1e-6, "step": 1e-3}, {}):
        with pytest.raises(UnsupportedError, match="lines chooses its own steps: give rtol"):
            Lines("lines").prepare(STICKS_AT_2, **asked)


class Euler(SmoothMode):
    """Explicit steps of a thousandth of the horizon; a root is the end of its step."""

    def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
        before = self.guards(t, x)
        while t < until:
            end = min(t + 1e-3 * self.horizon, until)
            x = x + (end - t) * self.rhs(t, x)
            now = self.guards(end, x)
            fallen = np.flatnonzero((before > 0) & (now <= 0))
            if fallen.size:
                return self.stopped(end, x, fallen)
            t, before = end, now
            self.work.steps += 1
        return self.stopped(until, x)


EULER = ModeSolver("euler", Euler, landing="the end of a step", distribution="numpy")


def mode_of(problem: Problem, mode: tuple[int, ...], solver: ModeSolver = EULER) -> SmoothMode:
    """One mode of a problem at tolerances 1e-6."""
    return Euler(solver.library(1e-6, 1e-8), ModeFunctions(problem.system, mode), Work(None), 5.0)


def test_one_method_is_left_to_fill_in_and_makes_a_solver() -> None:
    assert SmoothMode.__abstractmethods__ == {"integrate"}
    assert isinstance(EULER, Solver)
    assert (EULER.version, EULER.fixed_step) == (np.__version__, False)
    found = EULER.prepare(STICKS_AT_2, rtol=1e-3)()
    assert [(event.kind, event.landing) for event in found.transitions] == [("stick", "the end of a step")]
    assert found.transitions[0].time == pytest.approx(2.0, abs=0.01)
    assert (found.status, found.end_state, found.end_mode) == ("ok", (0.0,), (0,))
    assert found.counts.steps == found.counts.rhs_evaluations - 1  # one of them ended at the event


def test_what_a_mode_offers_has_the_shapes_that_are_documented() -> None:
    curved = FilippovSystem((X, U), (S,), (X**2 + U,), (U - S, -X * U))
    mode = mode_of(Problem(curved, sp.Integer(0), (sp.Integer(2), sp.Integer(1)), sp.Integer(5)), (1,))
    x = mode.model.start(0.0, (2.0, 1.0))
    assert x.tolist() == [2.0, 1.0, 5.0]  # the guard is not linear: a copy of it is integrated along
    assert mode.rhs(0.0, x).tolist() == [0.0, -2.0, -2.0]
    assert mode.guards(0.0, x).tolist() == [5.0, 1e100]
    assert mode.jacobian(0.0, x).tolist() == [[0.0, 1.0, 0.0], [-1.0, -2.0, 0.0], [-1.0, 2.0, 0.0]]
    assert (mode.rtol, mode.atol) == (1e-6, 1e-8)


def test_a_mode_says_where_it_stopped() -> None:
    mode = mode_of(STICKS_AT_2, (1,))
    assert mode.stopped(5.0, np.array([1.0])) == Stop("horizon", 5.0, 0.0, (1.0,))
    assert mode.stopped(2.0, np.array([0.0]), np.array([0])) == Stop("event", 2.0, 0.0, (0.0,), (0,))
    assert mode.stopped(2.0, np.array([1e101]), np.array([1])).status == "diverged"


def test_steps_that_stand_still_and_a_deadline_end_the_run_as_they_should() -> None:
    class Still(Euler):
        def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
            while True:
                self.guards(t, x)

    stalled = ModeSolver("still", Still, landing="none", distribution="numpy").prepare(STICKS_AT_2, rtol=1e-3)()
    assert (stalled.status, stalled.reason) == ("failed", "the steps no longer move the time t = 0")
    assert EULER.prepare(STICKS_AT_2, rtol=1e-3, deadline=0.0)().status == "timeout"


def test_an_implicit_method_is_watched_later_than_an_explicit_one() -> None:
    implicit = replace(EULER, implicit=True)
    assert EULER.library(1e-6, 1e-6).errors == (EPSILON, 0.0)
    assert implicit.library(1e-6, 1e-6).errors == (STOPPED * 1e-6, STOPPED * 1e-6)


def test_what_is_no_stop_and_no_index_is_refused() -> None:
    class Forgets(Euler):
        def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
            return None  # type: ignore[return-value]

    with pytest.raises(ContractError, match=r"integrate must return the result of self\.stopped or self\.f"):
        ModeSolver("forgets", Forgets, landing="none", distribution="numpy").prepare(STICKS_AT_2, rtol=1e-3)()
    for fallen in (np.array([True, False]), [-1], [2], []):
        with pytest.raises(ContractError, match="indices of guards, 0 to 1"):
            mode_of(STICKS_AT_2, (1,)).stopped(2.0, np.array([0.0]), fallen)
    with pytest.raises(ContractError, match="'t' must be a time, not nan"):
        mode_of(STICKS_AT_2, (1,)).stopped(np.nan, np.array([0.0]))


def test_arrays_of_another_shape_are_refused() -> None:
    """The states are enough; a mode with a guard that is not linear has more unknowns."""
    system = FilippovSystem((X, U), (S,), (X * U,), (-S, sp.Integer(0)))
    mode = mode_of(Problem(system, sp.Integer(0), (sp.Integer(2), sp.Integer(1)), sp.Integer(5)), (1,))
    assert len(mode.model.unknowns) == 3
    for x in ([1.0, 2.0], np.array([1.0, 2.0, 2.0])):
        assert mode.stopped(5.0, x, samples=np.zeros((4, 2))).x == (1.0, 2.0)
    for x in ([], [1.0], [1.0, 2.0, 2.0, 0.0], np.zeros((2, 2))):
        with pytest.raises(ContractError, match="'x' must have the 2 states or all 3 unknowns, not the shape"):
            mode.stopped(5.0, x)
    for samples in (np.zeros(2), np.zeros((4, 3))):
        with pytest.raises(ContractError, match=r"'samples' must have the shape \(k, 2\), not"):
            mode.stopped(5.0, [1.0, 2.0], samples=samples)


def test_a_guard_that_starts_at_zero_reads_one_until_it_is_clear_of_zero() -> None:
    """After a crossing: the state lies on the surface, and its guard rises at speed 1."""
    seen = []

    class Looks(Euler):
        def integrate(self, t: float, x: NDArray[np.float64], until: float) -> Stop:
            seen.append((self.guards(t, x)[0], self.guards(t + 1e-3, x + 1e-3)[0]))
            return self.stopped(until, x + (until - t))

    system = FilippovSystem((X,), (S,), (X,), (2 + S,))  # from x = -1 at speed 1, through 0 at t = 1, then at 3
    mode = Looks(EULER.library(1e-6, 1e-6), ModeFunctions(system, (1,)), Work(None), 5.0)
    mode.advance(1.0, 0.0, (0.0,), 5.0, [(0, 4.0, 3.0)], None)
    mode.advance(1.0, 0.0, (0.0,), 5.0, [], None)
    assert seen == [(1.0, 1e-3), (0.0, 1e-3)]
