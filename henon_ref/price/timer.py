"""Wall times of runs taken in turn, so that what the machine does meanwhile falls on all of them alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

from henon_ref.score.timing import Timing, summarise, timed

Key = TypeVar("Key")


def in_turn(runs: Mapping[Key, Callable[[], object]], *, rounds: int) -> dict[Key, Timing]:
    """Time every run once a round, after one round to warm up.

    Parameters
    ----------
    runs : mapping of callables
    rounds : int
        At least three samples each.
    """
    samples: dict[Key, list[float]] = {key: [] for key in runs}
    for number in range(max(rounds, 3) + 1):
        for key, run in runs.items():
            taken = timed(run)
            if number:
                samples[key].append(taken)
    found = {key: summarise(own) for key, own in samples.items()}
    return {key: timing for key, timing in found.items() if timing is not None}
