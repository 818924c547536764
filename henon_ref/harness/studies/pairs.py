"""Pairs of ``henon`` and another solver for the same digits, their runs interleaved by one worker.

Of heyoka its own calls of ``propagate_until`` are clocked as well, without the mode switches in Python: a program that
switches modes in compiled code pays these and next to nothing else.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

from henon_ref.baselines.heyoka_taylor import HeyokaTaylor
from henon_ref.harness import registry
from henon_ref.harness.campaign.options import Options
from henon_ref.harness.campaign.progress import Observer
from henon_ref.harness.campaign.timing import Turns, interleaved, median_interval, timed
from henon_ref.harness.report.text.ranking import reaching
from henon_ref.harness.rows import Key, Row, RunRow, number
from henon_ref.harness.table import significant
from henon_ref.modes.problem import Problem
from henon_ref.solver import Run, Solver
from henon_ref.text import code
from henon_ref.workers.pool import Jobs, WorkerPool
from henon_ref.workers.worker import Failure, Job, WorkerState

FIRST = "henon"
"""The solver that all others are set against."""
SECOND = "heyoka"
"""The next best."""
CANDIDATES = 3
"""Settings of a side that are timed: the cheapest by the rows. The cheapest in turn is among them, or next to it."""
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
class PairRow(Row):
    """The reference and another solver at settings with the same digits, their runs interleaved."""

    case: str
    reading: str
    digits: int | None
    """None where there is no transition."""
    against: str
    rtol: float | None
    rival: str
    rival_rtol: float | None
    rival_step_s: float | None
    wall_s: float
    """Median [s]."""
    rival_wall_s: float
    ratio: float
    """The reference's time over the other one's."""
    ratio_low: float
    """Lower end of its 95 % bootstrap interval."""
    ratio_high: float
    rounds: int
    rival_own_s: float | None = None
    """What of the rival's time its library takes itself, without the mode switches in Python that a compiled program
    does not pay [s]; heyoka's alone is known."""

    @property
    def problem(self) -> tuple[str, str]:
        """Case and reading."""
        return self.case, self.reading

    @property
    def times_as_long(self) -> float:
        """Time of the rival over the reference's."""
        return 1.0 / self.ratio

    @property
    def own_times_as_long(self) -> float | None:
        """Time of the rival's own library over the reference's whole run; None where it is not known."""
        return None if self.rival_own_s is None else self.rival_own_s / self.wall_s


@dataclass(frozen=True)
class TimedPair(PairRow):
    """A pair with the times of every round."""

    samples_s: tuple[float, ...] = ()
    """The reference's [s]."""
    rival_samples_s: tuple[float, ...] = ()


@dataclass(frozen=True)
class Pair:
    """The reference against a rival, for the same digits; each side the rows of its cheapest settings."""

    digits: int | None
    """Digits that every setting of both reaches; None where there is no transition to time."""
    against: str
    """The other side: a solver's name, or that of a group whose cheapest is taken."""
    own: tuple[RunRow, ...]
    rival: tuple[RunRow, ...]


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


def _cheapest(rows: Sequence[RunRow], solvers: Collection[str]) -> tuple[RunRow, ...]:
    own = [row for row in rows if row.solver in solvers and row.wall_s]
    return tuple(sorted(own, key=lambda row: number(row.wall_s))[:CANDIDATES])


class _WithOwn:
    """An object of heyoka's with one function of ours; all else is passed on."""

    def __init__(self, theirs: Any, **ours: Callable[..., Any]) -> None:
        object.__setattr__(self, "_theirs", theirs)
        vars(self).update(ours)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._theirs, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._theirs, name, value)


@dataclass(frozen=True)
class ClockedHeyoka(HeyokaTaylor):
    """heyoka, its own calls clocked."""

    spent_s: list[float] = field(default_factory=list, kw_only=True)
    """Time of each call [s]."""

    def load(self) -> Any:
        """The module, with integrators whose calls of ``propagate_until`` are clocked."""
        module = super().load()

        def taylor_adaptive(*args: Any, **options: Any) -> _WithOwn:
            made = module.taylor_adaptive(*args, **options)

            def propagate_until(*args: Any, **options: Any) -> Any:
                began = perf_counter()
                result = made.propagate_until(*args, **options)
                self.spent_s.append(perf_counter() - began)
                return result

            return _WithOwn(made, propagate_until=propagate_until)

        return _WithOwn(module, taylor_adaptive=taylor_adaptive)


def clocked(solver: Solver) -> ClockedHeyoka | None:
    """The same solver with its calls clocked; None where it is not heyoka."""
    if not isinstance(solver, HeyokaTaylor):
        return None
    return ClockedHeyoka(**{own.name: getattr(solver, own.name) for own in fields(solver)})


def own_part(solver: str, run: Run, prepare: Callable[[Any], Run], *, rounds: int) -> float | None:
    """Time of the library's own calls over that of a whole run, median over rounds of one of each; None where unknown.

    Parameters
    ----------
    solver : str
    run : callable
        Its run.
    prepare : callable
        Prepares the same run by a solver.
    rounds : int
        One more is made first, to warm up.
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
    return median(parts[1:]) or None  # an integrator that all modes share was made without the clock


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
    def candidates(self) -> dict[Key, RunRow]:
        """The settings that run."""
        return {row.key: row for pair in self.pairs for row in (*pair.own, *pair.rival)}

    @property
    def round_s(self) -> float:
        """Time of one round, by the rows [s]."""
        return sum(max(number(row.wall_s), TURN) for row in self.candidates.values())

    @property
    def rounds(self) -> int:
        """How often each setting is run."""
        return min(max(int(self.spend / self.round_s), self.fewest), MOST)

    @property
    def seconds(self) -> float:
        return PREPARE_SECONDS + 10.0 * (self.rounds + 1) * self.round_s

    def run(self, state: WorkerState) -> list[TimedPair]:
        """Rows of all pairs."""
        runs = {key: self._prepared(row, registry.solver(row.solver)) for key, row in self.candidates.items()}
        times = interleaved(runs, rounds=self.rounds, turn=TURN)
        own_parts: dict[Key, float | None] = {}
        found = []
        for pair in self.pairs:
            own, rival = (min(rows, key=lambda row: times.median(row.key)) for rows in (pair.own, pair.rival))
            if rival.key not in own_parts:
                rounds, prepare = min(self.rounds, OWN_ROUNDS), partial(self._prepared, rival)
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
    timings: Mapping[str, Sequence[PairedTiming]], options: Options, observer: Observer
) -> tuple[list[TimedPair], list[str]]:
    """Time pairs by case, those of each job by one worker; their rows, and what could not be timed, a sentence each."""
    rows: list[TimedPair] = []
    failed: list[str] = []

    def jobs(own: Sequence[PairedTiming]) -> Jobs:
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
        pool.add("timings", jobs(own))
    pool.run(observer.tick)
    return [row for case in timings for row in rows if row.case == case], failed


def own_words(rows: Sequence[PairRow]) -> str:
    """In a sentence, what of heyoka's times is heyoka's; empty where that is not known."""
    found = [row for row in rows if row.against == SECOND and row.rival_own_s is not None]
    if not found:
        return ""
    part = np.median([number(row.rival_own_s) / row.rival_wall_s for row in found])
    whole = np.median([row.times_as_long for row in found])
    own = np.median([number(row.own_times_as_long) for row in found])
    return (
        f"In turn {code(SECOND)} takes {significant(float(whole), 2)} times as long as {code(FIRST)} (median over "
        f"readings and digits), of which its own calls of `propagate_until` are {part:.0%}: a program that switches "
        f"modes in compiled code would take {significant(float(own), 2)} times as long."
    )


def bound(digits: int | None) -> str:
    """Digits to be reached, as the cell of a table."""
    return "no transition" if digits is None else f"{digits:g}"
