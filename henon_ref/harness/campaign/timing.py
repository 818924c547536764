"""Wall times: repeated runs, medians, intervals that say how far to trust them, and runs timed in turn."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Generic, TypeVar

import numpy as np

from henon_ref.solver import SelfTimedRun

Key = TypeVar("Key")
SAMPLES = 100
"""Most samples taken where the caller does not say how many."""
FEWEST = 3
"""Fewest samples of a run that is repeated: fewer have no interquartile range."""
SLOW = 3.0
"""A run is not repeated where the fewest samples would take more than so many budgets."""
RESAMPLES = 1000
"""Bootstrap resamples behind an interval."""
UNSTABLE = 0.1
"""A sample whose interquartile range is above this fraction of its median is called unstable."""
MOST = 20
"""Repetitions in one turn at most."""


def timed(run: Callable[[], object]) -> float:
    """Wall time of one run [s], the garbage collector held off; by the run's own clock, where it has one."""
    if isinstance(run, SelfTimedRun):
        return run.times(1)[0]
    was_on = gc.isenabled()
    gc.disable()
    try:
        begin = time.perf_counter_ns()
        run()
        return (time.perf_counter_ns() - begin) * 1e-9
    finally:
        if was_on:
            gc.enable()


def repeat(
    run: Callable[[], object], *, first: float, repeats: int | None, budget: float, cold: bool = False
) -> tuple[float, ...]:
    """Time a run again and again.

    Parameters
    ----------
    run : callable
        A prepared run, already called once.
    first : float
        Wall time of that first call [s]. It was the warm-up: it is a sample only where it is the sole one.
    repeats : int, optional
        Number of samples; None takes as many as fit the budget, from ``FEWEST`` to ``SAMPLES``.
    budget : float
        Seconds all samples may take; a run whose ``FEWEST`` samples would take ``SLOW`` budgets is not repeated.
    cold : bool
        The first call may have loaded or compiled something: take one sample at least, however slow it was.

    Returns
    -------
    tuple of float
        Samples [s], in the order taken.
    """
    if isinstance(run, SelfTimedRun):
        count = (_affordable(first, budget) or int(cold)) if repeats is None else repeats
        return run.times(count) if count else (first,)
    if repeats is not None:
        return tuple(timed(run) for _ in range(repeats))
    samples = [timed(run)] if cold else []
    if not _affordable(samples[0] if cold else first, budget):
        return tuple(samples) or (first,)
    while len(samples) < FEWEST or (len(samples) < SAMPLES and sum(samples) < budget):
        samples.append(timed(run))
    return tuple(samples)


def _affordable(pace: float, budget: float) -> int:
    """How many samples of a run that takes so long fit the budget: three at least, or none where it is too slow."""
    return 0 if FEWEST * pace > SLOW * budget else min(max(int(budget / pace), FEWEST), SAMPLES)


def median_interval(samples: Sequence[float], *, seed: int = 0) -> tuple[float, float]:
    """Percentile bootstrap interval (95 %) of the median (Efron 1979); the same samples give the same interval.

    ``scipy.stats.bootstrap`` gives the same numbers, for three samples in 1.8 ms in place of 0.25 ms and after an
    import of 0.5 s in every process: these lines stay.

    Parameters
    ----------
    samples : sequence of float
        At least one [s].
    seed : int
        Seed of the resampling.
    """
    values = np.asarray(samples, dtype=float)
    draws = np.random.default_rng(seed).integers(0, values.size, size=(RESAMPLES, values.size))
    medians = np.median(values[draws], axis=1)
    low, high = np.quantile(medians, [0.025, 0.975])
    return float(low), float(high)


def summarise(samples: Sequence[float]) -> dict[str, float]:
    """What a row says of its samples (columns of ``runs.csv``); of fewer than three no spread and no interval."""
    if not samples:
        return {}
    found = {"wall_s": float(np.median(samples)), "timed_runs": len(samples)}
    if len(samples) < FEWEST:
        return found
    quarter, three = np.quantile(samples, [0.25, 0.75])
    low, high = median_interval(samples)
    return found | {"wall_s_iqr": float(three - quarter), "wall_s_low": low, "wall_s_high": high}


def turn_times(run: Callable[[], object], seconds: float) -> list[float]:
    """Wall times of a run that is repeated for so many seconds, once at least and ``MOST`` times at most [s]."""
    taken = [timed(run)]
    if isinstance(run, SelfTimedRun):
        count = min(int(seconds / taken[0]), MOST)
        return list(run.times(count)) if count > 1 else taken
    while sum(taken) + taken[-1] <= seconds and len(taken) < MOST:
        taken.append(timed(run))
    return taken


@dataclass(frozen=True)
class Turns(Generic[Key]):
    """Times of runs, a round beside the other."""

    times: Mapping[Key, list[float]]
    """Every run's median time in each round [s]."""

    def median(self, key: Key) -> float:
        """Median time of a run [s]."""
        return median(self.times[key])

    def ratio(self, key: Key, other: Key) -> float:
        """Time of one run over another's: the median of what each round says.

        Where the machine changes its pace on the way, the two medians may come from different paces; a round does not.
        """
        return median(self.ratios(key, other))

    def ratios(self, key: Key, other: Key) -> list[float]:
        """What each round says of it."""
        return [a / b for a, b in zip(self.times[key], self.times[other], strict=True)]


def interleaved(runs: Mapping[Key, Callable[[], object]], *, rounds: int, turn: float = 0.0) -> Turns[Key]:
    """Time every run once a round, after one round to warm up: a change of the machine's pace falls on all alike.

    Parameters
    ----------
    runs : mapping of callables
    rounds : int
        How many; three at least.
    turn : float
        Seconds for which a run is repeated when it is its turn: what is much shorter than the others would else always
        find the processor's caches filled with theirs.
    """
    samples: dict[Key, list[float]] = {key: [] for key in runs}
    for number in range(max(rounds, 3) + 1):
        for key, run in runs.items():
            taken = turn_times(run, turn)
            if number:
                samples[key].append(median(taken))
    return Turns(samples)
