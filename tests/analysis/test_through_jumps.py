"""Derivatives through jumps of the state: against closed forms, and differences of runs."""

from __future__ import annotations

from math import log

import numpy as np
import pytest
import sympy as sp
from derivatives import floquet_multipliers, fundamental_matrix

import henon_ref as hr
from henon_ref.casefile.case import load_case
from henon_ref.modes.problem import Problem


def table(restitution: float = 0.8) -> hr.System:
    """A ball above a table y = sin(2 pi t + phi - pi) / 10, phi of the motion that meets it every second."""
    return hr.System(
        state=["x", "v"],
        parameters={"g": 10, "e": restitution, "w": "2*pi", "A": 0.1, "phi": "acos(g*(1 - 0.8)/(2*(1 + 0.8)*A*w))"},
        surfaces={"s": "x - A*sin(w*t + phi - pi)"},
        field=["v", "-g"],
        resets={"s": {"map": {"v": "-e*v + (1 + e)*A*w*cos(w*t + phi - pi)"}}},
    )


def bouncing() -> Problem:
    return load_case("scenes/bouncing_table").readings[0].problem


def test_multipliers_of_a_ball_on_a_table_are_those_of_its_map() -> None:
    # Holmes' map of phase and speed, exact for this table: speed w after an impact at time t; its determinant is e^2.
    found = np.sort_complex(floquet_multipliers(bouncing(), since=sp.Integer(1), period=sp.Integer(1), tolerance=1e-14))
    assert np.prod(found).real == pytest.approx(0.64, rel=1e-10)
    problem, step = bouncing(), 1e-6
    ends = []
    for k in range(2):
        for way in (1, -1):
            x = [float(v) for v in problem.initial]
            x[k] += way * step
            run = hr.simulate(
                hr.System.from_case("scenes/bouncing_table"),
                dict(zip(("x_ball", "v_ball"), x, strict=True)),
                until=1,
                rtol=1e-13,
            )
            ends.append(run.trajectory.end_state)
    numbers = np.array(ends)
    quotient = np.column_stack([(numbers[0] - numbers[1]) / (2 * step), (numbers[2] - numbers[3]) / (2 * step)])
    matrix, rank = fundamental_matrix(problem, sp.Integer(0), sp.Integer(1), tolerance=1e-14)
    assert rank == 2
    assert matrix == pytest.approx(quotient, rel=1e-5, abs=1e-6)


def test_exponents_sum_up_to_what_impacts_take() -> None:
    spectrum = hr.lyapunov_exponents(table(), {"x": 1.3, "v": 0}, span=50, discard=5)
    impacts = spectrum.transitions
    assert spectrum.status == "ok"
    assert sum(spectrum.exponents) == pytest.approx(2 * log(0.8) * impacts / spectrum.span, rel=1e-9)


def test_a_rest_takes_both_directions() -> None:
    system = hr.System.from_case("scenes/inelastic_ball")
    spectrum = hr.lyapunov_exponents(system, {"x_ball": 0.5, "v_ball": 0}, span=3)
    assert spectrum.exponents == (-np.inf, -np.inf)


def test_nothing_is_left_of_a_perturbation_after_a_limit_of_impacts() -> None:
    problem = load_case("scenes/bouncing_ball").reading("to_rest").problem
    matrix, rank = fundamental_matrix(problem, sp.Integer(0), sp.Integer(5), tolerance=1e-12)
    assert rank == 0
    assert matrix == pytest.approx(np.zeros((2, 2)), abs=1e-12)


def test_a_periodic_orbit_through_an_impact_is_proven() -> None:
    system = hr.System.from_case("scenes/bouncing_table")
    orbit = hr.periodic_orbit(system, {"x_ball": 1.3, "v_ball": 0}, until=30, period=1)
    multipliers = [complex(m) for m in orbit.multipliers]
    assert np.prod(multipliers).real == pytest.approx(0.64, rel=1e-12)
