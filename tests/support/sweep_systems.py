"""Systems for tests of sweeps, and comparison of two results."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from henon_ref.simulation.system import System
from henon_ref.sweeps.plan import Plan
from henon_ref.sweeps.sweep import SweepTable, assembled, done

FIELD = ["v", "-x - F*s/(1 + d*s*(v - vb))"]


def belt(**parameters: Any) -> System:
    """A block on a belt."""
    return System(["x", "v"], {"F": 1, "d": 3, "vb": 0.5, **parameters}, {"s": "v - vb"}, FIELD)


def sliding_block() -> System:
    """x'' = -F sgn(x'): from x = 0 it stops after v/F, at v^2/(2 F)."""
    return System(["x", "v"], {"F": 1}, {"s": "v"}, ["v", "-F*s"])


def oscillator() -> System:
    """x'' = -w^2 x, with a surface that no field uses."""
    return System(["x", "v"], {"w": 1}, {"s": "x - 100"}, ["v", "-w**2*x"])


def collected(plan: Plan) -> SweepTable:
    """The results of a plan, done in this process."""
    return assembled(plan.points, list(done(plan, None, jobs=1)))


def assert_same(one: SweepTable, other: SweepTable) -> None:
    """Assert that two results are the same to the last bit."""
    pd.testing.assert_frame_equal(one, other, check_exact=True)
    assert set(one.frames) == set(other.frames)
    for name, frame in one.frames.items():
        pd.testing.assert_frame_equal(frame, other.frames[name], check_exact=True)


def parquet_files(folder: Path) -> dict[str, bytes]:
    """Every Parquet file below a folder, by its path in it."""
    return {file.relative_to(folder).as_posix(): file.read_bytes() for file in sorted(folder.rglob("*.parquet"))}


SWEEP = """\
schema: 1
name: belts
title: Sticks over the belt's speed and the start
source: my notebook
system:
  state: [x, v]
  parameters: {F: 1, d: 3, vb: 0.5}
  surfaces: {s: "v - vb"}
  field: ["v", "-x - F*s/(1 + d*s*(v - vb))"]
initial: {t: 0, x: 1.5, v: 0}
until: 50
points:
  grid:
    vb: {from: 0.05, to: 1, count: 5}
    x: [-1, 0, 1.5]
observe:
  - sticks: {after: 20}
  - final_state: {}
  - section: {of: x, after: 20, direction: rising}
rtol: 1e-9
chunk: 4
"""
"""A small sweep file: 15 points in 4 chunks."""
