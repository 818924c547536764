"""Long runs: wall time per transition, growth of memory and error of the last sticks for horizons up to 1e6 s."""

from __future__ import annotations

import math
import resource
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from statistics import median

import numpy as np
import sympy as sp
from matplotlib.figure import Figure

from henon_ref.figures import style
from henon_ref.harness import registry
from henon_ref.harness.campaign.timing import timed
from henon_ref.harness.rows import Row
from henon_ref.harness.score.ranking import by_solver
from henon_ref.harness.studies.page import draw_line, finish, fitted, in_fresh_process
from henon_ref.harness.table import Table, duration, error
from henon_ref.integrator.integrator import Integrator, order_for
from henon_ref.integrator.run import Run
from henon_ref.modes.problem import Problem
from henon_ref.solver import Solver
from henon_ref.text import code

HORIZONS: Mapping[str, tuple[float, ...]] = {
    "henon": (1e2, 1e3, 1e4, 1e5, 1e6),
    "heyoka": (1e2, 1e3, 1e4, 1e5),
    "scipy-dop853": (1e2, 1e3, 1e4),
}
"""Horizons of each solver [s]; the longest run takes up to a minute."""
TOLERANCE = 1e-13
STICKS = (1.17430046762285, 0.41641643691198)
"""Durations of the sticks of the periodic orbit of Fig. 8's `listing_limit` [s], certified by Krawczyk's test."""
SETTLED = 500.0
"""Time after which the influence of the start is below rounding [s] (the orbit's multiplier is 0.4 per period)."""
BOUND = 1e-11
"""Largest allowed error of a stick in a run of a million seconds [s]."""
SEEN = 400
"""Number of last transitions in which 20 complete sticks are found."""
_STICK, _RELEASE = 0, 1
_Transition = tuple[tuple[float, float], int | None]
"""Time in two parts [s], and kind, of a transition."""
Ended = tuple[int, Iterable[_Transition]]
"""Result of a run: number of transitions, and the last of them."""


@dataclass(frozen=True)
class Horizon(Row):
    """Measurement of one run of one solver."""

    solver: str
    until: float
    """Horizon [s]."""
    transitions: int
    wall_s: float
    """Median wall time of three runs, or the time of the only one [s]."""
    grown: float
    """Growth of the process's peak resident memory by the run [MiB]."""
    stick_error_s: float
    """Largest error of the last sticks [s]; NaN if the horizon is before :data:`SETTLED`."""

    @property
    def per_transition_s(self) -> float:
        """Wall time of one transition [s]."""
        return self.wall_s / self.transitions


def horizons(problem: Problem, wanted: Mapping[str, Sequence[float]] = HORIZONS) -> list[Horizon]:
    """Run Fig. 8's periodic motion over each horizon, each solver in a new process."""
    return [own for solver, until in wanted.items() for own in in_fresh_process(horizons_of, solver, problem, until)]


def horizons_of(solver: str, problem: Problem, horizons: Sequence[float]) -> list[Horizon]:
    """Measure a solver's runs, in the order of ``horizons``; those of ``henon`` stream their transitions."""
    if solver == "henon":
        prepare = partial(_streamed, Integrator(problem.system, order_for(TOLERANCE)))
    else:
        prepare = partial(_whole, registry.solver(solver))

    def run_to(until: float) -> Callable[[], Ended]:
        return prepare(replace(problem, until=sp.Rational(until)))

    run_to(10.0)()
    return [_measured(solver, until, run_to(until)) for until in horizons]


def _measured(solver: str, until: float, run: Callable[[], Ended]) -> Horizon:
    """Measure a run; one that is shorter than five seconds is made three times."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    ends: list[Ended] = []
    times: list[float] = []
    while len(times) < 3 and (not times or times[0] < 5.0):
        times.append(timed(lambda: ends.append(run())))
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    transitions, last = ends[-1]
    sticks, since = [], None
    for (high, low), kind in last:
        if kind == _STICK:
            since = high, low
        elif kind == _RELEASE and since is not None:
            sticks.append((high - since[0]) + (low - since[1]))
    found = np.array(sticks[-20:])
    error = np.min([np.abs(found - exact) for exact in STICKS], axis=0).max() if until >= SETTLED else np.nan
    return Horizon(solver, until, transitions, median(times), grown, float(error))


def _streamed(integrator: Integrator, problem: Problem) -> Callable[[], Ended]:
    """Prepare a run of the reference that streams its transitions."""
    start = integrator.start(problem, tolerance=TOLERANCE)

    def run() -> Ended:
        count, last = 0, deque[_Transition](maxlen=SEEN)
        for block in Run(integrator, start).stream():
            count += len(block)
            last.extend(zip(block.times[-SEEN:], block.kinds[-SEEN:], strict=True))
        return count, last

    return run


def _whole(solver: Solver, problem: Problem) -> Callable[[], Ended]:
    """Prepare a run of a solver that returns all transitions at the end."""
    prepared = solver.prepare(problem, rtol=TOLERANCE, atol=TOLERANCE)
    codes = {"stick": _STICK, "release": _RELEASE}

    def run() -> Ended:
        transitions = prepared().transitions
        return len(transitions), [((t.time, t.time_low), codes.get(t.kind)) for t in transitions[-SEEN:]]

    return run


def growth_table(found: Sequence[Horizon]) -> Table:
    """Table of cost, memory and accuracy over the horizon."""
    lines: list[tuple[str, ...]] = [
        (
            code(own.solver),
            f"{own.until:.0e} s",
            f"{own.transitions}",
            duration(own.wall_s),
            duration(own.per_transition_s),
            f"{own.grown:.1f} MiB",
            "not settled" if math.isnan(own.stick_error_s) else f"{error(own.stick_error_s)} s",
        )
        for own in found
    ]
    headings = (
        "solver", "horizon", "transitions", "wall time", "time per transition", "growth of peak memory",
        "error of the last sticks",
    )  # fmt: skip
    return Table(headings, "lr", lines)


def draw_growth(found: Sequence[Horizon]) -> Figure:
    """Draw the time per transition and the error of the last sticks over the horizon, for every solver."""
    solvers = by_solver(found)
    powers = {solver: fitted(own, "until", "wall_s", since=1e3) for solver, own in solvers.items()}
    with style.figure(3.0) as figure:
        times, errors = figure.subplots(1, 2, sharex=True)
        for solver, fit in powers.items():
            own = solvers[solver]
            settled = [(run.until, max(run.stick_error_s, 1e-16)) for run in own if not math.isnan(run.stick_error_s)]
            points, look = [(run.until, 1e6 * run.per_transition_s) for run in own], style.line_of(solver)
            draw_line(times, look, points, f"{solver}: run ~ horizon^({fit})")
            draw_line(errors, look, settled, solver)
        errors.axhline(BOUND, color=style.GREY, ls="--", lw=0.9)
        errors.annotate(
            f"bound: {BOUND:.0e} s", (max(run.until for run in found), BOUND), (0, -11),
            textcoords="offset points", fontsize=8.0, color=style.GREY, ha="right",
        )  # fmt: skip
        times.set(xlabel="horizon [s]", ylabel="wall time per transition [µs]")
        errors.set(xlabel="horizon [s]", ylabel="largest error of the last sticks [s]")
        finish(
            figure,
            "Time per transition, and error of the last sticks, over the horizon",
            "Two panels with logarithmic axes. Time of a run grows with a power of the horizon: "
            + "; ".join(f"{solver} {fit}" for solver, fit in powers.items())
            + f". In the second panel a dashed line is the bound of {BOUND:.0e} s on the error of the last sticks.",
            (times,),
        )
    return figure
