"""What Hénon's trick is worth: three landings on one engine, far from a graze and ever nearer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from henon_ref.henon.solvers import HENON_BRENT, HENON_NEWTON, HENON_SOLVER
from henon_ref.model.case import Case, Reading
from henon_ref.price.timer import in_turn
from henon_ref.trajectory import Trajectory
from henon_ref.truth.reference import Truth, split_double

SOLVERS = (HENON_SOLVER, HENON_NEWTON, HENON_BRENT)
RTOL = 1e-13
ROUNDS = 40


@dataclass(frozen=True)
class Landed:
    """One landing on one reading."""

    case: str
    reading: str
    solver: str
    transitions: int
    evaluations: float
    """Evaluations of the guard's polynomial, a transition."""
    wall_s: float
    error_s: float
    """Worst error of a transition's time; NaN where the sequence is not the truth's."""


def landings(cases: Sequence[Case], truths: dict[tuple[str, str], Truth]) -> list[Landed]:
    """Run the three landings on every reading that has a stored truth with transitions."""
    found = []
    for case in cases:
        for reading in case.readings:
            truth = truths.get((case.name, reading.name))
            if truth is not None and truth.transitions and reading.solvers is None:
                found += _three(case, reading, truth)
    return found


def _three(case: Case, reading: Reading, truth: Truth) -> list[Landed]:
    runs = {s.name: s.prepare(reading.problem, rtol=RTOL, deadline=20.0) for s in SOLVERS}
    times = in_turn(runs, rounds=ROUNDS)
    lines = []
    for solver, run in runs.items():
        result = run()
        count = len(result.transitions)
        evaluations = result.counts.event_evaluations / count if count else math.nan
        error = _error(result, truth)
        lines.append(Landed(case.name, reading.name, solver, count, evaluations, times[solver].median, error))
    return lines


def _error(run: Trajectory, truth: Truth) -> float:
    crossings = [t for t in truth.transitions if t.kind != "graze"]
    own = [t for t in run.transitions if t.kind != "graze"]
    if [t.to_mode for t in own] != [t.to_mode for t in crossings]:
        return math.nan
    worst = 0.0
    for mine, exact in zip(own, crossings, strict=True):
        high, low = split_double(exact.time_digits)
        worst = max(worst, abs((mine.time - high) + (mine.time_low - low)))
    return worst
