"""Paired timing: the runs of a reading's pairs interleaved by one worker, and ratios taken round by round."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from henon_ref import registry
from henon_ref.campaign.interleaved import Turns, interleaved
from henon_ref.campaign.options import Observer, Options
from henon_ref.campaign.pool import Jobs, WorkerPool
from henon_ref.campaign.timing import median_interval
from henon_ref.campaign.worker import Failure, Job, WorkerState
from henon_ref.columns import Row
from henon_ref.filippov.problem import Problem
from henon_ref.report.text.paired_times import OWN
from henon_ref.score.errors import score
from henon_ref.score.reference import Expected
from henon_ref.score.verdict import RIGHT
from henon_ref.solver import Run
from henon_ref.studies.price.own_calls import ClockedHeyoka, clocked, own_part
from henon_ref.studies.price.pairs import Candidate, Pair

SAMPLES, RIVAL_SAMPLES = "samples_s", "rival_samples_s"
"""What a row holds besides: the times of every round [s]."""
FEWEST, MOST = 9, 200
"""How often each setting is run."""
TURN = 1e-3
"""Seconds for which a short run is repeated when it is its turn."""
PREPARE_SECONDS = 300.0
"""Processor time that the preparation of all settings may take [s]: compiled callbacks take some seconds each."""
OWN_ROUNDS = 20
"""Rounds at most in which a library's own calls are clocked."""

_LOG = logging.getLogger(__name__)


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
    expected: Expected | None = None
    """Truth that the rivals' runs are scored against before they are timed; None where the rows have their digits."""
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

    def run(self, state: WorkerState) -> tuple[list[Row], list[str]]:
        """Rows of all pairs, and which rivals have not been timed, a sentence each."""
        runs = {candidate: self._prepared(candidate) for candidate in self.candidates}
        pairs, refused = self.pairs, []
        if self.expected is not None:
            rivals = dict.fromkeys(rival for pair in pairs for rival in pair.rival)
            digits = {rival: _digits(runs[rival], rival, self.expected) for rival in rivals}
            refused = [f"{self.case}, {self.reading}, {words}" for words in _refused(pairs, digits)]
            pairs = _able(pairs, digits)
        timed = dict.fromkeys(candidate for pair in pairs for candidate in (*pair.own, *pair.rival))
        times = interleaved({candidate: runs[candidate] for candidate in timed}, rounds=self.rounds, turn=TURN)
        own_times: dict[Candidate, float | None] = {}
        for pair in pairs:
            rival = min(pair.rival, key=times.median)
            if rival not in own_times:
                own_times[rival] = self._own_time(rival, runs[rival], times)
        return [self._row(pair, times, own_times) for pair in pairs], refused

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
        return part * times.median(rival)

    def _row(self, pair: Pair, times: Turns[Candidate], own_times: Mapping[Candidate, float | None]) -> Row:
        own, rival = (min(candidates, key=times.median) for candidates in (pair.own, pair.rival))
        low, high = median_interval(times.ratios(own, rival))
        return {
            "case": self.case,
            "reading": self.reading,
            "digits": pair.digits,
            "against": pair.against,
            "rtol": own.setting.rtol,
            "rival": rival.solver,
            "rival_rtol": rival.setting.rtol,
            "rival_step_s": rival.setting.step,
            "wall_s": times.median(own),
            "rival_wall_s": times.median(rival),
            "ratio": times.ratio(own, rival),
            "ratio_low": low,
            "ratio_high": high,
            "rounds": self.rounds,
            OWN: own_times[rival],
            SAMPLES: times.times[own],
            RIVAL_SAMPLES: times.times[rival],
        }


def _digits(run: Run, candidate: Candidate, expected: Expected) -> float:
    """Digits that a run gets; infinite where it is right and there is nothing to time, -1 where it is not right."""
    scored = score(run(), expected, tolerance=candidate.setting.rtol)
    if scored.verdict != RIGHT:
        return -1.0
    return math.inf if scored.digits is None else scored.digits


def _able(pairs: Sequence[Pair], digits: Mapping[Candidate, float]) -> tuple[Pair, ...]:
    """The pairs with those rivals alone that get so many digits, where there are any."""
    found = (replace(p, rival=tuple(c for c in p.rival if digits[c] >= (p.digits or 0))) for p in pairs)
    return tuple(pair for pair in found if pair.rival)


def _refused(pairs: Sequence[Pair], digits: Mapping[Candidate, float]) -> Iterator[str]:
    """A sentence for each rival that does not get so many digits."""
    for pair in pairs:
        for candidate in pair.rival:
            if digits[candidate] < (pair.digits or 0):
                got = digits[candidate]
                what = "it is not right" if got < 0 else f"it gets {math.floor(10 * got) / 10}"
                wanted = "" if pair.digits is None else f" for {pair.digits} digits"
                yield f"{candidate.solver} at rtol {candidate.setting.rtol:g}{wanted}: {what}"


def time_pairs(
    timings: Mapping[str, Sequence[PairedTiming]], options: Options, observer: Observer
) -> tuple[list[Row], list[str]]:
    """Time pairs, those of each job by one worker; their rows, and what could not be timed, a sentence each.

    Parameters
    ----------
    timings : mapping of sequences of PairedTiming
        By case.
    options : Options
        Processes and memory are taken from it.
    observer : Observer
    """
    rows: list[Row] = []
    failed: list[str] = []

    def timed(own: Sequence[PairedTiming]) -> Jobs:
        for timing in own:
            result = yield timing
            if isinstance(result, Failure):
                whom = ", ".join(dict.fromkeys(pair.against for pair in timing.pairs))
                failed.append(f"{timing.case}, {timing.reading}, against {whom}: {result.reason}")
                _LOG.info("cannot be timed in turn: %s", failed[-1])
            else:
                rows.extend(result[0])
                failed.extend(result[1])

    pool = WorkerPool(workers=options.processes, memory=options.memory)
    for own in timings.values():
        pool.add("timings", timed(own))
    pool.run(observer.tick)
    return [row for case in timings for row in rows if row["case"] == case], failed
