"""Paired timing: the runs of a reading's pairs interleaved by one worker, and ratios taken round by round."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options, Setting
from henon_ref.harness.campaign.progress import Observer
from henon_ref.harness.campaign.timing import Turns, interleaved, median_interval
from henon_ref.harness.report.text.ranking import reaching
from henon_ref.harness.rows import RunRow
from henon_ref.harness.studies.paired_times.own_calls import ClockedHeyoka, clocked, own_part
from henon_ref.harness.studies.paired_times.rows import FIRST, PairRow
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job, WorkerState

FEWEST, MOST = 9, 200
"""How often each setting is run."""
TURN = 1e-3
"""Seconds for which a short run is repeated when it is its turn."""
PREPARE_SECONDS = 300.0
"""Processor time that the preparation of all settings may take [s]: compiled callbacks take some seconds each."""
OWN_ROUNDS = 20
"""Rounds at most in which a library's own calls are clocked."""

_LOG = logging.getLogger(__name__)
CANDIDATES = 3
"""Settings of a side that are timed: the cheapest by the rows. The cheapest in turn is among them, or next to it."""


@dataclass(frozen=True)
class Candidate:
    """A solver at a setting."""

    solver: str
    setting: Setting
    wall_s: float
    """Time of a run, by the rows [s]."""


@dataclass(frozen=True)
class Pair:
    """The reference against a rival, for the same digits."""

    digits: int | None
    """Digits that every setting of both reaches; None where there is no transition to time."""
    against: str
    """The other side: a solver's name, or that of a group whose cheapest is taken."""
    own: tuple[Candidate, ...]
    """Candidates for the reference's cheapest setting."""
    rival: tuple[Candidate, ...]
    """Candidates for the other side's."""


def pairs_of(rows: Sequence[RunRow], rivals: Mapping[str, Collection[str]], levels: Sequence[int]) -> Iterator[Pair]:
    """The pairs of one reading's rows, for every level of digits; ``rivals``: of which solvers each is the cheapest.

    Where there is no transition to time, right rows are set against each other once.
    """
    for level, able in able_rows(rows, levels):
        own = _cheapest(able, (FIRST,))
        for against, solvers in rivals.items():
            rival = _cheapest(able, solvers)
            if own and rival:
                yield Pair(level, against, own, rival)


def able_rows(rows: Sequence[RunRow], levels: Sequence[int]) -> Iterator[tuple[int | None, list[RunRow]]]:
    """Rows that reach so many digits; once, and with None, those that are right where there is no transition."""
    idle = [row for row in rows if row.verdict == "right" and row.reference_transitions == 0 and row.wall_s]
    if idle:
        yield None, idle
    else:
        yield from ((level, reaching(rows, level)) for level in levels)


def _wall(candidate: Candidate) -> float:
    return candidate.wall_s


def _cheapest(rows: Sequence[RunRow], solvers: Collection[str]) -> tuple[Candidate, ...]:
    timed = [
        Candidate(row.solver, Setting(row.rtol, row.atol, row.step_s), row.wall_s)
        for row in rows
        if row.solver in solvers and row.wall_s
    ]
    return tuple(sorted(timed, key=_wall)[:CANDIDATES])


@dataclass(frozen=True)
class TimedPair(PairRow):
    """A pair with the times of every round."""

    samples_s: tuple[float, ...] = ()
    """The reference's [s]."""
    rival_samples_s: tuple[float, ...] = ()


@dataclass(frozen=True)
class PairedTiming(Job):
    """Time the settings of pairs on one reading, interleaved; a row a pair with the ratio of its cheapest settings."""

    case: str
    reading: str
    problem: Problem
    pairs: tuple[Pair, ...]
    spend: float
    """Seconds that the runs may take in all; each is made :attr:`fewest` times at least."""
    deadline: float
    """Seconds that one run may take."""
    fewest: int = FEWEST

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All that run."""
        return tuple(dict.fromkeys(candidate for pair in self.pairs for candidate in (*pair.own, *pair.rival)))

    @property
    def round_s(self) -> float:
        """Time of one round, by the rows [s]."""
        return sum(max(candidate.wall_s, TURN) for candidate in self.candidates)

    @property
    def rounds(self) -> int:
        """How often each setting is run."""
        return min(max(int(self.spend / self.round_s), self.fewest), MOST)

    @property
    def seconds(self) -> float:
        return PREPARE_SECONDS + 10.0 * (self.rounds + 1) * self.round_s

    def run(self, state: WorkerState) -> list[TimedPair]:
        """Rows of all pairs."""
        runs = {candidate: self._prepared(candidate) for candidate in self.candidates}
        times = interleaved(runs, rounds=self.rounds, turn=TURN)
        own_times: dict[Candidate, float | None] = {}
        for pair in self.pairs:
            rival = min(pair.rival, key=times.median)
            if rival not in own_times:
                own_times[rival] = self._own_time(rival, runs[rival], times)
        return [self._row(pair, times, own_times) for pair in self.pairs]

    def _prepared(self, candidate: Candidate, solver: ClockedHeyoka | None = None) -> Run:
        own = candidate.setting
        return (solver or registry.solver(candidate.solver)).prepare(
            self.problem, rtol=own.rtol, atol=own.atol, step=own.step, deadline=self.deadline
        )

    def _own_time(self, rival: Candidate, run: Run, times: Turns[Candidate]) -> float | None:
        """Time of a run that is the library's own [s]; None where that is not known."""
        solver = clocked(registry.solver(rival.solver))
        if solver is None:
            return None
        part = own_part(run, self._prepared(rival, solver), solver.clock, rounds=min(self.rounds, OWN_ROUNDS))
        return part * times.median(rival) or None  # an integrator that all modes share was made without the clock

    def _row(self, pair: Pair, times: Turns[Candidate], own_times: Mapping[Candidate, float | None]) -> TimedPair:
        own, rival = (min(candidates, key=times.median) for candidates in (pair.own, pair.rival))
        low, high = median_interval(times.ratios(own, rival))
        return TimedPair(
            case=self.case,
            reading=self.reading,
            digits=pair.digits,
            against=pair.against,
            rtol=own.setting.rtol,
            rival=rival.solver,
            rival_rtol=rival.setting.rtol,
            rival_step_s=rival.setting.step,
            wall_s=times.median(own),
            rival_wall_s=times.median(rival),
            ratio=times.ratio(own, rival),
            ratio_low=low,
            ratio_high=high,
            rounds=self.rounds,
            rival_own_s=own_times[rival],
            samples_s=tuple(times.times[own]),
            rival_samples_s=tuple(times.times[rival]),
        )


def time_pairs(
    timings: Mapping[str, Sequence[PairedTiming]], options: Options, observer: Observer
) -> tuple[list[TimedPair], list[str]]:
    """Time pairs by case, those of each job by one worker; their rows, and what could not be timed, a sentence each."""
    rows: list[TimedPair] = []
    failed: list[str] = []

    def timed(own: Sequence[PairedTiming]) -> Jobs:
        for timing in own:
            result = yield timing
            if isinstance(result, Failure):
                whom = ", ".join(dict.fromkeys(pair.against for pair in timing.pairs))
                failed.append(f"{timing.case}, {timing.reading}, against {whom}: {result.reason}")
                _LOG.info("cannot be timed in turn: %s", failed[-1])
            else:
                rows.extend(result)

    pool = WorkerPool(workers=options.processes, memory=options.memory)
    for own in timings.values():
        pool.add("timings", timed(own))
    pool.run(observer.tick)
    return [row for case in timings for row in rows if row.case == case], failed
