"""A belt whose speed is a function of time (the paper's conclusions name one and give no equations)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from henon_ref.baselines.henon import HENON_SOLVER
from henon_ref.casefile.case import parse_case
from henon_ref.harness.registry import solver
from henon_ref.harness.studies.runs import largest_time_difference
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Status

SPEED = (0.2, 0.4, 0.4)
"""v0, v1 and w of vp = v0 + v1 sin(w t)."""
PERIODS = 60
"""Periods of two swings of the belt until the motion has settled."""

_CASE = """\
schema: 1
name: moving_belt
title: Stick-slip on a belt whose speed swings through zero
scene:
  parameters: {{m: 1, k: 1, F: 1, delta: 3, v0: {0}, v1: {1}, w: {2}}}
  bodies:
    block: {{mass: m, states: [x1, x2]}}
    belt: {{velocity: v0 + v1*sin(w*t)}}
    wall: fixed
  connections:
    - spring: {{between: [block, wall], stiffness: k}}
    - friction: {{between: [block, belt], law: stribeck, force: F, slope: delta, name: s}}
initial: {{t: 0, x1: 0, x2: 0}}
until: {3}*4*pi/w
"""


@dataclass(frozen=True)
class MovingBelt:
    """What a run of it gives."""

    status: Status
    transitions: int
    apart: float
    """Greatest difference of a transition's time between two solvers [s]; infinite where they differ in sequence."""
    drift: float
    """Greatest difference of the block's velocity from the belt's in a stick [m/s]."""
    sticks: tuple[float, float]
    """The sticks of the settled motion, the shorter first [s]."""


def belt_problem(periods: int = PERIODS) -> Problem:
    """The block on the moving belt, for so many periods."""
    return parse_case(_CASE.format(*SPEED, periods)).readings[0].problem


def moving_belt() -> MovingBelt:
    """Run it with ``henon`` and ``heyoka``."""
    problem = belt_problem()
    times = np.linspace(0.0, float(problem.until), 40001)[:-1]
    run = HENON_SOLVER.prepare(problem, rtol=1e-13, sample_times=times)()
    other = solver("heyoka").prepare(problem, rtol=1e-13, atol=1e-13)()
    assert run.samples is not None
    assert run.sample_modes is not None
    stuck = np.array([mode == (0,) for mode in run.sample_modes])
    v0, v1, w = SPEED
    belt = v0 + v1 * np.sin(w * times)
    starts = [t.time for t in run.transitions if t.kind == "stick"]
    ends = [t.time for t in run.transitions if t.kind == "release"]
    lengths = [next(end for end in ends if end > start) - start for start in starts if start < ends[-1]]
    return MovingBelt(
        status=run.status,
        transitions=len(run.transitions),
        apart=largest_time_difference(run, other),
        drift=float(np.abs(run.samples[stuck, 1] - belt[stuck]).max()),
        sticks=(min(lengths[-2:]), max(lengths[-2:])),
    )
