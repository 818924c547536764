"""Random stacks of two blocks against friction that is smooth and steep, which needs no rule for what holds.

Friction rises to its static value within 1e-6 m/s and falls to the kinetic one within 1e-4 m/s. Where a held contact
reaches its limit the two agree as far as that goes. Where one comes to rest and several would be beyond their limits,
smooth laws themselves differ by how steep each is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from random_stacks import draws
from scipy.integrate import solve_ivp

NUMBER, SECONDS = 10, 15.0
NEAR, FAR = 5e-3, 0.07


def end_velocities(values: dict[str, float], velocities: tuple[float, float]) -> NDArray[np.float64]:
    """Of blocks a and b, by the smooth law."""

    def friction(static: float, kinetic: float, velocity: float) -> float:
        return float(np.sign(velocity) * np.interp(abs(velocity), [0, 1e-6, 1e-4], [0, static, kinetic]))

    def rates(t: float, v: NDArray[np.float64]) -> list[float]:
        floor = friction(values["Fs"], values["Fk"], v[0])
        upper = friction(values["Gs"], values["Gk"], v[1] - v[0])
        forces = values["A"] * np.sin(values["u"] * t), values["B"] * np.cos(values["w"] * t)
        return [forces[0] + upper - floor, (forces[1] - upper) / values["m"]]

    found = solve_ivp(rates, (0.0, SECONDS), velocities, method="LSODA", rtol=1e-8, atol=1e-12)
    assert found.success
    return found.y[:, -1]


def test_stacks_end_as_by_a_steep_law() -> None:
    errors = []
    for values, velocities, run in draws(NUMBER, 7, SECONDS):
        trajectory = run.to_horizon()
        assert trajectory.status == "ok"
        errors.append(np.max(np.abs(np.array(trajectory.end_state[1::2]) - end_velocities(values, velocities))))
    assert max(errors) < FAR
    assert sum(error < NEAR for error in errors) >= NUMBER - 1
