"""Long runs: wall time a transition, growth of memory and error of the last sticks over horizons up to 1e6 s."""

from __future__ import annotations

import math
import resource
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np
import sympy as sp

from henon_ref.harness import registry
from henon_ref.harness.rows import Row
from henon_ref.harness.studies.price.measure import in_fresh_process
from henon_ref.harness.table import Table, duration, error
from henon_ref.integrator.integrator import Integrator
from henon_ref.integrator.prepared_run import order_for
from henon_ref.integrator.records import HENON
from henon_ref.integrator.run import Run
from henon_ref.modes.problem import Problem

HORIZONS: Mapping[str, tuple[float, ...]] = {
    "henon": (1e2, 1e3, 1e4, 1e5, 1e6),
    "heyoka": (1e2, 1e3, 1e4, 1e5),
    "scipy-dop853": (1e2, 1e3, 1e4),
}
"""Horizons of each solver [s]: as far as a minute leads."""
TOLERANCE = 1e-13
STICKS = (1.17430046762285, 0.41641643691198)
"""Sticks of the periodic orbit of Fig. 8's `listing_limit` [s], certified by Krawczyk's test."""
SETTLED = 500.0
"""From this time on [s] what is left of the start is below a double's rounding (its multiplier is 0.4 a period)."""
SHORT = 5.0
"""Runs below this [s] are made three times."""
LONG = 1e3
"""The power of the growth is fitted from this horizon on [s]."""
LAST = 20
"""The last sticks that are compared with the certified ones."""
SEEN = 400
"""The last transitions that these are taken from."""
_STICK, _RELEASE = 0, 1
_Transition = tuple[tuple[float, float], int | None]
"""Time, in two parts [s], and kind."""
_Run = Callable[[], tuple[int, list[float]]]
"""A run: how many transitions there were, and how long the last sticks were [s]."""


@dataclass(frozen=True)
class Horizon(Row):
    """One solver's run."""

    solver: str
    until: float
    """Horizon [s]."""
    transitions: int
    wall_s: float
    """Median of three runs, or the one that was made [s]."""
    grown: float
    """Growth of the process's peak resident memory by the run [MiB]."""
    stick_error_s: float
    """Worst error of the last sticks against the certified ones [s]; NaN before the motion has settled."""

    @property
    def per_transition_s(self) -> float:
        """Wall time of one transition [s]."""
        return self.wall_s / self.transitions


def horizons(problem: Problem, wanted: Mapping[str, Sequence[float]] = HORIZONS) -> list[Horizon]:
    """Run Fig. 8's periodic motion over each horizon, each solver in a process of its own."""
    return [own for solver, until in wanted.items() for own in in_fresh_process(horizons_of, solver, problem, until)]


def horizons_of(solver: str, problem: Problem, horizons: Sequence[float]) -> list[Horizon]:
    """A solver's runs, the shortest first; those of ``henon`` stream their transitions."""
    prepare = _streamed(problem) if solver == "henon" else _whole(solver, problem)
    prepare(10.0)()
    return [_measured(solver, until, prepare(until)) for until in horizons]


def _measured(solver: str, until: float, run: _Run) -> Horizon:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    times: list[float] = []
    while len(times) < 3 and (not times or times[0] < SHORT):
        began = time.perf_counter()
        transitions, last = run()
        times.append(time.perf_counter() - began)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    found = np.array(last)
    error = np.min([np.abs(found - exact) for exact in STICKS], axis=0).max() if until >= SETTLED else np.nan
    return Horizon(solver, until, transitions, median(times), grown, float(error))


def _streamed(problem: Problem) -> Callable[[float], _Run]:
    """Runs of the reference, by its stream of transitions."""
    integrator = Integrator(problem.system, order_for(TOLERANCE))
    start = integrator.start(problem, tolerance=TOLERANCE, landing=HENON)

    def prepare(until: float) -> _Run:
        def run() -> tuple[int, list[float]]:
            count, last = 0, deque[_Transition](maxlen=SEEN)
            for block in Run(integrator, replace(start, until=(until, 0.0))).stream():
                count += len(block)
                last.extend(zip(block.times[-SEEN:], block.kinds[-SEEN:], strict=True))
            return count, _last_sticks(last)

        return run

    return prepare


def _whole(solver: str, problem: Problem) -> Callable[[float], _Run]:
    """Runs of a solver that returns all transitions at its end."""
    codes = {"stick": _STICK, "release": _RELEASE}

    def prepare(until: float) -> _Run:
        longer = replace(problem, until=sp.Rational(until))
        prepared = registry.solver(solver).prepare(longer, rtol=TOLERANCE, atol=TOLERANCE)

        def run() -> tuple[int, list[float]]:
            transitions = prepared().transitions
            return len(transitions), _last_sticks(
                ((t.time, t.time_low), codes.get(t.kind)) for t in transitions[-SEEN:]
            )

        return run

    return prepare


def _last_sticks(transitions: Iterable[_Transition]) -> list[float]:
    """How long the last sticks were [s]."""
    sticks, since = [], None
    for (high, low), kind in transitions:
        if kind == _STICK:
            since = high, low
        elif kind == _RELEASE and since is not None:
            sticks.append((high - since[0]) + (low - since[1]))
    return sticks[-LAST:]


def growth_table(found: Sequence[Horizon]) -> Table:
    """Cost, memory and accuracy over the horizon."""
    lines: list[tuple[str, ...]] = [
        (
            f"`{own.solver}`",
            f"{own.until:.0e} s",
            f"{own.transitions}",
            duration(own.wall_s),
            duration(own.per_transition_s),
            f"{own.grown:.1f} MiB",
            "not settled yet" if math.isnan(own.stick_error_s) else f"{error(own.stick_error_s)} s",
        )
        for own in found
    ]
    headings = (
        "solver", "horizon", "transitions", "wall time", "a transition", "growth of peak memory", "last sticks' error",
    )  # fmt: skip
    return Table(headings, "lrrrrrr", lines)
