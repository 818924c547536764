"""Features much narrower than a step, of which the Taylor series at its start have no visible trace.

Their widths are parameters, so that all of them share their machine code.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import sici

import henon_ref as hr

WIDTHS = [1e-2, 1e-4, 1e-6, 1e-8, 1e-10]
TOLERANCES = pytest.mark.parametrize("rtol", [10.0**-k for k in range(3, 14)])


def close(rtol: float) -> float:
    return 50 * rtol + 1e-12


FEATURES: dict[str, Callable[[float], float]] = {
    "1/(1 + ((x - c)/w)^2)": lambda z: 1 / (1 + z**2),
    "atan((x - c)/w)": math.atan,
    "(1 + ((x - c)/w)^2)^(-3/2)": lambda z: (1 + z**2) ** -1.5,
    "(x - c)/w/(1 + ((x - c)/w)^2)": lambda z: z / (1 + z**2),
}


def integral(feature: Callable[[float], float], c: float, w: float, until: float) -> float:
    """Of a feature of cos(t) at c, on pieces whose lengths grow with the distance from it."""
    off = [s * w * 3.0**k for k in range(30) for s in (-1, 1)]
    places = sorted({0.0, until, *(t for t in np.arccos(c) + np.array([0, *off]) if 0 < t < until)})
    pieces = pairwise([*places[:-1], *np.linspace(*places[-2:], 20)[1:]])
    return sum(quad(lambda t: feature((math.cos(t) - c) / w), *piece, epsabs=1e-15)[0] for piece in pieces)


@pytest.mark.parametrize("feature", FEATURES)
def test_an_oscillator_passes_a_feature(feature: str) -> None:
    system = hr.System(["x", "v", "y"], {"c": 0, "w": 1}, {}, ["v", "-x", feature])
    for w in WIDTHS:
        for c in (0.9, 0.3, -0.4):
            exact = integral(FEATURES[feature], c, w, 2.5)
            for k in range(3, 14):
                run = hr.simulate(system, [1, 0, 1], until=2.5, rtol=10.0**-k, parameters={"c": c, "w": w})
                assert run.y[2, -1] == pytest.approx(1 + exact, abs=close(10.0**-k)), (w, c, k)


@TOLERANCES
@pytest.mark.parametrize("w", WIDTHS)
def test_friction_that_rises_next_to_rest(w: float, rtol: float) -> None:
    """v' = -(1 + 1/(1 + (v/w)^2))/2 from v = 1 to 0 takes 2 - b atan(1/b), b = w sqrt(2)."""
    system = hr.System(["v"], {"w": 1}, {"s": "v"}, ["-1/2 - 1/2/(1 + (v/w)^2)"])
    run = hr.simulate(system, [1], until=3, rtol=rtol, parameters={"w": w})
    width = math.sqrt(2) * w
    assert run.transitions["time_s"].tolist() == pytest.approx([2 - width * math.atan(1 / width)], abs=close(rtol))


@TOLERANCES
@pytest.mark.parametrize("w", WIDTHS)
def test_both_roots_of_a_narrow_peak(w: float, rtol: float) -> None:
    system = hr.System(["x"], {"w": 1}, {"s": "1/(1 + ((t - 3)/w)^2) - 1/2"}, ["x"])
    run = hr.simulate(system, [1], until=4, rtol=rtol, parameters={"w": w})
    assert run.transitions["time_s"].tolist() == pytest.approx([3 - w, 3 + w], abs=close(rtol) * w + 1e-15)


@TOLERANCES
def test_a_denominator_that_falls_together_with_its_numerator(rtol: float) -> None:
    """x'' = -sin(x)/x passes x = 0; v^2/2 + Si(x) is constant."""
    system = hr.System(["x", "v"], {}, {}, ["v", "-sin(x)/x"])
    run = hr.simulate(system, [2.5, 0], until=20, rtol=rtol)
    x, v = run.y
    assert run.success
    assert v**2 / 2 + sici(x)[0] == pytest.approx(sici(2.5)[0], abs=close(rtol))
    assert run.counts.steps < 150


@TOLERANCES
def test_a_pole_below_the_tolerance_ends_the_run(rtol: float) -> None:
    system = hr.System(["x", "v", "y"], {}, {}, ["v", "-x", "1e-12/(x + 3/10)"])
    run = hr.simulate(system, [1, 0, 1], until=3, rtol=rtol)
    assert run.status == "failed"
    assert run.t[-1] == pytest.approx(math.acos(-0.3), abs=close(rtol))


@TOLERANCES
@pytest.mark.parametrize("w", [0.1, 0.01])
def test_an_exponential_in_a_denominator_costs_no_steps(w: float, rtol: float) -> None:
    """Its argument limits the step."""
    system = hr.System(["x", "v", "y"], {"w": 1}, {}, ["v", "-x", "1/(1 + exp(-x/w))"])
    run = hr.simulate(system, [1, 0, 0], until=2 * math.pi, rtol=rtol, parameters={"w": w})
    assert run.y[2, -1] == pytest.approx(math.pi, abs=close(rtol))
    assert run.counts.steps < 60 + 0.4 / w
