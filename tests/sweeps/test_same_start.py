"""One run is the same run, to the last bit, by itself and in a sweep."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

import henon_ref as hr

BELT = hr.System(
    ["x", "v"],
    {"F": 0.3, "c": 0.1, "u": "3/10", "twice": "2*F/3"},
    {"s": "v - u"},
    ["v", "-x - c*v - s*(twice + F/(1 + 3*(v - u)^2))"],
)
BLOCK = hr.System(["x", "v"], {"F": 0.5, "w": 1.1}, {"s": "v"}, ["v", "cos(w*t) - F*s"])
STATIC = hr.System(["x", "v"], {"a": 0.4, "k": "sqrt(2)"}, {"s": "v"}, ["v", "-k*x - a*s"], valid=["3 - x"])
BALL = hr.System(["h", "v"], {"r": 0.7, "g": 9.81}, {"s": "h"}, ["v", "-g"], resets={"s": {"map": {"v": "-r*v"}}})
PAIR = hr.System(
    ["x", "v", "y", "w"],
    {"F": 0.4, "G": 0.3, "k": 1.3},
    {"s": "v", "u": "w"},
    ["v", "k*(y - 2*x) - F*s + sin(t)", "w", "k*(x - 2*y) - G*u"],
)
SYSTEMS: dict[str, tuple[hr.System, dict[str, Any], Any, Any, dict[str, tuple[float, float]]]] = {
    "belt": (BELT, {"x": 1, "v": "1/7"}, 0, 20, {"F": (0.1, 0.6), "x": (-2, 2)}),
    "start that is no double": (BLOCK, {"x": "1/3", "v": 0}, 0.1, "10 + w/3", {"F": (0.1, 1), "w": (0.5, 2)}),
    "leaves its domain": (STATIC, {"x": 1, "v": 0.3}, 0, 7, {"a": (0.1, 0.9), "x": (-3, 3.5), "v": (-3, 3)}),
    "ball that comes to rest": (BALL, {"h": 1.1, "v": 0}, 0, 6, {"r": (0, 0.9), "h": (0.1, 2)}),
    "two blocks": (PAIR, {"x": 0, "v": 0, "y": 0.1, "w": 0}, 0, 12, {"F": (0.1, 1), "G": (0.1, 1), "x": (-1, 1)}),
}  # fmt: skip


def bits(values: Iterable[Any]) -> list[str]:
    return [float(v).hex() for v in values]


@pytest.mark.parametrize("count", [40, pytest.param(500, marks=pytest.mark.slow)])  # daily: forty of each system
@pytest.mark.parametrize("name", SYSTEMS)
def test_a_sweep_and_simulate_have_the_same_bits_at_many_points(name: str, count: int) -> None:
    """Drawn points, and some in round decimals and at rest; the first run of a system starts in another way."""
    system, initial, start, until, ranges = SYSTEMS[name]
    rng = np.random.default_rng(5)
    points = {key: rng.uniform(low, high, count) for key, (low, high) in ranges.items()}
    for key in points:
        points[key][: count // 10] = np.round(points[key][: count // 10], 1)
        points[key][count // 10 : count // 5] = np.round(points[key][count // 10 : count // 5], 3)
    grid = hr.points.table(points)
    table = hr.sweep(
        system,
        initial,
        start=start,
        until=until,
        grid=grid,
        observe=[hr.observe.final_state()],
        jobs=1,
    )
    assert len(table.status) == count
    differ = []
    for k in range(count):
        own = {key: float(values[k]) for key, values in points.items()}
        parameters = {key: value for key, value in own.items() if key not in system.state}
        run = hr.simulate(
            system, {**initial, **{x: own[x] for x in own if x in system.state}}, start=start, until=until,
            parameters=parameters, dense_output=False,
        )  # fmt: skip
        row = table.loc[k]
        found = row["status"], bits(row[f"final_{x}"] for x in system.state)
        if (run.status, bits(run.trajectory.end_state)) != found:
            differ.append((k, own))
    assert not differ
