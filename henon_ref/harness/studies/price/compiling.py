"""Preparation times (imports, derivatives, compiling) in a new process, and the runs that make up for them."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from henon_ref.casefile.case import Case
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Setting
from henon_ref.harness.rows import Row, number
from henon_ref.harness.studies.paired_times.rows import FIRST, PairRow
from henon_ref.harness.studies.price.ladder import TIMEOUT
from henon_ref.harness.studies.price.measure import caches_in, in_fresh_process, title
from henon_ref.harness.table import Table, duration, significant
from henon_ref.modes.problem import Problem

DIGITS = 9
"""Digits of the worst transition for which runs are counted."""
AGAINST = {
    FIRST: ("heyoka", "scipy-dop853"),
    "heyoka": ("scipy-dop853",),
    "cvode-c-adams": ("cvode-adams",),
    "diffrax-dopri8": ("scipy-dop853",),
    "diffrax-kvaerno5": ("scipy-radau",),
    "diffsol-tsit45": ("scipy-dop853",),
    "diffsol-bdf": ("scipy-radau",),
}
"""Solvers that compile, and those that each is set against: quicker to prepare, slower to run."""
WARM_RUNS = 3
"""Runs after the first one; the shortest is what a run takes."""


@dataclass(frozen=True)
class Ready(Row):
    """One solver on one reading."""

    case: str
    reading: str
    solver: str
    rtol: float
    wall_s: float
    """Time of a run, in turn with the others' [s]."""
    cold_s: float
    """Time from a new process to its first run's end, less the time of a run, with nothing compiled on disk [s]."""
    kept_s: float
    """The same with the compiled code that the first process left on disk [s]."""


def readiness(cases: Sequence[Case], pairs: Iterable[PairRow]) -> list[Ready]:
    """Measure it on every reading, at the settings that the pairs were timed at for :data:`DIGITS` digits."""
    problems = {(case.name, reading.name): reading.problem for case in cases for reading in case.readings}
    own = [row for row in pairs if row.digits == DIGITS]
    named = {*AGAINST, *(other for others in AGAINST.values() for other in others)}
    found = []
    for (case, reading), problem in problems.items():
        rows = [row for row in own if row.problem == (case, reading)]
        settings: dict[str, tuple[float, float]] = {}
        if rows:
            settings[FIRST] = number(rows[0].rtol), rows[0].wall_s
        settings |= {row.rival: (number(row.rival_rtol), row.rival_wall_s) for row in rows}
        for solver, (rtol, wall) in settings.items():
            if solver in named:
                cold, kept = _twice(problem, solver, Setting(rtol, rtol, None))
                found.append(Ready(case, reading, solver, rtol, wall, cold, kept))
    return found


def paid_after(own: Ready, other: Ready, *, cold: bool) -> float:
    """Runs after which a solver that is slower to get ready has taken less time in all; infinite where it never has."""
    gain = other.wall_s - own.wall_s
    extra = own.cold_s - other.cold_s if cold else own.kept_s - other.kept_s
    return math.inf if gain <= 0 else max(math.ceil(extra / gain), 0)


def _twice(problem: Problem, solver: str, setting: Setting) -> tuple[float, float]:
    with tempfile.TemporaryDirectory() as folder, caches_in(Path(folder)):
        cold, kept = (in_fresh_process(getting_ready, problem, solver, setting) for _ in range(2))
    return cold, kept


def getting_ready(problem: Problem, solver: str, setting: Setting) -> float:
    """Time to the end of a first run, less the time of a later one [s]."""
    began = time.perf_counter()
    run = registry.solver(solver).prepare(
        problem, rtol=setting.rtol, atol=setting.atol, step=setting.step, deadline=TIMEOUT
    )
    run()
    first = time.perf_counter() - began
    later = []
    for _ in range(WARM_RUNS):
        began = time.perf_counter()
        run()
        later.append(time.perf_counter() - began)
    return first - min(later)


def ready_table(found: Sequence[Ready]) -> Table:
    """Preparation times, and the runs after which they are made up for."""
    lines: list[tuple[str, ...]] = []
    for own in found:
        others = {o.solver: o for o in found if (o.case, o.reading) == (own.case, own.reading)}
        paid = [
            f"{_runs(paid_after(own, others[rival], cold=True))} / {_runs(paid_after(own, others[rival], cold=False))}"
            f" against `{rival}`"
            for rival in AGAINST.get(own.solver, ())
            if rival in others
        ]
        lines.append(
            (
                title(own.case, own.reading),
                f"`{own.solver}`",
                duration(own.wall_s),
                duration(own.cold_s),
                duration(own.kept_s),
                "; ".join(paid),
            )
        )
    headings = (
        "reading", "solver", "a run", "ready, nothing on disk", "ready, code on disk",
        "paid for after runs (nothing on disk / code on disk)",
    )  # fmt: skip
    return Table(headings, "llrrrl", lines)


def _runs(runs: float) -> str:
    return "never" if math.isinf(runs) else significant(runs, 2)
