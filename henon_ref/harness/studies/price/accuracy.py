"""Time and error of runs: with three landings, and over horizons up to 1e6 s.

Hénon's landing (swap of variables) is compared with Newton's and Brent's in one integrator: work, time and error. For
long runs: wall time per transition, growth of memory, and error of the last sticks.
"""

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

from henon_ref.baselines.henon import HENON_BRENT, HENON_NEWTON, HENON_SOLVER
from henon_ref.casefile.case import Case
from henon_ref.figures import style
from henon_ref.harness import registry
from henon_ref.harness.campaign.timing import interleaved, timed
from henon_ref.harness.rows import ReadingRow, Row
from henon_ref.harness.score.ranking import by_solver, readings_of
from henon_ref.harness.studies.page import draw_line, finish, fitted, in_fresh_process, title
from henon_ref.harness.studies.pairs import FIRST
from henon_ref.harness.table import Table, duration, error
from henon_ref.harness.truth.compute import stored_truth
from henon_ref.harness.truth.reference import split_double
from henon_ref.integrator.integrator import Integrator, order_for
from henon_ref.integrator.run import Run
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.simulation.arguments import problem_of
from henon_ref.simulation.system import System
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
LAST_TRANSITIONS = 400
"""Number of last transitions in which 20 complete sticks are found."""
_STICK, _RELEASE = 0, 1
_Transition = tuple[tuple[float, float], int | None]
"""Time in two parts [s], and kind, of a transition."""
Ended = tuple[int, Iterable[_Transition]]
"""Result of a run: number of transitions, and the last of them."""


@dataclass(frozen=True)
class Landed(ReadingRow):
    """Measurement of one landing on one reading."""

    solver: str
    transitions: int
    evaluations: float
    """Evaluations of the guard's polynomial per transition."""
    wall_s: float
    to_bracketing: float
    """Time of the run divided by that with bracketing (Brent), median over the rounds."""
    error_s: float
    """Largest error of a transition time [s]; NaN if the sequence of modes is wrong."""


def landings(cases: Sequence[Case]) -> list[Landed]:
    """Run the three landings on every reading that has a stored truth with transitions."""
    found = []
    for case in cases:
        for reading in case.readings:
            truth = stored_truth(case, reading)
            if truth is not None and truth.transitions and reading.solvers is None:
                exact = [(t.to_mode, t.time_digits) for t in truth.transitions if t.kind != "graze"]
                found += _three(case.name, reading.name, reading.problem, exact)
    return found


def crest_crossings(depths: Sequence[str] = ("1", "1e-1", "1e-3", "1e-5", "1e-7", "1e-9")) -> list[Landed]:
    """Run the three landings on ``sin(t) = 1 - g/2`` for decreasing depths g; its roots are closed forms.

    A depth is the distance of a crossing from the crest of the motion; 1 is half way up.
    """
    found = []
    for depth in depths:
        crest = System(["x", "v", "y"], {"g": depth}, {"s": "1 - g/2 - x"}, ["v", "-x", "s"])
        level = 1 - sp.Rational(depth) / 2
        exact = [((-1,), str(sp.N(sp.asin(level), 40))), ((1,), str(sp.N(sp.pi - sp.asin(level), 40)))]
        found += _three("crest", f"g = {depth}", problem_of(crest, {"x": 0, "v": 1, "y": 0}, until=3)[1], exact)
    return found


def _three(case: str, reading: str, problem: Problem, exact: Sequence[tuple[Mode, str]]) -> list[Landed]:
    """Measure the three landings on a problem with known modes and times of its transitions."""
    solvers = (HENON_SOLVER, HENON_NEWTON, HENON_BRENT)
    runs = {solver.name: solver.prepare(problem, rtol=1e-13, deadline=20.0) for solver in solvers}
    times = interleaved(runs, rounds=40)
    lines = []
    for name, run in runs.items():
        result = run()
        count = len(result.transitions)
        own = [t for t in result.transitions if t.kind != "graze"]
        worst = math.nan
        if [t.to_mode for t in own] == [mode for mode, _ in exact]:
            pairs = [(t, split_double(digits)) for t, (_, digits) in zip(own, exact, strict=True)]
            worst = max((abs((t.time - high) + (t.time_low - low)) for t, (high, low) in pairs), default=0.0)
        evaluations = result.counts.event_evaluations / count if count else math.nan
        ratio = times.ratio(name, HENON_BRENT.name)
        lines.append(Landed(case, reading, name, count, evaluations, times.median(name), ratio, worst))
    return lines


def landing_table(found: Sequence[Landed]) -> Table:
    """Table of evaluations, time and error of the landings, and the time with Hénon's divided by that with Brent's."""
    solvers = list(by_solver(found))
    lines = []
    for problem, every in readings_of(found).items():
        errors = ["another sequence" if math.isnan(one.error_s) else error(one.error_s) for one in every]
        cells = [*(f"{one.evaluations:.1f}" for one in every), *(duration(one.wall_s) for one in every), *errors]
        ratio = every[solvers.index(FIRST)].to_bracketing
        lines.append((title(*problem), *cells, f"{ratio:.2f}", "bracketing is quicker" if ratio > 1 else ""))
    columns = [f"{word}, {code(solver)}" for word in ("evaluations", "run", "error [s]") for solver in solvers]
    headings = ("reading", *columns, "run over bracketing", "note")
    return Table(headings, "l" + "r" * len(columns) + "rl", lines)


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
        count, last = 0, deque[_Transition](maxlen=LAST_TRANSITIONS)
        for block in Run(integrator, start).stream():
            count += len(block)
            last.extend(zip(block.times[-LAST_TRANSITIONS:], block.kinds[-LAST_TRANSITIONS:], strict=True))
        return count, last

    return run


def _whole(solver: Solver, problem: Problem) -> Callable[[], Ended]:
    """Prepare a run of a solver that returns all transitions at the end."""
    prepared = solver.prepare(problem, rtol=TOLERANCE, atol=TOLERANCE)
    codes = {"stick": _STICK, "release": _RELEASE}

    def run() -> Ended:
        transitions = prepared().transitions
        return len(transitions), [((t.time, t.time_low), codes.get(t.kind)) for t in transitions[-LAST_TRANSITIONS:]]

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
    bound = 1e-11  # largest allowed error of a stick in a run of a million seconds [s]
    powers = {solver: fitted(own, "until", "wall_s", since=1e3) for solver, own in solvers.items()}
    with style.figure(3.0) as figure:
        times, errors = figure.subplots(1, 2, sharex=True)
        for solver, fit in powers.items():
            own = solvers[solver]
            settled = [(run.until, max(run.stick_error_s, 1e-16)) for run in own if not math.isnan(run.stick_error_s)]
            points, look = [(run.until, 1e6 * run.per_transition_s) for run in own], style.line_of(solver)
            draw_line(times, look, points, f"{solver}: run ~ horizon^({fit})")
            draw_line(errors, look, settled, solver)
        errors.axhline(bound, color=style.GREY, ls="--", lw=0.9)
        errors.annotate(
            f"bound: {bound:.0e} s", (max(run.until for run in found), bound), (0, -11),
            textcoords="offset points", fontsize=8.0, color=style.GREY, ha="right",
        )  # fmt: skip
        times.set(xlabel="horizon [s]", ylabel="wall time per transition [µs]")
        errors.set(xlabel="horizon [s]", ylabel="largest error of the last sticks [s]")
        finish(
            figure,
            "Time per transition, and error of the last sticks, over the horizon",
            "Two panels with logarithmic axes. Time of a run grows with a power of the horizon: "
            + "; ".join(f"{solver} {fit}" for solver, fit in powers.items())
            + f". In the second panel a dashed line is the bound of {bound:.0e} s on the error of the last sticks.",
            (times,),
        )
    return figure
