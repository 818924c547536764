"""Starts at which a surface has no value: a row is that of a run by itself, in its words."""

from __future__ import annotations

import pytest

import henon_ref as hr


@pytest.mark.parametrize(
    ("surfaces", "field", "points"),
    [
        ({}, "piecewise(-k*(x - 2), x > 0, abs(log(v - 5)))", [2.5, -0.2, 1.5, 2.0]),
        ({}, "piecewise(-k*(x - 2), x > 0, max(sqrt(v - 5), x) + abs(1/(x - 3)))", [2.5, -0.2, 3.0]),
        ({}, "piecewise(-k*x, x > 0, abs(sqrt(-2*x - 1) - v))", [0.5, -0.2, -0.6]),
        ({}, "piecewise(-k*(x - 2), x > 0, max(sqrt(x - 5/2), 1) + log(v))", [2.5, -0.2, 3.0]),
        ({"s": "1/x - k"}, "-k + 0*s", [1.5, 0.0, -0.5]),
    ],
)
def test_a_start_without_value_is_what_simulate_makes_of_it(
    surfaces: dict[str, str], field: str, points: list[float]
) -> None:
    system = hr.System(["x", "v"], {"k": 1}, surfaces, ["v", field])
    observed = [hr.observe.status(), hr.observe.final_state()]
    table = hr.sweep(system, {"x": 1, "v": 0.25}, until=1, grid={"x": points}, observe=observed, jobs=1)
    found = table[["status", "message", "final_x", "final_v"]].values.tolist()
    assert found == [by_itself(system, x) for x in points]


def by_itself(system: hr.System, x: float) -> list[object]:
    try:
        run = hr.simulate(system, {"x": x, "v": 0.25}, until=1)
    except hr.HenonRefError as error:
        return ["failed", str(error), x, 0.25]
    return [run.status, run.message, *run.y[:, -1].tolist()]
