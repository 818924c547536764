"""Taylor series with gaps, as they begin at symmetric states: the last two coefficients then limit no step."""

from __future__ import annotations

import math

import mpmath
import pytest
from scipy.special import ellipk

import henon_ref as hr

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
