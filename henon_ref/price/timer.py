"""Wall times of runs taken in turn, so that what the machine does meanwhile falls on all of them alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

from henon_ref.score.timing import Timing, summarise, timed

Key = TypeVar("Key")


MOST = 20
"""Repetitions in one turn at most."""


def in_turn(runs: Mapping[Key, Callable[[], object]], *, rounds: int, turn: float = 0.0) -> dict[Key, Timing]:
    """Time every run once a round, after one round to warm up.

    Parameters
    ----------
    runs : mapping of callables
    rounds : int
        At least three samples each.
    turn : float
        Seconds for which a run is repeated when it is its turn: what is much shorter than the others would else always
        find the processor's caches filled with theirs.
    """
    samples: dict[Key, list[float]] = {key: [] for key in runs}
    for number in range(max(rounds, 3) + 1):
        for key, run in runs.items():
            taken = [timed(run)]
            while sum(taken) + taken[-1] <= turn and len(taken) < MOST:
                taken.append(timed(run))
            if number:
                samples[key] += taken
    found = {key: summarise(own) for key, own in samples.items()}
    return {key: timing for key, timing in found.items() if timing is not None}
