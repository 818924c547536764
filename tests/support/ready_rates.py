"""A program: how soon a first run is done, and what tables of a run cost.

``python -m tests.support.ready_rates``; processor time of processes of their own, caches as they are.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import pandas as pd
from sweep_rates import stribeck_belt

import henon_ref as hr
from henon_ref.simulation.tables import COLUMNS, STICK_COLUMNS

FIRST = """
import time
import henon_ref as hr
SYSTEMS = {
    "one surface": (["x", "v"], {"F": 1, "vb": 0.2}, {"s": "v - vb"}, ["v", "-x - F*s/(1 + 3*s*(v - vb))"]),
    "two surfaces": (["x", "v", "y", "w"], {"F": 1}, {"s": "v - 1", "r": "w - v"},
                     ["v", "-x - F*s + r/2 + y", "w", "x - y - r/2"]),
    "a reset": (["x", "v"], {"g": 9.81}, {"s": "x"}, ["v", "-g"], None, None,
                {"s": {"map": {"v": "-4*v/5"}}}),
}
def run(name, factor):
    state, parameters, surfaces, field, *more = SYSTEMS[name]
    system = hr.System(state, parameters, surfaces, [field[0], f"{field[1]} - {factor}*x", *field[2:]], *more)
    hr.simulate(system, {x: 0.3 + k for k, x in enumerate(state)}, until=2)
    return time.process_time()
first = run(%r, 1)
print(first, run(%r, 7) - first)
"""
"""What a new process does: its first run, and that of a second system of the same kind."""


def milliseconds(act: Callable[[], Any], repeats: int = 200) -> float:
    took = []
    for _ in range(repeats):
        began = time.perf_counter()
        act()
        took.append(time.perf_counter() - began)
    return median(took) * 1e3


def first_runs() -> None:
    """Processor time to the end of a first run, and of a second system."""
    for name in ("one surface", "two surfaces", "a reset"):
        found = []
        for _ in range(4):  # the first one fills the caches
            out = subprocess.run(
                [sys.executable, "-c", FIRST % (name, name)], capture_output=True, text=True, check=True
            )
            found.append([float(word) for word in out.stdout.split()])
        cold, *warm = found
        told = [median(times) for times in zip(*warm, strict=True)]
        print(f"{name}: {cold[0]:.2f} s, then {told[0]:.2f} s; a second system {told[1]:.3f} s")


def tables() -> None:
    """Frames of a run, by their properties and by rows with types set afterwards."""
    run = hr.simulate(stribeck_belt(), {"x": 1, "v": 0}, until=14)
    for name, columns in (("transitions", COLUMNS), ("sticks", STICK_COLUMNS)):
        frame = getattr(run, name)
        rows, numbers = frame.values.tolist(), {c: float for c in columns if c.endswith("_s")}

        def fresh(name: str = name) -> Any:
            vars(run).pop(name, None)
            return getattr(run, name)

        names = list(frame.columns)
        slow = milliseconds(
            lambda rows=rows, names=names, numbers=numbers: pd.DataFrame(rows, columns=names).astype(numbers)
        )
        print(f"{name}, {len(frame)} rows: {milliseconds(fresh):.2f} ms; by rows and astype {slow:.2f} ms")


if __name__ == "__main__":
    first_runs()
    tables()
