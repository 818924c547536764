"""What a transition costs by the way in which a system is written, over that of the belt.

    python -m tests.support.ways_of_writing [--points 1000] [--rounds 5]

Seven ways; each is run by ``simulate`` in a loop and in a sweep in one process, at as many points, all modes compiled.
Processor time, medians over rounds in which all ways come in turn.
"""

from __future__ import annotations

import argparse
import time
from statistics import median
from typing import NamedTuple

import numpy as np

import henon_ref as hr

LAW = "-x - F*s/(1 + d*s*(v - vb))"
UNTIL = 20
"""Horizon of each run [s]."""


class Way(NamedTuple):
    """A way of writing."""

    system: hr.System
    initial: dict[str, float]
    parameter: str
    """What is swept, by a tenth about its value."""

    def values(self, points: int) -> list[float]:
        own = float(self.system.parameters[self.parameter])
        return [float(f"{value:.9g}") for value in own * np.linspace(0.9, 1.1, points)]


def belt(rate: str = LAW, d: object = 3) -> Way:
    parameters = {"F": 1, "d": d, "vb": 0.5}
    return Way(hr.System(["x", "v"], parameters, {"s": "v - vb"}, ["v", rate]), {"x": 0, "v": 0}, "vb")


def reset(rate: str, speed: str) -> Way:
    system = hr.System(["x", "v"], {"k": 1, "r": 0.9}, {"s": "x"}, ["v", rate], resets={"s": {"map": {"v": speed}}})
    return Way(system, {"x": 1, "v": 0}, "k")


def two_blocks() -> Way:
    rates = [f"-x{i} - k*(x{i} - x{j}) - F*s{i}/(1 + 3*s{i}*(v{i} - vb))" for i, j in ((1, 2), (2, 1))]
    surfaces = {"s1": "v1 - vb", "s2": "v2 - vb"}
    states, field = ["x1", "v1", "x2", "v2"], ["v1", rates[0], "v2", rates[1]]
    system = hr.System(states, {"F": 1, "vb": 0.5, "k": 0.7}, surfaces, field)
    return Way(system, {"x1": 0, "v1": 0, "x2": 0.3, "v2": 0}, "vb")


WAYS = {
    "belt": belt(),
    "abs of the surface": belt("-x - F*s/(1 + d*abs(v - vb))"),
    "kink": belt(f"{LAW} - 2*max(0, x - 0.8)"),
    "kink at the release": belt(f"{LAW} - 2*max(0, x - 1)"),
    "reset": reset("-k", "-r*v"),
    "reset that goes on falling": reset("-k*x", "r*v"),
    "two blocks": two_blocks(),
    "parameter in an expression": belt(d="6*vb"),
}


def simulated(way: Way, values: list[float]) -> tuple[float, int]:
    """Processor time [s] of runs at some values, and their transitions."""
    begin, count = time.process_time(), 0
    for value in values:
        run = hr.simulate(way.system, way.initial, until=UNTIL, parameters={way.parameter: value}, dense_output=False)
        count += len(run.trajectory.transitions)
    return time.process_time() - begin, count


def swept(way: Way, values: list[float]) -> float:
    """Processor time [s] of a sweep over them."""
    begin = time.process_time()
    hr.sweep(way.system, way.initial, until=UNTIL, grid={way.parameter: values}, jobs=1)
    return time.process_time() - begin


def main() -> None:
    """Command line; see the module's text."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    found: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in WAYS}
    for number in range(given.rounds + 1):
        for name, way in WAYS.items():
            values = way.values(given.points)
            (alone, count), together = simulated(way, values), swept(way, values)
            if number:  # the first round compiles
                found[name][0].append(alone / count)
                found[name][1].append(together / count)
    base = [median(times) for times in found["belt"]]
    print(
        "| way of writing | simulate, us a transition | over the belt | sweep | over the belt |\n|---|---|---|---|---|"
    )
    for name, times in found.items():
        cells = [f"{1e6 * median(own):.1f} | {median(own) / b:.2f}" for own, b in zip(times, base, strict=True)]
        print(f"| {name} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
