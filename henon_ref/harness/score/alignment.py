"""Alignment of two keyed sequences with the fewest edits, ties broken by time.

A banded Needleman-Wunsch recursion (*J. Mol. Biol.* 48, 1970), one row per reference transition, vectorised along the
row. Only pairs whose times agree within a bound are allowed, so a row needs only the run's transitions near it: memory
is at most ``BAND`` bytes per row for any run.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

BAND = 128
"""Largest number of the run's transitions, the nearest in time, that a reference transition may be paired with."""
_UP, _LEFT, _DIAGONAL = 0, 1, 2


class Keyed(NamedTuple):
    """Transitions in the form used by the alignment."""

    keys: NDArray[np.int64]
    """(n, 2) integers; the second is an alternative key, -1 if there is none."""
    times: NDArray[np.float64]
    """(n,) [s]."""

    def since(self, first: int) -> Keyed:
        return Keyed(self.keys[first:], self.times[first:])


def align(ref: Keyed, run: Keyed, bound: NDArray[np.float64]) -> NDArray[np.intp]:
    """Align two sequences with the fewest edits, and with the least sum of time differences among those alignments.

    The times of the m transitions of ``ref`` do not decrease; a transition of ``run`` whose time is not finite is never
    paired. ``bound``, shape (m,), is the largest time difference of a pair [s]. Returns indices (reference, run), both
    increasing, shape (k, 2).
    """
    m, n = len(ref.times), len(run.times)
    if not m or not n:
        return np.zeros((0, 2), dtype=np.intp)
    if m == n and bool(np.all(_allowed(ref.keys.T, run.keys.T, np.abs(ref.times - run.times), bound))):
        return np.repeat(np.arange(m)[:, None], 2, axis=1)
    low, high = _windows(ref.times, run.times, float(bound.max()))
    return _trace(_fill(ref, run, bound, low, high), low, high)


def _allowed(
    ref_keys: NDArray[np.int64],
    run_keys: NDArray[np.int64],
    slips: NDArray[np.float64],
    bound: NDArray[np.float64] | float,
) -> NDArray[np.bool_]:
    """Whether pairs have the same key (first axis: the two keys) and agree in time; broadcast over the other axes."""
    same: NDArray[np.bool_] = (ref_keys[0] == run_keys[0]) | (ref_keys[1] == run_keys[1])
    return same & (slips <= bound)


def _windows(
    ref_times: NDArray[np.float64], run_times: NDArray[np.float64], reach: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Half-open ranges of the run's transitions that each reference transition may be paired with."""
    ordered = np.maximum.accumulate(np.where(np.isfinite(run_times), run_times, -np.inf))
    low = np.searchsorted(ordered, ref_times - reach, side="left")
    high = np.searchsorted(ordered, ref_times + reach, side="right")
    centre = np.searchsorted(ordered, ref_times, side="left")
    low = np.maximum(low, centre - BAND // 2)
    high = np.minimum(high, centre + BAND // 2)
    return np.maximum.accumulate(low), np.maximum.accumulate(np.maximum(high, low))


def _fill(
    ref: Keyed, run: Keyed, bound: NDArray[np.float64], low: NDArray[np.intp], high: NDArray[np.intp]
) -> list[NDArray[np.int8]]:
    """Return the best choice (up, left or diagonal) in each cell of the recursion, row by row.

    ``before[k]`` is the best value of the rows above if the first ``low + k`` transitions of the run are used.
    """
    choice: list[NDArray[np.int8]] = []
    edge_low, before = int(low[0]), np.zeros(1)
    for i in range(len(ref.times)):
        start, stop = int(low[i]), int(high[i])
        # The row above in this row's columns: constant after its end, cut off before this row's start.
        above = before[np.minimum(np.arange(start, stop + 1) - edge_low, before.size - 1)]
        slips = np.abs(ref.times[i] - run.times[start:stop])
        allowed = _allowed(ref.keys[i], run.keys[start:stop].T, slips, bound[i])
        # The weight of a time difference at its bound is small enough that edits are minimised first.
        gain = np.where(allowed, 1.0 - 1e-7 * slips / max(bound[i], np.finfo(float).tiny), -np.inf)
        diagonal = above[:-1] + gain
        best = np.maximum(above[1:], diagonal)
        row = np.maximum.accumulate(np.concatenate([above[:1], best]))
        choice.append(np.where(row[1:] > best, _LEFT, np.where(diagonal > above[1:], _DIAGONAL, _UP)).astype(np.int8))
        edge_low, before = start, row
    return choice


def _trace(choice: list[NDArray[np.int8]], low: NDArray[np.intp], high: NDArray[np.intp]) -> NDArray[np.intp]:
    pairs: list[tuple[int, int]] = []
    i, j = len(choice) - 1, int(high[-1])
    while i >= 0:
        j = min(j, int(high[i]))
        taken = choice[i][j - 1 - int(low[i])] if j > int(low[i]) else _UP
        if taken == _DIAGONAL:
            pairs.append((i, j - 1))
        i, j = i - (taken != _LEFT), j - (taken != _UP)
    return np.array(pairs[::-1], dtype=np.intp).reshape(-1, 2)
