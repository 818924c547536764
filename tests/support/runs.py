"""Runs of the reference, and their kinds and times of transitions."""

from __future__ import annotations

import numpy as np

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory


def run(problem: Problem, rtol: float = 1e-15, solver=HENON_SOLVER, **options) -> Trajectory:
    return solver.prepare(problem, rtol=rtol, deadline=20.0, **options)()


def kinds(trajectory: Trajectory) -> list[str]:
    return [q.kind for q in trajectory.transitions]


def times(trajectory: Trajectory) -> np.ndarray:
    return np.array([q.time for q in trajectory.transitions])
