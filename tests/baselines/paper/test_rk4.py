"""henon-rk4: order 4 of the transition times, against closed forms, on grids that do not contain the transitions.

Systems: the non-stop forced Coulomb oscillator (Den Hartog 1931, Shaw 1986), Leine's Stribeck belt (1998)
and Fig. 8 of Olejnik and Awrejcewicz (2013).
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from problems import make_problem
from scipy.optimize import brentq

from henon_ref.baselines.paper.rk4 import RK4
from henon_ref.casefile.case import load_case
from henon_ref.errors import UnsupportedError
from henon_ref.modes.problem import Problem
from henon_ref.modes.system import FilippovSystem
from henon_ref.solver import Solver
from henon_ref.taylor.tape import TIME

X, V, Q, U = sp.symbols("x v q u", real=True)
S, R = sp.symbols("s r", real=True)
STEPS = [0.04 / math.sqrt(2) / 1.3**k for k in range(7)]


def observed_order(steps, errors):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


@pytest.fixture(scope="module")
def forced_coulomb():
    """x'' + x = cos(2t + phi) - sgn(x')/5 turning at k pi/2, started between two turns of the exact orbit."""
    w, p, f = 2.0, 1.0, 0.2
    gain, u = 1 / (1 - w * w), math.tan(math.pi / (2 * w)) / w
    x0 = math.sqrt(gain**2 * p**2 - f**2 * u**2)
    phase = math.atan2(-f * u / (gain * p), x0 / (gain * p))
    system = FilippovSystem((X, V), (S,), (V,), (V, sp.cos(2 * TIME + sp.Float(phase, 17)) - X - S / 5))
    return Problem(system, sp.Integer(0), (sp.Float(x0, 17), sp.Integer(0)), sp.Integer(8))


@pytest.fixture(scope="module")
def forced_slide():
    """x' = 2 sin t - sgn x from rest: it slides until sin t = 1/2 and lands again where its own integral is 0."""
    system = FilippovSystem((X,), (S,), (X,), (2 * sp.sin(TIME) - S,))
    return Problem(system, sp.Integer(0), (sp.Integer(0),), sp.Integer(6))


def test_is_a_solver():
    assert isinstance(RK4, Solver)
    assert RK4.fixed_step


def test_crossings_of_the_forced_coulomb_oscillator_converge_with_order_4(forced_coulomb):
    errors = []
    for h in STEPS:
        found = RK4.prepare(forced_coulomb, step=h)()
        times = [t.time for t in found.transitions]
        assert [t.kind for t in found.transitions] == ["crossing"] * 5
        errors.append(max(abs(np.array(times) - np.arange(1, 6) * math.pi / 2)))
    assert errors[-1] < 1e-9
    assert observed_order(STEPS, errors) == pytest.approx(4, abs=0.3)


def test_landing_after_a_slide_converges_with_order_4(forced_slide):
    release = math.pi / 6
    landing = brentq(lambda t: math.sqrt(3) - 2 * math.cos(t) - (t - release), 2, 4, xtol=1e-15)
    errors = []
    for h in STEPS:
        a, b, *_ = RK4.prepare(forced_slide, step=h)().transitions
        assert (a.kind, a.to_mode, b.kind) == ("release", (1,), "crossing")
        errors.append(abs(b.time - landing))
    assert observed_order(STEPS, errors) == pytest.approx(4, abs=0.3)


def test_release_converges_with_order_5_of_its_one_swapped_step(forced_slide):
    steps, errors = [0.3 / 1.3**k for k in range(7)], []
    for h in steps:
        # The error depends on where in its step the release falls: mean over five grids.
        grids = [replace(forced_slide, start=sp.Float(h * j / 5, 17), until=sp.Integer(1)) for j in range(5)]
        found = [RK4.prepare(problem, step=h)().transitions[0] for problem in grids]
        assert {t.landing for t in found} == {"henon"}
        errors.append(np.mean([abs(t.time - math.pi / 6) for t in found]))
    assert observed_order(steps, errors) == pytest.approx(5, abs=0.6)


def test_stribeck_belt_sticks_and_slips_with_leines_period():
    v = V - sp.Rational(1, 5)
    system = FilippovSystem((X, V), (S,), (v,), (V, -X - S / (1 + 3 * S * v)))
    problem = Problem(system, sp.Integer(0), (sp.Integer(1), sp.Rational(1, 5)), sp.Integer(30), {0: -1})
    found = RK4.prepare(problem, step=1e-3)().transitions
    assert [t.kind for t in found] == ["stick", "release"] * 2 + ["stick"]
    assert found[0].time == pytest.approx(4.295999525480, abs=2e-11)
    assert found[1].time - found[0].time == pytest.approx(7.705031769350, abs=2e-11)
    assert found[3].time - found[1].time == pytest.approx(12.001031294831, abs=2e-11)


def touching(separation):
    """x = 1 - c + (1 - cos(t - 1)) dips below 1 for ``separation`` around t = 1."""
    depth = 1 - math.cos(separation / 2)
    system = FilippovSystem((X,), (S,), (X - 1,), (sp.sin(TIME - 1),))
    start = sp.Float(2 - math.cos(1) - depth, 17)
    return Problem(system, sp.Integer(0), (start,), sp.Integer(2))


def test_near_a_graze_the_root_is_bracketed():
    found = RK4.prepare(touching(0.12), step=0.1)().transitions
    assert [t.landing for t in found] == ["bracket", "bracket"]
    assert [t.time for t in found] == pytest.approx([0.94, 1.06], abs=1e-5)


def test_two_events_in_one_step_are_missed_as_the_paper_misses_them():
    assert not RK4.prepare(touching(0.06), step=0.08)().transitions


@pytest.fixture(scope="module")
def belt_pair():
    """Two Stribeck belts that do not touch each other."""
    first, second = V - sp.Rational(1, 5), U - sp.Rational(1, 5)
    field = (V, -X - S / (1 + 3 * S * first), U, -Q - R / (1 + 3 * R * second))
    system = FilippovSystem((X, V, Q, U), (S, R), (first, second), field)
    return Problem(system, sp.Integer(0), (sp.Integer(1), sp.Integer(0)) * 2, sp.Integer(30))


def test_two_surfaces_switch_one_by_one_and_together(belt_pair):
    start = (*belt_pair.initial[:2], sp.Rational(11, 10), sp.Integer(0))
    apart = RK4.prepare(replace(belt_pair, initial=start), step=1e-2)().transitions
    together = RK4.prepare(belt_pair, step=1e-2)().transitions
    own = [t.time for t in apart if t.surface == 0]
    assert [t.time for t in together if t.surface == 0] == pytest.approx(own, abs=1e-7)
    assert [(t.surface, t.time) for t in together[1::2]] == [(1, t.time) for t in together[::2]]
    assert (0, 0) in {t.to_mode for t in together}


def test_samples_lie_on_the_solution_and_know_their_mode(forced_slide):
    wanted = np.array([0.1, math.pi / 6 - 1e-3, math.pi / 6 + 1e-3, 1.0, 6.0])
    run = RK4.prepare(forced_slide, step=0.01, sample_times=wanted)()
    exact = [max(math.sqrt(3) - 2 * math.cos(t) - (t - math.pi / 6), 0) * (t > math.pi / 6) for t in wanted[:4]]
    assert run.samples[:4, 0] == pytest.approx(exact, abs=1e-9)
    assert run.sample_modes[:4] == ((0,), (0,), (1,), (1,))
    assert run.samples[4] == pytest.approx(run.end_state)


def test_the_run_ends_at_the_horizon_and_counts_its_work(forced_coulomb):
    run = RK4.prepare(forced_coulomb, step=0.03)()
    assert (run.status, run.end_time) == ("ok", 8.0)
    assert run.counts.rhs_evaluations == 4 * (run.counts.steps + len(run.transitions))
    assert run.max_surface_drift < 1e-12


def test_what_rounding_the_time_loses_does_not_pile_up():
    """After thousands of events the time is still the double next to it."""
    oscillator = make_problem("x v", ["v", "-(100**2)*x"], {"s": "x - 1/10"}, [1, 0], 100)
    run = RK4.prepare(oscillator, step=7e-4)()
    assert len(run.transitions) > 3000
    assert all(abs(event.time_low) <= math.ulp(event.time) for event in run.transitions)
    assert run.end_time == pytest.approx(100.0, abs=2e-14)


def test_one_system_runs_in_several_threads_at_once(forced_coulomb):
    """The compiled loop lets go of the interpreter lock, and a mode's equations are shared."""
    runs = [RK4.prepare(forced_coulomb, step=1e-4) for _ in range(4)]
    alone = runs[0]()
    with ThreadPoolExecutor(len(runs)) as pool:
        found = list(pool.map(lambda run: run(), runs))
    assert [tuple(run.transitions) for run in found] == [tuple(alone.transitions)] * len(runs)
    assert {run.end_state for run in found} == {alone.end_state}


def test_finite_escape_is_called_diverged():
    problem = Problem(FilippovSystem((X,), (S,), (X,), (X**3,)), sp.Integer(0), (sp.Integer(1),), sp.Integer(9))
    run = RK4.prepare(problem, step=1e-3)()
    assert run.status == "diverged"
    assert 0.5 <= run.end_time < 0.52


def test_a_guard_that_is_not_a_number_is_a_failure_not_a_missed_event():
    surface = sp.sqrt(1 - X) - sp.Rational(1, 10)
    problem = Problem(
        FilippovSystem((X,), (S,), (surface,), (1 + X * 0,)), sp.Integer(0), (sp.Rational(995, 1000),), sp.Integer(1)
    )
    run = RK4.prepare(problem, step=0.1)()
    assert (run.status, len(run.transitions)) == ("failed", 0)
    assert "not a number" in run.reason


def test_events_that_accumulate_end_the_run():
    """Twisting: x1'' = -2 sgn x1 - sgn x2 comes to rest after infinitely many crossings."""
    system = FilippovSystem((X, V), (S, R), (X, V), (V, -2 * S - R))
    end = 1.5 * (1 / 3 + 1 / math.sqrt(3)) / (1 - math.sqrt(1 / 3))
    problem = Problem(system, sp.Integer(0), (sp.Integer(0), sp.Rational(3, 2)), sp.Integer(4))
    run = RK4.prepare(problem, step=1e-3)()
    assert run.status == "failed"
    assert "events within one step" in run.reason
    assert run.end_time == pytest.approx(end, abs=1e-5)


def test_an_excursion_of_a_millionth_of_a_step_right_after_a_release_is_found():
    """The field above is 1e-19 there: any rounding of the mode's equations would swallow it."""
    width = sp.Rational(1, 10**9)
    above = (TIME - 1) * (2 * width / 3 - (TIME - 1))
    system = FilippovSystem((X,), (S,), (X,), ((1 + S) / 2 * above + (1 - S) / 2,))
    found = RK4.prepare(Problem(system, sp.Integer(0), (sp.Integer(0),), sp.Integer(2)), step=1e-3)().transitions
    assert [t.kind for t in found] == ["release", "stick"]
    assert found[1].time - found[0].time == pytest.approx(1e-9, abs=1e-15)


def test_repelling_sliding_stops_the_run():
    problem = Problem(FilippovSystem((X,), (S,), (X,), (S,)), sp.Integer(0), (sp.Integer(0),), sp.Integer(1))
    assert RK4.prepare(problem, step=0.1)().status == "nonunique"


def test_a_deadline_in_the_past_is_a_timeout(forced_coulomb):
    problem = Problem(forced_coulomb.system, sp.Integer(0), forced_coulomb.initial, sp.Integer(10**6))
    run = RK4.prepare(problem, step=1e-3, deadline=0.0)()
    assert run.status == "timeout"
    assert 0 < run.end_time < 10**6


@pytest.mark.parametrize("step", [None, 0.0, -1e-3, math.nan])
def test_a_step_is_needed(forced_slide, step):
    with pytest.raises(UnsupportedError, match="positive step"):
        RK4.prepare(forced_slide, step=step)


@pytest.mark.parametrize("step", [1e-2, 1e-3, 1e-4])
def test_a_crossing_at_the_very_end_of_a_step_is_found(step: float) -> None:
    """Switch times that are whole numbers of steps: the kernel adds its time up otherwise than the run does."""
    surfaces = {"a": "t - 20", "b": "t - 201/10", "c": "t - 60", "d": "t - 60 - 10**(-10)"}
    problem = make_problem("x", ["10**4*(a - b + c - d)/2"], surfaces, [0], 100)
    result = RK4.prepare(problem, step=step)()
    assert result.status == "ok"
    assert [q.time for q in result.transitions] == pytest.approx([20, 20.1, 60, 60], abs=1e-9)


def test_what_rounding_lost_of_a_time_is_less_than_its_last_place() -> None:
    case = load_case(Path(__file__).parents[3] / "cases" / "fig8.yaml")
    found = RK4.prepare(case.reading("equations").problem, step=1e-3)()
    assert len(found.transitions) > 50
    assert all(abs(event.time_low) <= np.spacing(event.time) / 2 for event in found.transitions)
