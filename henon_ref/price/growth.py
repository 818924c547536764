"""Long runs: what a transition costs, what memory is taken and how right the sticks still are after 1e6 s."""

from __future__ import annotations

import resource
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from henon_ref.henon.compiled import double_double
from henon_ref.henon.engine import Engine
from henon_ref.henon.registers import HENON
from henon_ref.henon.session import Session
from henon_ref.henon.solvers import order_for
from henon_ref.trajectory import Problem

HORIZONS = (1e2, 1e3, 1e4, 1e5, 1e6)
TOLERANCE = 1e-13
STICKS = (1.17430046762285, 0.41641643691198)
"""Sticks of the periodic orbit of Fig. 8's `listing_limit` [s], certified by Krawczyk's test."""
SETTLED = 500.0
"""From this time on [s] what is left of the start is below a double's rounding (its multiplier is 0.4 a period)."""
_STICK, _RELEASE = 0, 1


@dataclass(frozen=True)
class Horizon:
    """One run."""

    until: float
    """Horizon [s]."""
    transitions: int
    wall_s: float
    grown: float
    """Memory that the process took more than before the run, at its peak [MiB]."""
    stick_error_s: float
    """Worst error of the last twenty sticks against the certified ones [s]; NaN before the motion has settled."""

    @property
    def per_transition_s(self) -> float:
        """Wall time of one transition [s]."""
        return self.wall_s / self.transitions


def horizons(problem: Problem, until: Sequence[float] = HORIZONS) -> list[Horizon]:
    """Run Fig. 8's periodic motion ever longer, transitions handed out as they come."""
    engine = Engine(problem.system, order_for(TOLERANCE))
    start = engine.start(problem, tolerance=TOLERANCE, landing=HENON)
    engine.run(replace(start, until=double_double(problem.start + 10)))
    return [_run(engine, replace(start, until=(horizon, 0.0)), horizon) for horizon in until]


def _run(engine: Engine, start, horizon: float) -> Horizon:  # type: ignore[no-untyped-def]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    session = Session(engine, start)
    began = time.perf_counter()
    count, opened = 0, None
    last: list[float] = []
    for block in session.stream():
        count += len(block)
        for (high, low), kind in zip(block.times[-400:], block.kinds[-400:], strict=True):
            if kind == _STICK:
                opened = high, low
            elif kind == _RELEASE and opened is not None:
                last.append((high - opened[0]) + (low - opened[1]))
        del last[:-20]
    wall = time.perf_counter() - began
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    found = np.array(last)
    error = np.min([np.abs(found - exact) for exact in STICKS], axis=0).max() if horizon >= SETTLED else np.nan
    return Horizon(horizon, count, wall, grown, float(error))
