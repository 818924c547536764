"""Sticks on surfaces that move, with friction that changes within a much smaller velocity than the run's error."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

import henon_ref as hr

TOLERANCES = pytest.mark.parametrize("rtol", [1e-3, 1e-4, 1e-5, 1e-6, 1e-9])
BELT = "(1/4 + sin(t)/4)"
LAW = {"w": 1e-3, "mk": 0.5, "ms": 0.6}
RANGES = {"mk": (0.3, 0.8), "V": (0.1, 0.6), "A": (0.05, 0.3), "om": (0.5, 3), "ph": (0, 6)}


def friction(sign: str, velocity: str) -> str:
    """mk, and ms at rest, within the width w."""
    return f"{sign}*(mk + (ms - mk)*exp(-{sign}*({velocity})/w))"


@TOLERANCES
@pytest.mark.parametrize("w", [1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
def test_a_body_on_a_belt_that_swings(w: float, rtol: float) -> None:
    """Up to some widths v = t/2 until sin(t), the belt's until -cos(t) = ms at t = r, and then 4/5 - (t - r)/2."""
    system = hr.System(["v"], {**LAW, "w": w}, {"s": "v - sin(t)"}, ["-" + friction("s", "v - sin(t)")])
    run = hr.simulate(system, [0.005], start=0.01, until=6, rtol=rtol)
    r = math.acos(-0.6)
    stick = brentq(lambda t: t / 2 - math.sin(t), 1, 3)
    crossing = brentq(lambda t: 0.8 - (t - r) / 2 - math.sin(t), 3, 6)
    assert run.transitions["kind"].tolist() == ["stick", "release", "crossing"]
    assert run.transitions["time_s"].tolist() == pytest.approx([stick, r, crossing], abs=20 * rtol + 20 * w)


def test_oscillators_on_belts_that_swing() -> None:
    """At random, with widths far below the error of a run."""
    slip = "v - V - A*sin(om*t + ph)"
    values = {**LAW, "V": 0.3, "A": 0.1, "om": 1, "ph": 0}
    system = hr.System(["x", "v"], values, {"s": slip}, ["v", "-x - " + friction("s", slip)])
    rng = np.random.default_rng(1)
    for n in range(30):
        drawn = {name: rng.uniform(*ends) for name, ends in RANGES.items()}
        values = {**drawn, "w": 10 ** rng.uniform(-6, -3), "ms": drawn["mk"] * rng.uniform(1.05, 1.5)}
        start = rng.uniform(-1, 1, 2)
        close = hr.simulate(system, start, until=20, rtol=1e-11, parameters=values)
        for rtol in (1e-4, 1e-5, 1e-7):
            run = hr.simulate(system, start, until=20, rtol=rtol, parameters=values)
            assert run.success, (n, rtol)
            assert run.transitions["kind"].tolist() == close.transitions["kind"].tolist(), (n, rtol)
            assert run.y[:, -1] == pytest.approx(close.y[:, -1], abs=10 * rtol), (n, rtol)


def on_a_belt(blocks: int) -> tuple[list[str], list[str]]:
    """Velocities of the surfaces of blocks between springs, and the forces on the blocks."""
    slip = [f"v{i} - {BELT}" for i in range(blocks)]
    springs = [f"x{max(i - 1, 0)} - 3*x{i} + x{min(i + 1, blocks - 1)}" for i in range(blocks)]
    return slip, [f"{force} - {friction(f's{i}', slip[i])}" for i, force in enumerate(springs)]


def stacked(blocks: int) -> tuple[list[str], list[str]]:
    """The same of a stack: each block lies on the one before, and carries the others."""
    slip = [f"v{i} - " + (f"v{i - 1}" if i else BELT) for i in range(blocks)]
    drags = [*(f"{blocks - i}*{friction(f's{i}', slip[i])}" for i in range(blocks)), "0"]
    return slip, [f"-x{i} - {below} + {above}" for i, (below, above) in enumerate(pairwise(drags))]


@pytest.mark.parametrize("blocks", [1, 2, 5])
@pytest.mark.parametrize("scene", [on_a_belt, stacked])
def test_a_slide_ends_on_its_surface(scene: Callable[[int], tuple[list[str], list[str]]], blocks: int) -> None:
    slip, forces = scene(blocks)
    x, v = ([f"{name}{i}" for i in range(blocks)] for name in "xv")
    surfaces = {f"s{i}": h for i, h in enumerate(slip)}
    system = hr.System([*x, *v], LAW, surfaces, [*v, *forces])
    for rtol in (1e-3, 1e-5, 1e-9):
        run = hr.simulate(system, [0] * (2 * blocks), until=30, rtol=rtol)
        assert run.success
        released = run.transitions[run.transitions["kind"] == "release"]
        assert len(released) > 1
        for row in released.to_dict("records"):
            assert abs(eval(surfaces[row["surface"]], {"sin": math.sin, "t": row["time_s"], **row})) < 1e-14, rtol
