"""The printed durations that the sticks of a run are held against."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def published_partners(durations: Sequence[float | None], published: Sequence[float]) -> tuple[float | None, ...]:
    """The published duration that belongs to each stick: the list repeated, started where it fits best.

    Parameters
    ----------
    durations : sequence of float or None
        Durations in order, None for a stick that the run does not have (it keeps its place).
    published : sequence of float
        The source's durations, one period of them [s].
    """
    if not published:
        return (None,) * len(durations)
    known = np.array([k for k, d in enumerate(durations) if d is not None], dtype=np.intp)
    lasting = np.array([d for d in durations if d is not None])
    printed, count = np.array(published), len(published)

    def misfit(shift: int) -> float:
        return float(np.sum(np.abs(lasting - printed[(known + shift) % count])))

    best = min(range(count), key=misfit)
    return tuple(None if d is None else published[(k + best) % count] for k, d in enumerate(durations))
