"""The period of a run that has settled, measured from its transitions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from henon_ref.trajectory import Transition

REPETITIONS = 3
"""Of a pattern, to be seen at the end of a run."""
SETTLING = 1e-2
"""How far a run may still be from its limit, relative to the largest state seen: near enough for Newton's method."""


@dataclass(frozen=True)
class Period:
    """What a settled run repeats."""

    value: float
    """Period [s]: the mean over all repetitions seen."""
    pattern: tuple[Transition, ...]
    """The transitions of one period, the last that were seen."""
    repetitions: int
    """Whole periods seen."""
    scatter: float
    """Largest difference of one return from the mean [s]."""
    settled: bool
    """Whether they repeat to the tolerance; else they come closer at each return, and their limit is near."""


def measured_period(
    transitions: Iterable[Transition], *, after: float, tolerance: float = 1e-9, most: int = 64
) -> Period | None:
    """The period of the end of a run of an autonomous system.

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
        None where no pattern of up to ``most`` transitions is seen at least three times over at the end.
    """
    late = [t for t in transitions if t.time > after]
    if len(late) < REPETITIONS:
        return None
    states = np.array([t.state for t in late])
    known: dict[object, int] = {}
    changes = np.array([known.setdefault((t.kind, t.surface, t.to_mode), len(known)) for t in late])
    times = np.array([t.time for t in late]) - late[0].time
    times += np.array([t.time_low for t in late]) - late[0].time_low
    lengths = range(1, min(most, len(late) // REPETITIONS) + 1)
    sizes = [float(np.abs(states[-REPETITIONS * length :]).max()) for length in lengths]
    returns = []
    for length in lengths:
        apart = np.abs(states[length:] - states[:-length]).max(axis=1)
        apart[changes[length:] != changes[:-length]] = np.inf
        returns.append(apart)
    for length, apart, size in zip(lengths, returns, sizes, strict=True):
        same = apart <= tolerance * size
        if same[-(REPETITIONS - 1) * length :].all():
            first = 0 if same.all() else len(same) - int(np.argmin(same[::-1]))
            return _period(late[first:], times[first:], length, settled=True)
    for length, apart, size in zip(lengths, returns, sizes, strict=True):
        before, now = apart[-2 * length : -length].max(), apart[-length:].max()
        # As a geometric series: how far it is still to the limit.
        if now < before < np.inf and now * now / (before - now) <= SETTLING * size:
            return _period(late[-REPETITIONS * length :], times[-REPETITIONS * length :], length, settled=False)
    return None


def _period(late: list[Transition], times: NDArray[np.float64], length: int, *, settled: bool) -> Period:
    count = (len(late) - 1) // length
    value = float((times[count * length] - times[0]) / count)
    scatter = float(np.abs(times[length:] - times[:-length] - value).max())
    return Period(value, tuple(late[-length:]), count, scatter, settled)
