"""The shared driver with an exact library: straight lines and parabolas, without tolerances."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
import systems
from numpy.typing import NDArray

from henon_ref.baselines.driver import Driver
from henon_ref.baselines.library import Stop, Work
from henon_ref.baselines.mode_functions import EPSILON, ModeFunctions
from henon_ref.baselines.restart import Fresh
from henon_ref.baselines.scipy_ivp import DOP853
from henon_ref.baselines.surface_functions import landing
from henon_ref.casefile.case import load_case
from henon_ref.modes.callables import _lambdified
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem

CASES = Path(__file__).parents[2] / "cases"
X, S, U, W = sp.symbols("x s u w", real=True)


class Flat:
    """Constant fields and guards linear in them: every root in closed form.

    ``first_only`` names one of several simultaneous roots, ``blind`` none at all.
    """

    solver = SimpleNamespace(landing="exact")
    accuracy = (EPSILON, EPSILON)
    errors = (EPSILON, 0.0)

    def __init__(self, first_only: bool = False, blind: bool = False) -> None:
        self.first_only = first_only
        self.blind = blind
        self.modes: list[Any] = []

    def loosened(self) -> Flat:
        return self

    def location_error(self, t: float) -> float:
        return 4.0 * EPSILON * (1.0 + abs(t))

    def flow(self, model: ModeFunctions, work: Work, horizon: float) -> _Line:
        self.modes.append(model.mode)
        return _Line(self, model, work)


class _Line:
    def __init__(self, library: Flat, model: ModeFunctions, work: Work) -> None:
        self.library, self.model, self.work = library, model, work

    def advance(
        self,
        t: float,
        low: float,
        x: Sequence[float],
        until: float,
        fresh: Sequence[Fresh],
        wanted: NDArray[np.float64] | None,
    ) -> Stop:
        self.work.steps += 1
        self.work.check()
        field = np.array(self.model.field(t, *x))
        rates = self.model.rates(t, *x)
        new = {item[0] for item in fresh}
        ends = {
            k: t - rates[2 * k] / rates[2 * k + 1]
            for k in range(len(self.model.guards))
            if rates[2 * k + 1] < 0 and not (k in new and abs(rates[2 * k]) < 1e-12)
        }
        end = min([until, *([] if self.library.blind else ends.values())])
        at = np.array(x) + (end - t) * field
        samples = None
        if wanted is not None:
            samples = np.array(x) + np.outer(wanted[wanted <= end] - t, field)
        hits = tuple(k for k, time in ends.items() if time == end and not self.library.blind)
        point = tuple(at.tolist())
        return Stop(
            "event" if hits else "horizon",
            end,
            0.0,
            point,
            hits[: 1 if self.library.first_only else None],
            samples=samples,
        )


def prepared(problem: Problem, library: Any, deadline: float | None = None, **options: Any) -> Driver:
    driver = Driver(problem, library, Work(deadline), **options)
    driver.compile()
    return driver


def run(problem: Problem, library: Flat | None = None, **options: Any) -> Any:
    return prepared(problem, library or Flat(), **options).run()


def walls(until: int = 10) -> Problem:
    """x' = -s between... a start at 2 falls to the surface 0 and sticks there at t = 2."""
    return Problem(FilippovSystem((X,), (S,), (X,), (-S,)), sp.Integer(0), (sp.Integer(2),), sp.Integer(until))


def summary(trajectory: Any) -> list[tuple[str, int, float]]:
    return [(t.kind, t.surface, t.time) for t in trajectory.transitions]


def test_a_stick_is_entered_and_held_to_the_horizon() -> None:
    found = run(walls())
    assert summary(found) == [("stick", 0, 2.0)]
    assert (found.status, found.end_time, found.end_state, found.end_mode) == ("ok", 10.0, (0.0,), (0,))


def test_a_run_has_no_memory_and_counts_afresh() -> None:
    go = prepared(walls(), Flat()).run
    first, second = go(), go()
    assert summary(first) == summary(second)
    assert first.counts == second.counts
    assert first.counts.steps == 2


def test_every_mode_of_one_surface_is_made_before_the_run() -> None:
    library = Flat()
    prepared(walls(), library)
    assert set(library.modes) == {(-1,), (0,), (1,)}


def test_an_event_at_the_horizon_counts_and_one_an_ulp_beyond_the_location_error_does_not() -> None:
    assert summary(run(walls(2))) == [("stick", 0, 2.0)]
    before = Problem(walls().system, sp.Integer(0), (sp.Integer(2),), sp.Rational(2) - sp.Rational(1, 10**9))
    assert summary(run(before)) == []


def test_a_horizon_of_one_ulp_runs() -> None:
    problem = Problem(walls().system, sp.Integer(1), (sp.Integer(2),), 1 + sp.Rational(1, 2**52))
    assert run(problem).status == "ok"


def pair(first: str, second: str) -> Problem:
    """Two particles that fall to their own surfaces, from heights given, at speeds 1 and 2."""
    system = FilippovSystem((X, U), (S, W), (X, U), (-S, -2 * W))
    return Problem(system, sp.Integer(0), (sp.Rational(first), sp.Rational(second)), sp.Integer(5))


def test_simultaneous_events_are_one_instant_even_if_the_library_names_only_one() -> None:
    for library in (Flat(), Flat(first_only=True)):
        found = run(pair("1", "2"), library)
        assert summary(found) == [("stick", 0, 1.0), ("stick", 1, 1.0)]
        assert [(t.from_mode, t.to_mode) for t in found.transitions] == [((1, 1), (0, 0))] * 2


class _GivesUp(_Line):
    def advance(self, *arguments: Any) -> Stop:
        raise RuntimeError("the other library gave up")


class _Other(Flat):
    def flow(self, model: ModeFunctions, work: Work, horizon: float) -> _Line:
        return _GivesUp(self, model, work)


class _Scouted(Flat):
    """A library for which another one finds out the modes."""

    def loosened(self) -> Flat:
        return _Other()


def test_what_another_library_makes_of_the_modes_is_no_failure_of_this_one() -> None:
    assert summary(run(pair("1", "2"), _Scouted())) == [("stick", 0, 1.0), ("stick", 1, 1.0)]


def test_events_1e_12_apart_stay_two() -> None:
    found = run(pair("1", "2.000000000002"))
    assert [t.to_mode for t in found.transitions] == [(0, 1), (0, 0)]
    assert found.transitions[1].time - found.transitions[0].time == pytest.approx(1e-12, rel=1e-3)


def test_a_surface_that_stands_alone_is_decided_without_the_general_search(monkeypatch: pytest.MonkeyPatch) -> None:
    driver = prepared(pair("1", "3"), Flat())
    monkeypatch.setattr(
        "henon_ref.baselines.mode_table.after_event", lambda *a: pytest.fail("the general search was asked")
    )
    assert [t.to_mode for t in driver.run().transitions] == [(0, 1), (0, 0)]


def test_a_library_that_steps_over_a_root_fails_and_says_which() -> None:
    found = run(walls(), Flat(blind=True))
    assert found.status == "failed"
    assert "stepped over" in found.reason
    assert "-8" in found.reason
    assert found.end_time == 0.0  # what came after the root belongs to no mode


def test_a_crossing_goes_on_and_a_spontaneous_switch_is_not_unique() -> None:
    system = FilippovSystem((X,), (S,), (X,), (2 + S,))
    found = run(Problem(system, sp.Integer(0), (sp.Integer(-1),), sp.Integer(3)))
    assert summary(found) == [("crossing", 0, 1.0)]
    assert found.end_state == (6.0,)
    found = run(systems.spontaneous_switch())
    assert (found.status, len(found.transitions)) == ("nonunique", 0)
    assert "not unique" in found.reason


def test_the_model_s_end_is_invalid_at_its_time() -> None:
    system = FilippovSystem((X,), (S,), (X + 1,), (sp.Integer(1),), valid=(1 - X,))
    found = run(Problem(system, sp.Integer(0), (sp.Integer(0),), sp.Integer(3)))
    assert (found.status, found.end_time) == ("invalid", 1.0)


def zigzag() -> Problem:
    """Twisting with speeds instead of forces: each round trip takes half the time of the one before."""
    system = FilippovSystem((X, U), (S, W), (X, U), (-W - S / 3, S - W / 3))
    return Problem(system, sp.Integer(0), (sp.Integer(1), sp.Integer(1)), sp.Integer(100))


def test_accumulating_events_end_the_run_and_keep_their_transitions() -> None:
    found = run(zigzag())
    assert found.status == "failed"
    assert "accumulate" in found.reason
    assert len(found.transitions) > 40
    times = [t.time for t in found.transitions]
    # From (1, 1) the axes are reached in geometric sequence; the limit is closed.
    legs = np.diff(times)
    ratio = legs[5] / legs[4]
    assert found.end_time == pytest.approx(times[4] + legs[4] / (1 - ratio), abs=1e-9)


def test_a_deadline_ends_a_run_with_what_it_has() -> None:
    found = run(walls(), deadline=0.0)
    assert found.status == "timeout"


def test_samples_carry_state_and_mode_and_stop_with_the_run() -> None:
    found = run(walls(), sample_times=np.array([0.0, 1.5, 2.0, 7.0, 10.0, 11.0]))
    assert found.samples[:5, 0].tolist() == [2.0, 0.5, 0.0, 0.0, 0.0]
    assert math.isnan(found.samples[5, 0])
    assert found.sample_modes == ((1,), (1,), (1,), (0,), (0,), (0,))


def test_transitions_are_a_sequence() -> None:
    found = run(pair("1", "3")).transitions
    assert [t.kind for t in found[1:]] == ["stick"]
    assert found[-1].landing == "exact"
    assert isinstance(found[0].time, float)


def test_a_mode_that_was_not_seen_before_costs_no_functions_of_its_own() -> None:
    """In a chain of blocks on a belt nearly every transition leads to one: SymPy's ``lambdify`` takes some 20 ms."""
    problem = load_case(CASES / "classic/block_chain.yaml").readings[0].problem
    landing.cache_clear()
    driver, modes, made = Driver(problem, DOP853.library(1e-6, 1e-6), Work(None)), [], []
    for until in (5.0, 10.0):
        driver.until = until
        driver.run()
        modes.append(len(driver.table.visited))
        made.append(_lambdified.cache_info().misses)
    assert modes[1] > modes[0] + 10
    assert made[1] <= made[0] + 4
    assert landing.cache_info().currsize <= len(problem.system.surfaces)
