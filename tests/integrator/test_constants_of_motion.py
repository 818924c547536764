"""Surfaces whose functions are constants of the motion: errors of the steps decide nothing on them."""

from __future__ import annotations

import pytest
import sympy as sp

import henon_ref as hr


@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-9, 1e-10, 1e-12])
@pytest.mark.parametrize(
    ("energy", "field", "start"),
    [
        ("v^2/2 - cos(x)", ["v", "-sin(x)"], {"x": "pi/2", "v": 0}),
        ("x^2 + v^2 - 1", ["v", "-x"], {"x": 1, "v": 0}),
    ],
)
def test_a_constant_of_the_motion_ends_no_run(energy: str, field: list[str], start: dict, rtol: float) -> None:
    """It is zero along the whole motion, and drifts by the errors of the steps, which exceed rounding."""
    run = hr.simulate(hr.System(["x", "v"], {}, {"s": energy}, field), start, until=20, rtol=rtol)
    exact = sp.lambdify(["x", "v"], energy.replace("^", "**"))
    assert run.status == "ok"
    assert exact(*run.y) == pytest.approx(0, abs=1e3 * rtol)


CONSTANTS = [
    ("v^2/2 - cos(x)", ["v", "-sin(x)"], {"x": "pi/2", "v": 0}),
    ("v^2/2 - cos(x) + 1/2", ["v", "-sin(x)"], {"x": "pi/3", "v": 0}),
    ("x^2 + v^2 - 1", ["v", "-x"], {"x": 1, "v": 0}),
    ("x^2 + v^2 - 1", ["v", "-x"], {"x": "3/5", "v": "4/5"}),
    ("v^2/2 + x^2/2 + x^4/4 - 3/4", ["v", "-x - x^3"], {"x": 1, "v": 0}),
    ("x - v", ["v", "x"], {"x": "1/3", "v": "1/3"}),
]


@pytest.mark.parametrize("rtol", [10.0**-k for k in range(3, 14)])
@pytest.mark.parametrize(("energy", "field", "start"), CONSTANTS)
def test_a_constant_of_the_motion_is_undecided_from_its_start(
    energy: str, field: list[str], start: dict, rtol: float
) -> None:
    run = hr.simulate(hr.System(["x", "v"], {}, {"s": energy}, field), start, until=5, rtol=rtol)
    assert (run.status, run.undecided_after) == ("ok", {"s": 0.0})
