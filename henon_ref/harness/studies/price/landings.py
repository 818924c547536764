"""Hénon's landing (the swap of variables) against Newton's and Brent's on one integrator: work, times, errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import sympy as sp

from henon_ref.baselines.henon import HENON_BRENT, HENON_NEWTON, HENON_SOLVER
from henon_ref.casefile.case import Case, parse_case
from henon_ref.harness.campaign.timing import interleaved
from henon_ref.harness.rows import Row
from henon_ref.harness.studies.paired_times.rows import FIRST
from henon_ref.harness.studies.price.measure import title
from henon_ref.harness.table import Table, duration, error
from henon_ref.harness.truth.compute import stored_truth
from henon_ref.harness.truth.reference import split_double
from henon_ref.modes.mode import Mode
from henon_ref.modes.problem import Problem
from henon_ref.trajectory import Trajectory

GRAZES = ("1", "1e-1", "1e-3", "1e-5", "1e-7", "1e-9")
"""Depths of a crossing below the crest it goes through: 1 is half way up."""
CREST = """\
schema: 1
name: crest
title: A crossing near a crest
system:
  state: [x, v, y]
  parameters: {{g: {depth}}}
  surfaces: {{s: 1 - g/2 - x}}
  field: [v, -x, s]
initial: {{t: 0, x: 0, v: 1, y: 0}}
until: 3
"""
SOLVERS = (HENON_SOLVER, HENON_NEWTON, HENON_BRENT)
RTOL = 1e-13
ROUNDS = 40


@dataclass(frozen=True)
class Landed(Row):
    """One landing on one reading."""

    case: str
    reading: str
    solver: str
    transitions: int
    evaluations: float
    """Evaluations of the guard's polynomial, a transition."""
    wall_s: float
    to_bracketing: float
    """Time of the run over that with bracketing alone, median over the rounds."""
    error_s: float
    """Worst error of a transition's time; NaN where the sequence is not the truth's."""


def landings(cases: Sequence[Case]) -> list[Landed]:
    """Run the three landings on every reading that has a stored truth with transitions."""
    found = []
    for case in cases:
        for reading in case.readings:
            truth = stored_truth(case, reading)
            if truth is not None and truth.transitions and reading.solvers is None:
                crossings = [t for t in truth.transitions if t.kind != "graze"]
                exact = [split_double(t.time_digits) for t in crossings]
                found += _three(case.name, reading.name, reading.problem, exact, [t.to_mode for t in crossings])
    return found


def crest_crossings(depths: Sequence[str] = GRAZES) -> list[Landed]:
    """Run them on ``sin(t) = 1 - g/2`` for ever smaller depths g below the crest; its roots are closed forms."""
    found = []
    for depth in depths:
        problem = parse_case(CREST.format(depth=depth)).readings[0].problem
        level = 1 - sp.Rational(depth) / 2
        exact = [split_double(str(sp.N(root, 40))) for root in (sp.asin(level), sp.pi - sp.asin(level))]
        found += _three("crest", f"g = {depth}", problem, exact, [(-1,), (1,)])
    return found


def _three(
    case: str, reading: str, problem: Problem, exact: Sequence[tuple[float, float]], modes: Sequence[Mode]
) -> list[Landed]:
    runs = {s.name: s.prepare(problem, rtol=RTOL, deadline=20.0) for s in SOLVERS}
    times = interleaved(runs, rounds=ROUNDS)
    lines = []
    for solver, run in runs.items():
        result = run()
        count = len(result.transitions)
        evaluations = result.counts.event_evaluations / count if count else math.nan
        error = _error(result, exact, modes)
        ratio = times.ratio(solver, HENON_BRENT.name)
        lines.append(Landed(case, reading, solver, count, evaluations, times.median(solver), ratio, error))
    return lines


def _error(run: Trajectory, exact: Sequence[tuple[float, float]], modes: Sequence[Mode]) -> float:
    own = [t for t in run.transitions if t.kind != "graze"]
    if [t.to_mode for t in own] != list(modes):
        return math.nan
    pairs = zip(own, exact, strict=True)
    return max((abs((t.time - high) + (t.time_low - low)) for t, (high, low) in pairs), default=0.0)


def landing_table(found: Sequence[Landed]) -> Table:
    """Evaluations, time and error of the three landings, and the time with Hénon's over that with bracketing."""
    solvers = list(dict.fromkeys(one.solver for one in found))
    columns: tuple[Callable[[Landed], str], ...] = (
        lambda one: f"{one.evaluations:.1f}",
        lambda one: duration(one.wall_s),
        lambda one: "another sequence" if math.isnan(one.error_s) else error(one.error_s),
    )
    lines = []
    for case, reading in dict.fromkeys((own.case, own.reading) for own in found):
        own = {one.solver: one for one in found if (one.case, one.reading) == (case, reading)}
        cells = [column(own[solver]) for column in columns for solver in solvers]
        ratio = own[FIRST].to_bracketing
        note = "bracketing is quicker" if ratio > 1 else ""
        lines.append((title(case, reading), *cells, f"{ratio:.2f}", note))
    words = ("evaluations", "run", "error [s]")
    headings = (
        "reading",
        *(f"{word}, `{solver}`" for word in words for solver in solvers),
        "run over bracketing",
        "note",
    )
    return Table(headings, "l" + "r" * len(words) * len(solvers) + "rl", lines)
