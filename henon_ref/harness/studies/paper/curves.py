"""Curves to draw: a run sampled densely, with its transitions put in so that corners are sharp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from henon_ref.harness.registry import solver
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory, Transition

Floats = NDArray[np.float64]

RTOL = 1e-13


@dataclass(frozen=True)
class Curve:
    """A part of a run of a system with one surface."""

    times: Floats
    states: Floats
    """(k, n)"""
    modes: NDArray[np.int64]
    """Mode from each time to the next."""
    transitions: tuple[Transition, ...]

    def sticks(self) -> list[slice]:
        """Index ranges of the sticks, their ends included."""
        edges = np.flatnonzero(np.diff(np.concatenate(([0], (self.modes == 0).astype(int), [0]))))
        return [slice(a, min(b + 1, len(self.times))) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def reference(problem: Problem) -> Trajectory:
    """The run by the Taylor reference."""
    return solver("henon").prepare(problem, rtol=RTOL)()


def curve(problem: Problem, *, after: float, until: float, points: int = 800) -> Curve:
    """The run between two times, by the Taylor reference; shorter where it ends early."""
    wanted = np.linspace(after, until, points)
    run = solver("henon").prepare(problem, rtol=RTOL, sample_times=wanted)()
    assert run.samples is not None
    assert run.sample_modes is not None
    good = np.isfinite(run.samples).all(axis=1)
    inside = [t for t in run.transitions if after < t.time < until]
    times = np.concatenate([wanted[good], [t.time for t in inside]])
    states = np.concatenate([run.samples[good], np.array([t.state for t in inside]).reshape(-1, run.samples.shape[1])])
    sampled = np.array([mode[0] for mode in run.sample_modes])[good]
    modes = np.concatenate([sampled, np.array([t.to_mode[0] for t in inside], dtype=int)])
    order = np.argsort(times, kind="stable")
    return Curve(times[order], states[order], modes[order], tuple(inside))


def thinned(values: Floats, every: int) -> NDArray[np.intp]:
    """Indices of every so-manieth of some values in a row, and of both sides of each change of their sign.

    Examples
    --------
    >>> thinned(np.array([1.0, 1.0, 1.0, -1.0, -1.0, 0.0, 0.0, 0.0]), 4).tolist()
    [0, 2, 3, 4, 5, 7]
    """
    changes = np.flatnonzero(np.diff(np.sign(values)))
    return np.unique(np.concatenate([np.arange(0, len(values), every), changes, changes + 1, [len(values) - 1]]))
