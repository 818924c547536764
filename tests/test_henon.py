"""The reference integrator against closed forms and certified digits (FACTS of the classic systems)."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from baselines.scipy_ivp import DOP853
from henon_ref.henon.solvers import HENON_BRENT, HENON_NEWTON, HENON_SOLVER
from henon_ref.model.case import load_case
from henon_ref.trajectory import Problem, Trajectory
from henon_ref.truth.simulate import simulate
from tests.conftest import make_problem

SOLVERS = [HENON_SOLVER, HENON_NEWTON, HENON_BRENT]


def run(problem: Problem, rtol: float = 1e-15, solver=HENON_SOLVER, **options) -> Trajectory:
    return solver.prepare(problem, rtol=rtol, deadline=20.0, **options)()


def kinds(trajectory: Trajectory) -> list[str]:
    return [q.kind for q in trajectory.transitions]


def times(trajectory: Trajectory) -> np.ndarray:
    return np.array([q.time for q in trajectory.transitions])


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda s: s.name)
def test_free_coulomb_turns_at_multiples_of_pi_and_sticks_for_good(solver) -> None:
    result = run(make_problem("x v", ["v", "-x - 3*s/5"], {"s": "v"}, ["53/10", 0], 20), solver=solver)
    assert result.status == "ok"
    assert kinds(result) == ["crossing", "crossing", "crossing", "stick"]
    np.testing.assert_allclose(times(result), math.pi * np.arange(1, 5), rtol=3e-16)
    assert result.end_state == pytest.approx((0.5, 0.0), abs=4e-15)


def test_a_slide_is_left_at_its_tangent_point() -> None:
    result = run(make_problem("x", ["t - s"], {"s": "x"}, [0], 3))
    assert kinds(result) == ["release"]
    assert result.transitions[0].time == 1.0
    assert result.end_state == (2.0,)


@pytest.mark.parametrize("rtol", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_a_loose_tolerance_leaves_tangent_points_as_a_tight_one(rtol: float) -> None:
    """Fig. 8: a slide that ended a little beside its tangent point would begin anew at once (210 events, not 126)."""
    case = load_case(Path(__file__).parents[1] / "cases" / "fig8.yaml")
    (reading,) = [r for r in case.readings if r.name == "listing_limit"]
    found = HENON_SOLVER.prepare(reading.problem, rtol=rtol)()
    exact = HENON_SOLVER.prepare(reading.problem, rtol=1e-13)()
    assert kinds(found) == kinds(exact)
    assert max(abs(a.time - b.time) for a, b in zip(found.transitions, exact.transitions, strict=True)) < rtol


def test_rotating_crossing_of_a_circle() -> None:
    rows = ["a*(1) + s*2*pi*b", "b - s*2*pi*a"]
    result = run(make_problem("a b", rows, {"s": "a**2 + b**2 - 1"}, ["exp(-1)", 0], 2))
    assert kinds(result) == ["crossing"]
    assert result.transitions[0].time == pytest.approx(1.0, rel=1e-15)


def test_relay_feedback_releases_at_lamberts_time() -> None:
    field = ["-(2*w*z + 1)*a + b - s", "-(2*w*z + w**2)*a + c + 2*s", "-w**2*a - s"]
    field = [f.replace("w", "25").replace("z", "(1/20)") for f in field]
    result = run(make_problem("a b c", field, {"s": "a"}, [0, "-1/1000", "-1/50"], 20))
    assert result.transitions[0].time == pytest.approx(2.812403376023301, rel=4e-16)
    assert kinds(result)[:6] == ["release", "stick"] * 3


def test_stribeck_belt_periods() -> None:
    field = ["v", "-x - s/(1 + 3*s*(v - 1/5))"]
    result = run(make_problem("x v", field, {"s": "v - 1/5"}, [1, "1/5"], 120))
    assert kinds(result)[:4] == ["stick", "release", "stick", "release"]
    durations = np.diff(times(result))
    np.testing.assert_allclose(durations[0::2], 7.705031769350, atol=1e-12)
    np.testing.assert_allclose(durations[1::2], 4.295999525480, atol=1e-12)


def test_non_stop_forced_coulomb_turns_at_multiples_of_pi_over_w() -> None:
    w, p, f = 2.0, 1.0, 0.2
    v = 1 / (1 - w**2)
    u = math.tan(math.pi / (2 * w)) / w
    x0 = math.sqrt(v**2 * p**2 - f**2 * u**2)
    phase = math.atan2(-f * u / (v * p), x0 / (v * p))
    assert x0 == pytest.approx(0.317979733805649, rel=1e-14)
    field = ["y", f"-x + cos(2*t + {phase!r}) - s/5"]
    result = run(make_problem("x y", field, {"s": "y"}, [repr(x0), 0], 20))
    assert set(kinds(result)) == {"crossing"}
    np.testing.assert_allclose(times(result), math.pi / w * np.arange(1, 13), atol=2e-14)


def test_twisting_accumulates_and_ends_with_a_clear_word() -> None:
    result = run(make_problem("a b", ["b", "-2*s - u"], {"s": "a", "u": "b"}, [0, "3/2"], 5))
    assert result.status == "failed"
    assert "accumulate" in result.reason
    assert result.end_time == pytest.approx(3.2320508075688776, rel=4e-16)
    assert len(result.transitions) > 50


def test_three_blocks_of_stewart_stick_one_after_another() -> None:
    field = ["v1", "v2", "v3", "-2*q1+q2-v1-3*s/10", "q1-2*q2+q3-v2-3*u/10", "q2-q3-v3-3*c/10"]
    surfaces = {"s": "v1", "u": "v2", "c": "v3"}
    result = run(make_problem("q1 q2 q3 v1 v2 v3", field, surfaces, [-1, 1, -1, -1, 1, 1], 12))
    assert result.status == "ok"
    assert kinds(result) == ["crossing"] * 5 + ["stick"] * 3
    assert result.end_mode == (0, 0, 0)


def test_a_future_that_is_not_unique_is_said_so_and_a_given_mode_settles_it() -> None:
    result = run(make_problem("x", ["s"], {"s": "x"}, [0], 3))
    assert result.status == "nonunique"
    assert run(make_problem("x", ["s"], {"s": "x"}, [0], 3, mode={0: -1})).end_state == (-3.0,)


def test_blow_up_in_finite_time_is_diverged_with_its_time() -> None:
    result = run(make_problem("x", ["x**2"], {"s": "x - 10"}, [1], 2))
    assert result.status == "diverged"
    assert result.end_time == pytest.approx(1.0, rel=1e-14)
    assert result.transitions[0].time == pytest.approx(0.9, rel=1e-15)


@pytest.mark.parametrize(
    ("field", "surface", "words"),
    [
        (["1", "0"], "exp(exp(x)) - 1/2", "the surface of s is not finite there"),
        (["1", "0"], "sqrt(1 - x) + 1", "the surface of s is singular there"),
        (["1", "sqrt(1 - x)"], "x + 1", "the field of y is "),
    ],
)
def test_a_run_that_stalls_says_what_is_not_finite(field: list[str], surface: str, words: str) -> None:
    result = run(make_problem("x y", field, {"s": surface}, [0, 0], 10))
    assert result.status == "failed"
    assert words in result.reason


def test_a_model_that_ends_is_invalid() -> None:
    result = run(make_problem("x", ["1"], {"s": "x - 2"}, [0], 3, valid=["1 - x"]))
    assert result.status == "invalid"
    assert result.end_time == 1.0


@pytest.mark.parametrize("start", [10**9, -(10**9)])
def test_late_times_lose_no_digits(start: int) -> None:
    problem = make_problem("x v", ["v", "-x - 3*s/5"], {"s": "v"}, ["53/10", 0], start + 20, start=start)
    result = run(problem)
    shifted = [(q.time - start) + q.time_low for q in result.transitions]
    np.testing.assert_allclose(shifted, math.pi * np.arange(1, 5), rtol=1e-15)


@pytest.mark.parametrize("length", [-9, 0, 9])
@pytest.mark.parametrize("unit", [-9, 0, 9])
def test_units_do_not_matter(length: int, unit: int) -> None:
    """x in units of 10^length, t in units of 10^unit: the same digits."""
    a, b = f"10**({length})", f"10**({unit})"
    field = ["v", f"-x/({b})**2 - 3*s*({a})/({b})**2/5"]
    problem = make_problem("x v", field, {"s": "v"}, [f"53*({a})/10", 0], f"20*({b})")
    scaled = times(run(problem)) / 10.0**unit
    np.testing.assert_allclose(scaled, math.pi * np.arange(1, 5), rtol=1e-15)


@pytest.mark.parametrize("exponent", range(1, 15))
def test_two_roots_in_one_step_are_both_found(exponent: int) -> None:
    gap = 10.0**-exponent
    result = run(make_problem("x v", ["v", "2"], {"s": "x"}, [f"1 - 10**(-{2 * exponent})/4", -2], 3))
    assert kinds(result) == ["crossing", "crossing"]
    offsets = np.array([(q.time - 1) + q.time_low for q in result.transitions])
    np.testing.assert_allclose(offsets, [-gap / 2, gap / 2], atol=min(1e-15 / gap, 1e-3 * gap))


def test_an_exact_touch_is_a_graze_and_a_miss_by_a_hair_is_nothing() -> None:
    assert kinds(run(make_problem("x v", ["v", "2"], {"s": "x"}, [1, -2], 3))) == ["graze"]
    assert kinds(run(make_problem("x v", ["v", "2"], {"s": "x"}, ["1 + 10**(-28)", -2], 3))) == []


def test_samples_lie_on_the_trajectory() -> None:
    problem = make_problem("x v", ["v", "-x - 3*s/5"], {"s": "v"}, ["53/10", 0], 20)
    wanted = np.linspace(0, 3, 50)
    result = run(problem, sample_times=wanted)
    np.testing.assert_allclose(result.samples[:, 0], 0.6 + 4.7 * np.cos(wanted), rtol=0, atol=1e-14)


@pytest.mark.parametrize("gap", ["10**(-10)", "-10**(-16)", "0"])
def test_samples_before_an_event_that_takes_a_closer_look_are_of_their_own_time(gap: str) -> None:
    problem = make_problem("x v", ["v", "-x"], {"s": f"1 - {gap} - x"}, [0, 1], 3)
    wanted = np.linspace(0, 3, 50)
    result = run(problem, sample_times=wanted)
    np.testing.assert_allclose(result.samples[:, 0], np.sin(wanted), rtol=0, atol=1e-14)


def test_error_follows_the_tolerance() -> None:
    problem = make_problem("x v", ["v", "-x - 3*s/5"], {"s": "v"}, ["53/10", 0], 20)
    errors = [np.abs(times(run(problem, rtol=r)) - math.pi * np.arange(1, 5)).max() for r in (1e-4, 1e-8, 1e-12)]
    assert errors[0] < 1e-3
    assert errors[1] < 1e-7
    assert errors[2] < 1e-11


@pytest.mark.parametrize(
    ("drive", "release"),
    [
        ("2*exp(-((t - 10)/w)**2)", 10 - 1e-4 * math.sqrt(math.log(2))),  # -1e10 at the start
        ("exp(20*t**2 - 2000)", 10.0),  # the argument stands still where the run begins
        ("exp(-20*(t - 4)**2*(t - 14)**2 + 7000*(t - 9))", None),  # and once more on the way, asleep
        ("(1 + tanh(1000*(t - 9)))*51/100", 9 + math.atanh(49 / 51) / 1000),
    ],
)
@pytest.mark.parametrize("rtol", [1e-6, 1e-12])
def test_a_drive_that_sleeps_is_waited_for_in_few_steps(drive: str, release: float | None, rtol: float) -> None:
    """Zero to the last digit, with all its derivatives, until it wakes: its argument tells when."""
    drive = drive.replace("w", "(1/10000)")
    result = run(make_problem("x", [f"{drive} - s"], {"s": "x"}, [0], "21/2"), rtol=rtol)
    assert result.transitions[0].kind == "release"
    if release is None:
        release = brentq(lambda t: -20 * (t - 4) ** 2 * (t - 14) ** 2 + 7000 * (t - 9), 9.5, 10.5, xtol=1e-14)
    assert result.transitions[0].time == pytest.approx(release, rel=1e-14)
    assert result.counts.steps < 2000


@pytest.mark.parametrize("power", [3, 4, 8])
@pytest.mark.parametrize("rtol", [1e-2, 1e-6, 1e-12])
def test_a_drive_whose_argument_is_flat_at_the_start_is_not_slept_through(power: int, rtol: float) -> None:
    """No derivative up to the power tells of the pulse at t = 10: looking back from a step's end does."""
    drive = f"2*exp(-((t**{power} - 10**{power})/10**{power - 2})**2)"
    result = run(make_problem("x", [f"{drive} - s"], {"s": "x"}, [0], 20), rtol=rtol)
    assert kinds(result) == ["release", "stick"]
    release = (10.0**power - 10.0 ** (power - 2) * math.sqrt(math.log(2))) ** (1 / power)
    assert result.transitions[0].time == pytest.approx(release, rel=1e-13)
    assert result.counts.steps < 1000


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12, 1e-15])
@pytest.mark.parametrize("near", [100, 1000, 10000])
def test_a_first_step_from_beside_a_branch_point_ends(near: int, rtol: float) -> None:
    """exp(-sqrt(e + t^2)): coefficients are 1e30 in units of the horizon, and none in those of the step they allow."""
    result = run(make_problem("y", [f"exp(-sqrt(1/{near} + t**2))"], {"s": "y - 1/2"}, [0], 3), rtol)
    exact = run(make_problem("y", [f"exp(-sqrt(1/{near} + t**2))"], {"s": "y - 1/2"}, [0], 3), 1e-14)
    assert kinds(result) == ["crossing"]
    assert times(result) == pytest.approx(times(exact), rel=max(10 * rtol, 1e-13))
    assert result.counts.rhs_evaluations < 100


@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10, 1e-14])
def test_a_high_power_is_not_leapt_over(rtol: float) -> None:
    """x' = t^30 from t = -3 through where it is flat: on the far side terms grow after those a step is judged by."""
    result = run(make_problem("x", ["t**30"], {"s": "x - 39*10**12"}, [0], "7/2", start=-3), rtol)
    assert kinds(result) == ["crossing"]
    assert times(result)[0] == pytest.approx((31 * 39e12 - 3**31) ** (1 / 31), rel=max(rtol, 1e-14))


@pytest.mark.parametrize("power", [11, 21, 41])
@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-7, 1e-9])
def test_soft_walls_of_a_high_power_keep_the_energy(power: int, rtol: float) -> None:
    """v^2/2 + x^(p + 1)/(p + 1) is constant; between the walls all terms vanish but those of order p and 2 p + 1."""
    result = run(make_problem("x v", ["v", f"-x**{power}"], {"s": "x - 9/10"}, [1, 0], 50), rtol)
    x, v = result.end_state
    assert result.status == "ok"
    assert abs(0.5 * v * v * (power + 1) + x ** (power + 1) - 1) < 30 * rtol


TOLERANCES = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12, 1e-14]


@pytest.mark.parametrize("steep", [10**8, 10**12])
@pytest.mark.parametrize("rtol", TOLERANCES)
def test_a_pulse_far_below_the_tolerance_where_a_step_begins_is_found(steep: int, rtol: float) -> None:
    """Seen from t = 0 a guard's terms are 1e-9 or less of its size, but they grow: the poles are near t = 3."""
    result = run(make_problem("x", ["s"], {"s": f"1/(1 + {steep}*(t - 3)**2) - 1/2"}, [0], 6), rtol)
    exact = [3 - steep**-0.5, 3 + steep**-0.5]
    assert times(result) == pytest.approx(exact, rel=max(1e-6 * rtol, 1e-14))
    assert result.counts.rhs_evaluations < 200


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_a_jump_of_the_field_that_terms_hardly_tell_of_is_not_leapt_over(rtol: float) -> None:
    """Terms of atan's integral fall like 1/k^2 up to its branch points and are below the tolerance from t = 0."""
    jump = "1 + atan(10000*(t - 3)) - s/5"
    result = run(make_problem("x", [jump], {"s": "x - 1"}, [0], 6), rtol)

    def integral(u: float) -> float:
        return u * math.atan(1e4 * u) - 0.5e-4 * math.log1p(1e8 * u * u)

    exact = brentq(lambda t: 1.2 * t + integral(t - 3) - integral(-3) - 1, 3.2, 6, xtol=1e-15)
    assert times(result) == pytest.approx([exact], rel=max(rtol, 1e-14))


@pytest.mark.parametrize(
    ("valid", "status", "end"),
    [
        ("t", "ok", 2),
        ("t**2", "ok", 2),
        ("t**2*(1 - t)", "invalid", 1),
        ("-t", "invalid", 0),
        ("-t**2", "invalid", 0),
        ("x - t", "invalid", 0),
    ],
)
def test_a_model_whose_edge_the_start_is_on_holds_if_its_expression_rises(valid: str, status: str, end: float) -> None:
    problem = make_problem("x", ["1"], {"s": "x + 5"}, [0], 2, valid=[valid])
    truth = simulate(problem, 128)
    assert (truth.status, float(truth.end_time)) == (status, end)
    for solver in (HENON_SOLVER, DOP853):
        result = run(problem, 1e-9, solver)
        assert (result.status, result.end_time) == (status, pytest.approx(end, abs=1e-12))


@pytest.mark.parametrize(
    ("states", "field", "surface", "start", "words"),
    [
        ("x", ["-x"], "x", [0], "the field does not depend on the sign of a surface it should slide on"),
        ("x v", ["v", "-x - s"], "(v - 1/5)**3", [2, 0], "the surface of s has a repeated factor"),
    ],
)
def test_where_no_mode_is_consistent_the_surface_s_part_in_it_is_told(states, field, surface, start, words) -> None:
    problem = make_problem(states, field, {"s": surface}, start, 20)
    truth, result = simulate(problem, 128), run(problem)
    assert truth.status == "failed"
    assert result.status in ("failed", "nonunique")  # rounding decides which, where the gradient vanishes
    assert words in truth.reason
    assert words in result.reason


def test_a_model_without_a_series_where_it_begins_has_failed() -> None:
    result = run(make_problem("x", ["1"], {"s": "x + 5"}, [0], 2, valid=["sqrt(x)"]))
    assert result.status == "failed"


@pytest.mark.parametrize(
    "surface",
    ["(exp(x - 1) - 1)**3", "x - 1 - sin(x - 1)", "sin(x - 1)*(1 - cos(x - 1))", "tanh(x - 1)**5"],
)
@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12, 1e-15])
@pytest.mark.parametrize("field", ["1", "2 + s"])
def test_a_run_goes_on_behind_a_root_of_odd_order_of_any_function(surface: str, rtol: float, field: str) -> None:
    """Its size tells nothing of a guard whose first coefficients are known to be zero: the step must not shrink."""
    result = run(make_problem("x", [field], {"s": surface}, [0], "3/2"), rtol)
    first = result.transitions[0]
    assert (result.status, first.kind, first.state[0]) == ("ok", "crossing", pytest.approx(1, abs=1e-10))
    assert result.counts.steps < 40


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12, 1e-15])
@pytest.mark.parametrize(
    ("surface", "kind", "root"),
    [
        ("(x - 11/10)*(x - 8/5)**2*exp(x/3)", "graze", 1.6),
        ("-(x - 1/10)*(x - 7/5)**3", "crossing", 1.4),
        ("-(x - 1/10)*(x - 7/5)**3*exp(x/3)", "crossing", 1.4),
        ("(x - 1/10)**3*(x - 7/5)**2", "graze", 1.4),
        ("(1/10 - x)**3*(x - 7/5)**3*exp(x/3)", "crossing", 1.4),
    ],
)
def test_multiple_roots_behind_a_crossing_stay_where_they_are(
    surface: str, kind: str, root: float, rtol: float
) -> None:
    """The state at a crossing is beside the surface by its rounding: a root of that, were it not divided out."""
    result = run(make_problem("x", ["1"], {"s": surface}, [0], 3), rtol)
    assert kinds(result) == ["crossing", kind]
    assert times(result)[1] == pytest.approx(root, rel=1e-15)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-14])
@pytest.mark.parametrize("surface", ["(x - 9/10)**2*(x - 23/10)**3", "-(x - 9/10)**2*(x - 14/10)**2*(x - 23/10)"])
def test_multiple_roots_behind_a_touch_stay_where_they_are(surface: str, rtol: float) -> None:
    result = run(make_problem("x", ["1"], {"s": surface}, [0], 3), rtol)
    assert kinds(result) == ["graze"] * (len(result.transitions) - 1) + ["crossing"]
    assert times(result)[0] == pytest.approx(0.9, rel=1e-15)
    assert times(result)[-1] == pytest.approx(2.3, rel=1e-15)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-14])
@pytest.mark.parametrize("apart", [10**6, 10**8, 3 * 10**8])
def test_a_cluster_below_rounding_is_taken_apart(apart: int, rtol: float) -> None:
    """A crossing next to a triple one: all that a double sees between them is noise, of either sign."""
    surface = f"-(x - 6/5)*(x - 2)*(x - 2 - 1/{apart})**3*(2 + x**2)"
    result = run(make_problem("x", ["1"], {"s": surface}, [0], "69/21"), rtol)
    assert kinds(result) == ["crossing"] * 3
    assert times(result) == pytest.approx([1.2, 2, 2 + 1 / apart], rel=max(1e-2 * rtol, 1e-14))


@pytest.mark.parametrize("valid", ["(t - 1)**2", "(t - 1)**4"])
def test_a_model_ends_where_it_only_just_does(valid: str) -> None:
    result = run(make_problem("x", ["1"], {"s": "x - 5"}, [0], 3, valid=[valid]))
    assert result.status == "invalid"
    assert result.end_time == 1.0
