"""Wall times: repeated runs, medians with confidence intervals, and interleaved timing of several runs."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Generic, TypeVar

import numpy as np

from henon_ref.harness.campaign.contract_check import check_wall_times
from henon_ref.solver import SelfTimedRun

Key = TypeVar("Key")
SAMPLES = 100
"""Largest number of samples if the caller does not give the number."""
FEWEST = 3
"""Smallest number of samples of a repeated run; fewer have no interquartile range."""
SLOW = 3.0
"""A run is not repeated if ``FEWEST`` samples would take longer than this multiple of the budget."""
UNSTABLE = 0.1
"""Ratio of interquartile range to median above which a sample is called unstable."""
MAX_REPETITIONS = 20
"""Largest number of repetitions in one turn."""


def timed(run: Callable[[], object], result: list[object] | None = None) -> float:
    """Measure the wall time of one run [s] without garbage collection, by the run's own clock if it has one.

    ``result`` receives what the run returned in place of its content; with its own clock, a run returns only times.
    """
    if isinstance(run, SelfTimedRun):
        return _own_times(run, 1)[0]
    was_on = gc.isenabled()
    gc.disable()
    try:
        begin = time.perf_counter_ns()
        returned = run()
        took = (time.perf_counter_ns() - begin) * 1e-9
    finally:
        if was_on:
            gc.enable()
    if result is not None:
        result[:] = [returned]
    return took


def _own_times(run: SelfTimedRun, count: int) -> tuple[float, ...]:
    """Return the wall times of further runs by the run's own clock [s]; ContractError if they are not positive."""
    return check_wall_times(f"times({count})", run.times(count), count)


def repeat(
    run: Callable[[], object],
    *,
    first: float,
    repeats: int | None,
    budget: float,
    cold: bool = False,
    result: list[object] | None = None,
) -> tuple[float, ...]:
    """Time a prepared run repeatedly; return the samples [s], in the order taken.

    ``first`` is the wall time of the first call [s], the warm-up; it is a sample only if no other is taken. ``repeats``
    is the number of samples; None: as many as fit into the ``budget`` [s], from ``FEWEST`` to ``SAMPLES``, but a run
    whose ``FEWEST`` samples would take ``SLOW`` budgets is not repeated. ``cold``: whether the first call may have
    loaded or compiled code; if so, take at least one sample. ``result`` receives what the last call returned; unchanged
    if there is none, or if the run has its own clock.
    """
    if isinstance(run, SelfTimedRun):
        count = (_affordable(first, budget) or int(cold)) if repeats is None else repeats
        return _own_times(run, count) if count else (first,)
    if repeats is not None:
        return tuple(timed(run, result) for _ in range(repeats))
    samples = [timed(run, result)] if cold else []
    if not _affordable(samples[0] if cold else first, budget):
        return tuple(samples) or (first,)
    while len(samples) < FEWEST or (len(samples) < SAMPLES and sum(samples) < budget):
        samples.append(timed(run, result))
    return tuple(samples)


def _affordable(pace: float, budget: float) -> int:
    """Return the number of samples that fit into the budget: at least ``FEWEST``, or 0 if the run is too slow."""
    return 0 if FEWEST * pace > SLOW * budget else min(max(int(budget / pace), FEWEST), SAMPLES)


def median_interval(samples: Sequence[float]) -> tuple[float, float]:
    """Compute the 95 % percentile bootstrap interval of the median (Efron 1979); equal samples give equal intervals.

    ``scipy.stats.bootstrap`` returns the same numbers, but takes 1.8 ms instead of 0.25 ms for three samples, and its
    import takes 0.5 s in every process.
    """
    values = np.asarray(samples, dtype=float)
    draws = np.random.default_rng(0).integers(0, values.size, size=(1000, values.size))
    medians = np.median(values[draws], axis=1)
    low, high = np.quantile(medians, [0.025, 0.975])
    return float(low), float(high)


def summarise(samples: Sequence[float]) -> dict[str, float]:
    """Return the timing columns of ``runs.csv``; fewer than three samples have no spread and no interval."""
    if not samples:
        return {}
    found = {"wall_s": float(np.median(samples)), "timed_runs": len(samples)}
    if len(samples) < FEWEST:
        return found
    quarter, three = np.quantile(samples, [0.25, 0.75])
    low, high = median_interval(samples)
    return found | {"wall_s_iqr": float(three - quarter), "wall_s_low": low, "wall_s_high": high}


def turn_times(run: Callable[[], object], seconds: float) -> list[float]:
    """Repeat a run for some seconds, at least once and at most ``MAX_REPETITIONS`` times; return the wall times [s]."""
    taken = [timed(run)]
    if isinstance(run, SelfTimedRun):
        count = min(int(seconds / taken[0]), MAX_REPETITIONS)
        return list(_own_times(run, count)) if count > 1 else taken
    while sum(taken) + taken[-1] <= seconds and len(taken) < MAX_REPETITIONS:
        taken.append(timed(run))
    return taken


@dataclass(frozen=True)
class Turns(Generic[Key]):
    """Times of several runs in consecutive rounds."""

    times: Mapping[Key, list[float]]
    """Run -> its median time in each round [s]."""

    def median(self, key: Key) -> float:
        """Return the median time of a run over all rounds [s]."""
        return median(self.times[key])

    def ratio(self, key: Key, other: Key) -> float:
        """Return the ratio of the times of two runs: the median of the ratios of all rounds.

        If the speed of the machine changes between rounds, the median times of the two runs may come from different
        speeds. The ratio within one round does not mix speeds.
        """
        return median(self.ratios(key, other))

    def ratios(self, key: Key, other: Key) -> list[float]:
        """Return the ratio of the times of two runs in each round."""
        return [a / b for a, b in zip(self.times[key], self.times[other], strict=True)]


def interleaved(runs: Mapping[Key, Callable[[], object]], *, rounds: int, turn: float = 0.0) -> Turns[Key]:
    """Time every run once per round, after a warm-up round, so that changes of machine speed affect all runs alike.

    At least three rounds are done. ``turn`` is the time for which a run is repeated in its turn [s]. Otherwise a run
    that is much shorter than the others would always start with processor caches filled by them.
    """
    samples: dict[Key, list[float]] = {key: [] for key in runs}
    for number in range(max(rounds, 3) + 1):
        for key, run in runs.items():
            taken = turn_times(run, turn)
            if number:
                samples[key].append(median(taken))
    return Turns(samples)
