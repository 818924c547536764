"""Comparison of Hénon's landing (swap of variables) with Newton's and Brent's in one integrator: work, time, error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from henon_ref.baselines.henon import HENON_BRENT, HENON_NEWTON, HENON_SOLVER
from henon_ref.casefile.case import Case
from henon_ref.harness.campaign.timing import interleaved
from henon_ref.harness.rows import ReadingRow
from henon_ref.harness.score.ranking import by_solver, readings_of
from henon_ref.harness.studies.page import title
from henon_ref.harness.studies.pairs import FIRST
from henon_ref.harness.table import Table, duration, error
from henon_ref.harness.truth.compute import stored_truth
from henon_ref.harness.truth.reference import split_double
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.simulation.arguments import problem_of
from henon_ref.simulation.system import System
from henon_ref.text import code


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
