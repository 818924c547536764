"""Taylor series whose last two coefficients do not bound later ones: gaps at symmetric states, forcings that set in."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
import sympy as sp
from scipy.special import ellipk

import henon_ref as hr
from henon_ref.harness.studies.price.chains import chain

QUARTER = float(ellipk(0.5))
"""Quarter of the period of a pendulum that is released at a right angle; of x'' = -x^3 from (1, 0) it is this, too."""
TOLERANCES = pytest.mark.parametrize("rtol", [10.0**-k for k in range(3, 16)])


def close(rtol: float) -> float:
    return 1e3 * rtol + 1e-11


@TOLERANCES
@pytest.mark.parametrize(("angle", "sign"), [("pi/2", 1), ("-3*pi/2", 1), ("3*pi/2", -1)])
def test_a_pendulum_released_at_a_right_angle(angle: str, sign: int, rtol: float) -> None:
    """Every fourth coefficient is not zero, and the others are rounding."""
    system = hr.System(["x", "v"], {}, {}, ["v", "-sin(x)"])
    run = hr.simulate(system, {"x": angle, "v": 0}, until=3 * QUARTER, rtol=rtol)
    start = run.y[0, 0]
    lowest = round(start / math.pi - 0.5 * sign) * math.pi
    assert run.y[:, -1] == pytest.approx([lowest, sign * math.sqrt(2)], abs=close(rtol))


@TOLERANCES
def test_a_pendulum_released_at_a_right_angle_by_an_event(rtol: float) -> None:
    fields = ["v*(1 + s)/2", "-sin(x)*(1 + s)/2"]
    system = hr.System(["x", "v"], {}, {"s": "t - 1"}, fields)
    run = hr.simulate(system, {"x": "pi/2", "v": 0}, until=1 + 4 * QUARTER, rtol=rtol)
    assert run.y[:, -1] == pytest.approx([math.pi / 2, 0], abs=close(rtol))


@TOLERANCES
@pytest.mark.parametrize("power", [3, 5, 9])
def test_a_spring_without_linear_part(power: int, rtol: float) -> None:
    """x'' = -x^n from (0, 1): one coefficient of n + 1 is not zero. A quarter of the period by the beta function."""
    system = hr.System(["x", "v"], {}, {}, ["v", f"-x^{power}"])
    height = ((power + 1) / 2) ** (1 / (power + 1))
    quarter = height * float(mpmath.beta(1 / mpmath.mpf(power + 1), 0.5)) / (power + 1)
    run = hr.simulate(system, {"x": 0, "v": 1}, until=2 * quarter, rtol=rtol)
    assert run.y[:, -1] == pytest.approx([0, -1], abs=close(rtol))


@TOLERANCES
@pytest.mark.parametrize("power", range(2, 8))
def test_a_forcing_whose_series_begins_with_a_high_power(power: int, rtol: float) -> None:
    """Beside an oscillator, whose own last terms say nothing of the other rows."""
    system = hr.System(["x", "v", "y", "z"], {}, {}, ["v", "-x", f"cos(t^{power})", f"sin(t^{power})"])
    run = hr.simulate(system, {"x": 1, "v": 0, "y": 0, "z": 0}, until=2, rtol=rtol)
    exact = mpmath.quad(lambda t: mpmath.expj(t**power), mpmath.linspace(0, 2, 40))
    exact = [float(exact.real), float(exact.imag)]
    assert run.y[:, -1] == pytest.approx([math.cos(2), -math.sin(2), *exact], abs=close(rtol))


def quadrature(field: str, from_: float, until: float) -> float:
    """Integral of a field in t over an interval that begins in [-2, 0], to 1e-15."""
    function = sp.lambdify("t", field.replace("^", "**"), "mpmath")
    places = mpmath.linspace(from_, min(until, 2), 40)
    if until > 2:
        places += mpmath.linspace(2, until, 20)[1:]
    return float(mpmath.quad(function, places))


@TOLERANCES
@pytest.mark.parametrize(
    "field",
    ["1 - cos(t)", "1 - cos(t^2)", "log(1 + t^3)", "exp(t) - 1 - t - t^2/2", "sqrt(1 + t^2) - 1", "1 - sqrt(1 + t^4)"],
)
def test_a_state_that_leaves_zero_by_a_power_of_time(field: str, rtol: float) -> None:
    """Its first three terms are zero at the start, where it has no other size than that of its later terms."""
    run = hr.simulate(hr.System(["y"], {}, {}, [field]), {"y": 0}, until=2, rtol=rtol, max_steps=100)
    assert run.success
    assert run.y[0, -1] == pytest.approx(quadrature(field, 0, 2), rel=20 * rtol + 1e-13)


@TOLERANCES
@pytest.mark.parametrize("start", [0, 1e-100])
@pytest.mark.parametrize("field", ["1 - 1/(1 + t^2)", "t - sin(t)"])
def test_rounding_of_operations_on_time_is_no_hidden_term(field: str, start: float, rtol: float) -> None:
    """Next to t = 0 most digits of the slope cancel, whatever the state."""
    run = hr.simulate(hr.System(["y"], {}, {}, [field]), {"y": start}, until=2, rtol=rtol, max_steps=200)
    assert run.success
    assert run.y[0, -1] == pytest.approx(quadrature(field, 0, 2), rel=20 * rtol + 1e-13)


RAMPS = ["tanh(t^{})", "1 - exp(-t^{})", "cos(t^{})", "1/(1 + t^{})"]
"""Forcings that set in at t = 0 by a power of t."""


def linear_response(rate: complex, forcing: str) -> complex:
    """Integral of exp(rate (1.5 - t)) forcing over [0, 1.5]."""
    function = sp.lambdify("t", forcing.replace("^", "**"), "mpmath")
    return complex(mpmath.quad(lambda t: mpmath.exp(rate * (1.5 - t)) * function(t), mpmath.linspace(0, 1.5, 30)))


@pytest.mark.parametrize("rate", [0.5, -0.5])
@pytest.mark.parametrize("ramp", RAMPS)
@pytest.mark.parametrize("power", [3, 4, 5, 7, 9, 14])
def test_a_forcing_behind_a_series_that_decreases(power: int, ramp: str, rate: float) -> None:
    """The terms of exp(rate t) decrease; behind the last ones are those of the forcing."""
    forcing = ramp.format(power)
    exact = math.exp(1.5 * rate) + linear_response(rate, forcing).real
    system = hr.System(["x"], {}, {}, [f"{forcing} + ({rate})*x"])
    for k in range(3, 16):
        run = hr.simulate(system, {"x": 1}, until=1.5, rtol=10.0**-k)
        assert run.y[0, -1] == pytest.approx(exact, abs=50 * 10.0**-k + 1e-13), k


@pytest.mark.parametrize("ramp", RAMPS)
@pytest.mark.parametrize("power", [3, 4, 7, 14])
def test_a_forced_oscillator(power: int, ramp: str) -> None:
    forcing = ramp.format(power)
    response = linear_response(1j, forcing)  # (v + ix)' = i (v + ix) + forcing
    system = hr.System(["x", "v"], {}, {}, ["v", f"{forcing} - x"])
    for k in range(3, 16):
        run = hr.simulate(system, {"x": 2, "v": 0}, until=1.5, rtol=10.0**-k)
        exact = 2 * math.cos(1.5) + response.imag, -2 * math.sin(1.5) + response.real
        assert run.y[:, -1] == pytest.approx(exact, abs=50 * 10.0**-k + 1e-13), k


@pytest.mark.parametrize(
    ("ramp", "power"), [(r, p) for r in RAMPS for p in (2, 3, 4, 7, 8, 14, 17, 21, 30) if p < 15 or "cos" not in r]
)
def test_an_oscillator_in_equilibrium_up_to_a_power_of_time(ramp: str, power: int) -> None:
    """The velocity begins at exactly zero, as do its first derivatives; a size of its own comes with the forcing."""
    forcing = ramp.format(power)
    response, start = linear_response(1j, forcing), 1 if ramp in RAMPS[2:] else 0
    exact = start * math.cos(1.5) + response.imag, -start * math.sin(1.5) + response.real
    system = hr.System(["x", "v"], {}, {}, ["v", f"{forcing} - x"])
    for k in range(2, 16):
        run = hr.simulate(system, {"x": start, "v": 0}, until=1.5, rtol=10.0**-k)
        assert run.y[:, -1] == pytest.approx(exact, abs=50 * 10.0**-k + 1e-13), k
        assert run.counts.steps < 30 + 20 * power or "cos" in ramp, k


@TOLERANCES
@pytest.mark.parametrize("size", ["1e-110", "1e-150", "1e-280"])
def test_the_size_of_a_state_that_leaves_zero_changes_no_step(size: str, rtol: float) -> None:
    """Beside an oscillator; relative to the smallest size that is distinguished from zero it is not always large."""
    system = hr.System(["x", "v", "y"], {"a": 1}, {}, ["v", "-x", "a*(1 - exp(-t^5))*v"])
    run, other = (hr.simulate(system, [1, 0, 0], until=3, rtol=rtol, parameters={"a": a}) for a in (1, size))
    assert run.counts == other.counts
    assert other.y[2, -1] / float(size) == pytest.approx(run.y[2, -1], rel=1e-14)


@TOLERANCES
@pytest.mark.parametrize("start", [1e-60, 1e-130, 1e-250])
def test_rounding_that_grows_over_a_step_is_no_hidden_term(start: float, rtol: float) -> None:
    """The error of t - sin(t), as large as its value, grows with t; a step from near 0 leads to 1e3 times t."""
    system = hr.System(["x", "v"], {}, {}, ["v", "t - sin(t) - x"])
    run = hr.simulate(system, [start, start], until=1.5, rtol=rtol)
    exact = 1.5 + 0.75 * math.cos(1.5) - 1.5 * math.sin(1.5)
    assert run.y[0, -1] == pytest.approx(exact, rel=20 * rtol + 1e-12)
    assert run.counts.rhs_evaluations < 150


@TOLERANCES
def test_a_state_whose_prediction_beyond_its_radius_is_large(rtol: float) -> None:
    """y leaves zero by t^6; at the end of the first step that is tried its polynomial is 1e4 times as large."""
    exact = quadrature("-2*exp(t - 5/2)*sin(t^3)*sin(t^2)", 0, 2) + quadrature(
        "-2*exp(t - 5/2)*sin(t^3)*sin(t^2)", 2, 2.5
    )
    system = hr.System(["y"], {}, {}, ["-2*sin(t^3)*sin(t^2) - y"])
    run = hr.simulate(system, {"y": 0}, until=2.5, rtol=rtol)
    assert run.y[0, -1] == pytest.approx(exact, rel=20 * rtol + 1e-12)


@TOLERANCES
def test_slopes_below_the_rounding_of_their_operations_next_to_a_root(rtol: float) -> None:
    """1 + x^2 is rounded to 1 where the run begins; x grows by a power of time."""
    fields = ["2*log(1 + y^2)", "-2*z^2/(1 + z^2)", "2*sqrt(1 + t^6) - 1 - z"]
    run = hr.simulate(hr.System(["x", "y", "z"], {}, {}, fields), [0, 0, 0], until=2.5, rtol=rtol)
    close_by = hr.simulate(hr.System(["x", "y", "z"], {}, {}, fields), [0, 0, 0], until=2.5, rtol=1e-15)
    assert run.y[:, -1] == pytest.approx(close_by.y[:, -1], rel=20 * rtol + 1e-11)
    assert run.counts.rhs_evaluations < 400


@pytest.mark.parametrize("masses", [4, 8, 12, 16])
@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-8, 1e-12])
def test_a_wave_that_enters_a_chain_at_rest(masses: int, rtol: float) -> None:
    """The mass k leaves zero by the power 2 k of time, higher than the order from some mass on."""
    x = [f"x{k}" for k in range(masses)]
    forces = [f"sin({x[max(k - 1, 0)]} - {x[k]}) + sin({x[min(k + 1, masses - 1)]} - {x[k]})" for k in range(masses)]
    system = hr.System([*x, *(f"v{k}" for k in range(masses))], {}, {}, [*(f"v{k}" for k in range(masses)), *forces])
    start = np.eye(2 * masses)[0]
    run = hr.simulate(system, start, until=2, rtol=rtol)
    x_end, v_end = run.y[:masses, -1], run.y[masses:, -1]
    energy = v_end @ v_end / 2 + np.sum(1 - np.cos(np.diff(x_end)))
    assert energy == pytest.approx(1 - math.cos(1), abs=20 * rtol + 1e-14)
    assert v_end.sum() == pytest.approx(0, abs=20 * rtol + 1e-14)
    far = hr.simulate(system, start, until=2, rtol=1e-15).y[:, -1]
    assert run.y[:, -1] == pytest.approx(far, rel=300 * rtol + 1e-12)
    assert run.counts.rhs_evaluations < 150


@TOLERANCES
@pytest.mark.parametrize("power", [4, 7, 9, 14, 25])
def test_a_guard_behind_a_series_that_decreases(power: int, rtol: float) -> None:
    """The field is linear; the guard alone has terms behind those of the exponential function."""
    system = hr.System(["x"], {}, {"h": f"x - tanh(t^{power})"}, ["-x/2"])
    crossing = mpmath.findroot(lambda t: mpmath.exp(-t / 2) - mpmath.tanh(t**power), (0.5, 1.5), solver="anderson")
    run = hr.simulate(system, {"x": 1}, until=3, rtol=rtol)
    assert run.transitions["time_s"].tolist() == pytest.approx([float(crossing)], abs=20 * rtol + 1e-11)


@TOLERANCES
@pytest.mark.parametrize("near", ["1/10^16", "1/10^9", "1/1000"])
@pytest.mark.parametrize("field", ["1/(1 + x^6)", "1 + x^5", "cos(x^4)", "sqrt(1 + x^8)"])
def test_a_start_near_a_symmetric_state(field: str, near: str, rtol: float) -> None:
    """The terms in a gap are not zero, and proportional to the distance. The time passed is the integral of 1/x'."""
    run = hr.simulate(hr.System(["x"], {}, {}, [field]), {"x": near}, until=1, rtol=rtol)
    passed = quadrature(f"1/({field})".replace("x", "t"), run.y[0, 0], run.y[0, -1])
    assert passed == pytest.approx(1, abs=50 * rtol + 5e-12)


@TOLERANCES
@pytest.mark.parametrize("angle", [1.5708, 1.571, 1.57, 1.6])
def test_a_pendulum_released_near_a_right_angle(angle: float, rtol: float) -> None:
    run = hr.simulate(hr.System(["x", "v"], {}, {}, ["v", "-sin(x)"]), {"x": angle, "v": 0}, until=5, rtol=rtol)
    x, v = run.y
    assert v**2 / 2 - np.cos(x) == pytest.approx(-math.cos(angle), abs=50 * rtol + 5e-12)


@pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-6, 1e-10, 1e-12])
@pytest.mark.parametrize("field", ["1/(1 + t^6)", "cos(t^3)", "sin(t^4)", "log(2 + t^6)", "sqrt(1 + t^8)"])
def test_steps_that_begin_near_a_symmetric_state(field: str, rtol: float) -> None:
    """Steps from many starts, some of which begin near t = 0."""
    system = hr.System(["x"], {}, {}, [field])
    after = quadrature(field, 0, 1.5)
    for k in range(40):
        start = -2 + k / 40
        run = hr.simulate(system, {"x": 1}, start=start, until=1.5, rtol=rtol, dense_output=False)
        assert run.y[0, -1] == pytest.approx(1 + after + quadrature(field, start, 0), abs=20 * rtol + 1e-13)


@TOLERANCES
@pytest.mark.parametrize("power", [8, 12, 16, 24, 40])
def test_a_series_that_is_linear_up_to_its_order(power: int, rtol: float) -> None:
    """The first term after the slope is of an order that the expansion may not reach; the sine limits the step."""
    system = hr.System(["x", "y"], {}, {}, [f"log(2 + 7*x^{power})", "sin(t)"])
    run = hr.simulate(system, {"x": 0, "y": 0}, until=2, rtol=rtol)
    passed = quadrature(f"1/log(2 + 7*t^{power})", 0, run.y[0, -1])
    assert passed == pytest.approx(2, abs=50 * rtol + 5e-12)


@TOLERANCES
def test_a_symmetric_state_after_an_event_in_a_mode_with_long_steps(rtol: float) -> None:
    """A reset leads to tau = 0; the last step in this mode was many times as long."""
    fields = ["1", "1/(1 + tau^8)", "exp(-tau)"]
    resets = {"s": {"when": "falling", "map": {"tau": "0"}}}
    system = hr.System(["tau", "y", "z"], {}, {"s": "40 - tau"}, fields, resets=resets)
    run = hr.simulate(system, {"tau": 25, "y": 0, "z": 0}, until=16.5, rtol=rtol)
    parts = ((25, 30, 40), (0, 0.5, 1, 1.5))
    exact = sum(mpmath.quad(lambda tau: 1 / (1 + tau**8), part) for part in parts)
    assert run.y[1, -1] == pytest.approx(float(exact), abs=close(rtol))


@TOLERANCES
def test_a_cycle_of_integrals(rtol: float) -> None:
    """The fourth derivative of x is x: every fourth coefficient is not zero, and each rate is another state."""
    system = hr.System(["x", "v", "a", "j"], {}, {}, ["v", "a", "j", "x"])
    run = hr.simulate(system, {"x": 1, "v": 0, "a": 0, "j": 0}, until=4, rtol=rtol)
    exact = (math.cosh(4) + math.cos(4)) / 2, (math.sinh(4) - math.sin(4)) / 2
    assert run.y[:2, -1] == pytest.approx(exact, rel=close(rtol))


def test_series_that_converge_fast_have_no_gaps() -> None:
    """The steps of a chain are short for its slow blocks: their terms fall by more than a thousand somewhere."""
    system = chain(16, 0.5)
    x, v = np.random.default_rng(16).uniform(-1, 1, (2, 16))
    run = hr.simulate(system, np.column_stack([2 * x, v]).ravel().tolist(), until=20, rtol=1e-9)
    assert run.counts.rhs_evaluations < 2.3 * run.counts.steps  # after an event one is of slopes alone
