"""Wall times of interleaved runs: each once a round, so that a change of the machine's pace falls on all alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import median
from typing import Generic, TypeVar

from henon_ref.harness.campaign.timing import turn_times

Key = TypeVar("Key")


MOST = 20
"""Repetitions in one turn at most."""


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
    """Time every run once a round, after one round to warm up.

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
            taken = turn_times(run, turn, MOST)
            if number:
                samples[key].append(median(taken))
    return Turns(samples)
