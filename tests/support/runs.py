"""Runs of the reference, and their kinds and times of transitions."""

from __future__ import annotations

import numpy as np

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.integrator.constants import LoopData
from henon_ref.kernel.library import ffi
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory


def run(problem: Problem, rtol: float = 1e-15, solver=HENON_SOLVER, **options) -> Trajectory:
    return solver.prepare(problem, rtol=rtol, deadline=20.0, **options)()


def constants_of(data: LoopData) -> np.ndarray:
    """Constants of each mode, shape (M, tapes, K): each row has the doubles, then their remainders."""
    memory = ffi.buffer(data.tables.numbers, 8 * data.compiled.sources.size)
    return np.frombuffer(memory).reshape(data.compiled.sources.shape).copy()


def kinds(trajectory: Trajectory) -> list[str]:
    return [q.kind for q in trajectory.transitions]


def times(trajectory: Trajectory) -> np.ndarray:
    return np.array([q.time for q in trajectory.transitions])
