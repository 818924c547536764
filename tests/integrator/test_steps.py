"""How long steps are: none goes past what its terms tell of, and there are few of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from often import daily
from problems import make_problem
from runs import kinds, run, times
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

TOLERANCES = daily([1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12, 1e-14], some=[1e-3, 1e-6, 1e-9, 1e-14])
"""Each has machine code of its own, of its order."""


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


@pytest.mark.parametrize("power", daily([3, 4, 8], some=[8]))
@pytest.mark.parametrize("rtol", daily([1e-2, 1e-6, 1e-12], some=[1e-2, 1e-12]))  # daily: the loosest and the tightest
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


@pytest.mark.parametrize("rtol", TOLERANCES)
@pytest.mark.parametrize("power", [8, 12, 20, 22, 24, 30])
def test_a_high_power_is_not_leapt_over(power: int, rtol: float) -> None:
    """x' = t^p from t = -3 through where it is flat: on the far side terms grow after those a step is judged by."""
    height = (3 ** (power + 1) + 34 ** (power + 1) // 10 ** (power + 1)) // (power + 1)
    result = run(make_problem("x", [f"t**{power}"], {"s": f"x - {height}"}, [0], "7/2", start=-3), rtol)
    assert kinds(result) == ["crossing"]
    exact = ((power + 1) * height - 3 ** (power + 1)) ** (1 / (power + 1))
    assert times(result)[0] == pytest.approx(exact, rel=max(rtol, 1e-14))


@pytest.mark.parametrize("rtol", [1e-9, 1e-12, 1e-14])
def test_terms_of_a_polynomial_do_not_cancel_more_digits_than_there_are_to_spare(rtol: float) -> None:
    """x = (t - 47/7)^14: seen from t = 0 its terms at t = 94/7 are 5e6 times its size."""
    top = (47 / 7) ** 14
    result = run(make_problem("x", ["14*(t - 47/7)^13"], {"s": "x - 10^13"}, ["(47/7)^14"], "94/7"), rtol)
    assert result.end_state[0] == pytest.approx(top, rel=max(rtol, 3e-13))


@pytest.mark.parametrize("rtol", [1e-9, 1e-12])
def test_an_event_whose_terms_cancel_is_looked_at_closer(rtol: float) -> None:
    """x = (t - 32/7)^12 falls from 8e7 to 38/13, and rises to it again: where is known to double precision."""
    result = run(make_problem("x", ["12*(t - 32/7)^11"], {"s": "x - 38/13"}, ["(32/7)^12"], 6), rtol)
    half = (38 / 13) ** (1 / 12)
    assert times(result) == pytest.approx([32 / 7 - half, 32 / 7 + half], abs=1e-14)


def test_what_is_a_polynomial_by_its_form_is_expanded_once() -> None:
    """However much longer than the last a step is; another function is expanded again to see where it leads."""
    polynomial = run(make_problem("x v", ["v", "s - 2"], {"s": "x"}, [1, 0], 1000), 1e-9)
    assert polynomial.counts.rhs_evaluations == polynomial.counts.steps + 1  # and the speeds at its crossing
    decay = run(make_problem("x v", ["v", "s - 2 - v/10^9"], {"s": "x"}, [1, 0], 1000), 1e-9)
    assert decay.counts.rhs_evaluations > decay.counts.steps + 2


@pytest.mark.parametrize("power", [11, 21, 41])
@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-7, 1e-9])
def test_soft_walls_of_a_high_power_keep_the_energy(power: int, rtol: float) -> None:
    """v^2/2 + x^(p + 1)/(p + 1) is constant; between the walls all terms vanish but those of order p and 2 p + 1."""
    result = run(make_problem("x v", ["v", f"-x**{power}"], {"s": "x - 9/10"}, [1, 0], 50), rtol)
    x, v = result.end_state
    assert result.status == "ok"
    assert abs(0.5 * v * v * (power + 1) + x ** (power + 1) - 1) < 30 * rtol


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


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize(
    ("field", "surface", "start", "until", "end", "events"),
    [
        (["1", "sqrt(x^2 - 2*x + 1)"], "z - 3/4", ["0", "0"], 3, 1.0, [1 + math.sqrt(0.5)]),  # a kink
        (["1", "sqrt(1 - cos(x))"], "z - 3", ["-2", "0"], 6, 2.0, [4.3206587791709]),
        (["-sqrt(x)", "0"], "x - 1/4", ["1", "0"], 100, 2.0, [1.0]),  # Torricelli: x = (1 - t/2)^2, and dry then
        (["-sqrt(1 - x^2)", "0"], "x + 1/2", ["0", "0"], 10, math.pi / 2, [math.pi / 6]),
    ],
)
def test_no_step_leads_over_a_branch_point(
    field: list[str], surface: str, start: list[str], until: int, end: float, events: list[float], rtol: float
) -> None:
    """A root's series may be a polynomial, or an entire function, that knows nothing of where it branches.

    A run ends there, or begins anew just behind it and is right; whatever rounding makes of its start.
    """
    for ulps in range(-6, 7):
        shifted = [f"{start[0]} + {ulps}*2^(-52)", start[1]]
        result = run(make_problem("x z", field, {"s": surface}, shifted, until), rtol=rtol)
        expected = events
        if result.status == "failed":
            assert result.end_time == pytest.approx(end, abs=3 * math.sqrt(rtol) + 1e-6), ulps
            expected = [event for event in events if event < end]
        assert times(result) == pytest.approx(expected, abs=10 * rtol), ulps


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize(("field", "end"), [("sqrt(x)", 2 / 3), ("x^(5/2)", 2 / 7)])
def test_a_run_into_a_branch_point_ends_in_few_steps(field: str, end: float, rtol: float) -> None:
    """A step goes half the way that is left, or more: one that is not to be believed is not cut to a quarter."""
    result = run(make_problem("x y", ["-1", field], {"s": "x + 1"}, ["1", "0"], 2), rtol)
    assert result.status == "failed"
    assert "the field of y" in result.reason
    assert result.end_time == pytest.approx(1, abs=rtol)
    assert result.end_state == pytest.approx([0, end], abs=10 * rtol)
    assert result.counts.steps < 70


@pytest.mark.parametrize("rtol", [1e-2, 1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize(
    ("start", "level", "until"),
    [(0, "1", 3), (0, "1", 10), (1, "1", 4), (2, "1e-27", 3), (0, "1e-27", 1), (-2, "1", 3)],
)
def test_a_tank_that_runs_dry_is_dry_in_few_steps(start: int, level: str, until: int, rtol: float) -> None:
    """h' = -sqrt(h): each step's series is a parabola to the last bit, whose far side is never to be believed."""
    result = run(make_problem("h", ["-sqrt(h)"], {"s": "h + 1"}, [level], until, start=start), rtol)
    assert result.status == "failed"
    assert "the field of h is singular" in result.reason
    lasts = 2 * math.sqrt(float(level))
    assert result.end_time == pytest.approx(start + lasts, abs=rtol * lasts + 5e-16 * abs(start))
    assert result.end_state[0] < 1e-20
    assert result.counts.steps < 100


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9, 1e-12])
def test_late_is_no_excuse_to_step_over_a_branch_point(rtol: float) -> None:
    """At t = 1e9 doubles are 1e-7 s apart; a tank that runs dry within 2e-9 s does not fill again all the same."""
    late = make_problem("h", ["-sqrt(h)"], {"s": "h - 1e-18/4"}, ["1e-18"], "10**9 + 10**(-8)", start=10**9)
    result = run(late, rtol)
    assert (result.status, len(result.transitions)) == ("failed", 1)
    event = result.transitions[0]
    assert (event.time - 1e9) + event.time_low == pytest.approx(1e-9, rel=10 * rtol)
    assert result.end_state[0] < 1e-20


@pytest.mark.parametrize("tolerance", [1e-8, 1e-10, 1e-12])
@pytest.mark.parametrize(
    ("fall", "belt", "start"),
    [
        ("sqrt(u**2 + 10**-6)*100", "3/10", [0, "3/10"]),
        ("(u*10**4)**2", "27/125 + 171*cos(1371*t/1000)/500", ["-617/1000", 0]),
    ],
)
def test_rounding_of_a_sliding_velocity_after_a_release_shortens_no_step(
    fall: str, belt: str, start: list[str], tolerance: float
) -> None:
    """It begins as the square of time: on the second step its rounding is large beside it. In the last mode, DOP853."""
    sliding = f"(v - ({belt}))"
    field = "-x + 129*cos(1371*t/1000)/200 - s*79*(3 + 2*exp(-{}))/500".format(fall.replace("u", sliding))
    result = run(make_problem("x v", ["v", field], {"s": sliding}, start, 8), rtol=tolerance)
    release = result.transitions[-1]
    assert (result.status, release.kind) == ("ok", "release")
    rates = eval("lambda t, x, v: " + field, {"s": release.to_mode[0], "cos": np.cos, "exp": np.exp, "sqrt": np.sqrt})
    exact = solve_ivp(
        lambda t, y: [y[1], rates(t, *y)], (release.time, 8), release.state, method="DOP853", rtol=1e-12, atol=1e-14
    )
    assert result.end_state == pytest.approx(exact.y[:, -1], abs=100 * tolerance + 1e-10)
