"""A program: measure the rates of sweeps in docs/sweep.md.

``python -m tests.support.sweep_rates [NAME ...]``: friction, belt, bifurcation, workers, tasks, chunks, extremes;
without a name all of them.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from statistics import median
from typing import Any

import numpy as np

import henon_ref as hr
from henon_ref.sweeps.chunk import execute
from henon_ref.sweeps.plan import planned
from henon_ref.workers.executors import finished

FRICTION = {"xi": "1/20", "musd": 2, "mud": 0.5, "v0": 0.5, "vd": 1.5}
LAW = "-x - 2*xi*v - s*(mud + mud*(musd - 1)*exp(-s*(v - vd)/v0))"
"""The friction oscillator of bSTAB and pyBasin; abs(v - vd) is s*(v - vd)."""


def friction_oscillator() -> hr.System:
    """x'' = -x - 2 xi x' - s (mud + mud (musd - 1) exp(-abs(x' - vd)/v0)), s = sgn(x' - vd)."""
    return hr.System(["x", "v"], FRICTION, {"s": "v - vd"}, ["v", LAW])


def stribeck_belt() -> hr.System:
    """The shipped case, written out."""
    field = ["v", "-x - F*s/(1 + d*s*(v - vb))"]
    return hr.System(["x", "v"], {"F": 1, "d": 3, "vb": 0.2}, {"s": "v - vb"}, field)


def timed(act: Callable[[], Any], repeats: int = 3) -> tuple[float, Any]:
    """Median of some wall times [s], and what was returned last."""
    took = []
    for _ in range(repeats):
        began = time.perf_counter()
        found = act()
        took.append(time.perf_counter() - began)
    return median(took), found


def friction() -> None:
    """1e5 random starts, and the 100 x 100 grid with its edges."""
    arguments: dict[str, Any] = {
        "until": 500,
        "rtol": 1e-8,
        "observe": [hr.observe.sticks(after=400), hr.observe.final_state()],
    }
    draws = {"x": {"uniform": [-2, 2]}, "v": {"uniform": [0, 2]}}
    points = hr.points.random(draws, count=100_000, seed=1)
    system, start = friction_oscillator(), {"x": 0, "v": 0}
    hr.sweep(system, start, grid=hr.points.random(draws, count=8000, seed=2), jobs=1, **arguments)  # compiles all code
    for jobs in (1, 2):
        took, table = timed(lambda jobs=jobs: hr.sweep(system, start, grid=points, jobs=jobs, **arguments), repeats=1)
        cycle = float((table["stick_count"] > 0).mean())
        print(f"friction oscillator, 1e5 points, {jobs} workers: {len(table) / took:,.0f} runs/s; share {cycle:.4f}")
    grid = {"x": np.linspace(-2, 2, 100), "v": np.linspace(0, 2, 100)}
    table = hr.sweep(system, start, grid=grid, **arguments)
    cycle, ended = float((table["stick_count"] > 0).mean()), table["status"].value_counts().to_dict()
    print(f"100 x 100 grid: share {cycle:.4f}; {ended}")


def belt() -> None:
    """Short runs of stribeck_belt, and what a new point costs over the runs themselves."""
    system = stribeck_belt()
    points = {"vb": np.linspace(0.1, 0.4, 400), "x": np.linspace(-1, 1, 500)}
    for until in (20, 62):
        arguments: dict[str, Any] = {"until": until, "rtol": 1e-9, "observe": [hr.observe.final_state()]}
        for jobs in (1, 2):
            act = partial(hr.sweep, system, {"x": 1, "v": 0}, grid=points, jobs=jobs, **arguments)
            act()
            took, table = timed(act)
            print(f"stribeck_belt to {until} s, {len(table):,} points, {jobs} workers: {len(table) / took:,.0f} runs/s")


def bifurcation() -> None:
    """1,000 speeds of the belt, 1,000 section points each."""
    system = stribeck_belt()
    observe = [hr.observe.section("s", after=500, direction="rising", most=1000)]
    act = lambda count: hr.sweep(  # noqa: E731
        system, {"x": 1.5, "v": 0}, until=50_000, grid={"vb": np.linspace(0.05, 1, count)}, observe=observe, rtol=1e-9
    )
    act(50)  # compiles all code
    took, table = timed(partial(act, 1000), repeats=1)
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"bifurcation diagram, {len(table.frames['section']):,} section points: {took:.1f} s, {peak:.2f} GiB")


def workers() -> None:
    """Two workers over one, for chunks of about a second; weak scaling: twice the points for two."""
    system = stribeck_belt()
    for points, jobs in ((16_000, 1), (16_000, 2), (32_000, 2)):
        grid = {"x": np.linspace(-1, 1, points)}
        act = lambda grid=grid, jobs=jobs: hr.sweep(  # noqa: E731
            system, {"x": 1, "v": 0}, until=2000, grid=grid, observe=[hr.observe.final_state()], rtol=1e-9, jobs=jobs,
            chunk=2000,
        )  # fmt: skip
        took, _ = timed(act)
        print(f"{points:,} points, {jobs} workers: {took:.2f} s, {points / took:,.0f} runs/s")


def tasks() -> None:
    """What a task costs that does next to nothing."""
    plan = planned(
        stribeck_belt(), {"x": 1, "v": 0}, until=1e-3, grid={"x": np.linspace(-1, 1, 4000)}, observe=[], chunk=1
    )
    pickled = plan.work.pickled()
    execute(pickled, 0, plan.points.values[:1], 1)
    alone, _ = timed(lambda: [execute(pickled, k, plan.points.values[k : k + 1], 1) for k in range(500)])
    began = time.perf_counter()
    given = ((k, (pickled, k, plan.points.values[k : k + 1], 1)) for k in range(4000))
    results = finished(execute, given, jobs=2)
    for _ in range(100):
        next(results)
    first, began = time.perf_counter() - began, time.perf_counter()
    for _ in results:
        pass
    each = (time.perf_counter() - began) / 3900
    print(f"workers at work after {first:.2f} s")
    print(f"a task that does nothing: {each * 1e3:.3f} ms with 2 workers, {alone / 500 * 1e3:.3f} ms alone")
    print(f"estimate: {each * 1000 * 20:.1f} s a chunk keep 1,000 workers busy with 5 % of it spent on handing out")


def chunks() -> None:
    """2,000 points in default chunks over one chunk, in turn, in one process."""
    system = stribeck_belt()
    grid = {"vb": np.linspace(0.1, 1, 2000)}
    for until in (5, 20):
        took: dict[int | None, list[float]] = {None: [], 2000: []}
        for chunk in (None, 2000) * 12:
            act = lambda chunk=chunk, until=until: hr.sweep(  # noqa: E731
                system, {"x": 1, "v": 0}, until=until, grid=grid, observe=[hr.observe.final_state()], rtol=1e-9,
                jobs=1, chunk=chunk,
            )  # fmt: skip
            took[chunk].append(timed(act, 1)[0])
        default, one = (median(times[1:]) for times in took.values())
        print(f"until {until}: {default * 1e3:.1f} ms over {one * 1e3:.1f} ms, {default / one:.2f}")


def extremes() -> None:
    """Extremes of the velocity of the friction oscillator, 500 runs of 20 s, over the same without them."""
    system, start = friction_oscillator(), {"x": 0, "v": 0}
    grid = hr.points.random({"x": {"uniform": [-2, 2]}, "v": {"uniform": [0, 2]}}, count=500, seed=1)
    took = {}
    for name, observed in (("with", [hr.observe.extremes("v", after=10)]), ("without", [])):
        act = lambda observed=observed: hr.sweep(  # noqa: E731
            system, start, until=20, grid=grid, observe=observed, rtol=1e-8, jobs=1
        )
        act()
        took[name], _ = timed(act)
    print(f"{took['with'] * 2:.2f} ms a run, without extremes {took['without'] * 2:.2f} ms")


if __name__ == "__main__":
    for name in sys.argv[1:] or ["friction", "belt", "bifurcation", "workers", "tasks", "chunks", "extremes"]:
        globals()[name]()
