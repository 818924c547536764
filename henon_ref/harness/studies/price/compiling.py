"""Preparation times (imports, derivatives, compiling) in a new process, and number of runs that compensate them."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from tempfile import TemporaryDirectory

from henon_ref.casefile.case import Case
from henon_ref.harness import registry
from henon_ref.harness.campaign.timing import timed
from henon_ref.harness.rows import Row, number
from henon_ref.harness.studies.page import title
from henon_ref.harness.studies.pairs import FIRST, PairRow
from henon_ref.harness.studies.price.ladder import TIMEOUT
from henon_ref.harness.studies.price.measure import in_fresh_process
from henon_ref.harness.table import Table, duration, significant
from henon_ref.modes.problem import Problem
from henon_ref.text import code

DIGITS = 9
"""Digits of the worst transition at which runs are compared."""
AGAINST = {
    FIRST: ("heyoka", "scipy-dop853"),
    "heyoka": ("scipy-dop853",),
    "cvode-c-adams": ("cvode-adams",),
    "diffrax-dopri8": ("scipy-dop853",),
    "diffrax-kvaerno5": ("scipy-radau",),
    "diffsol-tsit45": ("scipy-dop853",),
    "diffsol-bdf": ("scipy-radau",),
}
"""Solvers that compile, and the solvers with which each is compared: quicker to prepare, slower to run."""


@dataclass(frozen=True)
class Ready(Row):
    """Preparation times of one solver on one reading."""

    case: str
    reading: str
    solver: str
    rtol: float
    wall_s: float
    """Time of a run, interleaved with those of the other solvers [s]."""
    cold_s: float
    """Time from the start of a process to the end of its first run, minus the time of a run, without compiled code on
    disk [s]."""
    kept_s: float
    """The same time with the compiled code of the first process on disk [s]."""

    def paid_after(self, other: Ready) -> str:
        """Number of runs after which the total time is below that of ``other``: without / with code on disk."""
        gain = other.wall_s - self.wall_s
        extra = self.cold_s - other.cold_s, self.kept_s - other.kept_s
        return " / ".join("never" if gain <= 0 else significant(max(math.ceil(own / gain), 0), 2) for own in extra)


def readiness(cases: Sequence[Case], pairs: Iterable[PairRow]) -> list[Ready]:
    """Measure preparation times on every reading, at the settings of the pairs with :data:`DIGITS` digits."""
    problems = {(case.name, reading.name): reading.problem for case in cases for reading in case.readings}
    named = {*AGAINST, *(other for others in AGAINST.values() for other in others)}
    settings: dict[tuple[str, str, str], tuple[float, float]] = {}
    for row in pairs:
        if row.digits == DIGITS:
            settings.setdefault((*row.problem, FIRST), (number(row.rtol), row.wall_s))
            if row.rival in named:
                settings[(*row.problem, row.rival)] = number(row.rival_rtol), row.rival_wall_s
    found = []
    for (case, reading, solver), (rtol, wall) in settings.items():
        with TemporaryDirectory() as folder:
            given = problems[case, reading], solver, rtol
            cold, kept = (in_fresh_process(getting_ready, *given, cache=folder) for _ in range(2))
        found.append(Ready(case, reading, solver, rtol, wall, cold, kept))
    return found


def getting_ready(problem: Problem, solver: str, rtol: float) -> float:
    """Time to the end of the first run, minus the shortest time of three later runs [s]."""
    began = time.perf_counter()
    run = registry.solver(solver).prepare(problem, rtol=rtol, atol=rtol, deadline=TIMEOUT)
    run()
    first = time.perf_counter() - began
    return first - min(timed(run) for _ in range(3))


def ready_table(found: Sequence[Ready]) -> Table:
    """Table of the preparation times and the number of runs that compensate them."""
    lines: list[tuple[str, ...]] = []
    for own in found:
        others = {o.solver: o for o in found if (o.case, o.reading) == (own.case, own.reading)}
        rivals = [rival for rival in AGAINST.get(own.solver, ()) if rival in others]
        paid = "; ".join(f"{own.paid_after(others[rival])} against {code(rival)}" for rival in rivals)
        times = map(duration, (own.wall_s, own.cold_s, own.kept_s))
        lines.append((title(own.case, own.reading), code(own.solver), *times, paid))
    headings = (
        "reading", "solver", "run", "preparation, no code on disk", "preparation, code on disk",
        "compensated after runs (no code on disk / code on disk)",
    )  # fmt: skip
    return Table(headings, "llrrrl", lines)
