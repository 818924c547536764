"""A reading's matches, timed in turn by a worker."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from henon_ref import registry
from henon_ref.campaign.interleaved import Turns, in_turn
from henon_ref.campaign.options import Observer, Options
from henon_ref.campaign.pool import Jobs, WorkerPool
from henon_ref.campaign.timing import median_interval
from henon_ref.campaign.worker import Failure, Job, WorkerState
from henon_ref.columns import Row
from henon_ref.filippov.problem import Problem
from henon_ref.score.errors import score
from henon_ref.score.reference import Expected
from henon_ref.score.verdict import RIGHT
from henon_ref.solver import Run
from henon_ref.studies.rivals.match import Entry, Match

SAMPLES, RIVAL_SAMPLES = "samples_s", "rival_samples_s"
"""What a row holds besides: the times of every round [s]."""
FEWEST, MOST = 9, 200
"""How often each setting is run."""
TURN = 1e-3
"""Seconds for which a short run is repeated when it is its turn."""
PREPARE_SECONDS = 300.0
"""Processor time that a duel's preparation may take [s]."""

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Duel(Job):
    """Time the settings of matches on one reading in turn, and set them against each other."""

    case: str
    reading: str
    problem: Problem
    matches: tuple[Match, ...]
    spend: float
    """Seconds that the runs may take in all; each is made :attr:`fewest` times at least."""
    deadline: float
    """Seconds that one run may take."""
    expected: Expected | None = None
    """What the rivals' answers are held against before they are timed; None where the rows have told."""
    fewest: int = FEWEST

    @property
    def entries(self) -> tuple[Entry, ...]:
        """All that run."""
        return tuple(dict.fromkeys(entry for match in self.matches for entry in (*match.own, *match.rival)))

    @property
    def round_s(self) -> float:
        """Time of one round, by the rows [s]."""
        return sum(max(entry.wall_s, TURN) for entry in self.entries)

    @property
    def rounds(self) -> int:
        """How often each setting is run."""
        return min(max(int(self.spend / self.round_s), self.fewest), MOST)

    @property
    def seconds(self) -> float:
        return PREPARE_SECONDS + 10.0 * (self.rounds + 1) * self.round_s

    def run(self, state: WorkerState) -> tuple[list[Row], list[str]]:
        """Rows of all matches, and which rivals have not been timed, a sentence each."""
        runs = {entry: self._prepared(entry) for entry in self.entries}
        matches, refused = self.matches, []
        if self.expected is not None:
            digits = {entry: _digits(runs[entry], entry, self.expected) for match in matches for entry in match.rival}
            refused = [f"{self.case}, {self.reading}, {words}" for words in _refused(matches, digits)]
            matches = _able(matches, digits)
        timed = dict.fromkeys(entry for match in matches for entry in (*match.own, *match.rival))
        times = in_turn({entry: runs[entry] for entry in timed}, rounds=self.rounds, turn=TURN)
        return [self._row(match, times) for match in matches], refused

    def _prepared(self, entry: Entry) -> Run:
        own = entry.setting
        return registry.solver(entry.solver).prepare(
            self.problem, rtol=own.rtol, atol=own.atol, step=own.step, deadline=self.deadline
        )

    def _row(self, match: Match, times: Turns[Entry]) -> Row:
        own, rival = (min(entries, key=times.median) for entries in (match.own, match.rival))
        low, high = median_interval(times.ratios(own, rival))
        return {
            "case": self.case,
            "reading": self.reading,
            "digits": match.digits,
            "against": match.against,
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
            SAMPLES: times.times[own],
            RIVAL_SAMPLES: times.times[rival],
        }


def _digits(run: Run, entry: Entry, expected: Expected) -> float:
    """Digits that a run gets; infinite where it is right and there is nothing to time, -1 where it is not right."""
    scored = score(run(), expected, tolerance=entry.setting.rtol)
    if scored.verdict != RIGHT:
        return -1.0
    return math.inf if scored.digits is None else scored.digits


def _able(matches: Sequence[Match], digits: Mapping[Entry, float]) -> tuple[Match, ...]:
    """The matches with those rivals alone that get so many digits, where there are any."""
    found = (replace(m, rival=tuple(e for e in m.rival if digits[e] >= (m.digits or 0))) for m in matches)
    return tuple(match for match in found if match.rival)


def _refused(matches: Sequence[Match], digits: Mapping[Entry, float]) -> Iterator[str]:
    """What is said of each rival that does not."""
    for match in matches:
        for entry in match.rival:
            if digits[entry] < (match.digits or 0):
                what = "it is not right" if digits[entry] < 0 else f"it gets {math.floor(10 * digits[entry]) / 10}"
                wanted = "" if match.digits is None else f" for {match.digits} digits"
                yield f"{entry.solver} at rtol {entry.setting.rtol:g}{wanted}: {what}"


def fight(duels: Mapping[str, Sequence[Duel]], options: Options, observer: Observer) -> tuple[list[Row], list[str]]:
    """Time duels, each by one worker; their rows, and what could not be timed, a sentence each.

    Parameters
    ----------
    duels : mapping of sequences of Duel
        By case.
    options : Options
        Processes and memory are taken from it.
    observer : Observer
    """
    rows: list[Row] = []
    failed: list[str] = []

    def timed(own: Sequence[Duel]) -> Jobs:
        for duel in own:
            result = yield duel
            if isinstance(result, Failure):
                whom = ", ".join(dict.fromkeys(match.against for match in duel.matches))
                failed.append(f"{duel.case}, {duel.reading}, against {whom}: {result.reason}")
                _LOG.info("cannot be timed in turn: %s", failed[-1])
            else:
                rows.extend(result[0])
                failed.extend(result[1])

    pool = WorkerPool(workers=options.processes, memory=options.memory)
    for own in duels.values():
        pool.add("duels", timed(own))
    pool.run(observer.tick)
    return [row for case in duels for row in rows if row["case"] == case], failed
