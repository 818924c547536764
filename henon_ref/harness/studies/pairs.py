"""Paired times of ``henon`` and another solver for the same number of digits, with interleaved runs in one worker.

heyoka's calls of ``propagate_until`` are also timed separately, without the mode switches in Python: they are nearly
the whole time of a program that switches modes in compiled code.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from statistics import median
from time import perf_counter
from types import ModuleType
from typing import Any

import numpy as np

from henon_ref.baselines.heyoka_taylor import HeyokaTaylor
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.progress import ProgressLine
from henon_ref.harness.campaign.timing import Turns, interleaved, median_interval, timed
from henon_ref.harness.rows import Key, ReadingRow, RunRow, number
from henon_ref.harness.score.ranking import reaching
from henon_ref.harness.table import significant
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run, Solver
from henon_ref.text import code
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job, WorkerState

FIRST = "henon"
"""The solver with which all other solvers are compared."""
SECOND = "heyoka"
"""The next best solver."""
FEWEST, MOST = 9, 200
"""Bounds of the number of runs of each setting."""
TURN = 1e-3
"""A short run is repeated for this time in its turn [s]."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class PairRow(ReadingRow):
    """Times of the reference and another solver at settings with the same digits, from interleaved runs."""

    digits: int | None
    """None if there is no transition."""
    against: str
    rtol: float | None
    rival: str
    rival_rtol: float | None
    rival_step_s: float | None
    wall_s: float
    """Median [s]."""
    rival_wall_s: float
    ratio: float
    """Time of the reference divided by that of the rival."""
    ratio_low: float
    """Lower end of the 95 % bootstrap interval of the ratio."""
    ratio_high: float
    rounds: int
    rival_own_s: float | None = None
    """Time of the rival library's own calls, without mode switches in Python [s]; None if the rival is not heyoka."""

    @property
    def times_as_long(self) -> float:
        """Time of the rival divided by that of the reference."""
        return 1.0 / self.ratio

    @property
    def own_times_as_long(self) -> float | None:
        """Time of the rival library's own calls divided by that of the reference's run; None if it is unknown."""
        return None if self.rival_own_s is None else self.rival_own_s / self.wall_s


@dataclass(frozen=True)
class TimedPair(PairRow):
    """A pair with the times of every round."""

    samples_s: tuple[float, ...] = ()
    """Times of the reference [s]."""
    rival_samples_s: tuple[float, ...] = ()


@dataclass(frozen=True)
class Pair:
    """The reference and a rival for the same digits, each with the rows of its cheapest settings."""

    digits: int | None
    """Digits that every setting of both solvers reaches; None if the reading has no transition."""
    against: str
    """Name of the rival, or of a group of solvers whose cheapest is taken."""
    own: tuple[RunRow, ...]
    rival: tuple[RunRow, ...]


def pairs_of(rows: Sequence[RunRow], rivals: Mapping[str, Collection[str]], levels: Sequence[int]) -> Iterator[Pair]:
    """Yield the pairs of one reading's rows for every level of digits.

    ``rivals`` maps the name of a rival to its solvers. A reading without transitions has one pair, of its right rows.
    """
    for level, able in able_rows(rows, levels):
        own = _cheapest(able, (FIRST,))
        for against, solvers in rivals.items():
            rival = _cheapest(able, solvers)
            if own and rival:
                yield Pair(level, against, own, rival)


def able_rows(rows: Sequence[RunRow], levels: Sequence[int]) -> Iterator[tuple[int | None, list[RunRow]]]:
    """Yield each level with the rows that reach it; for a reading without transitions, None with its right rows."""
    idle = [row for row in rows if row.verdict == "right" and row.reference_transitions == 0 and row.wall_s]
    if idle:
        yield None, idle
    else:
        yield from ((level, reaching(rows, level)) for level in levels)


def _cheapest(rows: Sequence[RunRow], solvers: Collection[str]) -> tuple[RunRow, ...]:
    """Three cheapest settings by the rows; timing may change their order."""
    own = [row for row in rows if row.solver in solvers and row.wall_s]
    return tuple(sorted(own, key=lambda row: number(row.wall_s))[:3])


class _Clocked:
    """Integrator of heyoka that appends the time of each call of ``propagate_until`` to ``spent_s``."""

    def __init__(self, integrator: Any, spent_s: list[float]) -> None:
        vars(self).update(_integrator=integrator, _spent_s=spent_s)

    def propagate_until(self, *args: Any, **options: Any) -> Any:
        began = perf_counter()
        result = self._integrator.propagate_until(*args, **options)
        self._spent_s.append(perf_counter() - began)
        return result

    def __getattr__(self, name: str) -> Any:
        return getattr(self._integrator, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._integrator, name, value)


@dataclass(frozen=True)
class ClockedHeyoka(HeyokaTaylor):
    """heyoka with timed calls of ``propagate_until``."""

    spent_s: list[float] = field(default_factory=list, kw_only=True, compare=False)
    """Time of each call [s]."""

    def load(self) -> Any:
        """Return a copy of the module, with integrators whose calls of ``propagate_until`` are timed.

        Caches of integrators find no other copy's.
        """
        module = super().load()
        copy = ModuleType(module.__name__)

        def taylor_adaptive(*args: Any, **options: Any) -> _Clocked:
            return _Clocked(module.taylor_adaptive(*args, **options), self.spent_s)

        vars(copy).update(vars(module) | {"taylor_adaptive": taylor_adaptive})
        return copy


def clocked(solver: Solver) -> ClockedHeyoka | None:
    """Return a copy of the solver with timed calls; None if the solver is not heyoka."""
    if not isinstance(solver, HeyokaTaylor):
        return None
    return ClockedHeyoka(**{own.name: getattr(solver, own.name) for own in fields(solver)})


def own_part(solver: str, run: Run, prepare: Callable[[Any], Run], *, rounds: int) -> float | None:
    """Median over rounds of the time of the library's own calls divided by that of a whole run; None if unknown.

    ``prepare`` prepares the same run as ``run`` by a solver. One more round is made first, to warm up.
    """
    own = clocked(registry.solver(solver))
    if own is None:
        return None
    parts, clocked_run = [], prepare(own)
    for _ in range(rounds + 1):
        whole = timed(run)
        own.spent_s.clear()
        clocked_run()
        parts.append(sum(own.spent_s) / whole)
    return median(parts[1:])


@dataclass(frozen=True)
class PairedTiming:
    """Time the settings of pairs on one reading in interleaved runs; make a row per pair for its cheapest settings."""

    case: str
    reading: str
    problem: Problem
    pairs: tuple[Pair, ...]
    spend: float
    """Time that all runs may take together [s]; each is made at least :attr:`fewest` times."""
    deadline: float
    """Time that one run may take [s]."""
    fewest: int = FEWEST

    @property
    def candidates(self) -> dict[Key, RunRow]:
        """Settings to run, by key."""
        return {row.key: row for pair in self.pairs for row in (*pair.own, *pair.rival)}

    @property
    def round_s(self) -> float:
        """Estimated time of one round, from the rows [s]."""
        return sum(max(number(row.wall_s), TURN) for row in self.candidates.values())

    @property
    def rounds(self) -> int:
        """Number of runs of each setting."""
        return min(max(int(self.spend / self.round_s), self.fewest), MOST)

    @property
    def seconds(self) -> float:
        # The preparation of all settings may take 300 s; compiled callbacks take some seconds each.
        return 300.0 + 10.0 * (self.rounds + 1) * self.round_s

    def run(self, state: WorkerState) -> list[TimedPair]:
        runs = {key: self._prepared(row, registry.solver(row.solver)) for key, row in self.candidates.items()}
        times = interleaved(runs, rounds=self.rounds, turn=TURN)
        own_parts: dict[Key, float | None] = {}
        found = []
        for pair in self.pairs:
            own, rival = (min(rows, key=lambda row: times.median(row.key)) for rows in (pair.own, pair.rival))
            if rival.key not in own_parts:
                rounds, prepare = min(self.rounds, 20), partial(self._prepared, rival)
                own_parts[rival.key] = own_part(rival.solver, runs[rival.key], prepare, rounds=rounds)
            found.append(self._row(pair, own, rival, times, own_parts[rival.key]))
        return found

    def _prepared(self, row: RunRow, solver: Solver) -> Run:
        return solver.prepare(self.problem, rtol=row.rtol, atol=row.atol, step=row.step_s, deadline=self.deadline)

    def _row(self, pair: Pair, own: RunRow, rival: RunRow, times: Turns[Key], part: float | None) -> TimedPair:
        low, high = median_interval(times.ratios(own.key, rival.key))
        return TimedPair(
            case=self.case,
            reading=self.reading,
            digits=pair.digits,
            against=pair.against,
            rtol=own.rtol,
            rival=rival.solver,
            rival_rtol=rival.rtol,
            rival_step_s=rival.step_s,
            wall_s=times.median(own.key),
            rival_wall_s=times.median(rival.key),
            ratio=times.ratio(own.key, rival.key),
            ratio_low=low,
            ratio_high=high,
            rounds=self.rounds,
            rival_own_s=None if part is None else part * times.median(rival.key),
            samples_s=tuple(times.times[own.key]),
            rival_samples_s=tuple(times.times[rival.key]),
        )


def time_pairs(
    timings: Sequence[PairedTiming], options: Options, observer: ProgressLine
) -> tuple[list[TimedPair], list[str]]:
    """Time pairs, each job in one worker; return the rows, and a sentence for each job that fails."""
    rows: dict[int, list[TimedPair]] = {}
    failed: list[str] = []

    def job(k: int, timing: PairedTiming) -> Jobs:
        result = yield Job(timing.run, (), timing.seconds)
        if isinstance(result, Failure):
            whom = ", ".join(dict.fromkeys(pair.against for pair in timing.pairs))
            failed.append(f"{timing.case}, {timing.reading}, against {whom}: {result.reason}")
            _LOG.info("no alternating runs: %s", failed[-1])
        else:
            rows[k] = result

    pool = WorkerPool(workers=options.processes, memory=options.memory)
    for k, timing in enumerate(timings):
        pool.add("timings", job(k, timing))
    pool.run(observer.tick)
    return [row for k in sorted(rows) for row in rows[k]], failed


def own_words(rows: Sequence[PairRow]) -> str:
    """Sentence on the part of heyoka's own calls in its times; empty if that is unknown."""
    found = [row for row in rows if row.against == SECOND and row.rival_own_s is not None]
    if not found:
        return ""
    part = np.median([number(row.rival_own_s) / row.rival_wall_s for row in found])
    whole = np.median([row.times_as_long for row in found])
    own = np.median([number(row.own_times_as_long) for row in found])
    return (
        f"In alternating runs {code(SECOND)} takes {significant(float(whole), 2)} times as long as {code(FIRST)} "
        f"(median over readings and digits), of which its own calls of `propagate_until` are {part:.0%}: a program "
        f"that switches modes in compiled code would take {significant(float(own), 2)} times as long."
    )


def bound(digits: int | None) -> str:
    """Format a level of digits for a table."""
    return "no transition" if digits is None else f"{digits:g}"
