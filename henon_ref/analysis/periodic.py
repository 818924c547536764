"""The period of a run that has settled, measured from its transitions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from henon_ref.trajectory import Transition


@dataclass(frozen=True)
class Period:
    """What a settled run repeats."""

    value: float
    """Period [s]: the mean over all repetitions seen."""
    pattern: tuple[Transition, ...]
    """The transitions of one period."""
    repetitions: int
    """Whole periods seen."""
    scatter: float
    """Largest difference of one return from the mean [s]."""


def measured_period(
    transitions: Iterable[Transition], *, after: float, tolerance: float = 1e-9, most: int = 64
) -> Period | None:
    """The period of the tail of a run of an autonomous system.

    Parameters
    ----------
    transitions : iterable of Transition
        In order of time.
    after : float
        Only transitions later than this are looked at [s].
    tolerance : float
        Two states closer than this, relative to the largest state seen, are the same.
    most : int
        Longest pattern looked for, in transitions.

    Returns
    -------
    Period or None
        None where no pattern of up to ``most`` transitions is seen at least three times over.
    """
    late = [t for t in transitions if t.time > after]
    if len(late) < 3:
        return None
    states = np.array([t.state for t in late])
    changes = [(t.kind, t.surface, t.to_mode) for t in late]
    times = np.array([t.time for t in late]) - late[0].time
    times += np.array([t.time_low for t in late]) - late[0].time_low
    bound = tolerance * np.abs(states).max()
    for length in range(1, min(most, len(late) // 3) + 1):
        same_change = changes[length:] == changes[:-length]
        if same_change and np.abs(states[length:] - states[:-length]).max() <= bound:
            count = (len(late) - 1) // length
            value = float(times[count * length] / count)
            scatter = float(np.abs(times[length:] - times[:-length] - value).max())
            return Period(value, tuple(late[:length]), count, scatter)
    return None
