"""No run is ``ok`` whose operations have overflowed, or underflowed so that it counts."""

from __future__ import annotations

import math
from typing import Any

import pytest

import henon_ref as hr

NO_DOUBLE = "overflows or underflows at t = .*: an operation's result is no double"


def run_of(state: dict[str, object], field: list[str], surface: str = "x - 5", until: object = 1, **more: Any) -> Any:
    return hr.simulate(hr.System([*state], {}, {"s": surface}, field), state, until=until, **more)


@pytest.mark.parametrize(
    ("state", "field"),
    [
        # z^2 is 1e-326, which is 0: x' is 1e-5.
        ({"x": 0, "z": "1e-163", "w": "1e-153"}, ["1e15*z*z/(w*w)", "0", "0"]),
        # z grows from 0: at the start nothing is lost.
        ({"x": 0, "z": 0, "w": "1e-153"}, ["1e15*z*z/(w*w)", "1e-163", "0"]),
        ({"x": 0, "z": 0, "w": "1e-153"}, ["x + 1e15*z*z/(w*w)", "1e-163*cos(t)", "0"]),
        ({"x": 1, "z": "1e-163", "w": "1e-153"}, ["-x*(1 + z^2/w^2*1e23)", "0", "0"]),
        # z^2 is a number of one digit.
        ({"x": 0, "z": "3e-162", "w": "1e-153"}, ["1e15*z*z/(w*w)", "0", "0"]),
        # y^4 is infinite, its inverse 0: x' is 1.
        ({"x": 0, "z": "1e20", "y": "1e80"}, ["1e300*z/y^4", "0", "0"]),
    ],
)
def test_what_counts_is_not_ok(state: dict[str, object], field: list[str]) -> None:
    run = run_of(state, field)
    assert run.status == "failed"
    assert "the field of x overflows or underflows at t = 0: an operation's result is no double" in run.message


def test_the_sign_of_a_surface_that_underflows_is_not_ok() -> None:
    """z = (2 - t) 1e-170 falls to y = 1e-170 at 1; in double precision both squares are 0."""
    run = run_of({"z": "2e-170", "y": "1e-170"}, ["-1e-170", "0"], "z*z - y*y", until=3)
    assert (run.status, len(run.transitions)) == ("failed", 0)
    assert "the surface of s overflows or underflows at t = 0" in run.message


@pytest.mark.parametrize(
    ("state", "field", "end"),
    [
        ({"x": 1, "z": "1e-170"}, ["1e250*x*z*z", "0"], 1.0),
        ({"x": 1, "z": "1e-155"}, ["1e300*x*z*z", "0"], math.exp(1e-10)),
        ({"x": 1, "y": "1e90"}, ["-x + 1/(1 + y^4)", "0"], math.exp(-1)),
        ({"x": 1, "z": 1}, ["-x + exp(-(z/0.001)^2)", "0"], math.exp(-1)),
        ({"x": 1, "z": "1e-300"}, ["-x", "-z"], math.exp(-1)),
        ({"x": 1, "z": 1}, ["-x", "-1e-20*z"], math.exp(-1)),
    ],
)
def test_what_does_not_count_is_ok(state: dict[str, object], field: list[str], end: float) -> None:
    run = run_of(state, field)
    assert (run.status, run.y[0, -1]) == ("ok", pytest.approx(end, rel=1e-12))


@pytest.mark.parametrize("stribeck", [0.1, 0.001, 1e-4])
def test_a_narrow_stribeck_law_needs_no_second_look(stribeck: float) -> None:
    """exp(-(v/v_s)^2) is zero in double precision nearly everywhere."""
    field = ["v", f"-x - s*(1 + exp(-(v/{stribeck})^2))"]
    run = hr.simulate(hr.System(["x", "v"], {}, {"s": "v"}, field), {"x": 5, "v": 0.5}, until=5)
    assert (run.status, run.counts.decisions.ranges) == ("ok", 0)


def test_a_sweep_says_the_same() -> None:
    system = hr.System(["x", "z", "w"], {"a": 1}, {"s": "x - 5"}, ["-x + a*z*z/(w*w)", "0", "0"])
    initial = {"x": 1, "z": "1e-163", "w": "1e-153"}
    grid = {"a": [0, 1e15, 1, -1e18]}
    table = hr.sweep(system, initial, until=1, grid=grid, observe=[hr.observe.final_state()], jobs=1)
    runs = [hr.simulate(system, initial, until=1, parameters={"a": a}) for a in grid["a"]]
    assert table.status.tolist() == [run.status for run in runs] == ["ok", "failed", "ok", "failed"]
    assert table.final_x[0] == runs[0].y[0, -1]


def test_the_map_of_a_reset_has_the_exponents_that_it_needs() -> None:
    resets = {"s": {"map": {"x": "1", "v": "1e15*z*z/(w*w)"}}}
    system = hr.System(["x", "v", "z", "w"], {}, {"s": "x"}, ["-1", "0", "0", "0"], resets=resets)
    run = hr.simulate(system, {"x": 1, "v": 0, "z": "1e-163", "w": "1e-153"}, until=1.5)
    assert (run.status, run.y[1, -1]) == ("ok", pytest.approx(1e-5, rel=1e-12))
