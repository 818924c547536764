"""A run is the same whatever ran before it: the first call in a process, with nothing compiled, and every later one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from henon_ref.simulation import launch
from henon_ref.simulation.simulate import simulate
from henon_ref.simulation.solution import Solution
from henon_ref.simulation.system import System

PRESSED = (["x", "v"], {"u": 1}, {"s": "v - u", "g": "1 - x"}, ["v", "1 - s/2"])
STOP = {"g": {"map": {"v": "0"}}}
HOLD = {"field": ["v", "0"], "release": [{"when": "2 - x", "direction": "falling", "to": 1}], "entry": "inside"}
RUNS: dict[str, tuple[System, dict[str, Any], float, dict[str, Any]]] = {
    # At u = 0 the block stands on a belt at rest: the belt's surface is the speed that a body at rest on a stop keeps.
    "pressed on a stop": (System(*PRESSED, resets=STOP), {"x": 1, "v": 0}, 3, {"u": 0}),
    "flying to a stop": (System(*PRESSED, resets=STOP), {"x": 0, "v": 0}, 3, {"u": 0}),
    # Crossings, sticks and releases at the horizon, where no mode behind them is compiled at first.
    "kink at the horizon": (System(["x", "v"], {}, {"s": "v - 2"}, ["v", "-max(v,0) - s/2"]), {"x": 1, "v": -1}, 2, {}),
    "crossing": (System(["x", "v"], {}, {"s": "v - 2", "r": "v"}, ["v", "1 - r/2"]), {"x": 0, "v": -1.5}, 1, {}),
    "stick": (System(["x", "v"], {}, {"s": "x - 9", "r": "v"}, ["v", "-1/2 - r"]), {"x": 0, "v": 3}, 2, {}),
    "release": (System(["v", "w"], {}, {"s": "w - 9", "r": "v"}, ["w - r", "1"]), {"v": 0, "w": 0}, 1, {}),
    "graze": (System(["x", "v"], {}, {"s": "x", "r": "v - 9"}, ["v", "2"]), {"x": 1, "v": -2}, 2, {}),
    "end of a stick by a jump": (System(["x"], {}, {"s": "x", "c": "t - 3/2"}, ["1 + c - s"]), {"x": 1}, 2, {}),
    "hold zone": (
        System(["x", "v"], {}, {"s": "v", "r": "x - 1/4"}, ["v", "1 - 2*s"], sliding={"s": HOLD}),
        {"x": 0, "v": 1},
        3,
        {},
    ),
    "close roots": (System(["x", "v"], {}, {"s": "x + 1e-18", "r": "v - 9"}, ["v", "2"]), {"x": 1, "v": -2}, 2, {}),
}


def _seen(run: Solution) -> tuple[object, ...]:
    end = [float(value).hex() for value in run.y[:, -1]]
    return run.status, run.message, end, run.final_mode, run.transitions.values.tolist(), tuple(run.counts)[:3]


@pytest.mark.parametrize("name", RUNS)
def test_the_first_run_is_as_every_later_one(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    system, initial, until, parameters = RUNS[name]
    monkeypatch.setattr(launch, "_kept", type(launch._kept)())  # compiled systems are shared by all System objects
    first, *later = [_seen(simulate(system, initial, until=until, parameters=parameters)) for _ in range(3)]
    assert later == [first, first]
    assert _seen(simulate(system.with_parameters(parameters), initial, until=until)) == first


def test_a_block_pressed_on_a_stop_rests_whatever_the_belt_does() -> None:
    system = System(*PRESSED, resets=STOP)
    for speed in (0, 1, 0, -1):
        run = simulate(system, {"x": 1, "v": 0}, until=3, parameters={"u": speed})
        assert run.success, run.message
        np.testing.assert_array_equal(run.y[:, -1], [1, 0])
